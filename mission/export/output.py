"""Files and folders that are there as a whole or not at all, and never in the place of others."""

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from mission.export.errors import ExportError, OutputError

_UNFINISHED = ".unfinished-"


@contextmanager
def new_folder(folder: Path) -> Iterator[Path]:
    """Give a folder to write into; what stands there in the end is moved into `folder`, and nothing after an error.

    Raises ExportError when `folder` holds something already, OutputError when it, or what is put there, cannot be
    written.
    """
    try:
        is_new = not folder.exists()
        folder.mkdir(parents=True, exist_ok=True)
        if any(folder.iterdir()):
            raise ExportError(f"The folder {folder} is not empty; name a new one.")
        unfinished = Path(tempfile.mkdtemp(prefix=_UNFINISHED, dir=folder))
    except OSError as error:
        raise OutputError(f"The folder {folder} cannot be made ({error.strerror}); name another one.") from error
    try:
        yield unfinished
        for entry in unfinished.iterdir():
            entry.rename(folder / entry.name)
    except OSError as error:
        raise OutputError(f"The export to {folder} cannot be written ({error.strerror}); nothing is kept.") from error
    finally:
        shutil.rmtree(unfinished, ignore_errors=True)
        if is_new:
            with suppress(OSError):  # all is well: it holds what was exported
                folder.rmdir()


def write_new_file(file: Path, content: bytes) -> None:
    """Write a file that does not exist yet.

    Raises ExportError when it exists, OutputError when it cannot be written.
    """
    try:
        if file.exists():
            raise ExportError(f"{file} exists already; name a new file.")
        file.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=_UNFINISHED, dir=file.parent) as unfinished:
            part = Path(unfinished) / file.name
            part.write_bytes(content)
            part.rename(file)
    except OSError as error:
        raise OutputError(f"The file {file} cannot be written ({error.strerror}); name another one.") from error
