"""The executive: the thin asynchronous shell that flies a mission.

Twenty times a second, to deadlines, it reads telemetry and vision, asks safety what stands against going on, asks the
task for the next step, and sends it. It never waits for vision. [Ceron] section 6.3 calls it the task manager.
"""

import asyncio
import contextlib
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from drivers.camera.camera import Intrinsics
from drivers.clock import NS_PER_S, Clock
from mission import machine as m
from mission.autopilot import Autopilot, AutopilotError, VehicleState
from mission.build import (
    fence,
    guidance_settings,
    reactions,
    safety_limits,
    setpoint_limits,
)
from mission.checks import Check
from mission.departure import depart
from mission.eyes import Eyes
from mission.flow import Flow
from mission.hazards import find_hazards
from mission.helm import Helm, TakenOverError, UnsafeSetpointError
from mission.logbook import Logbook
from mission.operator import Wish
from mission.plan import MissionPlan
from mission.preflight import wait_until_ready
from mission.records import (
    Attachment,
    AutopilotTarget,
    ControlTick,
    Event,
    FlightStart,
    MissionEnded,
    Origin,
    PreflightCheck,
    Result,
    Severity,
)
from mission.reporting import FlightLog, Progress
from mission.resumption import CannotResumeError, Resumption, plan_to_reckon
from mission.safety import PAUSES, Hazard, Reaction, decide, keep_going_down
from mission.situation import Computer, Situation
from mission.tasks.task import Observation

CONTROL_RATE_HZ = 20.0


@dataclass(frozen=True, slots=True)
class Crew:
    """Whom the executive works with: the vehicle, the eyes, the log, the journal, and who knows how the computer does.

    `camera` is the eyes'.
    """

    autopilot: Autopilot
    eyes: Eyes
    camera: Intrinsics
    log: FlightLog
    logbook: Logbook
    computer: Computer


