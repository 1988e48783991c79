"""The curve in which a conductor hangs between two supports: a true catenary."""

import math

import numpy as np
from numpy.typing import NDArray

_N_BISECTIONS = 80


def catenary_parameter_m(span_m: float, rise_m: float, sag_m: float) -> float:
    """The parameter a [m] of y = a cosh(x / a) that hangs `sag_m` below its chord at mid-span.

    `span_m` is the horizontal distance of the supports, `rise_m` how much the second stands above the first. The sag
    is measured vertically from the middle of the chord, as line engineers do. Raises ValueError unless
    0 < sag_m <= span_m and span_m > 0.

    The sag grows with s = span / 2a; s is bisected.
    """
    if not span_m > 0.0:
        raise ValueError(f"A span must be longer than 0 m, not {span_m} m.")
    if not 0.0 < sag_m <= span_m:
        raise ValueError(f"The sag must lie above 0 m and not above the span of {span_m} m, not at {sag_m} m.")

    low, high = 0.0, 4.0
    while sag_m_of(span_m / (2.0 * high), span_m, rise_m) < sag_m:
        high *= 2.0
    for _ in range(_N_BISECTIONS):
        middle = 0.5 * (low + high)
        if sag_m_of(span_m / (2.0 * middle), span_m, rise_m) < sag_m:
            low = middle
        else:
            high = middle
    return span_m / (low + high)


def sag_m_of(parameter_m: float, span_m: float, rise_m: float) -> float:
    """The sag [m] at mid-span below the chord, of the catenary with the parameter a [m].

    With s = span / 2a and u = asinh(rise / (2 a sinh s)) it is a cosh(u) (cosh(s) - 1).
    """
    s = span_m / (2.0 * parameter_m)
    # cosh(s) - 1 cancels for the flat curves of real lines; 2 sinh(s/2)^2 is the same without the loss.
    return parameter_m * math.hypot(1.0, rise_m / (2.0 * parameter_m * math.sinh(s))) * 2.0 * math.sinh(s / 2.0) ** 2


def hang(
    start_ned_m: tuple[float, float, float], end_ned_m: tuple[float, float, float], sag_m: float, step_m: float
) -> NDArray[np.float64]:
    """Sample the catenary that hangs `sag_m` [m] below its chord at mid-span.

    Takes and returns what hang_at does. Raises ValueError as catenary_parameter_m does.
    """
    span_m, rise_m = _span_and_rise_m(start_ned_m, end_ned_m)
    return hang_at(start_ned_m, end_ned_m, catenary_parameter_m(span_m, rise_m, sag_m), step_m)


def hang_at(
    start_ned_m: tuple[float, float, float], end_ned_m: tuple[float, float, float], parameter_m: float, step_m: float
) -> NDArray[np.float64]:
    """Sample the catenary of the parameter a [m] between two supports.

    `start_ned_m` and `end_ned_m` are NED [m]; the samples stand at most `step_m` [m] apart on the ground. Returns
    (n, 3) float64 [m] NED whose first and last rows are the supports. Raises ValueError for a parameter so small that
    the wire would be more than a hundred spans long.
    """
    start, end = np.asarray(start_ned_m, dtype=np.float64), np.asarray(end_ned_m, dtype=np.float64)
    a = parameter_m
    span_m, rise_m = _span_and_rise_m(start_ned_m, end_ned_m)
    if not a * 14.0 > span_m > 0.0:
        raise ValueError(f"Nothing hangs over a span of {span_m} m with the parameter {a} m.")
    u = math.asinh(rise_m / (2.0 * a * math.sinh(span_m / (2.0 * a))))
    lowest_m = span_m / 2.0 - a * u

    along = np.linspace(0.0, 1.0, max(2, math.ceil(span_m / step_m - 1e-9) + 1))
    points = start + along[:, None] * (end - start)
    # a (cosh p - cosh q) written as a product, for the same reason as above.
    p, q = (along * span_m - lowest_m) / a, -lowest_m / a
    points[:, 2] = start[2] - 2.0 * a * np.sinh((p + q) / 2.0) * np.sinh((p - q) / 2.0)
    points[-1] = end
    return points


def _span_and_rise_m(start: tuple[float, float, float], end: tuple[float, float, float]) -> tuple[float, float]:
    return math.hypot(end[0] - start[0], end[1] - start[1]), start[2] - end[2]
