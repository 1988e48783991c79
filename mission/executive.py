"""The executive: the thin asynchronous shell that flies a mission.

Twenty times a second, to deadlines, it reads telemetry and vision, asks safety what stands against going on, asks the
task for the next step, and sends it. It never waits for vision. [Ceron] section 6.3 calls it the task manager.
"""

import asyncio
import contextlib
import math
from collections.abc import Callable, Sequence

from drivers.camera.camera import Intrinsics
from drivers.clock import NS_PER_S, Clock
from mission import machine as m
from mission.autopilot import Autopilot, AutopilotError, Setpoint, VehicleState
from mission.build import build_task, guidance_settings, reactions, safety_limits
from mission.checks import Check
from mission.eyes import Eyes, Lookout
from mission.helm import Helm
from mission.plan import MissionPlan
from mission.preflight import wait_until_ready
from mission.records import CheckResult, Event, MissionEnded, PreflightCheck, Result, Severity, TaskEnded, TaskStarted
from mission.reporting import FlightLog, Progress
from mission.safety import Hazard, Reaction, SafetyInput, decide, find_hazards, keep_going_down, way_down
from mission.tasks.go_down import GoDownTask
from mission.tasks.task import Command, FlightMemory, Observation, Task

CONTROL_RATE_HZ = 20.0
PAUSE_BEFORE_GOING_DOWN_S = 2.0
GOING_DOWN_LIMIT_S = 300.0

_STAYS_CLEAR = ("takeoff", "ascend", "descend", "rotate", "hold", "land", "return")
"""Tasks that do not carry the vehicle anywhere over ground by themselves; the others may bring it over the line."""

_TRIGGERS = {Result.FAILED: "fail", Result.TIMED_OUT: "fail", Result.INTERRUPTED: "interrupt"}
_RESULTS = {
    Hazard.INTERRUPTED: Result.INTERRUPTED,
    Hazard.TASK_TIMED_OUT: Result.TIMED_OUT,
    Hazard.TAKEOVER: Result.TAKEN_OVER,
}


