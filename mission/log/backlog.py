"""What waits to be written: a bounded queue that gives up images before data, and never makes the flight wait."""

import threading
from collections import deque
from dataclasses import replace

from vision.records import VisionReport


class Backlog:
    """Records on their way from the flight to the log's writer thread.

    Images are taken while fewer than `max_images` wait; a report that comes later goes in without its image. Any record
    is taken while fewer than `max_records` wait. What is turned away is counted.
    """

    def __init__(self, max_records: int, max_images: int) -> None:
        self._max_records = max_records
        self._max_images = max_images
        self._changed = threading.Condition()
        self._waiting: deque[object] = deque()
        self._n_images = 0
        self._is_closed = False
        self.n_dropped_images = 0
        self.n_dropped_records = 0

    @property
    def n_waiting(self) -> int:
        """How many records wait to be taken."""
        return len(self._waiting)

    def put(self, record: object) -> None:
        """Add a record, or count it as dropped; returns at once."""
        with self._changed:
            if self._is_closed or len(self._waiting) >= self._max_records:
                self.n_dropped_records += 1
                return
            if isinstance(record, VisionReport) and record.jpeg is not None:
                if self._n_images >= self._max_images:
                    self.n_dropped_images += 1
                    record = replace(record, jpeg=None)
                else:
                    self._n_images += 1
            self._waiting.append(record)
            self._changed.notify()

    def take(self, timeout_s: float) -> list[object] | None:
        """Take all that waits, oldest first, after at most `timeout_s` [s, wall]; None once closed and empty."""
        with self._changed:
            self._changed.wait_for(lambda: self._waiting or self._is_closed, timeout_s)
            if self._is_closed and not self._waiting:
                return None
            taken = list(self._waiting)
            self._waiting.clear()
            self._n_images = 0
            return taken

    def close(self) -> None:
        """Take no more records."""
        with self._changed:
            self._is_closed = True
            self._changed.notify()
