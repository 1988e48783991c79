"""Find how one log's clock stands to another's, by the motion that both hold. Pure arithmetic on arrays.

Two logs of one flight hold the same estimate, so its velocity correlates almost perfectly at the right offset, and the
positions then tell the rest: a clock that is late by dt shows every position `v dt` behind (least squares).
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mission.imports.errors import NoMatchError
from mission.imports.motion import GRID_S, Flags, Floats, Grid, Motion, Pair, moving_s

MIN_OVERLAP_S = 20.0
"""Less than this in common tells nothing."""
MIN_MOVING_S = 5.0
"""The vehicle has to have moved for this long within the overlap."""
MIN_CORRELATION = 0.99
"""One flight's two logs reach 0.9998; others 0.986 in 34 recordings of PX4, each with each, and 0.989 in simulation."""
MIN_COARSE_CORRELATION = 0.9
"""Below this, before the offset is refined, there is nothing to refine: the positions of two flights lead anywhere."""
MAX_POSITION_RMS_M, MAX_POSITION_RMS_S = 0.15, 0.05
"""So far may positions differ, and by so much of a second's flight more: one flight's do by 0.01 m, others by 0.3 m."""
MAX_LAG_S = 1.0
"""Telemetry that is older than this does not belong to the clocks."""
MIN_DRIFT_OVERLAP_S = 60.0
"""A drift is looked for from this length on."""

_MAX_DRIFT_ERROR_S = 0.005  # at the overlap's ends; a drift known less well is worse than none
_N_REFINEMENTS = 6
_RIVAL_S = 5.0  # another peak farther away than this is another answer


@dataclass(frozen=True, slots=True)
class ClockMap:
    """How to read the other clock [s] in ours: `theirs + offset_s + drift * (theirs - reference_s)`."""

    offset_s: float
    drift: float
    reference_s: float

    def ours_s(self, theirs_s: Floats) -> Floats:
        """Their times in our clock."""
        return np.asarray(theirs_s + self.offset_s + self.drift * (theirs_s - self.reference_s))

    def ours_ns(self, theirs_ns: int) -> int:
        """A time of theirs in our clock [ns]."""
        return theirs_ns + round(self.offset_s * 1e9 + self.drift * (theirs_ns - self.reference_s * 1e9))

    def later(self, lag_s: float) -> "ClockMap":
        """The map that puts everything `lag_s` later."""
        return replace(self, offset_s=self.offset_s + lag_s)


@dataclass(frozen=True, slots=True)
class Fit:
    """How well two motions agree: correlation up to 1, root mean squares of the differences, over `overlap_s` [s].

    `speed_rms_m_s` is ours. `shift_m` (3,) NED [m] is what their positions lack on ours on average; `position_rms_m` is
    without it.
    """

    correlation: float
    overlap_s: float
    speed_rms_m_s: float
    velocity_rms_m_s: float
    position_rms_m: float
    shift_m: Floats


def match_motion(ours: Motion, theirs: Motion) -> tuple[ClockMap, Fit]:
    """Find the clock map by the motion alone, over every offset at which the logs overlap, and a drift if it shows.

    Raises NoMatchError when the vehicle hardly moved, the overlap is short, or the motions differ or fit twice.
    """
    clock = _coarse(ours, theirs)
    clock, shift_m = _refine(ours, theirs, clock)
    fit = _fit(ours, theirs, clock, shift_m)
    _require_one_flight(fit)
    return clock, fit


def check_motion(ours: Motion, theirs: Motion, clock: ClockMap) -> tuple[float, Fit]:
    """Check a known clock map against the motion; returns how late our log's motion is [s], and the fit without that.

    Raises NoMatchError when the motions do not agree within MAX_LAG_S of it, or hold too little to tell.
    """
    if _pair(ours, theirs, clock).t_s.size * GRID_S < MIN_OVERLAP_S:
        raise NoMatchError(
            f"by the autopilot's clock they have less than {MIN_OVERLAP_S:.0f} s of motion in common; its log is of "
            "another flight"
        )
    lags_s = np.arange(-MAX_LAG_S, MAX_LAG_S + GRID_S / 2, GRID_S)
    correlations = [_fit(ours, theirs, clock.later(lag_s), None).correlation for lag_s in lags_s.tolist()]
    _require_correlation(max(correlations), MIN_COARSE_CORRELATION)
    lagged = clock.later(float(lags_s[int(np.argmax(correlations))]))
    refined, shift_m = _refine(ours, theirs, lagged, with_drift=False)
    fit = _fit(ours, theirs, refined, shift_m)
    _require_one_flight(fit)
    lag_s = refined.offset_s - clock.offset_s
    if abs(lag_s) > MAX_LAG_S:
        raise NoMatchError(f"the boot clock and the motion disagree by {lag_s:+.1f} s; they are of different flights")
    return lag_s, fit


