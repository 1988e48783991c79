"""The executive: the thin asynchronous shell that flies a mission.

Twenty times a second, to deadlines, it reads telemetry and vision, asks safety what stands against going on, asks the
task for the next step, and sends it. It never waits for vision. [Ceron] section 6.3 calls it the task manager.
"""

import asyncio
import contextlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from drivers.camera.camera import Intrinsics
from drivers.clock import NS_PER_S, Clock
from mission import machine as m
from mission.autopilot import Autopilot, AutopilotError, Setpoint, VehicleState
from mission.build import (
    build_task,
    fence,
    guidance_settings,
    reactions,
    safety_limits,
    search_settings,
    setpoint_limits,
)
from mission.checks import Check
from mission.departure import Departure, depart
from mission.detours import Detour, detour_task
from mission.eyes import Eyes
from mission.hazards import TaskView, find_hazards
from mission.helm import Helm, TakenOverError, UnsafeSetpointError
from mission.limits import floor_m
from mission.logbook import Logbook
from mission.plan import MissionPlan
from mission.preflight import wait_until_ready
from mission.records import Event, MissionEnded, PreflightCheck, Result, Severity, TaskEnded, TaskStarted
from mission.reporting import FlightLog, Progress
from mission.resumption import CannotResumeError, Resumption, plan_to_reckon
from mission.safety import PAUSES, Hazard, Reaction, decide, keep_going_down, way_down
from mission.situation import Computer, Situation, Troubles
from mission.tasks.go_down import GoDownTask
from mission.tasks.rejoin import RejoinTask
from mission.tasks.task import Command, Observation, Task

CONTROL_RATE_HZ = 20.0
PAUSE_BEFORE_GOING_DOWN_S = 2.0
GOING_DOWN_LIMIT_S = 300.0
REJOINING_LIMIT_S = 300.0

_STAYS_CLEAR = ("takeoff", "ascend", "descend", "rotate", "hold", "land", "return")
"""Tasks that do not carry the vehicle anywhere over ground by themselves; the others may bring it over the line."""

