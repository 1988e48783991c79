"""Hangs a line's conductors: from hold to hold, over the spans that are there, each with its insulators."""

import itertools
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sitl.world.catenary import hang, hang_at, sag_m_of
from sitl.world.errors import WrongKey
from sitl.world.line_models import HangModel
from sitl.world.records import Conductor, Member, PointNed
from sitl.world.route import Stand
from sitl.world.structure import Hold
from sitl.world.tension import ruling_span_m, tension_at_n
from sitl.world.wires import WIRES, Wire

_STEP_M = 0.5
_PIECES = 150  # of a long span: straight pieces stay within a millimetre of the curve
_TENSION_SHARE = 0.18
_ANGLE_RAD = math.radians(3.0)  # from such a turn on, the wire ends at the support on both sides
_PIN_DIAMETER_M = 0.11
_STRING_DIAMETER_M = 0.20
_JUMPER_SAG = 0.8  # of the string's length

Run = tuple[int, int]
"""Spans that hang together: from the first one up to, and without, the second."""


def runs(n_spans: int, missing_spans: Sequence[int]) -> list[Run]:
    """The runs of spans between the missing ones, which are counted from 1."""
    present = [k for k in range(n_spans) if k + 1 not in missing_spans]
    starts = [k for k in present if k - 1 not in present]
    return [(k, next(j for j in range(k + 1, n_spans + 1) if j == n_spans or j + 1 in missing_spans)) for k in starts]


def insulators(stands: Sequence[Stand], line_runs: Sequence[Run], i: int, hold: Hold) -> tuple[Member, ...]:
    """The insulators of one hold at support `i`: a pin, a string that hangs, or one towards each span that ends."""
    stand = stands[i]
    foot = stand.at(0.0, hold.right_m, hold.fixed_m)
    if hold.wire_m == hold.fixed_m:
        return ()
    if not hold.is_string:
        end, thick_m, thin_m = stand.at(0.0, hold.right_m, hold.wire_m), _PIN_DIAMETER_M, 0.8 * _PIN_DIAMETER_M
        return (Member(foot, end, thick_m, thin_m, "porcelain"),)
    if not _ends_at(stands, line_runs, i):
        ends = [stand.at(0.0, hold.right_m, hold.wire_m)]
    else:
        spans = {i - 1, i} & {k for first, beyond in line_runs for k in range(first, beyond)}
        ends = [_string_end(stands, k, i, hold) for k in sorted(spans)]
    return tuple(Member(foot, end, _STRING_DIAMETER_M, _STRING_DIAMETER_M, "porcelain") for end in ends)


def string_conductor(
    stands: Sequence[Stand],
    line_runs: Sequence[Run],
    holds: Sequence[Hold],
    hung: HangModel,
    key: str,
    bundle: tuple[float, float] = (0.0, 0.0),
    *,
    is_shield: bool = False,
) -> list[Conductor]:
    """Hang one wire over all runs; `holds` has its hold at each support.

    `bundle` is where the wire lies in its bundle: right of and above the bundle's middle [m]. `key` is the model's in
    the file, for the error. Raises WrongKey when the wire cannot hang so.
    """
    wire_at = [Hold(h.right_m + bundle[0], h.fixed_m + bundle[1], h.wire_m + bundle[1]) for h in holds]
    diameter_m = WIRES[hung.wire].diameter_m if isinstance(hung.wire, str) else hung.wire.diameter_m
    conductors = []
    for first, beyond in line_runs:
        parameters_m = {} if hung.sag_m is not None else _parameters_m(stands, (first, beyond), hung)
        pieces: list[NDArray[np.float64]] = []
        for k in range(first, beyond):
            start, end = (
                _clamp(stands, line_runs, k, k, wire_at[k]),
                _clamp(stands, line_runs, k, k + 1, wire_at[k + 1]),
            )
            span_m = math.dist(start[:2], end[:2])
            step_m = max(_STEP_M, span_m / _PIECES)
            try:
                if hung.sag_m is not None:
                    hung_m = hang(start, end, hung.sag_m, step_m)
                else:
                    hung_m = hang_at(start, end, parameters_m[k], step_m)
            except ValueError as error:
                raise WrongKey(key, f"in span {k + 1} nothing can hang so: {error}") from error
            if pieces and math.dist(pieces[-1][-1], start) > 1e-6:
                pieces.append(_jumper(pieces[-1][-1], hung_m[0], wire_at[k]))
            pieces.append(hung_m)
        points = np.concatenate([pieces[0], *(piece[1:] for piece in pieces[1:])])
        conductors.append(Conductor(diameter_m, points, is_shield))
    return conductors


