"""The executive: the thin asynchronous shell that flies a mission.

Twenty times a second, to deadlines, it reads telemetry and vision, asks safety what stands against going on, asks the
task for the next step, and sends it. It never waits for vision. [Ceron] section 6.3 calls it the task manager.
"""

import asyncio
import contextlib
import math

from drivers.camera.camera import Intrinsics
from drivers.clock import NS_PER_S, Clock
from mission import machine as m
from mission.autopilot import Autopilot, AutopilotError, FlightMode, Setpoint, VehicleState
from mission.build import build_task, guidance_settings, reactions, safety_limits
from mission.eyes import Eyes, GroupSize, StateHistory, sight_of
from mission.guidance import leash
from mission.mode_watch import ModeWatch
from mission.plan import MissionPlan
from mission.records import Event, MissionEnded, Result, Severity, TaskEnded, TaskStarted
from mission.reporting import FlightLog, Progress
from mission.safety import Hazard, Reaction, SafetyInput, clear_of_the_line, decide, find_hazards
from mission.tasks.go_down import GoDownTask
from mission.tasks.task import Command, FlightMemory, Observation, Sight, Step, Task

CONTROL_RATE_HZ = 20.0
PAUSE_BEFORE_GOING_DOWN_S = 2.0
GOING_DOWN_LIMIT_S = 300.0

_READY_POLL_S = 0.2
_MAX_REFUSALS = 3
_MATTERS_GOING_DOWN = (
    Hazard.TAKEOVER,
    Hazard.LINK_LOST,
    Hazard.TELEMETRY_STALE,
    Hazard.COMMAND_REFUSED,
    Hazard.INTERNAL_ERROR,
    Hazard.TASK_TIMED_OUT,
)
_ENDS = {Result.FAILED: "fail", Result.TIMED_OUT: "fail", Result.INTERRUPTED: "interrupt", Result.TAKEN_OVER: "give_up"}