class Executive:
    """Flies one mission; `run` once. `request_stop` may be called at any time from the event loop.

    `free_bytes` tells the room on the log's disk; `on_checks` hears the pre-flight checks once, before arming.
    """

    def __init__(
        self,
        plan: MissionPlan,
        autopilot: Autopilot,
        eyes: Eyes,
        log: FlightLog,
        clock: Clock,
        camera: Intrinsics,
        free_bytes: Callable[[], int | None] = lambda: None,
        on_checks: Callable[[Sequence[Check]], None] = lambda checks: None,
    ) -> None:
        self._free_bytes = free_bytes
        self._on_checks = on_checks
        self._plan = plan
        self._autopilot = autopilot
        self._eyes = eyes
        self._log = log
        self._clock = clock
        self._guidance = guidance_settings(plan.guidance)
        self._limits = safety_limits(plan.safety)
        self._reactions = reactions(plan.safety)
        self._machine = m.FlightMachine([task.task for task in plan.tasks], self._on_change)
        self._lookout = Lookout(eyes, log, camera, self._guidance)
        self._helm = Helm(autopilot, log, clock, self._guidance.leash_m)
        self._memory = FlightMemory(Setpoint(0.0, 0.0, 0.0, 0.0), 0.0)
        self._task: Task | None = None
        self._task_started_ns = 0
        self._may_be_over_line = False
        self._is_interrupted = False
        self._was_armed = False
        self._task_failure: str | None = None
        self._refusal: str | None = None
        self._internal_error: str | None = None
        self._noted: set[Hazard] = set()
        self._end: tuple[Result, str] = (Result.FAILED, "")
        self.progress = Progress(m.PREFLIGHT, None, None, None)

    @property
    def may_have_armed(self) -> bool:
        """Whether the vehicle was armed, or told to without a refusal."""
        return self._helm.was_told_to_arm or self._was_armed

    def request_stop(self) -> None:
        """Ask the flight to end now: before arming at once, in the air by the mission's reaction."""
        self._is_interrupted = True

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
                    with contextlib.suppress(AutopilotError):
                        await self._autopilot.hold()
                raise
            ended = MissionEnded(self._clock.now_ns(), *self._end)
        self._log.record(ended)
        return ended

    async def _preflight(self) -> MissionEnded | None:
        """Wait until all is ready; the end of the mission if that never comes."""

        def tell(missing: tuple[str, ...]) -> None:
            self._keep_status_texts()
            self._lookout.keep_notices(self._clock.now_ns())
            self.progress = Progress(m.PREFLIGHT, None, None, None, waiting_for=missing)

        checks = await wait_until_ready(
            self._autopilot,
            self._eyes,
            self._clock,
            self._plan,
            self._free_bytes,
            lambda: self._is_interrupted,
            tell,
        )
        for check in checks:
            self._log.record(PreflightCheck(self._clock.now_ns(), check.name, check.result, check.reason))
        self._on_checks(checks)
        missing = [check.line for check in checks if check.result is CheckResult.FAILED]
        state = self._autopilot.state
        if self._is_interrupted:
            await self._machine.trigger_named("interrupt")
            return MissionEnded(self._clock.now_ns(), Result.INTERRUPTED, "stopped before arming")
        if missing or state is None:
            await self._machine.trigger_named("fail")
            return MissionEnded(self._clock.now_ns(), Result.FAILED, "not ready to fly: " + "; ".join(missing))
        start = Setpoint(state.north_m, state.east_m, state.down_m, state.yaw_rad)
        theta_0_rad = self._guidance.theta_0_rad
        self._memory = FlightMemory(start, state.yaw_rad if theta_0_rad is None else theta_0_rad)
        self._helm.reference = start
        return None

    # -- the control loop ----------------------------------------------------------------------------------------

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
        self._was_armed = self._was_armed or state.is_armed
        self._log.record(state)
        self._keep_status_texts()
        sight = None
        try:
            sight = self._lookout.look(now_ns, state)
        except Exception as error:
            self._internal_error = f"{type(error).__name__} while placing the line: {error}"
        self._show(state)
        if await self._react(now_ns, state):
            return
        try:
            step = self._task.step(self._helm.reference, Observation(dt_s, state, sight))
            await self._helm.do(step, state)
        except AutopilotError as error:
            self._note_refusal(str(error))
            return
        except Exception as error:
            self._internal_error = f"{type(error).__name__} in {self._machine.state}: {error}"
            return
        self._task_failure = step.failed
        if step.done is not None:
            await self._end_task(Result.COMPLETED, step.done)

    def _note_refusal(self, words: str) -> None:
        """On the way down a refusal is noted, and the task asks again; before that it is a hazard."""
        if isinstance(self._task, GoDownTask):
            self._log.record(Event(self._clock.now_ns(), Hazard.COMMAND_REFUSED, Severity.WARNING, words))
        else:
            self._refusal = words

    # -- tasks ---------------------------------------------------------------------------------------------------

    def _start_task(self) -> None:
        index = self._machine.task_index
        if index is None:
            return
        plan = self._plan.tasks[index]
        self._task = build_task(plan, self._guidance, self._memory)
        self._task_started_ns = self._clock.now_ns()
        self._lookout.line_seen_ns = self._task_started_ns
        self._may_be_over_line = self._may_be_over_line or plan.task not in _STAYS_CLEAR
        self._log.record(TaskStarted(self._task_started_ns, index, plan.task))

    async def _end_task(self, result: Result, reason: str) -> None:
        """Close the task in the log; after a completed one go on with the next, or end the flight."""
        index = self._machine.task_index
        if index is not None:
            self._log.record(TaskEnded(self._clock.now_ns(), index, self._plan.tasks[index].task, result, reason))
        if result is not Result.COMPLETED:
            return
        if index is None:  # going down has ended: the mission ends as the reaction said
            await self._machine.trigger_named(_TRIGGERS[self._end[0]])
            return
        await self._machine.trigger_named("advance")
        if self._machine.is_over:
            self._end = (Result.COMPLETED, reason)
        self._start_task()

    # -- safety --------------------------------------------------------------------------------------------------

    async def _react(self, now_ns: int, state: VehicleState) -> bool:
        """Find hazards and act on the most urgent; true when the task must not step in this tick."""
        is_going_down = self._machine.state == m.GOING_DOWN
        hazards = find_hazards(self._safety_input(now_ns, state), self._limits)
        if is_going_down:
            hazards = keep_going_down(hazards)
        decision = decide(hazards, self._reactions, is_offboard=self._helm.modes.is_offboard)
        for hazard, words in hazards.items():
            if hazard not in self._noted and (decision is None or hazard is not decision[0]):
                self._noted.add(hazard)
                self._log.record(Event(now_ns, hazard, Severity.WARNING, words))
        if decision is None:
            return False
        hazard, reaction = decision
        if is_going_down:
            reaction = Reaction.GIVE_UP_CONTROL
        reaction = way_down(reaction, may_be_over_line=self._may_be_over_line)
        self._log.record(Event(now_ns, hazard, Severity.ERROR, hazards[hazard], reaction))
        self._end = (_RESULTS.get(hazard, Result.FAILED), f"{hazard.replace('_', ' ')}: {hazards[hazard]}")
        await self._end_task(*self._end)
        if reaction is Reaction.GIVE_UP_CONTROL:
            # Touch nothing more: the pilot, or the autopilot's own failsafe, has the vehicle.
            await self._machine.trigger_named("give_up")
        else:
            await self._go_down(hazard, reaction)
        return True

    def _safety_input(self, now_ns: int, state: VehicleState) -> SafetyInput:
        index = self._machine.task_index
        task = self._task
        return SafetyInput(
            now_ns=now_ns,
            state=state,
            allowed_modes=self._helm.modes.explained(now_ns, state),
            distance_m=self._from_start_m(state),
            altitude_m=self._memory.start.down_m - state.down_m,
            was_armed=self._was_armed,
            is_going_down=isinstance(task, GoDownTask),
            task_age_s=(now_ns - self._task_started_ns) / NS_PER_S,
            task_limit_s=GOING_DOWN_LIMIT_S if index is None else self._plan.tasks[index].time_limit_s,
            needs_line=task is not None and task.needs_line,
            line_seen_ns=self._lookout.line_seen_ns,
            needs_vision=task is not None and task.needs_vision,
            vision_failure=self._eyes.failure,
            task_failure=self._task_failure,
            refusal=self._refusal,
            internal_error=self._internal_error,
            is_interrupted=self._is_interrupted,
        )

    async def _go_down(self, hazard: Hazard, reaction: Reaction) -> None:
        """End the mission early: hold for a moment, then land or return."""
        await self._machine.trigger_named("go_down")
        self._refusal = self._task_failure = self._internal_error = None
        self._task_started_ns = self._clock.now_ns()
        if not self.may_have_armed:
            await self._machine.trigger_named(_TRIGGERS[self._end[0]])
            return
        command = Command.LAND if reaction is Reaction.LAND else Command.RETURN
        task = self._task
        is_healthy = hazard not in (Hazard.INTERNAL_ERROR, Hazard.TASK_TIMED_OUT)
        if isinstance(task, GoDownTask) and is_healthy and task.command in (command, Command.LAND):
            return  # it is on that way already
        self._task = GoDownTask(command, PAUSE_BEFORE_GOING_DOWN_S)
        try:
            await self._helm.hold()
        except AutopilotError as error:  # then the way down is all the more urgent, and goes on
            self._note_refusal(str(error))

    # -- what others hear ----------------------------------------------------------------------------------------

    def _from_start_m(self, state: VehicleState) -> float:
        start = self._memory.start
        return math.hypot(state.north_m - start.north_m, state.east_m - start.east_m)

    def _show(self, state: VehicleState) -> None:
        height_m = self._memory.start.down_m - state.down_m
        self.progress = Progress(
            self._machine.state, self._machine.task_index, height_m, self._from_start_m(state), state.yaw_rad
        )

    def _keep_status_texts(self) -> None:
        for text in self._autopilot.drain_status_texts():
            self._log.record_status_text(self._clock.now_ns(), text)

    def _on_change(self, state: str) -> None:
        before = self.progress
        self.progress = Progress(
            state, self._machine.task_index, before.height_m, before.distance_m, before.heading_rad
        )
