"""Blame by causing it: what was done to a flight is what its log says was done."""

import asyncio
import itertools
import math
import random
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import yaml

from mission import guidance
from mission.autopilot import Setpoint, VehicleState
from mission.guidance import WorldLine
from mission.log.blame.blame import find_excursions
from mission.log.blame.records import Culprit, Fault, Kind
from mission.log.imported import Imported, ImportedActuators, ImportedLog
from mission.log.reader import Flight
from mission.plan import MissionPlan, Rotate
from mission.tasks import follow_lines
from sitl.gust_front import GustFronts, one_minus_cosine
from sitl.wind import Wind
from tests.support.faulty_autopilot import FaultyAutopilot
from tests.support.flights import LINE_HEADING_RAD, Cockpit
from tests.support.logged_flight import Bend, fly_and_log
from vision.records import VisionReport

PLAN = MissionPlan.model_validate(
    yaml.safe_load(
        """
version: 1
name: blamed
tasks:
  - {task: takeoff, altitude_m: 5}
  - {task: ascend, altitude_m: 16}
  - {task: move_until}
  - {task: align, turn: right}
  - {task: follow_lines, distance_m: 35}
  - {task: return}
safety: {line_height_m: 10.3, line_lost_s: 4.0}
"""
    )
)
SEEDS = tuple(range(1, 11))
MEAN_WIND_M_S = 4.0


class OneGust(GustFronts):
    """A single gust from where the wind blows, `strength` times the mean, which comes when it is told to."""

    def __init__(self, strength: float) -> None:
        self._strength = strength
        self._since_s = -1.0

    def begin(self) -> None:
        self._since_s = 0.0

    def step(self, dt_s: float, travelled_m: float) -> tuple[float, float]:
        if self._since_s < 0.0:
            return (0.0, 0.0)
        self._since_s += dt_s
        share = one_minus_cosine(self._since_s, 0.8) - one_minus_cosine(self._since_s - 3.0, 1.5)
        return (share * self._strength, 0.0)


def fly(path: Path, seed: int, do: Callable[[Cockpit], None], gust: OneGust | None = None) -> Flight:
    """Fly along the line in a wind that comes from somewhere abeam; `do` is done four seconds into the leg."""
    return fly_and_log(
        path,
        PLAN,
        wind=wind_abeam(seed, gust),
        seed=seed,
        in_task="follow_lines",
        after_s=4.0,
        do=do,
        until="return",
        until_s=20.0,
    )


def wind_abeam(seed: int, gust: OneGust | None = None) -> Wind:
    draw = random.Random(f"blame {seed}")
    abeam_rad = LINE_HEADING_RAD + math.copysign(math.pi / 2, draw.random() - 0.5) + draw.uniform(-0.6, 0.6)
    return Wind(MEAN_WIND_M_S, seed, abeam_rad, fronts=gust)


def without_truth(flight: Flight) -> Flight:
    """The same log from a real flight, where nobody knows where vehicle and line truly were."""
    return replace(flight, truth=(), line=None)


def bias_camera(cockpit: Cockpit, draw: random.Random) -> None:
    cockpit.eyes.askew_rad = math.copysign(math.radians(draw.uniform(10.0, 14.0)), draw.random() - 0.5)


def delay(cockpit: Cockpit, draw: random.Random) -> None:
    """Estimates come later than they may steer."""
    cockpit.eyes.latency_ns = round(draw.uniform(0.7, 1.2) * 1e9)


def misdate(cockpit: Cockpit, draw: random.Random) -> None:
    """Frames say that they were taken later than they were."""
    cockpit.eyes.stamp_late_ns = round(draw.uniform(0.4, 0.6) * 1e9)


def weaken(cockpit: Cockpit, draw: random.Random) -> None:
    vehicle = cockpit.autopilot.sim.vehicle
    vehicle.weaken(draw.randrange(len(vehicle.airframe.rotors)), draw.uniform(0.0, 0.2))


def either_side(draw: random.Random, least: float, most: float) -> float:
    return math.copysign(draw.uniform(least, most), draw.random() - 0.5)


def jump_for_good(cockpit: Cockpit, draw: random.Random) -> None:
    """Something else is taken for the line, beside it but near enough to be believed."""
    cockpit.eyes.aside_m = either_side(draw, 1.0, 1.4)


