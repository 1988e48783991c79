"""What a command prints: an output that takes no more is told from a fault of ours."""

import contextlib
import io
import os
import sys
from collections.abc import Iterator


class OutputLostError(Exception):
    """What a command has to say cannot be written; the message is one sentence."""


class _Output(io.TextIOWrapper):
    """Standard output. A reader that has gone, as `head` does, is no loss: BrokenPipeError passes as it is."""

    def write(self, text: str, /) -> int:
        with _told():
            return super().write(text)

    def flush(self) -> None:
        with _told():
            super().flush()


class _Asides(io.TextIOWrapper):
    """Standard error: what it does not take is lost, and changes nothing about how the command ends."""

    def write(self, text: str, /) -> int:
        with contextlib.suppress(OSError):
            return super().write(text)
        return len(text)

    def flush(self) -> None:
        with contextlib.suppress(OSError):
            super().flush()


def watch_output() -> None:
    """From now on OutputLostError, and no OSError, tells that standard output cannot be written."""
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout = _over(_Output, sys.stdout)
    if isinstance(sys.stderr, io.TextIOWrapper):
        sys.stderr = _over(_Asides, sys.stderr)


def forget_output() -> None:
    """Let the interpreter's last flush have nowhere to fail: what waits goes nowhere."""
    with contextlib.suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)


def _over(kind: type[io.TextIOWrapper], stream: io.TextIOWrapper) -> io.TextIOWrapper:
    return kind(
        stream.buffer,
        encoding=stream.encoding,
        errors=stream.errors,
        line_buffering=stream.line_buffering,
        write_through=stream.write_through,
    )


@contextlib.contextmanager
def _told() -> Iterator[None]:
    try:
        yield
    except BrokenPipeError:
        raise
    except OSError as error:
        raise OutputLostError(
            f"The output could not be written ({error.strerror or error}); send it to where there is room."
        ) from error
