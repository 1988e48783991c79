"""Painted grounds are kept on disk, so that only the first flight in a world waits for the painter."""

import contextlib
import hashlib
import os
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

_MOST_BYTES = 4_000_000_000  # a ground is up to 300 MB; what was not used for longest goes first


def cache_folder() -> Path:
    """Where painted grounds are kept: lineflight/worlds in XDG_CACHE_HOME, or in ~/.cache."""
    base = os.environ.get("XDG_CACHE_HOME", "")
    return (Path(base) if base.startswith("/") else Path("~/.cache").expanduser()) / "lineflight" / "worlds"


def key_of(*parts: object) -> str:
    """A name for what was painted from `parts`, whose repr must tell them apart from all others."""
    return hashlib.sha256(repr(parts).encode()).hexdigest()[:32]


def recall(key: str, shape: tuple[int, ...], paint: Callable[[], NDArray[np.uint8]]) -> NDArray[np.uint8]:
    """The array that `paint` returns, from disk where it is kept there under `key`, as one read-only map of the file.

    A folder that cannot be read or written, or a file that is not whole, is no error: then it is painted again.
    """
    file = cache_folder() / f"{key}.npy"
    with contextlib.suppress(OSError, ValueError, EOFError):
        kept = np.load(file, mmap_mode="r", allow_pickle=False)
        if kept.shape == shape and kept.dtype == np.uint8:
            with contextlib.suppress(OSError):
                os.utime(file)
            return np.asarray(kept)
    painted = paint()
    with contextlib.suppress(OSError):
        _keep(file, painted)
        return np.asarray(np.load(file, mmap_mode="r", allow_pickle=False))
    return painted


def _keep(file: Path, painted: NDArray[np.uint8]) -> None:
    """Write a file at once or not at all, whoever else writes the same one; let go what is too much."""
    file.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=file.parent, suffix=".part")
    try:
        with os.fdopen(handle, "wb") as part:
            np.save(part, painted)
        Path(name).replace(file)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise
    room_bytes = _MOST_BYTES
    kept = [(path.stat(), path) for path in file.parent.glob("*.npy")]
    for facts, path in sorted(kept, key=lambda entry: entry[0].st_mtime, reverse=True):
        room_bytes -= facts.st_size
        if room_bytes < 0 and path != file:
            path.unlink(missing_ok=True)