def sags_m(stands: Sequence[Stand], line_runs: Sequence[Run], hung: HangModel) -> list[float]:
    """The sag of each span that is there [m]."""
    if hung.sag_m is not None:
        return [hung.sag_m]
    sags = []
    for run in line_runs:
        for k, parameter_m in _parameters_m(stands, run, hung).items():
            here, there = stands[k], stands[k + 1]
            span_m = math.dist(here.place_ne_m, there.place_ne_m)
            sags.append(sag_m_of(parameter_m, span_m, there.up_m - here.up_m))
    return sags


def bundle_offsets(n_bundle: int, spacing_m: float) -> list[tuple[float, float]]:
    """Where the wires of a bundle lie around its middle, right and up [m]: neighbours `spacing_m` apart."""
    if n_bundle == 1:
        return [(0.0, 0.0)]
    radius_m = spacing_m / (2.0 * math.sin(math.pi / n_bundle))
    first_rad = {2: 0.0, 3: math.pi / 2.0, 4: math.pi / 4.0}[n_bundle]
    angles = [first_rad + 2.0 * math.pi * k / n_bundle for k in range(n_bundle)]
    return [(radius_m * math.cos(angle), radius_m * math.sin(angle)) for angle in angles]


def _ends_at(stands: Sequence[Stand], line_runs: Sequence[Run], i: int) -> bool:
    """Whether the wires are held fast at support `i`: at an angle, and where a run begins or ends."""
    return abs(stands[i].turn_rad) > _ANGLE_RAD or any(i in run for run in line_runs)


def _clamp(stands: Sequence[Stand], line_runs: Sequence[Run], span: int, i: int, hold: Hold) -> PointNed:
    """Where the wire of a span begins or ends at support `i`."""
    if hold.is_string and _ends_at(stands, line_runs, i):
        return _string_end(stands, span, i, hold)
    return stands[i].at(0.0, hold.right_m, hold.wire_m)


def _string_end(stands: Sequence[Stand], span: int, i: int, hold: Hold) -> PointNed:
    """The end of a string that is pulled level at support `i`, along `span`."""
    here, there = stands[i].place_ne_m, stands[span if i > span else span + 1].place_ne_m
    north_m, east_m, down_m = stands[i].at(0.0, hold.right_m, hold.fixed_m)
    share = (hold.fixed_m - hold.wire_m) / math.dist(here, there)
    return north_m + share * (there[0] - here[0]), east_m + share * (there[1] - here[1]), down_m


def _jumper(start: NDArray[np.float64], end: NDArray[np.float64], hold: Hold) -> NDArray[np.float64]:
    """The slack wire below an angle support that joins both spans."""
    along = np.linspace(0.0, 1.0, 9)[:, None]
    points = start + along * (end - start)
    points[:, 2] += _JUMPER_SAG * (hold.fixed_m - hold.wire_m) * np.sin(np.pi * along[:, 0])
    return np.asarray(points)


def _parameters_m(stands: Sequence[Stand], run: Run, hung: HangModel) -> dict[int, float]:
    """The catenary parameter H / w [m] of each span of a run, by its sections' ruling spans."""
    first, beyond = run
    holds_fast = [first, *(i for i in range(first + 1, beyond) if abs(stands[i].turn_rad) > _ANGLE_RAD), beyond]
    wire = _wire(hung)
    tension_n = hung.tension_n or _TENSION_SHARE * wire.strength_n
    parameters: dict[int, float] = {}
    for start, end in itertools.pairwise(holds_fast):
        spans_m = [math.dist(stands[k].place_ne_m, stands[k + 1].place_ne_m) for k in range(start, end)]
        now_n = tension_at_n(wire, ruling_span_m(spans_m), tension_n, hung.tension_at_c, hung.temperature_c)
        parameters |= dict.fromkeys(range(start, end), now_n / wire.weight_n_m)
    return parameters


def _wire(hung: HangModel) -> Wire:
    if isinstance(hung.wire, str):
        return WIRES[hung.wire]
    own = hung.wire
    return Wire(
        own.diameter_m,
        own.mass_kg_m or 0.0,
        1e-6 * (own.area_mm2 or 0.0),
        1e9 * (own.modulus_gpa or 0.0),
        own.expansion_per_k or 0.0,
        0.0,
    )
