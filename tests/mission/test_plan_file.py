"""Mission files: what is good is read, and what is bad is told all at once, with file, line and key."""

import json
from pathlib import Path

import pytest

from mission.plan_file import MAX_BYTES, MissionFileError, read_mission, schema_text

MISSIONS = Path(__file__).parents[2] / "missions"
GOOD = """version: 1
name: good
tasks:
  - {task: takeoff, altitude_m: 5}
  - {task: land}
"""


def problems_of(path: Path, text: str | bytes) -> list[str]:
    """The messages for a file of this text, without the file's name."""
    file = path / "mission.yaml"
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(MissionFileError) as caught:
        read_mission(file)
    lines = caught.value.lines()
    assert all(line.startswith(f"{file}:") for line in lines)
    return [line.removeprefix(f"{file}:") for line in lines]


@pytest.mark.parametrize("file", sorted(MISSIONS.glob("*.yaml")), ids=lambda file: file.stem)
def test_shipped_missions_are_good_and_short(file: Path) -> None:
    mission = read_mission(file)
    assert mission.plan.name == file.stem
    assert len(mission.text.splitlines()) < 30


def test_the_shipped_schema_is_current() -> None:
    assert (MISSIONS / "mission.schema.json").read_text(encoding="utf-8") == schema_text(), "run make schema"


def test_the_schema_refuses_unknown_keys_everywhere() -> None:
    schema = json.loads(schema_text())
    sections = [schema, *schema["$defs"].values()]
    assert all(section["additionalProperties"] is False for section in sections if section.get("type") == "object")


def test_all_errors_come_at_once_in_the_order_of_the_file(tmp_path: Path) -> None:
    text = """version: 2
name: bad
tasks:
  - {task: align}
  - {task: takeof}
  - {task: move_forward, distance_m: -3}
  - {task: ascend, altitude_ft: 30}
guidance:
  p_per_s: 0.5
"""
    found = problems_of(tmp_path, text)
    assert [line.split(": ")[:2] for line in found] == [
        ["1", "version"],
        ["4", "tasks[0].task"],
        ["5", "tasks[1].task"],
        ["6", "tasks[2].distance_m"],
        ["7", "tasks[3].altitude_m"],
        ["7", "tasks[3].altitude_ft"],
        ["7", "tasks[3].task"],
        ["9", "guidance.p_per_s"],
    ]
    assert "found align before takeoff; allowed: takeoff as the first task" in found[1]
    assert "found takeof; allowed: takeoff, ascend, descend," in found[2]
    assert "found -3; allowed: greater than 0" in found[3]
    assert "did you mean altitude_m?" in found[5]
    assert "allowed: land or return as the last task" in found[6]
    assert "did you mean P_per_s?" in found[7]


@pytest.mark.parametrize(
    ("edit", "expected"),
    [
        (("altitude_m: 5", "altitude_m: 5 ft"), 'tasks[0].altitude_m: found "5 ft"; allowed: a plain number'),
        (("altitude_m: 5", "altitude_m: '5'"), 'tasks[0].altitude_m: found "5"; allowed: a plain number'),
        (("altitude_m: 5", "altitude_m: .nan"), "tasks[0].altitude_m: found NaN; allowed: a finite number"),
        (("altitude_m: 5", "altitude_m: true"), "tasks[0].altitude_m: found true; allowed: a plain number"),
        (("altitude_m: 5", "altitude_m: 70"), "found 70 m; allowed: at most safety.max_altitude_m = 60 m"),
        (("  - {task: land}", "  - {task: hold, duration_s: 3}"), "allowed: land or return as the last task"),
        (("  - {task: land}", "  - land"), "allowed: a mapping with a key named task, e.g. {task: land}"),
        (("  - {task: land}", "  - {task: land}\n  - {task: land}"), "allowed: land only as the last task"),
        (("  - {task: land}", "  - {task: takeoff}\n  - {task: land}"), "allowed: takeoff only as the first task"),
        (
            ("{task: land}", "{task: descend, altitude_m: 9}\n  - {task: land}"),
            "found descend to 9 m; allowed: less than the 5 m flown before",
        ),
        (
            ("{task: land}", "{task: move_forward, distance_m: as_move_until}\n  - {task: land}"),
            "found as_move_until without a move_until before; allowed: a number of metres",
        ),
        (("version: 1\n", ""), "version: missing; this key must be given"),
        (("name: good", "name: good\nname: better"), "name: this key stands here twice; keep one"),
        (("name: good", "name: &n good\ndescription: *n"), "YAML aliases (*name) are not allowed"),
        (("name: good", "name: [good"), "not valid YAML"),
    ],
)
def test_each_mistake_is_named(tmp_path: Path, edit: tuple[str, str], expected: str) -> None:
    text = GOOD.replace(*edit)
    assert text != GOOD
    found = problems_of(tmp_path, text)
    assert len(found) == 1, found
    assert expected in found[0]


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (b"", "empty; a mission needs version, name and tasks"),
        (b"  \n\n", "empty; a mission needs version, name and tasks"),
        (b"# only a comment\n", "a mission is a mapping with version, name and tasks"),
        (b"just words", 'found "just words"; a mission is a mapping'),
        (b"- 1\n- 2\n", "a mission is a mapping"),
        (b"\x7fELF\x02\x01\x01\x00\xff\xfe", "not text (UTF-8)"),
        (b"name: \x00\x01", "not valid YAML"),
        (b"[" * 2_000 + b"]" * 2_000, "nested too deeply"),
        (b"x" * 10_000_000, f"larger than {MAX_BYTES // 1024} KB"),
        (b"{}", "version: missing"),
        (b"name: !!python/object:os.system x", "YAML tags (!name) are not allowed"),
    ],
)
def test_what_is_no_mission_is_refused(tmp_path: Path, content: bytes, expected: str) -> None:
    assert expected in "\n".join(problems_of(tmp_path, content))


