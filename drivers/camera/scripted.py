"""A camera that plays a script: what each read gives is written down beforehand."""

from collections.abc import Iterable
from types import TracebackType
from typing import Self

from drivers.camera.camera import Frame


class ScriptedCamera:
    """Gives what the script holds, one item a read, at once; at the script's end every read raises EOFError.

    An item is a frame, None (nothing came in time) or an exception, which is raised.
    """

    def __init__(self, script: Iterable[Frame | Exception | None]) -> None:
        self._script = iter(tuple(script))
        self.is_open = False

    def read(self, timeout_s: float) -> Frame | None:
        """Give the script's next item; never waits. Raises what the script says, EOFError after its end."""
        for item in self._script:
            if isinstance(item, Exception):
                raise item
            return item
        raise EOFError("The script has no more frames.")

    def __enter__(self) -> Self:
        self.is_open = True
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.is_open = False
