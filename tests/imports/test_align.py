"""Aligning two logs by their motion: known offsets and drifts come back, and what tells nothing is refused."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mission.imports.align import ClockMap, check_motion, match_motion
from mission.imports.errors import NoMatchError
from mission.imports.motion import Motion

NOISE_M, NOISE_M_S, NOISE_RAD = 0.03, 0.03, 0.005


def wander(seed: int, t_s: np.ndarray) -> Motion:
    """A smooth random flight as it truly is at `t_s` [s]: sums of slow waves, at 1 to 3 m/s."""
    draw = np.random.default_rng(seed)
    rates_rad_s = draw.uniform(0.05, 1.0, (3, 6))
    phases_rad = draw.uniform(0.0, 2 * np.pi, (3, 6))
    speeds_m_s = draw.uniform(0.3, 1.0, (3, 6))
    angles = rates_rad_s[None] * t_s[:, None, None] + phases_rad
    velocity_m_s = (speeds_m_s * np.cos(angles)).sum(-1)
    position_m = (speeds_m_s / rates_rad_s * np.sin(angles)).sum(-1)
    yaw_rad = np.cumsum(np.gradient(t_s) * 0.4 * np.sin(0.23 * t_s + seed))
    return Motion(t_s, position_m, velocity_m_s, np.asarray((yaw_rad + np.pi) % (2 * np.pi) - np.pi))


def seen(true: Motion, seed: int) -> Motion:
    """A motion with a sensor's noise."""
    draw = np.random.default_rng(seed)
    return Motion(
        true.t_s,
        true.position_m + draw.normal(0, NOISE_M, true.position_m.shape),
        true.velocity_m_s + draw.normal(0, NOISE_M_S, true.velocity_m_s.shape),
        true.yaw_rad + draw.normal(0, NOISE_RAD, true.yaw_rad.shape),
    )


def in_clock(motion: Motion, clock: ClockMap) -> Motion:
    """The motion as a log has it whose times `clock` would turn into those of `motion`."""
    theirs_s = (motion.t_s - clock.offset_s + clock.drift * clock.reference_s) / (1 + clock.drift)
    return Motion(theirs_s, motion.position_m, motion.velocity_m_s, motion.yaw_rad)


@settings(max_examples=40)
@given(
    seed=st.integers(0, 10_000),
    offset_s=st.floats(-3_000.0, 3_000.0),
    drift=st.floats(-200e-6, 200e-6),
    length_s=st.floats(60.0, 600.0),
    head_s=st.floats(0.0, 40.0),
    rate_hz=st.floats(10.0, 60.0),
)
def test_offset_and_drift_come_back(
    seed: int, offset_s: float, drift: float, length_s: float, head_s: float, rate_hz: float
) -> None:
    """Anywhere in the flight a moment of theirs is put within 10 ms of where it belongs."""
    start_s = 5_000.0
    ours = seen(wander(seed, np.arange(start_s, start_s + length_s, 0.05)), seed + 1)
    true = wander(seed, np.arange(start_s - head_s, start_s + length_s - head_s / 2, 1 / rate_hz))
    clock = ClockMap(offset_s, drift, start_s)
    theirs = in_clock(seen(true, seed + 2), clock)
    found, fit = match_motion(ours, theirs)
    inside = (true.t_s >= ours.t_s[0]) & (true.t_s <= ours.t_s[-1])
    np.testing.assert_allclose(found.ours_s(theirs.t_s)[inside], true.t_s[inside], rtol=0, atol=0.010)
    assert fit.correlation > 0.99
    assert fit.position_rms_m < 3 * NOISE_M
    assert fit.velocity_rms_m_s < 3 * NOISE_M_S


@settings(max_examples=25)
@given(seed=st.integers(0, 10_000), lag_s=st.floats(0.0, 0.4), drift=st.floats(-100e-6, 100e-6))
def test_a_known_clock_tells_how_late_our_motion_is(seed: int, lag_s: float, drift: float) -> None:
    true = wander(seed, np.arange(5_000.0, 5_120.0, 0.05))
    clock = ClockMap(4_000.0, drift, 1_000.0)
    late = Motion(true.t_s + lag_s, true.position_m, true.velocity_m_s, true.yaw_rad)
    found_s, fit = check_motion(seen(late, seed), in_clock(seen(true, seed + 1), clock), clock)
    assert found_s == pytest.approx(lag_s, abs=0.01)
    assert fit.correlation > 0.99


@settings(max_examples=25)
@given(seed=st.integers(0, 10_000), length_s=st.floats(40.0, 300.0))
def test_another_flight_is_refused(seed: int, length_s: float) -> None:
    ours = wander(seed, np.arange(0.0, length_s, 0.05))
    theirs = wander(seed + 1, np.arange(0.0, length_s * 1.5, 0.04))
    with pytest.raises(NoMatchError, match=r"different flights|alike"):
        match_motion(ours, theirs)
    with pytest.raises(NoMatchError, match=r"different flights|alike"):
        check_motion(ours, theirs, ClockMap(0.0, 0.0, 0.0))


