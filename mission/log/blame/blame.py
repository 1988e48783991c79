"""Find a flight's excursions, and trace each to perception, the executive, the autopilot or the wind.

While a line is followed, the way off it is a sum (mission/log/blame/signals.py): the line was elsewhere than told, the
setpoint was off the line as told, the vehicle was off its setpoint. What the vehicle does at its setpoint's expense is
the wind's work if the air pushed it away, and the autopilot's if it went there by its own thrust.
"""

from mission.log.blame.attitude import off_heading, off_height
from mission.log.blame.leg import leg_of
from mission.log.blame.line import misdated, off_line, unseen
from mission.log.blame.records import Excursion, Limits
from mission.log.blame.signals import knowledge_of, motion_of
from mission.log.blame.tilt import tilted
from mission.log.reader import Flight
from mission.log.task_spans import FOLLOW_TASK, task_spans

DEFAULT_LIMITS = Limits()


def find_excursions(flight: Flight, limits: Limits = DEFAULT_LIMITS) -> tuple[Excursion, ...]:
    """All excursions of a flight, in the order of their times; all but those in tilt while it followed its line."""
    if not flight.states:
        return ()
    whole, known = motion_of(flight), knowledge_of(flight)
    tasks = task_spans(flight)
    found: list[Excursion] = list(tilted(whole, tasks, limits))
    for span in tasks:
        if span.task != FOLLOW_TASK:
            continue
        leg = leg_of(flight, whole, known, span)
        if leg.is_flown.sum() >= 2:
            finders = (off_line, unseen, misdated) if flight.fixes or not leg.has_estimates else ()
            for find in (*finders, off_height, off_heading):
                found.extend(find(leg, limits))
    return tuple(sorted(found, key=lambda excursion: (excursion.start_ns, excursion.kind)))
