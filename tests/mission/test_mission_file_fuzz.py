"""Ten thousand mission files that are wrong in some way: none crashes the reader, and every refusal names its place."""

import copy
import json
import re
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mission.plan_file import MissionFileError, read_mission

GOOD_TEXT = """version: 1
name: good
description: Out and back.
tasks:
  - {task: takeoff, altitude_m: 5}
  - {task: ascend, altitude_m: 16}
  - {task: move_until, max_distance_m: 40.0}
  - {task: align, turn: right}
  - {task: follow_lines, distance_m: 30}
  - {task: move_forward, distance_m: as_move_until}
  - {task: return}
camera: {width_px: 640, controls: {gain: 1}}
safety:
  line_height_m: 10.3
  fence: {polygon_m: [[-90, -90], [-90, 90], [90, 0]], min_altitude_m: 4}
  reactions: {line_lost: return}
"""
GOOD: dict[str, Any] = yaml.safe_load(GOOD_TEXT)

ODD_VALUES: list[Any] = [
    None, True, False, 0, -1, 1e308, -1e308, 5e-324, 10**30, 10**400, -(10**400), 2**63, 0.1, "", " ", "5 m", "5", "ja",
    "äöü", "電線", "\u202e", "\U0001f681", "a" * 300, "\n", "\t", "\x00", "\x7f", "\ud800",
    "~/x.yaml", "../../etc/passwd",
    "takeoff", "land", "as_move_until", "sim:", "v4l2:", "file:\x00", "foo:bar", [], {}, [[]], [{}], {"task": "land"},
    {"task": None}, {"task": ["land"]}, {"task": {"task": "land"}}, {"": ""},
    [None] * 201, {str(n): n for n in range(99)},
    [[1e308, 1e308], [-1e308, 1e308], [0, -1e308]], [[0, 0]] * 4, [[-1, -1], [-1, 1], [1, "x"]],
]  # fmt: skip
ODD_KEYS = [
    "task",
    "altitude_ft",
    "altitude_m",
    "",
    " ",
    "ä",
    "\n",
    "version ",
    "Version",
    "0",
    "<<",
    "a.b[0]",
    "\ud800",
]
ODD_TEXTS = [
    "\t", "\n\t- x", "&a ", "*a", "&a &a", "<<: *a", "<<: {a: 1}", "!!python/object:os.system x",
    "!!binary aGk=", "!x y",
    "!!set {a}", "!!omap [a: 1]", "!!timestamp x", "!!int x", "!!float []", "? [a, b]\n: c\n", "? {a: b}\n: c\n",
    "2001-01-01: x\n", "2001-99-99", "2001-01-01 25:61:61", "1: 2\n", "1.5: 2\n", "null: 2\n", "~: 2\n", "true: 2\n",
    "!!binary aGk=: x\n", "12:30:45", "0x1F", "0b2", "0o9", "1_000", ".inf", "-.inf", ".nan", "1e999",
    "9" * 5000, "9" * 4000,
    "---\n", "...\n", "--- x\n--- y\n", "%YAML 9.9\n---\n", "%TAG ! tag:x\n---\n", "|\n x", ">-\n", "'", '"', '"\\x00"',
    '"\\ud800"', '"\\z"', "#", "# x", ": ", "- ", "{", "}", "[", "]", ",", "{{", "[[", "[" * 60, "{a: " * 60, "[" * 300,
    "\u2028", "\u0085", "\ufeff", "\x00", "\x1b[31m", "\r", "\r\n", "\x07", "`", "@", "=", "name: x\nname: y\n",
]  # fmt: skip


def assert_read_or_refused(folder: Path, content: bytes) -> None:
    """The file is a mission, or every line of the refusal says file, line and what is wrong, and can be printed."""
    file = folder / "mission.yaml"
    file.write_bytes(content)
    try:
        read_mission(file)
    except MissionFileError as error:
        lines = error.lines()
        assert lines
        n_lines = len(re.split(rb"\r\n|\r|\n|\xc2\x85|\xe2\x80[\xa8\xa9]", content))
        for line in lines[:40]:
            match = re.fullmatch(re.escape(str(file)) + r":(\d+): (.+)", line)
            assert match, f"no place, or more than one line: {line!r}"
            assert 1 <= int(match[1]) <= n_lines
            line.encode()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("missions")