def _pair(ours: Motion, theirs: Motion, clock: ClockMap) -> Pair:
    return Pair.of(ours, replace(theirs, t_s=clock.ours_s(theirs.t_s)))


def _require_correlation(correlation: float, least: float) -> None:
    if not correlation >= least:
        raise NoMatchError(
            f"their motion agrees only to {max(correlation, 0.0):.3f} where {MIN_CORRELATION} is needed; they are of "
            "different flights"
        )


def _require_one_flight(fit: Fit) -> None:
    _require_correlation(fit.correlation, MIN_CORRELATION)
    limit_m = MAX_POSITION_RMS_M + MAX_POSITION_RMS_S * fit.speed_rms_m_s
    if not fit.position_rms_m <= limit_m:
        raise NoMatchError(
            f"their positions differ by {fit.position_rms_m:.2f} m where {limit_m:.2f} m is the most; they are of two "
            "flights that are much alike"
        )


def _coarse(ours: Motion, theirs: Motion) -> ClockMap:
    """The offset at which the motions correlate best, to a fraction of GRID_S."""
    a, b = Grid.of(ours), Grid.of(theirs)
    for grid, whose in ((a, "our log"), (b, "the autopilot's log")):
        known_s = grid.is_known.sum() * GRID_S
        if known_s < MIN_OVERLAP_S:
            raise NoMatchError(f"{whose} holds only {known_s:.0f} s of motion where {MIN_OVERLAP_S:.0f} s are needed")
        if grid.is_moving.sum() * GRID_S < MIN_MOVING_S:
            raise NoMatchError(f"the vehicle hardly moves in {whose}, so nothing tells how the clocks belong together")
    size = 1 << (len(a.is_known) + len(b.is_known)).bit_length()

    def spectrum(values: Floats | Flags) -> NDArray[np.complex128]:
        return np.asarray(np.fft.rfft(values.astype(np.float64), size, axis=0))

    def correlate(left: NDArray[np.complex128], right: NDArray[np.complex128]) -> Floats:
        # Entry k is the sum of left[i] * right[i + k]; negative k stand at the end.
        product = np.conj(left) * right
        return np.asarray(np.fft.irfft(product if product.ndim == 1 else product.sum(axis=1), size))

    known_a, known_b = spectrum(a.is_known), spectrum(b.is_known)
    overlap_s = correlate(known_a, known_b) * GRID_S
    moving_a_s = correlate(spectrum(a.is_moving), known_b) * GRID_S
    moving_b_s = correlate(known_a, spectrum(b.is_moving)) * GRID_S
    power_a = correlate(spectrum((a.signal**2).sum(axis=1)), known_b)
    power_b = correlate(known_a, spectrum((b.signal**2).sum(axis=1)))
    # What moved has to be in both, or else two take-offs would do.
    holds_flight = (moving_a_s > 0.5 * a.is_moving.sum() * GRID_S) | (moving_b_s > 0.5 * b.is_moving.sum() * GRID_S)
    counts = (
        (overlap_s >= MIN_OVERLAP_S)
        & (np.minimum(moving_a_s, moving_b_s) >= MIN_MOVING_S - GRID_S)
        & holds_flight
        & (np.minimum(power_a, power_b) > 1e-6)
    )
    if not counts.any():
        raise NoMatchError(f"they have less than {MIN_OVERLAP_S:.0f} s of motion in common")
    score = np.full(size, -1.0)
    product = correlate(spectrum(a.signal), spectrum(b.signal))
    score[counts] = product[counts] / np.sqrt(power_a[counts] * power_b[counts])
    best = int(np.argmax(score))
    _require_correlation(float(score[best]), MIN_COARSE_CORRELATION)
    _refuse_rivals(score, best)
    before, at, after = score[best - 1], score[best], score[(best + 1) % size]
    bend = before - 2 * at + after
    peak = best + (0.5 * (before - after) / bend if bend < 0 and min(before, after) > -1.0 else 0.0)
    if best > size // 2:
        peak -= size
    reference_s = float(theirs.t_s[0] + theirs.t_s[-1]) / 2
    return ClockMap(float(a.start_s - b.start_s - peak * GRID_S), 0.0, reference_s)


