"""The flow of a flight: which task is flown now, what pauses it, and how it is ended early.

It turns the state machine, keeps the task and its detour, and tells log and journal. The executive says when.
"""

from collections.abc import Callable

from drivers.clock import NS_PER_S, Clock
from mission import machine as m
from mission.autopilot import Autopilot, AutopilotError, LandedState, Setpoint
from mission.build import build_task, guidance_settings, search_settings
from mission.departure import Departure
from mission.detours import Detour, detour_task
from mission.hazards import TaskView
from mission.helm import Helm, TakenOverError
from mission.limits import floor_m
from mission.logbook import Logbook
from mission.plan import MissionPlan
from mission.records import Event, Result, Severity, TaskEnded, TaskStarted
from mission.reporting import FlightLog
from mission.resumption import Resumption
from mission.safety import Hazard, Reaction, way_down
from mission.situation import Situation, Troubles
from mission.tasks.go_down import GoDownTask
from mission.tasks.hand_over import HandOverTask
from mission.tasks.rejoin import RejoinTask
from mission.tasks.task import Command, Task

PAUSE_BEFORE_GOING_DOWN_S = 2.0
GOING_DOWN_LIMIT_S = 300.0
HANDING_OVER_LIMIT_S = 30.0
REJOINING_LIMIT_S = 300.0

_STAYS_CLEAR = ("takeoff", "ascend", "descend", "rotate", "hold", "land", "return")
"""Tasks that do not carry the vehicle anywhere over ground by themselves; the others may bring it over the line."""

_TRIGGERS = {Result.FAILED: "fail", Result.TIMED_OUT: "fail", Result.INTERRUPTED: "interrupt"}
_RESULTS = {
    Hazard.INTERRUPTED: Result.INTERRUPTED,
    Hazard.OPERATOR_LAND: Result.INTERRUPTED,
    Hazard.OPERATOR_HOLD: Result.INTERRUPTED,
    Hazard.TASK_TIMED_OUT: Result.TIMED_OUT,
    Hazard.TAKEOVER: Result.TAKEN_OVER,
    Hazard.AUTOPILOT_FAILSAFE: Result.TAKEN_OVER,
    Hazard.OFFBOARD_REFUSED: Result.TAKEN_OVER,
}