def many(n_examples: int) -> settings:
    return settings(max_examples=n_examples, derandomize=True, database=None, suppress_health_check=list(HealthCheck))


def places(data: Any) -> list[tuple[Any, Any]]:
    """Every (container, key) of nested data."""
    items = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    return [(data, key) for key, _ in items] + [place for _, value in items for place in places(value)]


CHANGES = st.lists(
    st.tuples(
        st.integers(0, 10**6),
        st.sampled_from(("replace", "remove", "add", "repeat", "nest", "unwrap")),
        st.sampled_from(ODD_VALUES),
        st.sampled_from(ODD_KEYS),
    ),
    min_size=1,
    max_size=4,
)


def changed(changes: list[tuple[int, str, Any, str]]) -> Any:
    """The good mission's data after some changes."""
    data = copy.deepcopy(GOOD)
    for where, what, value, key in changes:
        found = places(data)
        if not found:
            break
        container, at = found[where % len(found)]
        if what == "replace":
            container[at] = copy.deepcopy(value)
        elif what == "remove":
            del container[at]
        elif what == "add" and isinstance(container, dict):
            container[key] = copy.deepcopy(value)
        elif what == "repeat" and isinstance(container, list):
            container.insert(at, copy.deepcopy(container[at]))
        elif what == "nest":
            container[at] = {key: container[at]} if where % 2 else [container[at]]
        elif what == "unwrap" and isinstance(container[at], dict | list):
            container[at] = next(iter(container[at]), None)
    return data


@many(4500)
@given(CHANGES, st.booleans())
def test_wrong_types_ranges_and_keys(folder: Path, changes: list[tuple[int, str, Any, str]], is_ascii: bool) -> None:
    text = json.dumps(changed(changes), ensure_ascii=is_ascii, indent=1)
    assert_read_or_refused(folder, text.encode("utf-8", "surrogatepass"))


@many(3500)
@given(
    st.lists(
        st.tuples(st.integers(0, len(GOOD_TEXT)), st.integers(0, 30), st.sampled_from(["", *ODD_TEXTS])),
        min_size=1,
        max_size=4,
    )
)
def test_odd_yaml(folder: Path, edits: list[tuple[int, int, str]]) -> None:
    text = GOOD_TEXT
    for at, n_cut, inserted in edits:
        at %= len(text) + 1
        text = text[:at] + inserted + text[at + n_cut :]
    assert_read_or_refused(folder, text.encode("utf-8", "surrogatepass"))


@many(1000)
@given(st.sampled_from(ODD_TEXTS), st.sampled_from(["version: ", "name: ", "tasks: ", "tasks:\n  - ", "safety: ", ""]))
def test_odd_beginnings(folder: Path, odd: str, key: str) -> None:
    assert_read_or_refused(folder, f"{key}{odd}\n{GOOD_TEXT}".encode())
    assert_read_or_refused(folder, f"{GOOD_TEXT}{key}{odd}".encode())


@many(1000)
@given(
    st.binary(max_size=200),
    st.integers(0, len(GOOD_TEXT)),
    st.sampled_from(["utf-8", "utf-16", "utf-32", "latin-1", "utf-8-sig"]),
)
def test_binary_garbage(folder: Path, garbage: bytes, at: int, encoding: str) -> None:
    good = GOOD_TEXT.encode(encoding)
    assert_read_or_refused(folder, garbage)
    assert_read_or_refused(folder, good[:at] + garbage + good[at:])


def test_the_good_mission_is_good(folder: Path) -> None:
    for text in (GOOD_TEXT, json.dumps(GOOD)):
        (folder / "good.yaml").write_text(text)
        assert read_mission(folder / "good.yaml").plan.name == "good"
