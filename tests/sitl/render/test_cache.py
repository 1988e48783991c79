"""Painted grounds come back from disk as they were; nothing that goes wrong there stops a flight."""

import os
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from sitl.render import cache
from sitl.render.cache import cache_folder, key_of, recall
from sitl.world.records import Ground, Tree

PICTURE = np.arange(24, dtype=np.uint8).reshape(2, 3, 4)


class Painter:
    def __init__(self) -> None:
        self.n_painted = 0

    def __call__(self) -> NDArray[np.uint8]:
        self.n_painted += 1
        return PICTURE.copy()


@pytest.fixture
def painter(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Painter:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return Painter()


def test_what_was_painted_comes_back_from_disk(painter: Painter) -> None:
    for _ in range(3):
        np.testing.assert_array_equal(recall("a", PICTURE.shape, painter), PICTURE)
    assert painter.n_painted == 1
    recall("b", PICTURE.shape, painter)
    assert painter.n_painted == 2
    assert sorted(path.name for path in cache_folder().iterdir()) == ["a.npy", "b.npy"]
    assert not recall("a", PICTURE.shape, painter).flags.writeable


def test_a_key_tells_worlds_and_versions_apart() -> None:
    tree = Tree("bush", 1.0, 2.0, 1.5, 0.7)
    keys = {
        key_of("surface", 1, Ground("pasture", 7), (tree,)),
        key_of("surface", 2, Ground("pasture", 7), (tree,)),
        key_of("surface", 1, Ground("pasture", 8), (tree,)),
        key_of("surface", 1, Ground("pasture", 7), ()),
    }
    assert len(keys) == 4
    assert key_of("surface", 1, Ground("pasture", 7), (tree,)) in keys


def test_a_broken_file_is_painted_again(painter: Painter) -> None:
    recall("a", PICTURE.shape, painter)
    file = cache_folder() / "a.npy"
    file.write_bytes(file.read_bytes()[:-5])
    np.testing.assert_array_equal(recall("a", PICTURE.shape, painter), PICTURE)
    file.write_bytes(b"")
    np.testing.assert_array_equal(recall("a", PICTURE.shape, painter), PICTURE)
    np.save(file, np.zeros((9, 9, 4), dtype=np.uint8))
    np.testing.assert_array_equal(recall("a", PICTURE.shape, painter), PICTURE)
    assert painter.n_painted == 4
    recall("a", PICTURE.shape, painter)
    assert painter.n_painted == 4


def test_a_folder_that_cannot_be_written_is_no_error(
    painter: Painter, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("in the way", encoding="utf-8")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    np.testing.assert_array_equal(recall("a", PICTURE.shape, painter), PICTURE)
    assert painter.n_painted == 1


def test_what_was_not_used_for_longest_goes(painter: Painter, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cache, "_MOST_BYTES", 2 * (PICTURE.nbytes + 128))  # two files, with NumPy's headers
    for age, key in enumerate("abc"):
        recall(key, PICTURE.shape, painter)
        file = cache_folder() / f"{key}.npy"
        os.utime(file, (1000 + age, 1000 + age))
    recall("b", PICTURE.shape, painter)  # is used, so it stays
    recall("d", PICTURE.shape, painter)
    assert sorted(path.name for path in cache_folder().iterdir()) == ["b.npy", "d.npy"]