def test_the_shift_between_two_origins_is_found() -> None:
    ours = wander(4, np.arange(0.0, 100.0, 0.05))
    theirs = Motion(ours.t_s + 7.0, ours.position_m - np.array([3.0, -40.0, 1.5]), ours.velocity_m_s, ours.yaw_rad)
    clock, fit = match_motion(ours, theirs)
    assert clock.ours_s(np.array([50.0]))[0] == pytest.approx(43.0, abs=1e-3)
    np.testing.assert_allclose(fit.shift_m, [3.0, -40.0, 1.5], atol=0.01)
    assert fit.position_rms_m < 0.01


def test_a_gap_in_a_log_costs_nothing() -> None:
    true = wander(5, np.arange(0.0, 120.0, 0.05))
    keeps = (true.t_s < 40.0) | (true.t_s > 55.0)
    ours = Motion(true.t_s[keeps], true.position_m[keeps], true.velocity_m_s[keeps], true.yaw_rad[keeps])
    clock, fit = match_motion(ours, Motion(true.t_s + 3.0, true.position_m, true.velocity_m_s, true.yaw_rad))
    assert clock.ours_s(np.array([60.0]))[0] == pytest.approx(57.0, abs=1e-3)
    assert fit.overlap_s == pytest.approx(105.0, abs=1.0)


def test_a_short_log_is_refused() -> None:
    ours = wander(1, np.arange(0.0, 100.0, 0.05))
    theirs = wander(1, np.arange(0.0, 12.0, 0.05))
    with pytest.raises(NoMatchError, match="the autopilot's log holds only 12 s of motion where 20 s are needed"):
        match_motion(ours, theirs)
    with pytest.raises(NoMatchError, match="less than 20 s"):
        check_motion(ours, theirs, ClockMap(0.0, 0.0, 0.0))


def test_a_short_overlap_is_refused() -> None:
    ours = wander(2, np.arange(0.0, 100.0, 0.05))
    theirs = wander(2, np.arange(88.0, 188.0, 0.05))
    with pytest.raises(NoMatchError):
        match_motion(ours, theirs)
    with pytest.raises(NoMatchError, match="less than 20 s"):
        check_motion(ours, theirs, ClockMap(0.0, 0.0, 0.0))


def test_a_hover_is_refused() -> None:
    t_s = np.arange(0.0, 100.0, 0.05)
    hover = seen(Motion(t_s, np.zeros((t_s.size, 3)), np.zeros((t_s.size, 3)), np.zeros(t_s.size)), 3)
    with pytest.raises(NoMatchError, match="hardly moves"):
        match_motion(hover, hover)
    with pytest.raises(NoMatchError, match="hardly moves"):
        check_motion(hover, hover, ClockMap(0.0, 0.0, 0.0))


def test_a_motion_that_repeats_itself_is_refused() -> None:
    """The same lap again and again fits at every lap."""
    t_s = np.arange(0.0, 200.0, 0.05)
    turn = 2 * np.pi / 20.0
    position_m = np.stack([10 * np.sin(turn * t_s), 10 * np.cos(turn * t_s), np.zeros(t_s.size)], axis=1)
    velocity_m_s = turn * np.stack([10 * np.cos(turn * t_s), -10 * np.sin(turn * t_s), np.zeros(t_s.size)], axis=1)
    lap = Motion(t_s, position_m, velocity_m_s, np.zeros(t_s.size))
    with pytest.raises(NoMatchError, match="repeats itself"):
        match_motion(lap, lap)
    lag_s, _ = check_motion(lap, lap, ClockMap(0.0, 0.0, 0.0))  # a known clock knows which lap
    assert lag_s == pytest.approx(0.0, abs=1e-3)


def test_a_wrong_boot_clock_is_refused() -> None:
    ours = wander(6, np.arange(0.0, 100.0, 0.05))
    with pytest.raises(NoMatchError, match="different flights"):
        check_motion(ours, ours, ClockMap(8.0, 0.0, 0.0))


@given(st.floats(-1e6, 1e6), st.floats(-1e-3, 1e-3), st.floats(0.0, 1e5), st.integers(0, 10**15))
def test_the_map_in_nanoseconds_is_that_in_seconds(
    offset_s: float, drift: float, reference_s: float, t_ns: int
) -> None:
    clock = ClockMap(offset_s, drift, reference_s)
    assert clock.ours_ns(t_ns) / 1e9 == pytest.approx(float(clock.ours_s(np.array(t_ns / 1e9))), abs=1e-6)
