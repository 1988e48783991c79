"""Hold: hover on the spot for a while."""

from mission.autopilot import Setpoint
from mission.tasks.task import Observation, Step


class HoldTask:
    """Keeps the setpoint for a duration."""

    needs_line = False
    needs_vision = False

    def __init__(self, duration_s: float) -> None:
        self._left_s = duration_s
        self.progress = 0.0

    def step(self, reference: Setpoint, seen: Observation) -> Step:
        """Keep the reference."""
        self._left_s -= seen.dt_s
        self.progress += seen.dt_s
        return Step(reference, done="held" if self._left_s <= 0.0 else None)
