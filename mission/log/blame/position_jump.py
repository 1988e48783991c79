"""Where the autopilot's own position jumped, as no vehicle does: its estimate was reset, or GPS jumped. Pure."""

from dataclasses import dataclass

import numpy as np

from drivers.clock import NS_PER_S
from mission.log.blame.leg import GROWTH_S, Leg
from mission.log.blame.records import Culprit, Fault
from mission.log.blame.signals import unexplained_steps_m

_SHARE = 0.5  # of the excursion
_NEWS_S = 1.0  # after the last sight of the line that was believed, a jump explains why the next ones were not
_LOST_M = 0.8  # a jump that makes another line of the one that was followed


@dataclass(frozen=True, slots=True)
class PositionJump:
    """The position jumped by `moved_m` [m] to the right of the line as flown, within `took_s` [s]."""

    moved_m: float
    took_s: float


def position_jump_before(leg: Leg, start_ns: int, peak: int, off_m: float) -> PositionJump | None:
    """The largest jump that explains why the vehicle was `off_m` [m] off the line at the sample `peak`.

    It came after the excursion's growth began, before `start_ns`. None where the velocity explains the way.
    """
    jump = _largest(leg, start_ns - round(GROWTH_S * NS_PER_S), int(leg.motion.t_ns[peak]))
    return jump if jump is not None and abs(jump.moved_m) > _SHARE * off_m else None


def position_jump_unseen(leg: Leg, start_ns: int, end_ns: int) -> PositionJump | None:
    """The jump that explains why a line was not known again between two times; None where there is none."""
    jump = _largest(leg, start_ns - round(_NEWS_S * NS_PER_S), end_ns)
    return jump if jump is not None and abs(jump.moved_m) > _LOST_M else None


def of_position(jump: PositionJump) -> tuple[Culprit, Fault, tuple[str, ...]]:
    """Such a jump is the autopilot's doing: setpoint and line as told lie by its position, and jump with it."""
    side = "right" if jump.moved_m > 0.0 else "left"
    words = (
        f"The vehicle's position, as the autopilot told it, jumped by {abs(jump.moved_m):.2f} m to the {side} within "
        f"{jump.took_s:.2f} s, which its velocity does not explain: its estimate was reset, or GPS jumped.",
    )
    return Culprit.AUTOPILOT, Fault.POSITION, words


def _largest(leg: Leg, first_ns: int, last_ns: int) -> PositionJump | None:
    t_ns, right = leg.motion.t_ns, np.nan_to_num(leg.lateral.right)
    across_m = (unexplained_steps_m(leg.motion) * right).sum(axis=1)
    across_m[(t_ns < first_ns) | (t_ns > last_ns)] = 0.0
    at = int(np.abs(across_m).argmax())
    if across_m[at] == 0.0:
        return None
    return PositionJump(float(across_m[at]), float(t_ns[at] - t_ns[at - 1]) / NS_PER_S)