_TRIGGERS = {Result.FAILED: "fail", Result.TIMED_OUT: "fail", Result.INTERRUPTED: "interrupt"}
_RESULTS = {
    Hazard.INTERRUPTED: Result.INTERRUPTED,
    Hazard.TASK_TIMED_OUT: Result.TIMED_OUT,
    Hazard.TAKEOVER: Result.TAKEN_OVER,
    Hazard.AUTOPILOT_FAILSAFE: Result.TAKEN_OVER,
    Hazard.OFFBOARD_REFUSED: Result.TAKEN_OVER,
}


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
    """Flies one mission; `run` once. `request_stop` may be called at any time from the event loop.

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
        self._search = search_settings(plan.safety)
        self._machine = m.FlightMachine([task.task for task in plan.tasks], self._before_change, self._after_change)
        self._situation = Situation(
            crew.autopilot, crew.eyes, crew.log, clock, crew.camera, self._guidance, fence(plan.safety), crew.computer
        )
        self._helm = Helm(crew.autopilot, crew.log, clock, setpoint_limits(plan))
        self._task: Task | None = None
        self._detour: Detour | None = None
        self._departure: Departure | None = None
        self._stand = Setpoint(0.0, 0.0, 0.0, 0.0)
        self._task_started_ns = 0
        self._may_be_over_line = False
        self._noted: set[Hazard] = set()
        self._end: tuple[Result, str] = (Result.FAILED, "")
        self.progress = Progress(m.PREFLIGHT, None, None, None)
        self.tick_s: float | None = None
        """When the last control tick began, in the event loop's time [s]; None before the first."""

    @property
    def may_have_armed(self) -> bool:
        """Whether the vehicle was armed, or told to without a refusal."""
        return self._helm.was_told_to_arm or self._situation.was_armed

    def request_stop(self) -> None:
        """Ask the flight to end now: before arming at once, in the air by the mission's reaction."""
        self._situation.is_interrupted = True

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
            ended = MissionEnded(self._clock.now_ns(), *self._end)
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
            lambda: self._situation.is_interrupted,
            tell,
            may_fly=self._resumption is not None,
        )
        for check in ready.checks:
            self._log.record(PreflightCheck(self._clock.now_ns(), check.name, check.result, check.reason))
        self._on_checks(ready.checks)
        state = self._autopilot.state
        if self._situation.is_interrupted:
            await self._machine.trigger_named("interrupt")
            return MissionEnded(self._clock.now_ns(), Result.INTERRUPTED, "stopped before arming")
        words = None
        if ready.failures or state is None:
            words = "not ready to fly: " + "; ".join(ready.failures)
        else:
            words = await self._begin(state, "" if ready.identity is None else ready.identity.uid)
        if words is not None:
            await self._machine.trigger_named("fail")
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
        self._departure, self._resumption = departure, departure.resumption
        self._situation.begin(departure.memory)
        self._helm.start, self._helm.reference = departure.memory.start, departure.here
        self._stand = departure.here
        await self._crew.logbook.begin(departure.origin, departure.memory, vehicle_uid, departure.resumption)
        return None

    # -- the control loop ----------------------------------------------------------------------------------------

    async def _fly(self) -> None:
        departure = self._departure
        if departure is None:
            raise RuntimeError("a flight without a beginning")
        if departure.resumption is not None and departure.is_flying:
            await self._rejoin(departure.resumption, departure.rejoin_at)
        else:
            await self._machine.trigger_named("advance")
            self._start_task()
        if not departure.is_as_it_was(self._autopilot.state):
            # Between the last look before the flight and now the disk was waited for: somebody was quicker.
            self._end = (Result.TAKEN_OVER, "takeover: somebody took the vehicle before the first command")
            await self._machine.trigger_named("give_up")
            return
        loop = asyncio.get_running_loop()
        period_ns = round(NS_PER_S / CONTROL_RATE_HZ)
        last_ns = self._clock.now_ns()
        due_ns = deadline_ns = last_ns
        while not self._machine.is_over:
            now_ns = self._clock.now_ns()
            self.tick_s = loop.time()
            self._situation.pace.tick(self._clock.wall_s((now_ns - due_ns) / NS_PER_S))
            # A late tick must not become one large step: what was missed is lost, and the vehicle waits.
            dt_s = min((now_ns - last_ns) / NS_PER_S, 2.0 / CONTROL_RATE_HZ)
            last_ns = now_ns
            await self._tick(now_ns, dt_s)
            due_ns = deadline_ns + period_ns
            deadline_ns = max(due_ns, self._clock.now_ns())  # what was missed is not made up for
            await asyncio.sleep(self._clock.wall_s((deadline_ns - self._clock.now_ns()) / NS_PER_S))

    async def _tick(self, now_ns: int, dt_s: float) -> None:
        state = self._autopilot.state
        if state is None or self._task is None:
            raise RuntimeError("a flight without telemetry or task")
        situation = self._situation
        sight = situation.look(now_ns, dt_s, state, self._helm)
        self._show(state)
        if self._detour is None:
            # Where a pause, a search or a pilot has left the vehicle is not where the task stands.
            is_ours = self._helm.modes.is_offboard and self._machine.state != m.GOING_DOWN
            self._stand = self._helm.reference if is_ours else self._stand
            self._crew.logbook.note(now_ns, self._machine.task_index, self._task.progress, self._stand)
        if await self._react(now_ns, state):
            return
        flown = self._task if self._detour is None else self._detour.task
        try:
            step = flown.step(self._helm.reference, Observation(dt_s, state, sight))
            await self._helm.do(step, state)
        except TakenOverError:
            return  # the next tick says so
        except AutopilotError as error:
            self._note_refusal(str(error))
            return
        except UnsafeSetpointError as error:
            situation.troubles.unsafe_setpoint = str(error)
            return
        except Exception as error:
            self._note_bug(f"{type(error).__name__} in {self._machine.state}: {error}")
            return
        situation.troubles.task_failure = step.failed
        if step.done is not None:
            if self._detour is not None:
                await self._carry_on(step.done)
            else:
                await self._end_task(Result.COMPLETED, step.done)

    def _note_refusal(self, words: str) -> None:
        """On the way down a refusal is noted, and the task asks again; before that it is a hazard."""
        if isinstance(self._task, GoDownTask):
            self._log.record(Event(self._clock.now_ns(), Hazard.COMMAND_REFUSED, Severity.WARNING, words))
        else:
            self._situation.troubles.refusal = words

    def _note_bug(self, words: str) -> None:
        """A bug on the way down is noted, and the way down goes on: who gave up there would leave it in the air."""
        if not isinstance(self._task, GoDownTask):
            self._situation.troubles.internal_error = words
        elif Hazard.INTERNAL_ERROR not in self._noted:
            self._noted.add(Hazard.INTERNAL_ERROR)
            self._log.record(Event(self._clock.now_ns(), Hazard.INTERNAL_ERROR, Severity.ERROR, words))

    # -- tasks ---------------------------------------------------------------------------------------------------

    def _start_task(self) -> None:
        index = self._machine.task_index
        if index is None:
            return
        plan = self._plan.tasks[index]
        self._task = build_task(plan, self._guidance, self._situation.memory)
        self._task_started_ns = self._clock.now_ns()
        self._situation.expect_line(self._task_started_ns)
        self._set_floor(getattr(plan, "altitude_m", None))
        self._may_be_over_line = self._may_be_over_line or plan.task not in _STAYS_CLEAR
        self._log.record(TaskStarted(self._task_started_ns, index, plan.task))

    def _set_floor(self, goal_m: float | None) -> None:
        """A task that starts from the ground has none to keep to."""
        height_m = self._altitude_m()
        heights_m = [height_m] if goal_m is None else [height_m, goal_m]
        self._helm.floor_m = floor_m(*heights_m)

    async def _end_task(self, result: Result, reason: str) -> None:
        """Close the task in the log; after a completed one go on with the next, or end the flight."""
        index = self._machine.task_index
        if index is not None and self._machine.state != m.REJOINING:
            self._log.record(TaskEnded(self._clock.now_ns(), index, self._plan.tasks[index].task, result, reason))
        if result is not Result.COMPLETED:
            return
        if index is None:  # going down has ended: the mission ends as the reaction said
            await self._machine.trigger_named(_TRIGGERS[self._end[0]])
            return
        departure = self._departure
        if index == 0 and departure is not None and departure.resumption is not None and departure.resumption.index > 0:
            await self._rejoin(departure.resumption, departure.rejoin_at)
            return
        await self._machine.trigger_named("advance")
        if self._machine.is_over:
            self._end = (Result.COMPLETED, reason)
        self._start_task()

    # -- detours: what pauses a task ---------------------------------------------------------------------------------

    async def _rejoin(self, resumption: Resumption, rejoin_at: Setpoint) -> None:
        """Fly to where the mission was interrupted; from there the task is taken up."""
        await self._machine.trigger_named("rejoin", towards=resumption.index)
        now_ns = self._clock.now_ns()
        words = f"flying to where task {resumption.index + 1} was interrupted"
        self._log.record(Event(now_ns, "rejoining", Severity.INFO, words))
        self._may_be_over_line = True
        self._set_floor(resumption.height_m)
        self._task_started_ns = now_ns
        self._task = build_task(self._plan.tasks[resumption.index], self._guidance, self._situation.memory)
        transit_down_m = self._situation.memory.start.down_m - resumption.transit_height_m
        rejoin = RejoinTask(rejoin_at, transit_down_m, self._guidance)
        self._detour = Detour(rejoin, None, Reaction.CONTINUE, now_ns)

    async def _pause(self, hazard: Hazard, reaction: Reaction, words: str) -> None:
        """Pause the task: hold, climb and hold, or search."""
        now_ns = self._clock.now_ns()
        self._log.record(Event(now_ns, hazard, Severity.WARNING, words, reaction))
        await self._machine.trigger_named("search" if reaction is Reaction.SEARCH else "pause")
        room_m = self._plan.safety.max_altitude_m - self._altitude_m() - 1.0
        task = detour_task(reaction, self._search, room_m, self._situation.memory, self._guidance)
        self._detour = Detour(task, hazard, reaction, now_ns)
        self._situation.expect_line(now_ns)

    async def _carry_on(self, words: str) -> None:
        """The detour is over: go on with the task. Its time limit does not count the detour."""
        was_rejoining = self._machine.state == m.REJOINING
        await self._machine.trigger_named("carry_on")
        now_ns = self._clock.now_ns()
        if self._detour is not None:
            self._task_started_ns += now_ns - self._detour.started_ns
        self._detour = None
        self._situation.expect_line(now_ns)
        if was_rejoining:
            self._start_task()
        else:
            self._log.record(Event(now_ns, "carried_on", Severity.INFO, words))

    # -- safety --------------------------------------------------------------------------------------------------

    async def _react(self, now_ns: int, state: VehicleState) -> bool:
        """Find hazards and act on the most urgent; true when the task must not step in this tick."""
        is_going_down = self._machine.state == m.GOING_DOWN
        seen = self._situation.safety_input(now_ns, state, self._helm, self._task_view(now_ns))
        hazards = find_hazards(seen, self._limits)
        if is_going_down:
            hazards = keep_going_down(hazards)
        decision = decide(hazards, self._reactions, is_offboard=self._helm.modes.is_offboard)
        self._note_hazards(now_ns, hazards, decision)
        if self._detour is not None and (decision is None or decision[1] in PAUSES):
            detour, safety = self._detour, self._plan.safety
            action = detour.next(
                now_ns,
                decision,
                hold_limit_s=safety.hold_limit_s,
                search_limit_s=safety.line_search.time_limit_s,
            )
            if action == "carry_on":
                await self._carry_on(f"{detour.hazard} is over")
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
                await self._pause(hazard, reaction, hazards[hazard])
                return True
        if is_going_down:
            reaction = Reaction.GIVE_UP_CONTROL
        await self._end_early(now_ns, hazard, reaction, hazards[hazard])
        return True

    async def _end_early(self, now_ns: int, hazard: Hazard, reaction: Reaction, words: str) -> None:
        """End the mission: give up control, or go down."""
        reaction = way_down(reaction, may_be_over_line=self._may_be_over_line)
        self._log.record(Event(now_ns, hazard, Severity.ERROR, words, reaction))
        self._end = (_RESULTS.get(hazard, Result.FAILED), f"{hazard.replace('_', ' ')}: {words}")
        await self._end_task(*self._end)
        if reaction is Reaction.GIVE_UP_CONTROL:
            # Touch nothing more: the pilot, or the autopilot's own failsafe, has the vehicle.
            await self._machine.trigger_named("give_up" if self._end[0] is Result.TAKEN_OVER else "lose")
        else:
            await self._go_down(hazard, reaction)

    def _note_hazards(self, now_ns: int, hazards: dict[Hazard, str], decision: tuple[Hazard, Reaction] | None) -> None:
        """Log each hazard that is not the one reacted to, once."""
        for hazard, words in hazards.items():
            if hazard not in self._noted and (decision is None or hazard is not decision[0]):
                self._noted.add(hazard)
                self._log.record(Event(now_ns, hazard, Severity.WARNING, words))

    def _task_view(self, now_ns: int) -> TaskView:
        index = self._machine.task_index
        task, detour = self._task, self._detour
        # While holding, the paused task's needs count; a search and a rejoining have their own.
        needing = detour.task if detour is not None and self._machine.state != m.HOLDING else task
        started_ns = self._task_started_ns if detour is None else now_ns
        if self._machine.state == m.REJOINING:
            limit_s, started_ns = REJOINING_LIMIT_S, self._task_started_ns
        elif index is None:
            limit_s = GOING_DOWN_LIMIT_S
        else:
            limit_s = self._plan.tasks[index].time_limit_s
        return TaskView(
            age_s=(now_ns - started_ns) / NS_PER_S,
            limit_s=limit_s,
            needs_line=needing is not None and needing.needs_line,
            needs_vision=needing is not None and needing.needs_vision,
            is_going_down=isinstance(task, GoDownTask) and detour is None,
            failure=self._situation.troubles.task_failure,
        )

    async def _go_down(self, hazard: Hazard, reaction: Reaction) -> None:
        """End the mission early: hold for a moment, then land or return."""
        await self._machine.trigger_named("go_down")
        self._situation.troubles = Troubles()
        self._detour = None
        self._task_started_ns = self._clock.now_ns()
        if not (self._helm.was_told_to_arm or (self._departure is not None and self._departure.is_flying)):
            await self._machine.trigger_named(_TRIGGERS[self._end[0]])
            return
        task, memory = self._task, self._situation.memory
        if isinstance(task, GoDownTask):  # it is on its way: nothing is gained by another one
            if hazard is Hazard.TASK_TIMED_OUT:
                self._task = GoDownTask(task.command, memory)
            return
        command = Command.LAND if reaction is Reaction.LAND else Command.RETURN
        self._task = GoDownTask(command, memory, PAUSE_BEFORE_GOING_DOWN_S)
        try:
            await self._helm.hold()
        except TakenOverError:
            return  # the next tick says so
        except AutopilotError as error:  # then the way down is all the more urgent, and goes on
            self._note_refusal(str(error))

    # -- what others hear ----------------------------------------------------------------------------------------

    def _altitude_m(self) -> float:
        state = self._autopilot.state
        return 0.0 if state is None else self._situation.height_m(state)

    def _show(self, state: VehicleState) -> None:
        situation = self._situation
        self.progress = Progress(
            self._machine.state,
            self._machine.task_index,
            situation.height_m(state),
            situation.from_start_m(state),
            state.yaw_rad,
        )

    async def _before_change(self, source: str, target: str) -> None:
        """The journal has it before it happens."""
        progress = 0.0 if self._task is None else self._task.progress
        await self._crew.logbook.transition(source, target, self._machine.task_index, progress, self._stand)

    def _after_change(self, state: str) -> None:
        before = self.progress
        self.progress = Progress(
            state, self._machine.task_index, before.height_m, before.distance_m, before.heading_rad
        )