class Flow:
    """Where a flight stands. `task` is the mission's, `detour` what is flown instead of it for a while.

    `machine` holds the state, `end` how the flight ends (it counts once the machine is over), and `stand` where the
    task is to be taken up again should the flight break off now. `departure` is set after pre-flight, before `begin`.
    `on_change(state)` hears of each transition.
    """

    def __init__(
        self,
        plan: MissionPlan,
        autopilot: Autopilot,
        helm: Helm,
        situation: Situation,
        log: FlightLog,
        logbook: Logbook,
        clock: Clock,
        on_change: Callable[[str], None],
    ) -> None:
        self._plan = plan
        self._autopilot = autopilot
        self._helm = helm
        self._situation = situation
        self._log = log
        self._logbook = logbook
        self._clock = clock
        self._guidance = guidance_settings(plan.guidance)
        self._search = search_settings(plan.safety)
        self._task_started_ns = 0
        self._may_be_over_line = False
        self._noted: set[Hazard] = set()
        self.machine = m.FlightMachine([task.task for task in plan.tasks], self._before_change, on_change)
        self.task: Task | None = None
        self.detour: Detour | None = None
        self.departure: Departure | None = None
        self.stand = Setpoint(0.0, 0.0, 0.0, 0.0)
        self.end: tuple[Result, str] = (Result.FAILED, "")

    @property
    def is_going_down(self) -> bool:
        """Whether the mission was ended early, and the vehicle is on its way down, or into hold."""
        return self.machine.state == m.GOING_DOWN

    @property
    def is_on_its_way_down(self) -> bool:
        """Whether a landing or a return is flown now, the mission's own or an early one."""
        return isinstance(self.task, GoDownTask) and self.detour is None

    @property
    def flown(self) -> Task | None:
        """The task that steers now: the mission's, or its detour's."""
        return self.task if self.detour is None else self.detour.task

    async def begin(self, departure: Departure) -> None:
        """Begin with the first task, or on the way to where the mission was interrupted."""
        if departure.resumption is not None and departure.is_flying:
            await self.rejoin(departure.resumption, departure.rejoin_at)
        else:
            await self.machine.trigger_named("advance")
            self.start_task()

    def keep_stand(self, now_ns: int) -> None:
        """Remember where the task stands; where a pause, a search or a pilot has left the vehicle is not it."""
        if self.detour is not None or self.task is None:
            return
        if self._helm.modes.is_offboard and not self.is_going_down:
            self.stand = self._helm.reference
        self._logbook.note(now_ns, self.machine.task_index, self.task.progress, self.stand)

    async def taken_over(self, words: str) -> None:
        """Somebody has the vehicle, and nothing was sent yet."""
        self.end = (Result.TAKEN_OVER, words)
        await self.machine.trigger_named("give_up")

    def start_task(self) -> None:
        """Make the task that the machine has come to; none where the flight is over."""
        index = self.machine.task_index
        if index is None:
            return
        plan = self._plan.tasks[index]
        self.task = build_task(plan, self._guidance, self._situation.memory)
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

    async def end_task(self, result: Result, reason: str) -> None:
        """Close the task in the log; after a completed one go on with the next, or end the flight."""
        index = self.machine.task_index
        if index is not None and self.machine.state != m.REJOINING:
            self._log.record(TaskEnded(self._clock.now_ns(), index, self._plan.tasks[index].task, result, reason))
        if result is not Result.COMPLETED:
            return
        if index is None:  # going down has ended: the mission ends as the reaction said
            await self.machine.trigger_named(_TRIGGERS[self.end[0]])
            return
        departure = self.departure
        if index == 0 and departure is not None and departure.resumption is not None and departure.resumption.index > 0:
            await self.rejoin(departure.resumption, departure.rejoin_at)
            return
        await self.machine.trigger_named("advance")
        if self.machine.is_over:
            self.end = (Result.COMPLETED, reason)
        self.start_task()

    async def rejoin(self, resumption: Resumption, rejoin_at: Setpoint) -> None:
        """Fly to where the mission was interrupted; from there the task is taken up."""
        await self.machine.trigger_named("rejoin", towards=resumption.index)
        now_ns = self._clock.now_ns()
        words = f"flying to where task {resumption.index + 1} was interrupted"
        self._log.record(Event(now_ns, "rejoining", Severity.INFO, words))
        self._may_be_over_line = True
        self._set_floor(resumption.height_m)
        self._task_started_ns = now_ns
        self.task = build_task(self._plan.tasks[resumption.index], self._guidance, self._situation.memory)
        transit_down_m = self._situation.memory.start.down_m - resumption.transit_height_m
        rejoin = RejoinTask(rejoin_at, transit_down_m, self._guidance)
        self.detour = Detour(rejoin, None, Reaction.CONTINUE, now_ns)

    async def pause(self, hazard: Hazard, reaction: Reaction, words: str) -> None:
        """Pause the task: hold, climb and hold, or search."""
        now_ns = self._clock.now_ns()
        self._log.record(Event(now_ns, hazard, Severity.WARNING, words, reaction))
        await self.machine.trigger_named("search" if reaction is Reaction.SEARCH else "pause")
        room_m = self._plan.safety.max_altitude_m - self._altitude_m() - 1.0
        task = detour_task(reaction, self._search, room_m, self._situation.memory, self._guidance)
        self.detour = Detour(task, hazard, reaction, now_ns)
        self._situation.expect_line(now_ns)

    async def carry_on(self, words: str) -> None:
        """The detour is over: go on with the task. Its time limit does not count the detour."""
        was_rejoining = self.machine.state == m.REJOINING
        await self.machine.trigger_named("carry_on")
        now_ns = self._clock.now_ns()
        if self.detour is not None:
            self._task_started_ns += now_ns - self.detour.started_ns
        self.detour = None
        self._situation.expect_line(now_ns)
        if was_rejoining:
            self._situation.memory.known_line.forget()  # the vehicle has come down to it
            self.start_task()
        else:
            self._log.record(Event(now_ns, "carried_on", Severity.INFO, words))

    async def end_early(self, now_ns: int, hazard: Hazard, reaction: Reaction, words: str) -> None:
        """End the mission: give up control, or go down."""
        state = self._autopilot.state
        is_on_ground = state is not None and state.landed is LandedState.ON_GROUND
        reaction = way_down(reaction, may_be_over_line=self._may_be_over_line, is_on_ground=is_on_ground)
        self._log.record(Event(now_ns, hazard, Severity.ERROR, words, reaction))
        self.end = (_RESULTS.get(hazard, Result.FAILED), f"{hazard.replace('_', ' ')}: {words}")
        await self.end_task(*self.end)
        if reaction is Reaction.GIVE_UP_CONTROL:
            # Touch nothing more: the pilot, or the autopilot's own failsafe, has the vehicle.
            await self.machine.trigger_named("give_up" if self.end[0] is Result.TAKEN_OVER else "lose")
        else:
            await self._go_down(hazard, reaction)

    async def _go_down(self, hazard: Hazard, reaction: Reaction) -> None:
        """End the mission early: hold for a moment, then land or return; or hold, and leave it at that."""
        await self.machine.trigger_named("go_down")
        self._situation.troubles = Troubles()
        self.detour = None
        self._task_started_ns = self._clock.now_ns()
        if not (self._helm.was_told_to_arm or (self.departure is not None and self.departure.is_flying)):
            await self.machine.trigger_named(_TRIGGERS[self.end[0]])
            return
        task, memory = self.task, self._situation.memory
        if reaction is Reaction.HOLD_AND_END:
            self.task = HandOverTask()
            return
        if isinstance(task, GoDownTask):  # it is on its way: nothing is gained by another one
            if hazard is Hazard.TASK_TIMED_OUT:
                self.task = GoDownTask(task.command, memory)
            return
        command = Command.LAND if reaction is Reaction.LAND else Command.RETURN
        self.task = GoDownTask(command, memory, PAUSE_BEFORE_GOING_DOWN_S)
        try:
            await self._helm.hold()
        except TakenOverError:
            return  # the next tick says so
        except AutopilotError as error:  # then the way down is all the more urgent, and goes on
            self.note_refusal(str(error))

    def task_view(self, now_ns: int) -> TaskView:
        """What the task needs and says, as safety wants it."""
        index = self.machine.task_index
        task, detour = self.task, self.detour
        # While holding, the paused task's needs count; a search and a rejoining have their own.
        needing = detour.task if detour is not None and self.machine.state != m.HOLDING else task
        started_ns = self._task_started_ns if detour is None else now_ns
        if self.machine.state == m.REJOINING:
            limit_s, started_ns = REJOINING_LIMIT_S, self._task_started_ns
        elif index is None:
            limit_s = HANDING_OVER_LIMIT_S if isinstance(task, HandOverTask) else GOING_DOWN_LIMIT_S
        else:
            limit_s = self._plan.tasks[index].time_limit_s
        return TaskView(
            age_s=(now_ns - started_ns) / NS_PER_S,
            limit_s=limit_s,
            needs_line=needing is not None and needing.needs_line,
            needs_vision=needing is not None and needing.needs_vision,
            is_going_down=self.is_on_its_way_down,
            failure=self._situation.troubles.task_failure,
        )

    def note_refusal(self, words: str) -> None:
        """On the way down a refusal is noted, and the task asks again; before that it is a hazard."""
        if self.is_on_its_way_down or self.is_going_down:
            self._log.record(Event(self._clock.now_ns(), Hazard.COMMAND_REFUSED, Severity.WARNING, words))
        else:
            self._situation.troubles.refusal = words

    def note_bug(self, words: str) -> None:
        """A bug on the way down is noted, and the way down goes on: who gave up there would leave it in the air."""
        if not (self.is_on_its_way_down or self.is_going_down):
            self._situation.troubles.internal_error = words
        elif Hazard.INTERNAL_ERROR not in self._noted:
            self._noted.add(Hazard.INTERNAL_ERROR)
            self._log.record(Event(self._clock.now_ns(), Hazard.INTERNAL_ERROR, Severity.ERROR, words))

    def note_hazards(self, now_ns: int, hazards: dict[Hazard, str], decision: tuple[Hazard, Reaction] | None) -> None:
        """Log each hazard that is not the one reacted to, once."""
        for hazard, words in hazards.items():
            if hazard not in self._noted and (decision is None or hazard is not decision[0]):
                self._noted.add(hazard)
                self._log.record(Event(now_ns, hazard, Severity.WARNING, words))

    async def _before_change(self, source: str, target: str) -> None:
        """The journal has it before it happens."""
        progress = 0.0 if self.task is None else self.task.progress
        await self._logbook.transition(source, target, self.machine.task_index, progress, self.stand)

    def _altitude_m(self) -> float:
        state = self._autopilot.state
        return 0.0 if state is None else self._situation.height_m(state)