def jump_for_a_while(cockpit: Cockpit, draw: random.Random) -> None:
    jump_for_good(cockpit, draw)
    asyncio.get_running_loop().call_later(2.5, lambda: setattr(cockpit.eyes, "aside_m", 0.0))


def turn_for_a_while(cockpit: Cockpit, draw: random.Random) -> None:
    """A fence or a road that runs askew below the vehicle is taken for the line, as if it turned."""
    cockpit.eyes.turned_rad = either_side(draw, math.radians(22.0), math.radians(30.0))
    asyncio.get_running_loop().call_later(2.5, lambda: setattr(cockpit.eyes, "turned_rad", 0.0))


CAUSES: dict[str, tuple[Callable[[Cockpit, random.Random], None], Culprit, Fault]] = {
    "biased camera": (bias_camera, Culprit.PERCEPTION, Fault.WRONG),
    "delayed estimate": (delay, Culprit.PERCEPTION, Fault.LATE),
    "misdated frames": (misdate, Culprit.PERCEPTION, Fault.LATE),
    "weak motor": (weaken, Culprit.AUTOPILOT, Fault.TRACKING),
    "line that jumps": (jump_for_good, Culprit.PERCEPTION, Fault.WRONG),
}


@pytest.mark.parametrize("cause", CAUSES)
def test_what_was_done_is_what_is_blamed(cause: str, tmp_path: Path) -> None:
    act, culprit, fault = CAUSES[cause]
    flights = {}
    for seed in SEEDS:
        draw = random.Random(f"{cause} {seed}")
        flights[seed] = fly(tmp_path / f"{seed}.mcap", seed, lambda cockpit, draw=draw: act(cockpit, draw))
    check(flights, culprit, fault)


def test_a_gust_is_blamed_on_the_wind(tmp_path: Path) -> None:
    flights = {}
    for seed in SEEDS:
        gust = OneGust(random.Random(f"gust {seed}").uniform(1.5, 2.0))
        flights[seed] = fly(tmp_path / f"{seed}.mcap", seed, lambda _, gust=gust: gust.begin(), gust)
    check(flights, Culprit.WIND, Fault.PUSHED)


@pytest.mark.parametrize("missing", ["setpoints", "states", "reports", "fixes"])
def test_what_a_log_lacks_does_not_stand_in_a_sentence_as_a_number(missing: str, tmp_path: Path) -> None:
    """A gust, and around it nothing of one stream: no figure is told of what nobody knows."""
    gust = OneGust(1.8)
    flight = fly(tmp_path / "1.mcap", 2, lambda _: gust.begin(), gust)
    (off, *_) = [one for one in find_excursions(flight) if one.kind is Kind.OFF_LINE]
    n_told = 0
    for early_s, long_s in itertools.product((6.0, 3.0, 1.0, 0.5, 0.2, -0.1, -0.5), (1.5, 3.0, 6.0, 20.0)):
        first_ns = off.start_ns - round(early_s * 1e9)
        last_ns = first_ns + round(long_s * 1e9)
        kept = tuple(one for one in getattr(flight, missing) if not first_ns < time_of(one) < last_ns)
        for log in (replace(flight, **{missing: kept}), without_truth(replace(flight, **{missing: kept}))):
            for one in find_excursions(log):
                n_told += 1
                assert math.isfinite(one.peak), one
                assert not re.search(r"\b(nan|inf)\b", " ".join(one.evidence)), (early_s, long_s, one)
    assert n_told


def test_a_setpoint_that_comes_back_faster_than_a_vehicle_follows_is_told_as_that(tmp_path: Path) -> None:
    """It leaned against a gust; after it the vehicle swings over, while the setpoint is over the line again."""
    gust = OneGust(random.Random("gust 6").uniform(1.5, 2.0))
    flight = fly(tmp_path / "6.mcap", 6, lambda _: gust.begin(), gust)
    for log in (flight, without_truth(flight)):
        (swing,) = [one for one in find_excursions(log) if one.culprit is Culprit.EXECUTIVE]
        assert swing.shares["executive"] < 0.0 < swing.shares["tracking"]
        assert re.match(
            r"The setpoint had gone 1\.\d\d m to the left of the line as told and came back", swing.evidence[0]
        )


