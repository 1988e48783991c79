"""Every fault of the fault matrix: what goes wrong, and how it is done to a flight in virtual time."""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import cast

from mission.autopilot import Setpoint
from mission.eyes import Notice
from mission.hazards import ComputerView
from mission.operator import Wish
from mission.simulated.virtual_time import VirtualTimeLoop
from mission.tasks.task import Observation, Step
from sitl.modes import Mode
from sitl.wind import Wind
from tests.support.flights import Cockpit
from vision.records import VisionReport


@dataclass(frozen=True)
class Fault:
    """A fault by its name; `is_takeover` where a person takes the vehicle, and nothing may be sent any more.

    `may_touch_line` where the autopilot's own failsafe decides alone where the vehicle comes down.
    """

    name: str
    what: str
    do: Callable[[Cockpit], None]
    is_takeover: bool = False
    may_touch_line: bool = False


class BrokenTask:
    """A task with a bug."""

    needs_line = needs_vision = False
    progress = 0.0

    def step(self, reference: Setpoint, seen: Observation) -> Step:
        raise ZeroDivisionError("a bug")


class NanTask(BrokenTask):
    """A task that wants the vehicle to go nowhere."""

    def step(self, reference: Setpoint, seen: Observation) -> Step:
        return Step(replace(reference, north_m=float("nan")))


class DivingTask(BrokenTask):
    """A task that wants the vehicle to go into the ground."""

    def step(self, reference: Setpoint, seen: Observation) -> Step:
        return Step(replace(reference, down_m=seen.state.down_m + 3.0))


class FailingTask(BrokenTask):
    """A task that says that it cannot be done."""

    def step(self, reference: Setpoint, seen: Observation) -> Step:
        return Step(reference, failed="it cannot be done")


def _later(delay_s: float, act: Callable[[], object]) -> None:
    asyncio.get_running_loop().call_later(delay_s, act)


def _again_and_again(period_s: float, for_s: float, act: Callable[[], object]) -> None:
    """Act now and every `period_s`, for as long as `for_s`."""
    act()
    if for_s > period_s:
        _later(period_s, lambda: _again_and_again(period_s, for_s - period_s, act))


def _pilot(mode: Mode) -> Callable[[Cockpit], None]:
    def take_over(cockpit: Cockpit) -> None:
        cockpit.autopilot.catch_up()
        cockpit.autopilot.sim.set_mode(mode)

    return take_over


def _sticks(cockpit: Cockpit) -> None:
    """The pilot has held the sticks centred, pulls one, and lets go again."""
    sim = cockpit.autopilot.sim

    def move(pitch: float) -> None:
        cockpit.autopilot.catch_up()
        sim.set_sticks(pitch, 0.0, 0.5, 0.0)

    _again_and_again(0.05, 0.4, lambda: move(0.0))
    _later(0.5, lambda: _again_and_again(0.05, 0.5, lambda: move(-0.7)))
    _later(1.0, lambda: _again_and_again(0.05, 600.0, lambda: move(0.0)))


def _kill(cockpit: Cockpit) -> None:
    cockpit.autopilot.catch_up()
    cockpit.autopilot.sim.disarm(is_forced=True)


def _cut_link(cockpit: Cockpit) -> None:
    autopilot = cockpit.autopilot
    autopilot.hears_us = autopilot.tells_us = False
    _later(3.0, lambda: setattr(autopilot, "is_connected", False))  # as MAVSDK notices it


def _cut_uplink(cockpit: Cockpit) -> None:
    cockpit.autopilot.hears_us = False


def _freeze_telemetry(cockpit: Cockpit) -> None:
    cockpit.autopilot.tells_us = False


def _second_controller(cockpit: Cockpit) -> None:
    """Another program sends setpoints five metres above where the vehicle was."""
    autopilot = cockpit.autopilot
    autopilot.catch_up()
    n, e, d = autopilot.sim.estimate.position_m

    def send() -> None:
        autopilot.catch_up()
        autopilot.sim.set_position_setpoint(n, e, d - 5.0, 0.0)

    autopilot.after_step.append(lambda: autopilot.sim.set_position_setpoint(n, e, d - 5.0, 0.0))
    send()


