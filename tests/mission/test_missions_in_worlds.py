"""The shipped missions fit the shipped worlds that they are flown in."""

import math
from pathlib import Path

import numpy as np
import pytest

from mission import plan as p
from mission.offline_checks import check_offline
from mission.plan_file import read_mission
from mission.records import CheckResult
from sitl.world.file import load_world

MISSIONS = Path(__file__).parents[2] / "missions"
FLOWN = [
    ("follow_line", "medium_voltage"),
    ("first_follow", "medium_voltage"),
    ("follow_line", "forest"),
    ("follow_line", "village"),
    ("follow_line", "crossing"),
    ("follow_high_voltage", "high_voltage"),
    ("follow_corner", "corner"),
    ("follow_hills", "hills"),
]


@pytest.mark.parametrize(("mission", "world_name"), FLOWN)
def test_a_mission_flies_clear_of_everything_near_its_way(mission: str, world_name: str) -> None:
    plan, world = read_mission(MISSIONS / f"{mission}.yaml").plan, load_world(world_name)
    altitude_m = max(task.altitude_m for task in plan.tasks if isinstance(task, p.Takeoff | p.Ascend))
    follows_m = max(task.distance_m for task in plan.tasks if isinstance(task, p.FollowLines))
    reach_m = math.hypot(25.0, follows_m) + 10.0
    tops = [(*s.top_ned_m[:2], -s.top_ned_m[2]) for s in world.supports]
    tops += [(n, e, -d) for conductor in world.conductors for n, e, d in conductor.points_ned_m]
    tops += [
        (t.north_m, t.east_m, world.terrain.at(t.north_m, t.east_m) + t.height_m)
        for t in world.trees
        if distance_to_line_m(world.line.axis_ne_m, t.north_m, t.east_m) < 8.0
    ]
    near_m = max(up_m for north_m, east_m, up_m in tops if math.hypot(north_m, east_m) < reach_m)
    assert altitude_m >= near_m + plan.safety.min_clearance_m


@pytest.mark.parametrize(
    ("mission", "world_name"), [pair for pair in FLOWN if pair[0] != "follow_line" or pair[1] == "medium_voltage"]
)
def test_a_mission_tells_the_height_of_its_line(mission: str, world_name: str) -> None:
    told_m = read_mission(MISSIONS / f"{mission}.yaml").plan.safety.line_height_m
    line = load_world(world_name).line
    top_m = max(
        max(-float(conductor.points_ned_m[:, 2].min()) for conductor in line.conductors),
        max(-support.top_ned_m[2] for support in line.supports),
    )
    assert told_m is not None
    assert top_m <= told_m <= top_m + 0.5


@pytest.mark.parametrize("mission", sorted({mission for mission, _ in FLOWN}))
def test_a_mission_passes_its_checks(mission: str) -> None:
    checks = check_offline(read_mission(MISSIONS / f"{mission}.yaml").plan)
    assert [check.line for check in checks if check.result is CheckResult.FAILED] == []


def distance_to_line_m(axis_ne_m: tuple[tuple[float, float], ...], north_m: float, east_m: float) -> float:
    axis = np.array(axis_ne_m)
    step = axis[1:] - axis[:-1]
    gap = np.array([north_m, east_m]) - axis[:-1]
    share = np.clip(np.sum(gap * step, axis=1) / np.sum(step * step, axis=1), 0.0, 1.0)
    return float(np.linalg.norm(gap - share[:, None] * step, axis=1).min())