class Misplaced:
    """An autopilot that takes itself to be `aside_m` to the right of where it is; its velocity is right."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.aside_m = 0.0
        state_of, send = FaultyAutopilot.state.fget, FaultyAutopilot.set_setpoint
        assert state_of is not None

        def state(autopilot: FaultyAutopilot) -> VehicleState | None:
            told = state_of(autopilot)
            return None if told is None else self._moved(told, self.aside_m)

        async def set_setpoint(autopilot: FaultyAutopilot, setpoint: Setpoint) -> None:
            await send(autopilot, self._moved(setpoint, -self.aside_m))

        monkeypatch.setattr(FaultyAutopilot, "state", property(state))
        monkeypatch.setattr(FaultyAutopilot, "set_setpoint", set_setpoint)

    def drift(self, speed_m_s: float) -> None:
        self.aside_m += 0.05 * speed_m_s
        asyncio.get_running_loop().call_later(0.05, self.drift, speed_m_s)

    @staticmethod
    def _moved(told: Any, aside_m: float) -> Any:
        north_m, east_m = -aside_m * math.sin(LINE_HEADING_RAD), aside_m * math.cos(LINE_HEADING_RAD)
        return replace(told, north_m=told.north_m + north_m, east_m=told.east_m + east_m)


@pytest.mark.parametrize("jump_m", [1.5, 2.5])
def test_a_position_that_jumps_is_the_autopilots_and_neither_the_lines_nor_the_winds(
    jump_m: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Vehicle and line stayed where they are; all that is told by the position went aside, the line as told, too."""
    n_named = 0
    for seed in SEEDS[:4]:
        misplaced = Misplaced(monkeypatch)
        side_m = either_side(random.Random(f"position {seed}"), jump_m, jump_m)
        flight = fly(tmp_path / f"{seed}.mcap", seed, lambda _, m=misplaced, s=side_m: setattr(m, "aside_m", s))
        monkeypatch.undo()
        for log in (flight, without_truth(flight)):
            found = find_excursions(log)
            assert all((one.culprit, one.fault) == (Culprit.AUTOPILOT, Fault.POSITION) for one in found), (seed, found)
            for one in found:
                words = re.search(r"jumped by (\d\.\d\d) m to the (left|right)", one.evidence[0])
                assert words is not None, one
                assert float(words[1]) == pytest.approx(jump_m, abs=0.05)
                assert words[2] == ("right" if side_m > 0.0 else "left")
            n_named += bool(found)
    assert n_named >= 7


def test_a_position_that_drifts_has_not_jumped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As GPS does."""
    for speed_m_s in (0.2, -0.5):
        misplaced = Misplaced(monkeypatch)
        flight = fly(tmp_path / f"{speed_m_s}.mcap", 3, lambda _, m=misplaced, v=speed_m_s: m.drift(v))
        monkeypatch.undo()
        assert abs(misplaced.aside_m) > 2.0
        for log in (flight, without_truth(flight)):
            assert all(one.fault is not Fault.POSITION for one in find_excursions(log))


def test_a_gust_is_no_jump_of_the_position(tmp_path: Path) -> None:
    for seed in SEEDS[:4]:
        gust = OneGust(2.0)
        flight = fly(tmp_path / f"{seed}.mcap", seed, lambda _, gust=gust: gust.begin(), gust)
        for log in (flight, without_truth(flight)):
            found = find_excursions(log)
            assert found
            assert all(one.fault is not Fault.POSITION for one in found), found


def time_of(record: Any) -> int:
    return int(record.t_capture_ns if isinstance(record, VisionReport) else record.t_ns)


@pytest.mark.parametrize("act", [jump_for_a_while, turn_for_a_while])
def test_a_line_that_is_lost_to_another_for_a_while_is_blamed_on_perception(
    act: Callable[[Cockpit, random.Random], None], tmp_path: Path
) -> None:
    """All of it: also the way back, where the setpoint alone is off the line as it is told by then."""
    for seed in SEEDS[:4]:
        draw = random.Random(f"{act.__name__} {seed}")
        flight = fly(tmp_path / f"{seed}.mcap", seed, lambda cockpit, draw=draw: act(cockpit, draw))
        for told in (flight, without_truth(flight)):
            found = find_excursions(told)
            assert {(one.culprit, one.fault) for one in found} == {(Culprit.PERCEPTION, Fault.WRONG)}, (seed, found)


@pytest.mark.parametrize("law", ["beside the line", "away from the line", "off course"])
def test_a_wrong_law_is_blamed_on_the_executive(law: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The line is told rightly, and the setpoint does not go where it is."""
    flights = {}
    for seed in SEEDS[:3]:
        draw = random.Random(f"{law} {seed}")
        beside_m, off_course_rad = either_side(draw, 1.7, 2.1), either_side(draw, math.radians(25), math.radians(35))
        with monkeypatch.context() as patch:

            def go_wrong(_: Cockpit, patch=patch, beside_m=beside_m, off_course_rad=off_course_rad) -> None:
                if law == "off course":

                    def askew(reference: Setpoint, heading_rad: float, step_m: float) -> Setpoint:
                        return guidance.step_along(reference, heading_rad + off_course_rad, step_m)

                    patch.setattr(follow_lines, "step_along", askew)
                    return

                def aside(reference: Setpoint, line: WorldLine, heading_rad: float, gain_per_s: float, *rest, **names):
                    line, sign = (line, -1.0) if law == "away from the line" else (line.beside(beside_m), 1.0)
                    return guidance.step_sideways(reference, line, heading_rad, sign * gain_per_s, *rest, **names)

                patch.setattr(follow_lines, "step_sideways", aside)

            flights[seed] = fly(tmp_path / f"{seed}.mcap", seed, go_wrong)
    check(flights, Culprit.EXECUTIVE, Fault.SETPOINT)