class Executive:
    """Flies one mission; `run` once. `request_stop` and `request` may be called at any time from the event loop.

    With a `resumption` it takes an interrupted mission up again; `plan` then holds what is left of it.
    `on_checks` hears the pre-flight checks once, before arming.
    """

    def __init__(
        self,
        plan: MissionPlan,
        crew: Crew,
        clock: Clock,
        resumption: Resumption | None = None,
        on_checks: Callable[[Sequence[Check]], None] = lambda checks: None,
    ) -> None:
        self._plan = plan
        self._crew = crew
        self._autopilot = crew.autopilot
        self._log = crew.log
        self._clock = clock
        self._resumption = resumption
        self._on_checks = on_checks
        self._guidance = guidance_settings(plan.guidance)
        self._limits = safety_limits(plan.safety)
        self._reactions = reactions(plan.safety)
        self._situation = Situation(
            crew.autopilot, crew.eyes, crew.log, clock, crew.camera, self._guidance, fence(plan.safety), crew.computer
        )
        self._helm = Helm(crew.autopilot, crew.log, clock, setpoint_limits(plan))
        self._flow = Flow(
            plan, crew.autopilot, self._helm, self._situation, crew.log, crew.logbook, clock, self._on_change
        )
        self.progress = Progress(m.PREFLIGHT, None, None, None)
        self.tick_s: float | None = None
        """When the last control tick began, in the event loop's time [s]; None before the first."""

    @property
    def may_have_armed(self) -> bool:
        """Whether the vehicle was armed, or told to without a refusal."""
        return self._helm.was_told_to_arm or self._situation.was_armed

    @property
    def needs_vision(self) -> bool:
        """Whether what is flown now needs eyes; before the flight they are looked through, too."""
        flown = self._flow.flown
        return flown is None or flown.needs_vision

    def request_stop(self) -> None:
        """Ask the flight to end now: before arming at once, in the air by the mission's reaction."""
        self._situation.is_interrupted = True

    def request(self, wish: Wish) -> None:
        """Pass on what the operator wishes: before arming the flight ends at once, in the air safety decides.

        A wish that comes too late changes nothing, which is said in the log: the pilot has the vehicle, or it is on its
        way down already.
        """
        words = None
        if self._flow.machine.is_over:
            words = (
                f"the operator asked to {wish} after the flight had ended ({self._flow.machine.state}); nothing is sent"
            )
        elif self._flow.is_going_down:
            words = f"the operator asked to {wish}; the mission has been ended already, and goes on with that"
        if words is None:
            self._situation.wish = wish
        else:
            self._log.record(Event(self._clock.now_ns(), f"operator_{wish}", Severity.WARNING, words))

    async def run(self) -> MissionEnded:
        """Fly the mission to its end, and say how it ended.

        Raises only what is a bug in this loop itself, after a vehicle under our setpoints was told to hold.
        """
        ended = await self._preflight()
        if ended is None:
            try:
                await self._fly()
            except BaseException:
                # Cancelled, or a bug: no stream of setpoints may outlive us. In its own modes it holds by itself.
                if self._helm.modes.is_offboard:
                    with contextlib.suppress(AutopilotError, TakenOverError):
                        await self._helm.hold()
                raise
            ended = MissionEnded(self._clock.now_ns(), *self._flow.end)
        self._log.record(ended)
        return ended

    async def _preflight(self) -> MissionEnded | None:
        """Wait until all is ready; the end of the mission if that never comes."""

        def tell(missing: tuple[str, ...]) -> None:
            self._situation.keep_words()
            self.progress = Progress(m.PREFLIGHT, None, None, None, waiting_for=missing)

        ready = await wait_until_ready(
            self._autopilot,
            self._crew.eyes,
            self._clock,
            self._plan if self._resumption is None else plan_to_reckon(self._plan, self._resumption.index),
            lambda: self._crew.computer().free_disk_bytes,
            lambda: self._situation.is_asked_to_end,
            tell,
            may_fly=self._resumption is not None,
        )
        for check in ready.checks:
            self._log.record(PreflightCheck(self._clock.now_ns(), check.name, check.result, check.reason))
        if ready.parameters is not None:
            text = json.dumps(dict(ready.parameters), indent=1, sort_keys=True)
            self._log.record(Attachment("parameters.json", "application/json", text.encode()))
        self._on_checks(ready.checks)
        state = self._autopilot.state
        if self._situation.is_asked_to_end:
            await self._flow.machine.trigger_named("interrupt")
            return MissionEnded(self._clock.now_ns(), Result.INTERRUPTED, "stopped before arming")
        words = None
        if ready.failures or state is None:
            words = "not ready to fly: " + "; ".join(ready.failures)
        else:
            words = await self._begin(state, "" if ready.identity is None else ready.identity.uid)
        if words is not None:
            await self._flow.machine.trigger_named("fail")
            return MissionEnded(self._clock.now_ns(), Result.FAILED, words)
        return None

    async def _begin(self, state: VehicleState, vehicle_uid: str) -> str | None:
        """Know where the flight begins; returns in a sentence why it must not."""
        try:
            departure = await depart(
                self._autopilot, self._plan, self._guidance.theta_0_rad, state, vehicle_uid, self._resumption
            )
        except CannotResumeError as error:
            return str(error)
        if departure.is_flying:
            self._helm.modes.begin(state.mode)
        self._flow.departure, self._resumption = departure, departure.resumption
        self._situation.begin(departure.memory)
        self._helm.start, self._helm.reference = departure.memory.start, departure.here
        self._flow.stand = departure.here
        memory, start = departure.memory, departure.memory.start
        self._log.record(
            FlightStart(
                self._clock.now_ns(),
                start.north_m,
                start.east_m,
                start.down_m,
                start.yaw_rad,
                memory.theta_0_rad,
                memory.move_until_m,
            )
        )
        if departure.origin is not None:
            place = departure.origin
            self._log.record(Origin(self._clock.now_ns(), place.latitude_rad, place.longitude_rad, place.altitude_m))
        await self._crew.logbook.begin(departure.origin, departure.memory, vehicle_uid, departure.resumption)
        return None

    # -- the control loop ----------------------------------------------------------------------------------------

    async def _fly(self) -> None:
        departure = self._flow.departure
        if departure is None:
            raise RuntimeError("a flight without a beginning")
        await self._flow.begin(departure)
        if not departure.is_as_it_was(self._autopilot.state):
            # Between the last look before the flight and now the disk was waited for: somebody was quicker.
            await self._flow.taken_over("takeover: somebody took the vehicle before the first command")
            return
        loop = asyncio.get_running_loop()
        period_ns = round(NS_PER_S / CONTROL_RATE_HZ)
        last_ns = self._clock.now_ns()
        due_ns = deadline_ns = last_ns
        while not self._flow.machine.is_over:
            now_ns = self._clock.now_ns()
            self.tick_s = loop.time()
            self._situation.pace.tick(self._clock.wall_s((now_ns - due_ns) / NS_PER_S))
            # A late tick must not become one large step: what was missed is lost, and the vehicle waits.
            dt_s = min((now_ns - last_ns) / NS_PER_S, 2.0 / CONTROL_RATE_HZ)
            last_ns = now_ns
            self._log_tick(now_ns, dt_s, due_ns)
            await self._tick(now_ns, dt_s)
            due_ns = deadline_ns + period_ns
            deadline_ns = max(due_ns, self._clock.now_ns())  # what was missed is not made up for
            await asyncio.sleep(self._clock.wall_s((deadline_ns - self._clock.now_ns()) / NS_PER_S))

    def _log_tick(self, now_ns: int, dt_s: float, due_ns: int) -> None:
        state, target = self._autopilot.state, self._autopilot.target
        age_s = 0.0 if state is None else (now_ns - state.t_ns) / NS_PER_S
        self._log.record(ControlTick(now_ns, dt_s, self._clock.wall_s((now_ns - due_ns) / NS_PER_S), age_s))
        if target is not None:
            self._log.record(AutopilotTarget(now_ns, target.north_m, target.east_m, target.down_m, target.yaw_rad))

    async def _tick(self, now_ns: int, dt_s: float) -> None:
        state = self._autopilot.state
        situation, flow = self._situation, self._flow
        if state is None or flow.flown is None:
            raise RuntimeError("a flight without telemetry or task")
        sight = situation.look(now_ns, dt_s, state, self._helm)
        self._show(state)
        flow.keep_stand(now_ns)
        if await self._react(now_ns, state):
            return
        try:
            step = flow.flown.step(self._helm.reference, Observation(dt_s, state, sight))
            await self._helm.do(step, state)
        except TakenOverError:
            return  # the next tick says so
        except AutopilotError as error:
            flow.note_refusal(str(error))
            return
        except UnsafeSetpointError as error:
            situation.troubles.unsafe_setpoint = str(error)
            return
        except Exception as error:
            flow.note_bug(f"{type(error).__name__} in {self._flow.machine.state}: {error}")
            return
        situation.troubles.task_failure = step.failed
        if step.done is not None:
            if flow.detour is not None:
                await flow.carry_on(step.done)
            else:
                await flow.end_task(Result.COMPLETED, step.done)

    # -- safety --------------------------------------------------------------------------------------------------

    async def _react(self, now_ns: int, state: VehicleState) -> bool:
        """Find hazards and act on the most urgent; true when the task must not step in this tick."""
        flow = self._flow
        seen = self._situation.safety_input(now_ns, state, self._helm, flow.task_view(now_ns))
        hazards = find_hazards(seen, self._limits)
        if flow.is_going_down:
            hazards = keep_going_down(hazards)
        decision = decide(hazards, self._reactions, is_offboard=self._helm.modes.is_offboard)
        flow.note_hazards(now_ns, hazards, decision)
        if flow.detour is not None and (decision is None or decision[1] in PAUSES):
            detour, safety = flow.detour, self._plan.safety
            action = detour.next(
                now_ns,
                decision,
                hold_limit_s=safety.hold_limit_s,
                search_limit_s=safety.line_search.time_limit_s,
            )
            if action == "carry_on":
                await flow.carry_on(f"{detour.hazard} is over")
            if action != "too_long":
                return action != "step"
            asking = decision[0] if decision is not None else detour.hazard
            hazard, reaction = asking or Hazard.TASK_TIMED_OUT, Reaction.LAND_CLEAR
            lasted_s = (now_ns - detour.started_ns) / NS_PER_S
            hazards.setdefault(hazard, f"not over after {lasted_s:.0f} s")
        elif decision is None:
            return False
        else:
            hazard, reaction = decision
            if reaction in PAUSES:
                await flow.pause(hazard, reaction, hazards[hazard])
                return True
        if flow.is_going_down:
            reaction = Reaction.GIVE_UP_CONTROL
        await flow.end_early(now_ns, hazard, reaction, hazards[hazard])
        return True

    # -- what others hear ----------------------------------------------------------------------------------------

    def _show(self, state: VehicleState) -> None:
        situation = self._situation
        self.progress = Progress(
            self._flow.machine.state,
            self._flow.machine.task_index,
            situation.height_m(state),
            situation.from_start_m(state),
            state.yaw_rad,
        )

    def _on_change(self, state: str) -> None:
        before = self.progress
        index = self._flow.machine.task_index
        self.progress = Progress(state, index, before.height_m, before.distance_m, before.heading_rad)