class Executive:
    """Flies one mission; `run` once. `request_stop` may be called at any time from the event loop."""

    def __init__(
        self, plan: MissionPlan, autopilot: Autopilot, eyes: Eyes, log: FlightLog, clock: Clock, camera: Intrinsics
    ) -> None:
        self._plan = plan
        self._autopilot = autopilot
        self._eyes = eyes
        self._log = log
        self._clock = clock
        self._camera = camera
        self._guidance = guidance_settings(plan.guidance)
        self._limits = safety_limits(plan.safety)
        self._reactions = reactions(plan.safety)
        self._machine = m.FlightMachine([task.task for task in plan.tasks], self._on_change)
        self._history = StateHistory()
        self._group = GroupSize()
        self._is_interrupted = False
        self._may_be_over_line = False
        self._memory = FlightMemory(Setpoint(0.0, 0.0, 0.0, 0.0), 0.0)
        self._reference = self._memory.start
        self._task: Task | None = None
        self._task_started_ns = 0
        self._line_seen_ns = 0
        self._modes = ModeWatch()
        self._has_armed = False
        self._way_down = Command.RETURN
        self._n_refusals = 0
        self._sight: Sight | None = None
        self._noted: set[Hazard] = set()
        self._task_failure: str | None = None
        self._refusal: str | None = None
        self._internal_error: str | None = None
        self._end: tuple[Result, str] = (Result.FAILED, "")
        self.progress = Progress(m.PREFLIGHT, None, None, None)

    @property
    def has_armed(self) -> bool:
        """Whether the vehicle was ever told to arm."""
        return self._has_armed

    @property
    def states(self) -> list[str]:
        """The names of the mission's task states, in order."""
        return self._machine.task_states

    def request_stop(self) -> None:
        """Ask the flight to end now: before arming at once, in the air by the mission's reaction."""
        self._is_interrupted = True

    async def run(self) -> MissionEnded:
        """Fly the mission to its end, and say how it ended.

        Raises only what is a bug in this loop itself, after the vehicle was told to hold.
        """
        ended = await self._preflight()
        if ended is None:
            try:
                await self._fly()
            except BaseException:
                # Cancelled, or a bug in this very loop: leave the vehicle in a mode that it can hold by itself.
                with contextlib.suppress(AutopilotError):
                    await self._autopilot.hold()
                raise
            ended = MissionEnded(self._clock.now_ns(), *self._end)
        self._log.record(ended)
        return ended

    # -- before arming -------------------------------------------------------------------------------------------

    async def _preflight(self) -> MissionEnded | None:
        """Connect and wait until the vehicle can arm and vision sees; the end of the mission if that never comes."""
        try:
            missing = await self._wait_until_ready()
        except AutopilotError as error:
            missing = [str(error)]
        if self._is_interrupted:
            await self._machine.trigger_named("interrupt")
            return MissionEnded(self._clock.now_ns(), Result.INTERRUPTED, "stopped before arming")
        state = self._autopilot.state
        if missing or state is None:
            await self._machine.trigger_named("fail")
            return MissionEnded(self._clock.now_ns(), Result.FAILED, "not ready to fly: " + "; ".join(missing))
        start = Setpoint(state.north_m, state.east_m, state.down_m, state.yaw_rad)
        theta_0_rad = self._guidance.theta_0_rad
        self._memory = FlightMemory(start, state.yaw_rad if theta_0_rad is None else theta_0_rad)
        self._reference = start
        return None

    async def _wait_until_ready(self) -> list[str]:
        """What is still missing when the time limit is over; empty when all is ready."""
        await self._autopilot.connect()
        # Compiling and connecting take wall time, however fast the flight's clock runs.
        loop = asyncio.get_running_loop()
        limit_s = loop.time() + self._plan.vehicle.ready_time_limit_s
        while True:
            missing = list(self._autopilot.missing_health())
            if self._autopilot.state is None:
                missing.append("telemetry")
            if self._eyes.failure is not None:
                return [self._eyes.failure]
            if not self._eyes.is_ready:
                missing.append("vision: waiting for the first frame")
            self._keep_status_texts()
            self._eyes.take()
            self.progress = Progress(m.PREFLIGHT, None, self._autopilot.state, None, tuple(missing))
            if not missing or self._is_interrupted or loop.time() > limit_s:
                return missing
            await asyncio.sleep(self._clock.wall_s(_READY_POLL_S))

    # -- in flight -----------------------------------------------------------------------------------------------

    async def _fly(self) -> None:
        await self._machine.trigger_named("advance")
        self._start_task()
        period_ns = round(NS_PER_S / CONTROL_RATE_HZ)
        last_ns = self._clock.now_ns()
        deadline_ns = last_ns
        while not self._machine.is_over:
            now_ns = self._clock.now_ns()
            # A late tick must not become one large step: what was missed is lost, and the vehicle waits.
            dt_s = min((now_ns - last_ns) / NS_PER_S, 2.0 / CONTROL_RATE_HZ)
            last_ns = now_ns
            await self._tick(now_ns, dt_s)
            deadline_ns = max(deadline_ns + period_ns, self._clock.now_ns())
            await asyncio.sleep(self._clock.wall_s((deadline_ns - self._clock.now_ns()) / NS_PER_S))

    async def _tick(self, now_ns: int, dt_s: float) -> None:
        state = self._autopilot.state
        if state is None or self._task is None:
            raise RuntimeError("a flight without telemetry or task")
        self._history.add(state)
        self._log.record(state)
        self._keep_status_texts()
        sight = self._look(now_ns)
        self.progress = Progress(self._machine.state, self._machine.task_index, state, self._sight)
        if await self._react(now_ns, state):
            return
        try:
            step = self._task.step(self._reference, Observation(dt_s, state, sight))
            await self._do(step, state)
        except AutopilotError as error:
            self._refusal = str(error)
            return
        except Exception as error:
            self._internal_error = f"{type(error).__name__} in {self._machine.state}: {error}"
            return
        self._task_failure = step.failed
        if step.done is not None:
            await self._end_task(Result.COMPLETED, step.done)

    def _look(self, now_ns: int) -> Sight | None:
        """The newest report since the last tick, on the map; the older ones are kept in the log alone."""
        reports = self._eyes.take()
        for report in reports:
            self._log.record(report)
        sight = None
        if reports:
            sight = sight_of(reports[-1], self._history, self._group, self._camera, self._guidance, now_ns)
        if sight is not None:
            self._sight = sight
            if sight.line is not None:
                self._line_seen_ns = max(self._line_seen_ns, sight.t_capture_ns)
        return sight

    async def _do(self, step: Step, state: VehicleState) -> None:
        """Send what the task wants."""
        now_ns = self._clock.now_ns()
        if step.command is Command.TAKEOFF:
            self._has_armed = True  # even when the answer gets lost: then it must come down again
            await self._autopilot.arm()
            await self._autopilot.takeoff(step.altitude_m)
            self._modes.command(now_ns, FlightMode.TAKEOFF, FlightMode.HOLD)
        elif step.command is Command.RETURN:
            await self._autopilot.return_home()
            self._modes.command(now_ns, FlightMode.RETURN, FlightMode.LAND)  # its end may be shown as LAND
        elif step.command is Command.LAND:
            await self._autopilot.land()
            self._modes.command(now_ns, FlightMode.LAND)
        if step.setpoint is None:
            return
        if self._modes.is_offboard:
            self._reference = leash(step.setpoint, state, self._guidance.leash_m)
            await self._autopilot.set_setpoint(self._reference)
        else:
            # The first setpoint is where the vehicle is: entering offboard must not move it.
            self._reference = Setpoint(state.north_m, state.east_m, state.down_m, self._reference.yaw_rad)
            await self._autopilot.start_offboard(self._reference)
            self._modes.command(now_ns, FlightMode.OFFBOARD)
        self._log.record_setpoint(self._clock.now_ns(), self._reference)

    # -- tasks ---------------------------------------------------------------------------------------------------

    def _start_task(self) -> None:
        index = self._machine.task_index
        if index is None:
            return
        plan = self._plan.tasks[index]
        self._task = build_task(plan, self._guidance, self._memory)
        self._task_started_ns = self._clock.now_ns()
        self._line_seen_ns = self._task_started_ns
        self._may_be_over_line = self._may_be_over_line or plan.task in ("move_until", "align", "follow_lines")
        self._log.record(TaskStarted(self._task_started_ns, index, plan.task))

    async def _end_task(self, result: Result, reason: str) -> None:
        """Close the task in the log; go on with the next one, or end the flight."""
        now_ns = self._clock.now_ns()
        index = self._machine.task_index
        if index is not None:
            self._log.record(TaskEnded(now_ns, index, self._plan.tasks[index].task, result, reason))
        if result is not Result.COMPLETED:
            return
        if index is None:  # going down has ended: the mission ends as the reaction said
            await self._machine.trigger_named(_ENDS[self._end[0]])
            return
        await self._machine.trigger_named("advance")
        if self._machine.is_over:
            self._end = (Result.COMPLETED, reason)
        self._start_task()

    # -- safety --------------------------------------------------------------------------------------------------

    async def _react(self, now_ns: int, state: VehicleState) -> bool:
        """Find hazards and act on the most urgent; true when the task must not step in this tick."""
        hazards = find_hazards(self._safety_input(now_ns, state), self._limits)
        if self._machine.state == m.GOING_DOWN:
            # Already on the way down: only losing the vehicle, or the way down itself failing, changes anything.
            hazards = {hazard: text for hazard, text in hazards.items() if hazard in _MATTERS_GOING_DOWN}
            if set(hazards) == {Hazard.COMMAND_REFUSED} and self._may_retry_going_down():
                return True
        decision = decide(hazards, self._reactions)
        for hazard in hazards:
            if hazard not in self._noted and (decision is None or hazard is not decision[0]):
                self._noted.add(hazard)
                self._log.record(Event(now_ns, hazard, Severity.WARNING, hazards[hazard]))
        if decision is None:
            return False
        hazard, reaction = decision
        reason = f"{hazard.replace('_', ' ')}: {hazards[hazard]}"
        if reaction is Reaction.GIVE_UP_CONTROL or self._machine.state == m.GOING_DOWN:
            self._log.record(Event(now_ns, hazard, Severity.ERROR, hazards[hazard], Reaction.GIVE_UP_CONTROL))
            await self._give_up(hazard, reason)
        else:
            reaction = clear_of_the_line(reaction, may_be_over_line=self._may_be_over_line)
            self._log.record(Event(now_ns, hazard, Severity.ERROR, hazards[hazard], reaction))
            await self._go_down(hazard, reaction, reason)
        return True

    def _safety_input(self, now_ns: int, state: VehicleState) -> SafetyInput:
        start = self._memory.start
        index = self._machine.task_index
        task = self._task
        return SafetyInput(
            now_ns=now_ns,
            state=state,
            allowed_modes=self._modes.explained(now_ns, state),
            distance_m=math.hypot(state.north_m - start.north_m, state.east_m - start.east_m),
            altitude_m=start.down_m - state.down_m,
            is_going_down=isinstance(task, GoDownTask),
            task_age_s=(now_ns - self._task_started_ns) / NS_PER_S,
            task_limit_s=GOING_DOWN_LIMIT_S if index is None else self._plan.tasks[index].time_limit_s,
            needs_line=task is not None and task.needs_line,
            line_seen_ns=self._line_seen_ns,
            needs_vision=task is not None and task.needs_vision,
            vision_failure=self._eyes.failure,
            task_failure=self._task_failure,
            refusal=self._refusal,
            internal_error=self._internal_error,
            is_interrupted=self._is_interrupted,
        )

    async def _give_up(self, hazard: Hazard, reason: str) -> None:
        """End our control and touch nothing: the pilot, or the autopilot's own failsafe, has the vehicle."""
        result = Result.TAKEN_OVER if hazard is Hazard.TAKEOVER else Result.FAILED
        self._end = (result, reason)
        await self._end_task(result, reason)
        await self._machine.trigger_named("give_up")

    async def _go_down(self, hazard: Hazard, reaction: Reaction, reason: str) -> None:
        """End the mission early: hold for a moment, then land or return."""
        result = {Hazard.INTERRUPTED: Result.INTERRUPTED, Hazard.TASK_TIMED_OUT: Result.TIMED_OUT}.get(
            hazard, Result.FAILED
        )
        self._end = (result, reason)
        await self._end_task(result, reason)
        await self._machine.trigger_named("go_down")
        self._refusal = None
        self._task_failure = None
        self._task_started_ns = self._clock.now_ns()
        self._internal_error = None
        if not self._has_armed:
            await self._machine.trigger_named(_ENDS[result])
            return
        self._way_down = Command.LAND if reaction is Reaction.LAND else Command.RETURN
        if isinstance(self._task, GoDownTask) and self._task.command in (self._way_down, Command.LAND):
            return  # it is on that way already
        self._task = GoDownTask(self._way_down, PAUSE_BEFORE_GOING_DOWN_S)
        try:
            await self._autopilot.hold()
            self._modes.command(self._clock.now_ns(), FlightMode.HOLD)
        except AutopilotError as error:  # then the way down is all the more urgent, and goes on
            self._log.record(Event(self._clock.now_ns(), Hazard.COMMAND_REFUSED, Severity.WARNING, str(error)))

    def _may_retry_going_down(self) -> bool:
        """Once more the same way down, after a command for it was refused or not answered; false after the third."""
        self._n_refusals += 1
        self._refusal = None
        self._task = GoDownTask(self._way_down)
        return self._n_refusals < _MAX_REFUSALS

    # -- the log -------------------------------------------------------------------------------------------------

    def _keep_status_texts(self) -> None:
        for text in self._autopilot.drain_status_texts():
            self._log.record_status_text(self._clock.now_ns(), text)

    def _on_change(self, state: str) -> None:
        self.progress = Progress(state, self._machine.task_index, self.progress.state, self.progress.sight)