def _refuse_rivals(score: Floats, best: int) -> None:
    """A motion that repeats itself fits at several offsets, and the best of them may be chance."""
    size = len(score)
    away = np.abs((np.arange(size) - best + size // 2) % size - size // 2) * GRID_S > _RIVAL_S
    rival = float(score[away].max(initial=-1.0))
    if score[best] >= MIN_CORRELATION and 1 - rival < 1.5 * (1 - float(score[best])) + 0.005:
        raise NoMatchError(
            f"their motion repeats itself and fits at several offsets ({float(score[best]):.3f} and {rival:.3f}), so "
            "it does not tell how the clocks belong together"
        )


def _refine(ours: Motion, theirs: Motion, clock: ClockMap, *, with_drift: bool = True) -> tuple[ClockMap, Floats]:
    """Least squares on the positions: the offset, the drift where it shows, and the mean shift (3,) of their positions.

    Drift is estimated when the common flight is long enough and it comes out well determined.
    """
    for _ in range(_N_REFINEMENTS):
        pair = _pair(ours, theirs, clock)
        if pair.t_s.size * GRID_S < MIN_OVERLAP_S:
            raise NoMatchError(f"they have less than {MIN_OVERLAP_S:.0f} s of motion in common")
        if min(moving_s(pair.ours_velocity_m_s), moving_s(pair.theirs_velocity_m_s)) < MIN_MOVING_S:
            raise NoMatchError(
                "the vehicle hardly moves while both logs run, so nothing tells that they belong together"
            )
        middle_s = float(pair.t_s.min() + pair.t_s.max()) / 2
        late_s, drift, drift_error, shift_m = _least_squares(pair, middle_s)
        half_s = float(pair.t_s.max() - pair.t_s.min()) / 2
        is_long = 2 * half_s >= MIN_DRIFT_OVERLAP_S
        if not (with_drift and is_long and drift_error * half_s <= _MAX_DRIFT_ERROR_S):
            late_s, drift, _, shift_m = _least_squares(pair, None)
        # What counts is known at the overlap's middle, and so it becomes the map's reference.
        reference_s = middle_s - clock.offset_s if with_drift else clock.reference_s
        offset_s = clock.offset_s + clock.drift * (reference_s - clock.reference_s)
        clock = ClockMap(offset_s + late_s, clock.drift + drift, reference_s)
        if abs(late_s) < 1e-5 and abs(drift) * half_s < 1e-5:
            break
    return clock, shift_m


def _least_squares(pair: Pair, middle_s: float | None) -> tuple[float, float, float, Floats]:
    """How late their clock has to be read [s], its drift (0 without `middle_s`) and that one's error, and the shift."""
    error_m = pair.ours_position_m - pair.theirs_position_m
    size_m = np.linalg.norm(error_m - np.median(error_m, axis=0), axis=1)
    keeps = size_m <= max(5 * float(np.median(size_m)), 0.1)  # a reset position is in both logs, but not at one moment
    error_m, velocity_m_s, t_s = error_m[keeps], pair.theirs_velocity_m_s[keeps], pair.t_s[keeps]
    columns = [-velocity_m_s] if middle_s is None else [-velocity_m_s, -velocity_m_s * (t_s - middle_s)[:, None]]
    design = np.zeros((len(t_s), 3, len(columns) + 3))
    for index, column in enumerate(columns):
        design[:, :, index] = column
    design[:, :, len(columns) :] = np.eye(3)
    flat, target = design.reshape(-1, design.shape[2]), error_m.reshape(-1)
    solution, *_ = np.linalg.lstsq(flat, target, rcond=None)
    if middle_s is None:
        return float(solution[0]), 0.0, 0.0, np.asarray(solution[1:])
    variance = float(np.mean((target - flat @ solution) ** 2))
    n_in_a_second = round(1 / GRID_S)  # neighbours err alike: count one of them each second
    drift_error = float(np.sqrt(variance * n_in_a_second * np.linalg.pinv(flat.T @ flat)[1, 1]))
    return float(solution[0]), float(solution[1]), drift_error, np.asarray(solution[2:])


def _fit(ours: Motion, theirs: Motion, clock: ClockMap, shift_m: Floats | None) -> Fit:
    pair = _pair(ours, theirs, clock)
    shift = np.zeros(3) if shift_m is None else shift_m
    if not pair.t_s.size:
        return Fit(0.0, 0.0, 0.0, 0.0, 0.0, shift)
    power = float(np.sqrt((pair.ours_signal**2).sum() * (pair.theirs_signal**2).sum()))
    velocity_m_s = pair.ours_velocity_m_s - pair.theirs_velocity_m_s
    position_m = pair.ours_position_m - pair.theirs_position_m - shift
    return Fit(
        correlation=float((pair.ours_signal * pair.theirs_signal).sum() / power) if power > 0 else 0.0,
        overlap_s=pair.t_s.size * GRID_S,
        speed_rms_m_s=float(np.sqrt((pair.ours_velocity_m_s**2).sum(axis=1).mean())),
        velocity_rms_m_s=float(np.sqrt((velocity_m_s**2).sum(axis=1).mean())),
        position_rms_m=float(np.sqrt((position_m**2).sum(axis=1).mean())),
        shift_m=shift,
    )