LINE = """version: 1
name: line
tasks:
  - {task: takeoff, altitude_m: 5}
  - {task: ascend, altitude_m: 14}
  - {task: move_until}
  - {task: return}
safety:
  line_height_m: 10
"""


@pytest.mark.parametrize(
    ("edit", "expected"),
    [
        (("altitude_m: 14", "altitude_m: 12"), "6: tasks[2]: found move_until at 12 m, where the line may be below"),
        (("{task: return}", "{task: land}"), "7: tasks[3]: found land at 0 m, where the line may be below; allowed: "),
        (("line_height_m: 10", "line_height_m: 12"), "line_height_m + min_clearance_m = 15 m"),
        (("safety:", "camera: {source: 'foo:bar'}\nsafety:"), "8: camera.source: found foo:bar; allowed: v4l2:DEVICE"),
        (("line_height_m: 10", "fence: {polygon_m: [[1, 1], [1, 2], [2, 2]]}"), "9: safety.fence: "),
        (("line_height_m: 10", "fence: {polygon_m: [[1, 1], [1, 2]]}"), "9: safety.fence.polygon_m: "),
        (("line_height_m: 10", "fence: {polygon_m: [[1, 1], [1, 2], [2]]}"), "9: safety.fence.polygon_m[2]: "),
    ],
)
def test_line_fence_and_camera_are_checked(tmp_path: Path, edit: tuple[str, str], expected: str) -> None:
    (tmp_path / "good.yaml").write_text(LINE)
    read_mission(tmp_path / "good.yaml")
    text = LINE.replace(*edit)
    assert text != LINE
    assert expected in "\n".join(problems_of(tmp_path, text))


def test_nothing_sinks_below_the_fences_least_height(tmp_path: Path) -> None:
    up_and_down = "  - {task: ascend, altitude_m: 9}\n  - {task: descend, altitude_m: 6}\n  - {task: land}"
    text = GOOD.replace("  - {task: land}", up_and_down) + "safety: {fence: {min_altitude_m: 7}}\n"
    assert problems_of(tmp_path, text) == [
        "6: tasks[2].altitude_m: found 6 m; allowed: at least safety.fence.min_altitude_m = 7 m"
    ]


def test_a_calibration_may_lie_in_the_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    found = problems_of(tmp_path, GOOD + "camera: {calibration: ~/none.yaml}\n")
    assert str(tmp_path / "home" / "none.yaml") in found[0]
    assert "no home" in problems_of(tmp_path, GOOD + "camera: {calibration: ~nobody-here/none.yaml}\n")[0]


def test_a_folder_and_a_missing_file_are_refused(tmp_path: Path) -> None:
    with pytest.raises(MissionFileError, match="this is a folder"):
        read_mission(tmp_path)
    with pytest.raises(MissionFileError, match="no such file"):
        read_mission(tmp_path / "none.yaml")


@pytest.mark.parametrize(
    ("safety", "allowed"),
    [
        ("{battery_low_percent: 20, battery_critical_percent: 50}", "below battery_low_percent = 20"),
        ("{max_altitude_m: 40.5, fence: {min_altitude_m: 100}}", "fence.min_altitude_m below max_altitude_m = 40.5"),
    ],
)  # fmt: skip
def test_limits_that_contradict_each_other_are_told_with_their_values(
    safety: str, allowed: str, tmp_path: Path
) -> None:
    text = f"version: 1\nname: x\ntasks: [{{task: takeoff}}, {{task: land}}]\nsafety: {safety}\n"
    (line,) = problems_of(tmp_path, text)
    assert line.endswith(allowed)