def _unanswered_setpoints(cockpit: Cockpit) -> None:
    cockpit.autopilot.faults["setpoint"] = ["lost"] * 20


def _stop_with(fault: str) -> Callable[[Cockpit], None]:
    def stop(cockpit: Cockpit) -> None:
        for command in ("hold", "land", "return"):
            cockpit.autopilot.faults[command] = [fault, fault]
        cockpit.executive.request_stop()

    return stop


def _replace_task(task: Callable[[], object]) -> Callable[[Cockpit], None]:
    def break_it(cockpit: Cockpit) -> None:
        cockpit.executive._flow.task = task()  # type: ignore[assignment]

    return break_it


def _battery(remaining: float) -> Callable[[Cockpit], None]:
    def drain(cockpit: Cockpit) -> None:
        cockpit.autopilot.sim.battery.remaining = remaining

    return drain


def _lose_gps(cockpit: Cockpit) -> None:
    cockpit.autopilot.catch_up()
    cockpit.autopilot.sim.set_parameter("SIM_GPS_USED", 0)


def _flicker_gps(cockpit: Cockpit) -> None:
    _lose_gps(cockpit)
    _later(4.5, lambda: cockpit.autopilot.sim.set_parameter("SIM_GPS_USED", 10))


def _shrink_fence(cockpit: Cockpit) -> None:
    situation = cockpit.executive._situation
    situation._fence = replace(situation._fence, max_altitude_m=0.5)


def _gale(cockpit: Cockpit) -> None:
    """A gale of 20 m/s for a quarter of a minute, and then a strong wind."""
    sim = cockpit.autopilot.sim
    sim.wind = Wind(20.0, 1)
    _later(15.0, lambda: setattr(sim, "wind", Wind(4.0, 1)))


def _kill_vision(cockpit: Cockpit) -> None:
    cockpit.eyes.failure = "the vision worker ended"


def _break_eyes(cockpit: Cockpit) -> None:
    def fail() -> list[VisionReport]:
        raise ValueError("a bug in looking")

    cockpit.eyes.take = fail  # type: ignore[method-assign]


def _camera(name: str, gone_s: float) -> Callable[[Cockpit], None]:
    """A camera that is gone or blind for a while; what lasts 3 s counts as dead, as mission.worker_eyes has it."""

    def impair(cockpit: Cockpit) -> None:
        eyes = cockpit.eyes
        eyes.impairment = Notice(name, f"the camera is {name}")
        eyes.is_silent = True
        if gone_s > 3.0:
            _later(3.0, lambda: setattr(eyes, "failure", "vision has seen nothing for 3.0 s"))
        else:
            _later(gone_s, lambda: setattr(eyes, "impairment", None))
            _later(gone_s, lambda: setattr(eyes, "is_silent", False))

    return impair


def _pause_reports(cockpit: Cockpit) -> None:
    cockpit.eyes.is_silent = True
    _later(2.5, lambda: setattr(cockpit.eyes, "is_silent", False))


def _hide_line(hidden_s: float) -> Callable[[Cockpit], None]:
    def hide(cockpit: Cockpit) -> None:
        cockpit.eyes.is_blind = True
        _later(hidden_s, lambda: setattr(cockpit.eyes, "is_blind", False))

    return hide


def _computer(view: ComputerView) -> Callable[[Cockpit], None]:
    def change(cockpit: Cockpit) -> None:
        cockpit.computer.view = view

    return change


def _block_loop(blocked_s: float, period_s: float, for_s: float) -> Callable[[Cockpit], None]:
    def block(_: Cockpit) -> None:
        loop = cast("VirtualTimeLoop", asyncio.get_running_loop())
        _again_and_again(period_s, for_s, lambda: loop.block(blocked_s))

    return block


def _age_task(cockpit: Cockpit) -> None:
    cockpit.executive._flow._task_started_ns -= 3_600_000_000_000


def _stop(cockpit: Cockpit) -> None:
    cockpit.executive.request_stop()


def _wish(wish: Wish, trouble: str | None = None) -> Callable[[Cockpit], None]:
    def ask(cockpit: Cockpit) -> None:
        if trouble is not None:
            cockpit.autopilot.faults |= {name: [trouble, trouble] for name in ("hold", "return", "land")}
        cockpit.executive.request(wish)

    return ask


