"""The situation: everything that safety looks at, brought together once in each control tick."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

from drivers.camera.camera import Intrinsics
from drivers.clock import NS_PER_S, Clock
from mission.autopilot import Autopilot, Setpoint, VehicleState
from mission.eyes import Eyes, Lookout
from mission.geofence import Fence, breach
from mission.guidance import GuidanceSettings
from mission.hazards import ComputerView, EyesView, SafetyInput, TaskView
from mission.helm import Helm
from mission.operator import Wish
from mission.reporting import FlightLog
from mission.tasks.task import FlightMemory, Sight
from mission.watchers import Pace, TrackingWatch

Computer = Callable[[], ComputerView]
"""Tells how the companion computer does. Never waits."""


@dataclass(slots=True)
class Troubles:
    """What went wrong in a tick, for the next one to react to; sentences, None where nothing did."""

    task_failure: str | None = None
    refusal: str | None = None
    unsafe_setpoint: str | None = None
    internal_error: str | None = None


class Situation:
    """Sees with `eyes`, and watches vehicle, control loop and computer.

    `troubles` is what the executive met; `memory` what later tasks need of earlier ones; `was_armed` says that the
    vehicle was seen armed.
    """

    def __init__(
        self,
        autopilot: Autopilot,
        eyes: Eyes,
        log: FlightLog,
        clock: Clock,
        camera: Intrinsics,
        guidance: GuidanceSettings,
        fence: Fence,
        computer: Computer,
    ) -> None:
        self._autopilot = autopilot
        self._eyes = eyes
        self._log = log
        self._clock = clock
        self._fence = fence
        self._was_above = False
        self._computer = computer
        self._lookout = Lookout(eyes, log, camera, guidance)
        self._tracking_watch = TrackingWatch(guidance.leash_m)
        self._tracking: str | None = None
        self._position_ok_ns = 0
        self._eyes_view = EyesView(None, None, None, 0, 0)
        self.pace = Pace()
        self.memory = FlightMemory(Setpoint(0.0, 0.0, 0.0, 0.0), 0.0)
        self.troubles = Troubles()
        self.was_armed = False
        self.is_interrupted = False
        self.wish: Wish | None = None
        """What the operator asked for last."""

    @property
    def is_asked_to_end(self) -> bool:
        """Whether somebody wants the flight to end, in whatever way."""
        return self.is_interrupted or self.wish is not None

    def begin(self, memory: FlightMemory) -> None:
        """The flight begins."""
        self.memory = memory
        self._position_ok_ns = self._clock.now_ns()

    def expect_line(self, now_ns: int) -> None:
        """A task begins, or goes on: what was seen before does not count against it."""
        self._lookout.expect(now_ns)

    def keep_words(self) -> None:
        """Put into the log what the autopilot said, and what happened to the eyes."""
        now_ns = self._clock.now_ns()
        for text in self._autopilot.drain_status_texts():
            self._log.record_status_text(now_ns, text)
        self._lookout.keep_notices(now_ns)

    def look(self, now_ns: int, dt_s: float, state: VehicleState, helm: Helm) -> Sight | None:
        """Take in what came since the last tick; returns the newest sight."""
        self.was_armed = self.was_armed or state.is_armed
        if state.is_position_ok:
            self._position_ok_ns = now_ns
        else:
            self.memory.known_line.forget()  # the map on which it has its place may jump
        self._log.record(state)
        self._tracking = self._tracking_watch.tick(dt_s, state, helm.reference, is_offboard=helm.modes.is_offboard)
        self.memory.trail.add(state)
        try:
            self.keep_words()
            self._eyes_view = self._view_of_eyes()
            sight = self._lookout.look(now_ns, state, self.memory.known_line, self.height_m(state))
        except Exception as error:
            # Whatever fails in looking is as good as blind: a task that needs no eyes goes on without them.
            self._eyes_view = replace(self._eyes_view, failure=f"looking fails ({type(error).__name__}: {error})")
            return None
        if sight is not None and sight.found is not None:
            self.memory.line_seen_at = Setpoint(state.north_m, state.east_m, state.down_m, state.yaw_rad)
        return sight

    def _view_of_eyes(self) -> EyesView:
        impairment = self._eyes.impairment
        name, words = (None, None) if impairment is None else (impairment.name, impairment.message)
        return EyesView(
            failure=self._eyes.failure,
            camera_gone=words if name == "camera_gone" else None,
            camera_blind=words if name == "camera_blind" else None,
            sight_ns=self._lookout.sight_ns,
            line_seen_ns=self._lookout.line_seen_ns,
        )

    def from_start_m(self, state: VehicleState) -> float:
        """The level distance from the take-off point [m]."""
        start = self.memory.start
        return math.hypot(state.north_m - start.north_m, state.east_m - start.east_m)

    def height_m(self, state: VehicleState) -> float:
        """The height above the take-off point [m]."""
        return self.memory.start.down_m - state.down_m

    def _fence_breach(self, state: VehicleState, *, is_going_down: bool) -> str | None:
        start, height_m, least_m = self.memory.start, self.height_m(state), self._fence.min_altitude_m
        self._was_above = self._was_above or (least_m is not None and height_m > least_m)
        return breach(
            self._fence,
            state.north_m - start.north_m,
            state.east_m - start.east_m,
            height_m,
            is_min_in_force=self._was_above and not is_going_down,
        )

    def safety_input(self, now_ns: int, state: VehicleState, helm: Helm, task: TaskView) -> SafetyInput:
        """All of it, as safety wants it."""
        troubles = self.troubles
        return SafetyInput(
            now_ns=now_ns,
            state=state,
            modes=helm.modes.view(now_ns, state),
            task=task,
            eyes=replace(self._eyes_view, sight_ns=self._lookout.sight_ns, line_seen_ns=self._lookout.line_seen_ns),
            computer=self._computer(),
            pace=self.pace.view,
            fence_breach=self._fence_breach(state, is_going_down=task.is_going_down),
            was_armed=self.was_armed,
            position_bad_s=(now_ns - self._position_ok_ns) / NS_PER_S,
            foreign_setpoint=helm.targets.heard(
                now_ns, self._autopilot.target, state, is_offboard=helm.modes.is_offboard
            ),
            tracking=self._tracking,
            refusal=troubles.refusal,
            unsafe_setpoint=troubles.unsafe_setpoint,
            internal_error=troubles.internal_error,
            is_interrupted=self.is_interrupted,
            wish=self.wish,
        )