def fly_bend(path: Path, seed: int, turn_deg: float, after_s: float, do: Callable[[Cockpit], None]) -> Flight:
    """Fly along a line that bends as in the world corner."""
    bend = Bend(35.0, math.radians(turn_deg))
    leg = PLAN.tasks[4].model_copy(update={"distance_m": 55.0})
    plan = PLAN.model_copy(update={"tasks": [*PLAN.tasks[:4], leg, PLAN.tasks[5]]})
    return fly_and_log(
        path,
        plan,
        wind=wind_abeam(seed),
        seed=seed,
        in_task="follow_lines",
        after_s=after_s,
        do=do,
        bend=bend,
        until="return",
        until_s=20.0,
    )


def test_a_vehicle_whose_attitude_does_not_follow_in_a_bend_is_the_autopilots(tmp_path: Path) -> None:
    def slacken(cockpit: Cockpit) -> None:
        for name in ("MC_ROLL_P", "MC_PITCH_P"):
            cockpit.autopilot.sim.set_parameter(name, 1.0)

    flights = {seed: fly_bend(tmp_path / f"{seed}.mcap", seed, 30.0, 12.0, slacken) for seed in SEEDS[:4]}
    check(flights, Culprit.AUTOPILOT, Fault.TRACKING)


def test_a_bend_that_is_told_late_is_named_as_that(tmp_path: Path) -> None:
    def hide(cockpit: Cockpit) -> None:
        cockpit.eyes.is_bend_hidden = True

    n_named = 0
    for seed in SEEDS[:4]:
        flight = fly_bend(tmp_path / f"{seed}.mcap", seed, 30.0, 4.0, hide)
        for log in (flight, without_truth(flight)):
            found = find_excursions(log)
            assert all((one.culprit, one.fault) == (Culprit.PERCEPTION, Fault.BEND) for one in found), (seed, found)
            n_named += bool(found)
    assert n_named >= 2


def test_a_bend_that_is_told_in_time_is_nobody_elses_fault(tmp_path: Path) -> None:
    for seed in SEEDS[:4]:
        flight = fly_bend(tmp_path / f"{seed}.mcap", seed, 60.0, 4.0, lambda _: None)
        for log in (flight, without_truth(flight)):
            found = find_excursions(log)
            assert all((one.culprit, one.fault) == (Culprit.EXECUTIVE, Fault.BEND) for one in found), (seed, found)


@pytest.mark.parametrize("cause", ["line that jumps", "weak motor", "delayed estimate"])
def test_a_second_leg_is_looked_at_as_the_first(cause: str, tmp_path: Path) -> None:
    """After a turn on the spot the line is flown back along, and only there something goes wrong."""
    act, culprit, fault = CAUSES[cause]
    leg = PLAN.tasks[4].model_copy(update={"distance_m": 25.0})
    turn = Rotate(task="rotate", angle_deg=180.0)
    plan = PLAN.model_copy(update={"tasks": [*PLAN.tasks[:4], leg, turn, leg, PLAN.tasks[5]]})
    flights = {}
    for seed in SEEDS[:3]:
        draw = random.Random(f"{cause} {seed}")
        flights[seed] = fly_and_log(
            tmp_path / f"{seed}.mcap",
            plan,
            wind=wind_abeam(seed),
            seed=seed,
            in_task="follow_lines",
            nth=2,
            after_s=3.0,
            do=lambda cockpit, draw=draw: act(cockpit, draw),
            until="return",
            until_s=20.0,
        )
        second_ns = [begun.t_ns for begun in flights[seed].tasks_started if begun.task == "follow_lines"][1]
        assert all(one.start_ns >= second_ns for one in find_excursions(flights[seed]))
    check(flights, culprit, fault)


