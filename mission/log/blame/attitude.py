"""Excursions of a leg in height and heading."""

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from drivers.clock import NS_PER_S
from mission.log.blame.leg import GROWTH_S, Leg
from mission.log.blame.records import Culprit, Excursion, Fault, Kind, Limits
from mission.log.blame.signals import Motion
from mission.log.blame.spans import spans
from mission.log.blame.tracking import TILT_LIMIT_RAD

Floats = NDArray[np.float64]

_MOTOR_MORE = 0.12  # of full thrust
_STILL_RAD, _STILL_S = math.radians(2.0), 2.0  # a setpoint whose yaw moves by less within this time stands still


def off_height(leg: Leg, limits: Limits) -> Iterator[Excursion]:
    """Where the vehicle was above or below its setpoint."""
    motion = leg.motion
    below_m = np.where(leg.is_flown, np.nan_to_num(motion.position_m[:, 2] - motion.setpoint_m[:, 2]), 0.0)
    for start_ns, end_ns in spans(motion.t_ns, np.abs(below_m) > limits.off_height_m, limits.least_s):
        inside = np.flatnonzero((motion.t_ns >= start_ns) & (motion.t_ns <= end_ns))
        peak = int(inside[np.abs(below_m[inside]).argmax()])
        tilt_rad = float(motion.tilt_rad[inside].max())
        is_tilted = tilt_rad > TILT_LIMIT_RAD
        words = [f"The vehicle flew {abs(below_m[peak]):.2f} m too {'low' if below_m[peak] > 0 else 'high'}."]
        culprit, fault = Culprit.AUTOPILOT, Fault.TRACKING
        moved_m = _setpoint_moved_m(motion, peak, math.copysign(1.0, below_m[peak]))
        if moved_m > 0.5 * abs(below_m[peak]):
            culprit, fault = Culprit.EXECUTIVE, Fault.SETPOINT
            words.append(f"the setpoint went {moved_m:.2f} m away from it, and it came behind")
        elif is_tilted and below_m[peak] > 0:
            culprit, fault = Culprit.WIND, Fault.PUSHED
            words.append(
                f"it was tilted by {math.degrees(tilt_rad):.0f} degrees against the wind, and its thrust had to do both"
            )
        words += _motor_words(leg, start_ns, end_ns)
        yield Excursion(
            Kind.OFF_HEIGHT,
            leg.task,
            start_ns,
            end_ns,
            float(abs(below_m[peak])),
            "m",
            culprit,
            fault,
            {},
            tuple(words),
        )


def _setpoint_moved_m(motion: Motion, peak: int, side: float) -> float:
    """By how much the setpoint's height went away from the vehicle, at most, in the seconds before `peak` [m]."""
    first = int(np.searchsorted(motion.t_ns, motion.t_ns[peak] - round(GROWTH_S * NS_PER_S)))
    heights_m = motion.setpoint_m[first : peak + 1, 2]
    heights_m = heights_m[np.isfinite(heights_m)]
    return float((side * (heights_m - heights_m[-1])).max()) if heights_m.size else 0.0


def off_heading(leg: Leg, limits: Limits) -> Iterator[Excursion]:
    """Where the vehicle's nose turned away from a setpoint that stood still."""
    motion = leg.motion
    off_rad = _wrapped(motion.yaw_rad - motion.setpoint_yaw_rad)
    is_still = _is_still(motion, leg.start_ns)
    is_beyond = (np.abs(np.nan_to_num(off_rad)) > limits.off_heading_rad) & is_still & leg.is_flown
    for start_ns, end_ns in spans(motion.t_ns, is_beyond, limits.least_s):
        inside = np.flatnonzero((motion.t_ns >= start_ns) & (motion.t_ns <= end_ns) & is_beyond)
        peak = int(inside[np.abs(off_rad[inside]).argmax()])
        nearby = (motion.t_ns >= start_ns - NS_PER_S) & (motion.t_ns <= end_ns)
        sunk_m = float(np.nan_to_num(motion.position_m[nearby, 2] - motion.setpoint_m[nearby, 2]).max())
        side = "right" if off_rad[peak] > 0 else "left"
        words = [
            f"The nose turned {math.degrees(abs(off_rad[peak])):.0f} degrees to the {side} though it was told to stay: "
            "air alone hardly turns a multirotor."
        ]
        if sunk_m > 0.15:
            words.append(
                f"it sank {sunk_m:.2f} m meanwhile, as one does whose rotors do not give what is asked of them"
            )
        words += _motor_words(leg, start_ns, end_ns)
        yield Excursion(
            Kind.OFF_HEADING,
            leg.task,
            start_ns,
            end_ns,
            float(math.degrees(abs(off_rad[peak]))),
            "deg",
            Culprit.AUTOPILOT,
            Fault.TRACKING,
            {},
            tuple(words),
        )


def _is_still(motion: Motion, start_ns: int) -> NDArray[np.bool_]:
    """Where the setpoint's yaw has hardly moved for a while; not at the leg's beginning, which may follow a turn."""
    then_ns = motion.t_ns - round(_STILL_S * NS_PER_S)
    before = np.searchsorted(motion.t_ns, then_ns)
    moved_rad = np.abs(_wrapped(motion.setpoint_yaw_rad - motion.setpoint_yaw_rad[before]))
    return np.asarray((np.nan_to_num(moved_rad, nan=np.inf) < _STILL_RAD) & (then_ns >= start_ns))


def _wrapped(angles_rad: Floats) -> Floats:
    return np.asarray(np.remainder(angles_rad + np.pi, 2 * np.pi) - np.pi)


def _motor_words(leg: Leg, start_ns: int, end_ns: int) -> list[str]:
    """Whether one motor was asked for much more than the others: its propeller, or it itself, gives less."""
    told = [one.motors for one in leg.motors if start_ns <= one.t_ns <= end_ns]
    n_motors = min(map(len, told), default=0)
    if n_motors < 3:
        return []
    means = np.array([motors[:n_motors] for motors in told]).mean(axis=0)
    most = int(means.argmax())
    others = float(np.median(np.delete(means, most)))
    if means[most] - others < _MOTOR_MORE:
        return []
    return [
        f"motor {most + 1} was asked for {means[most]:.2f}, the others for {others:.2f}: it gives less than they do"
    ]
