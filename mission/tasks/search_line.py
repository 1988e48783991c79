"""Search for a lost line: hold, climb a little, sweep in yaw, go back to where it was last seen, sweep again."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from mission.autopilot import Setpoint
from mission.guidance import GuidanceSettings, wrap_angle_rad
from mission.tasks.task import Observation, Step
from mission.tasks.walk import Walk, step_towards

_LOOK_S = 1.0
_BLIND_S = 1.0


@dataclass(frozen=True, slots=True)
class SearchSettings:
    """The plan's safety.line_search in the program's units. `n_detections` frames in a row find the line again."""

    climb_m: float
    sweep_rad: float
    back_m: float
    n_detections: int


class SearchLineTask:
    """Done when the line was seen in n frames in a row and the vehicle is back at its height; failed when it was not.

    `way_back` are the places of the flown path, from here to where the line was last seen, and `climb_m` is what the
    fence allows of the settings' own. A wider view (from higher up) and other headings cost seconds; going back costs
    the way, so it comes last. A search that has found the line comes down again; should it lose the line meanwhile, it
    goes on.
    """

    needs_line = False
    needs_vision = True
    progress = 0.0

    def __init__(
        self, way_back: Sequence[Setpoint], settings: SearchSettings, climb_m: float, guidance: GuidanceSettings
    ) -> None:
        self._way_back = way_back
        self._climb_m = climb_m
        self._settings = settings
        self._guidance = guidance
        self._walk: Walk | None = None
        self._height_down_m = 0.0
        self._look_s = 0.0
        self._n_in_a_row = 0
        self._unseen_s = 0.0

    def step(self, reference: Setpoint, seen: Observation) -> Step:
        """Look; walk on while there is nothing to be seen."""
        if self._walk is None:
            self._height_down_m = reference.down_m
            self._walk = Walk(self._waypoints(reference), self._guidance)
        self._look(seen)
        self._look_s += seen.dt_s
        if self._n_in_a_row >= self._settings.n_detections:
            goal = replace(reference, down_m=self._height_down_m)
            setpoint = step_towards(reference, goal, self._guidance, seen.dt_s)
            is_back = setpoint == goal and abs(seen.state.down_m - goal.down_m) < self._guidance.arrival_m
            return Step(setpoint, done="found the line again" if is_back else None)
        if self._look_s < _LOOK_S:
            return Step(reference)
        setpoint = self._walk.step(reference, seen)
        if self._walk.is_done:
            return Step(setpoint, failed="the line was lost, and not found again")
        return Step(setpoint)

    def _look(self, seen: Observation) -> None:
        self._unseen_s += seen.dt_s
        if seen.sight is not None and seen.sight.found is not None:
            self._n_in_a_row += 1
            self._unseen_s = 0.0
        elif seen.sight is not None or self._unseen_s > _BLIND_S:
            self._n_in_a_row = 0

    def _waypoints(self, here: Setpoint) -> list[Setpoint]:
        high = replace(here, down_m=here.down_m - self._climb_m)
        way = [replace(place, down_m=min(high.down_m, place.down_m), yaw_rad=here.yaw_rad) for place in self._way_back]
        last = way[-1] if way else high
        return [high, *self._sweep(high), *way, *self._sweep(last)]

    def _sweep(self, at: Setpoint) -> list[Setpoint]:
        sweep_rad = self._settings.sweep_rad
        yaws_rad = (at.yaw_rad + sweep_rad, at.yaw_rad, at.yaw_rad - sweep_rad, at.yaw_rad)
        return [replace(at, yaw_rad=wrap_angle_rad(yaw_rad)) for yaw_rad in yaws_rad]