def test_nobody_is_blamed_for_a_flight_without_trouble(tmp_path: Path) -> None:
    for seed in SEEDS[:4]:
        flight = fly(tmp_path / f"{seed}.mcap", seed, lambda _: None)
        assert find_excursions(flight) == ()
        assert find_excursions(without_truth(flight)) == ()


def check(flights: dict[int, Flight], culprit: Culprit, fault: Fault) -> None:
    """What is told of first is what was caused, in nine of ten flights, with the truth and without."""
    for logs in (flights, {seed: without_truth(flight) for seed, flight in flights.items()}):
        wrong = {}
        for seed, flight in logs.items():
            found = find_excursions(flight)
            if not found or (found[0].culprit, found[0].fault) != (culprit, fault):
                wrong[seed] = found
        assert len(wrong) <= len(logs) // 10, wrong


def test_a_motor_that_is_asked_for_more_than_the_others_is_named(tmp_path: Path) -> None:
    """The autopilot's own log, laid beside ours, tells which one is weak."""
    draw = random.Random("weak motor 1")
    flight = fly(tmp_path / "1.mcap", 1, lambda cockpit: weaken(cockpit, draw))
    aligned = (0.0, 0.0, 0.0, "motion", None, 0.99, 60.0, 0.1, 0.1, (0.0, 0.0, 0.0))
    log = ImportedLog("a.ulg", "ulog", "v1.16", "", "00", *aligned, was_cut_off=False)
    told = tuple(ImportedActuators(state.t_ns, (0.5, 0.5, 0.8, 0.5, 0.5, 0.5)) for state in flight.states)
    own = Imported(log, (), (), told, (), (), ())
    (found,) = find_excursions(replace(flight, imported=own))
    assert "motor 3 was asked for 0.80, the others for 0.50" in found.evidence[-1]
    level = tuple(replace(one, motors=(0.5, 0.52, 0.55, 0.5, 0.51, 0.5)) for one in told)
    (found,) = find_excursions(replace(flight, imported=replace(own, actuators=level)))
    assert not any("motor" in words for words in found.evidence)


def test_frames_that_do_not_come_are_missing_and_frames_without_a_line_are_too(tmp_path: Path) -> None:
    def silence(cockpit: Cockpit) -> None:
        cockpit.eyes.is_silent = True
        asyncio.get_running_loop().call_later(2.0, lambda: setattr(cockpit.eyes, "is_silent", False))

    def blind(cockpit: Cockpit) -> None:
        cockpit.eyes.is_blind = True
        asyncio.get_running_loop().call_later(2.0, lambda: setattr(cockpit.eyes, "is_blind", False))

    for act, words in ((silence, "no frame came through vision for"), (blind, "frames showed a line")):
        found = find_excursions(fly(tmp_path / f"{act.__name__}.mcap", 1, act))
        assert (found[0].culprit, found[0].fault) == (Culprit.PERCEPTION, Fault.MISSING), found
        assert any(words in line for line in found[0].evidence), found[0].evidence


def test_a_wind_that_is_too_strong_is_told_in_any_task(tmp_path: Path) -> None:
    """A gust that the vehicle leans against as far as it may, in a task that follows nothing."""
    gust = OneGust(3.0)
    flight = fly_and_log(
        tmp_path / "1.mcap",
        PLAN,
        wind=Wind(MEAN_WIND_M_S, 1, LINE_HEADING_RAD, fronts=gust),
        in_task="ascend",
        after_s=3.0,
        do=lambda _: gust.begin(),
        until="align",
    )
    found = [excursion for excursion in find_excursions(flight) if excursion.kind is Kind.TILTED]
    assert found
    assert {(excursion.culprit, excursion.fault) for excursion in found} == {(Culprit.WIND, Fault.PUSHED)}
    assert found[0].task == "ascend"
