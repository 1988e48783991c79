"""Records from one process to another through a pipe on which neither side ever waits for the other's work.

The writer puts records into a short queue that a thread empties into the pipe; when the reader is slow the oldest
records fall out. The reader takes what has arrived, whole records only, and never waits for the rest of one.
"""

import os
import struct
import threading
from collections import deque
from collections.abc import Iterator
from multiprocessing.reduction import ForkingPickler
from typing import Generic, TypeVar

T = TypeVar("T")

_HEADER = struct.Struct("!I")  # a record's length [bytes]
_READ_BYTES = 1 << 16


class Outbox(Generic[T]):
    """The writing side: `put` returns at once, whatever the reader does.

    At most `depth` records wait; one more pushes the oldest out. The pipe's own buffer holds some more.
    """

    def __init__(self, pipe_fd: int, depth: int) -> None:
        self._pipe_fd = pipe_fd
        self._waiting: deque[T] = deque(maxlen=depth)
        self._changed = threading.Condition()
        self._is_closed = False
        # A daemon: a reader that never reads again must not keep this process alive.
        self._thread = threading.Thread(target=self._send, name="outbox", daemon=True)
        self._thread.start()

    def put(self, record: T) -> None:
        """Queue a record, in place of the oldest when `depth` are waiting."""
        with self._changed:
            self._waiting.append(record)
            self._changed.notify()

    def close(self, timeout_s: float) -> None:
        """Let what is queued go out for at most `timeout_s` [s, wall]."""
        with self._changed:
            self._is_closed = True
            self._changed.notify()
        self._thread.join(timeout_s)

    def _send(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._waiting or self._is_closed)
                if not self._waiting:
                    return
                record = self._waiting.popleft()
            body = bytes(ForkingPickler.dumps(record))
            unsent = memoryview(_HEADER.pack(len(body)) + body)
            try:
                while unsent:
                    unsent = unsent[os.write(self._pipe_fd, unsent) :]
            except BrokenPipeError:
                return


class Inbox:
    """The reading side of the pipe at `pipe_fd`, which it makes non-blocking."""

    def __init__(self, pipe_fd: int) -> None:
        os.set_blocking(pipe_fd, False)
        self._pipe_fd = pipe_fd
        self._arrived = bytearray()
        self.is_ended = False

    def drain(self) -> list[object]:
        """Every whole record that has arrived, oldest first; sets `is_ended` once the writer is gone."""
        while not self.is_ended:
            try:
                piece = os.read(self._pipe_fd, _READ_BYTES)
            except BlockingIOError:
                break
            self._arrived += piece
            self.is_ended = not piece
        return list(self._whole_records())

    def _whole_records(self) -> Iterator[object]:
        while len(self._arrived) >= _HEADER.size:
            end = _HEADER.size + _HEADER.unpack_from(self._arrived)[0]
            if len(self._arrived) < end:
                return
            yield ForkingPickler.loads(bytes(self._arrived[_HEADER.size : end]))
            del self._arrived[:end]