FAULTS = (
    Fault("pilot_hold", "the pilot switches to hold", _pilot(Mode.LOITER), is_takeover=True),
    Fault("pilot_return", "the pilot switches to return", _pilot(Mode.RTL), is_takeover=True),
    Fault("pilot_land", "the pilot switches to land", _pilot(Mode.LAND), is_takeover=True, may_touch_line=True),
    Fault("pilot_sticks", "the pilot moves a stick (COM_RC_OVERRIDE)", _sticks, is_takeover=True),
    Fault("kill_switch", "the motors are stopped in the air", _kill, is_takeover=True, may_touch_line=True),
    Fault("link_lost", "nothing passes in either direction any more", _cut_link),
    Fault("uplink_lost", "nothing of ours arrives any more", _cut_uplink),
    Fault("telemetry_frozen", "no telemetry comes any more", _freeze_telemetry),
    Fault("second_controller", "another program sends setpoints too", _second_controller),
    Fault("setpoints_unanswered", "MAVSDK takes no setpoints for ten seconds", _unanswered_setpoints),
    Fault("stop_refused", "Ctrl-C, and the autopilot refuses twice what we ask", _stop_with("refused")),
    Fault("stop_unanswered", "Ctrl-C, and the autopilot's answers get lost twice", _stop_with("lost")),
    Fault("internal_error", "the task fails by a bug", _replace_task(BrokenTask)),
    Fault("setpoint_nan", "the task asks for a setpoint that is no number", _replace_task(NanTask)),
    Fault("setpoint_low", "the task asks for a setpoint in the ground", _replace_task(DivingTask)),
    Fault("task_failed", "the task says that it cannot be done", _replace_task(FailingTask)),
    Fault("task_too_long", "the task is over its time limit", _age_task),
    Fault("battery_low", "the battery is at 20 %", _battery(0.20)),
    Fault("battery_critical", "the battery is at 10 %", _battery(0.10)),
    Fault("battery_collapses", "the battery is at 4 %: PX4 lands at once", _battery(0.04), may_touch_line=True),
    Fault("gps_lost", "GPS is gone", _lose_gps, may_touch_line=True),
    Fault("gps_flickers", "GPS is gone for 4.5 s", _flicker_gps),
    Fault("operator_stop", "Ctrl-C", _stop),
    Fault("operator_land", "Land in the live view", _wish(Wish.LAND)),
    Fault("operator_hold", "Hold in the live view", _wish(Wish.HOLD)),
    Fault("operator_hold_unanswered", "the same, and the answers get lost twice", _wish(Wish.HOLD, "lost")),
    Fault("fence", "the vehicle is outside the fence", _shrink_fence),
    Fault("gale", "20 m/s of wind for 15 s", _gale),
    Fault("vision_dead", "the vision worker is dead", _kill_vision),
    Fault("eyes_raise", "looking fails by a bug, again and again", _break_eyes),
    Fault("camera_gone", "the camera is gone for good", _camera("camera_gone", 60.0)),
    Fault("camera_flickers", "the camera is gone for 2 s", _camera("camera_gone", 2.0)),
    Fault("camera_frozen", "the camera repeats itself", _camera("camera_blind", 60.0)),
    Fault("estimates_pause", "no estimates for 2.5 s", _pause_reports),
    Fault("line_gone", "the line is not to be seen any more", _hide_line(600.0)),
    Fault("line_hidden", "the line is not to be seen for 6 s", _hide_line(6.0)),
    Fault("guard_dead", "nothing guards the control loop", _computer(ComputerView(guard_failure="the guard ended"))),
    Fault("cpu_overload", "the event loop loses 60 ms every 100 ms", _block_loop(0.06, 0.1, 15.0)),
    Fault("loop_stalls", "the event loop is blocked once for 0.4 s", _block_loop(0.4, 1.0, 0.5)),
    Fault("disk_full", "the disk is full", _computer(ComputerView(free_disk_bytes=0))),
    Fault("log_failing", "log or journal cannot be written", _computer(ComputerView(log_failure="no space left"))),
    Fault("mission_changed", "the mission file is changed", _computer(ComputerView(mission_change="it was changed"))),
)
