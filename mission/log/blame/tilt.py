"""A vehicle that leans as far as it may: against the wind, or because it flies away."""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from drivers.clock import NS_PER_S
from mission.log.blame.records import Culprit, Excursion, Fault, Kind, Limits
from mission.log.blame.signals import Floats, Motion, Times
from mission.log.blame.spans import spans
from mission.log.task_spans import TaskSpan

_BALANCED = 0.5  # share of its thrust's level part that the air has to take up
_FAST_M_S = 3.0  # over the ground, the way it leans


def tilted(motion: Motion, tasks: Sequence[TaskSpan], limits: Limits) -> Iterator[Excursion]:
    """Where the vehicle leaned beyond the limit, over a whole flight.

    Leaning against the wind it stays where it is, or nearly: the air takes up what its thrust does. One that flies away
    gathers speed instead.
    """
    for start_ns, end_ns in spans(motion.t_ns, motion.tilt_rad > limits.tilted_rad, limits.tilted_s):
        inside = (motion.t_ns >= start_ns) & (motion.t_ns <= end_ns)
        thrust = motion.thrust_m_s2[inside].mean(axis=0)
        push = motion.push_m_s2[inside].mean(axis=0)
        taken_up = float(-(push @ thrust) / max(float(thrust @ thrust), 1e-6))
        peak_rad = float(motion.tilt_rad[inside].max())
        push_m_s2 = float(np.linalg.norm(push))
        is_wind = taken_up > _BALANCED
        if is_wind and _speed_along_m_s(motion.t_ns[inside], motion.position_m[inside], thrust) > _FAST_M_S:
            continue  # a fast flight, as the autopilot's return: the air is that of its own speed
        share = f"{100 * max(0.0, taken_up):.0f} % of what its thrust did"
        words = f"The vehicle leaned as far as it may and flew away: the air took up only {share}."
        if is_wind:
            words = (
                f"The wind was about as strong as this vehicle can hold: it pushed with {push_m_s2:.1f} m/s² and took "
                f"up {share}."
            )
        yield Excursion(
            Kind.TILTED,
            next((span.task for span in reversed(tasks) if span.start_ns <= start_ns), ""),
            start_ns,
            end_ns,
            math.degrees(peak_rad),
            "deg",
            Culprit.WIND if is_wind else Culprit.AUTOPILOT,
            Fault.PUSHED if is_wind else Fault.TRACKING,
            {},
            (words,),
        )


def _speed_along_m_s(t_ns: Times, position_m: Floats, thrust_m_s2: Floats) -> float:
    """How fast it went over the ground the way that its thrust took it."""
    took_s = float(t_ns[-1] - t_ns[0]) / NS_PER_S
    way_m = position_m[-1, :2] - position_m[0, :2]
    return float(way_m @ thrust_m_s2) / max(float(np.linalg.norm(thrust_m_s2)) * took_s, 1e-6)
