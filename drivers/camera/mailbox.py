"""A mailbox of size one between two threads: the newest item wins, and what nobody took in time is counted."""

import threading
from typing import Generic, TypeVar

T = TypeVar("T")


class Mailbox(Generic[T]):
    """Holds the newest item until it is taken.

    One thread puts, another gets. `put` never waits. An item that is overwritten before it was taken counts in
    `n_dropped`. After `close`, an item still in the box may be taken; then `get` raises.
    """

    def __init__(self) -> None:
        self._ready = threading.Condition()
        self._item: T | None = None
        self._error: Exception | None = None
        self._is_closed = False
        self._n_dropped = 0

    @property
    def n_dropped(self) -> int:
        """How many items were overwritten before anybody took them."""
        with self._ready:
            return self._n_dropped

    def put(self, item: T) -> None:
        """Leave an item, in place of one that was not taken; does nothing once the mailbox is closed."""
        with self._ready:
            if self._is_closed:
                return
            if self._item is not None:
                self._n_dropped += 1
            self._item = item
            self._ready.notify()

    def get(self, timeout_s: float) -> T | None:
        """Take the newest item, waiting for one at most `timeout_s` [s, wall]; None when none came.

        Raises the error that `close` was given, or EOFError, once the mailbox is closed and empty.
        """
        with self._ready:
            self._ready.wait_for(lambda: self._item is not None or self._is_closed, timeout_s)
            item, self._item = self._item, None
            if item is None and self._is_closed:
                raise self._error if self._error is not None else EOFError("The mailbox is closed.")
            return item

    def close(self, error: Exception | None = None) -> None:
        """Take no more items; an empty mailbox now raises `error`, or EOFError without one. The first call counts."""
        with self._ready:
            if not self._is_closed:
                self._is_closed = True
                self._error = error
            self._ready.notify_all()
