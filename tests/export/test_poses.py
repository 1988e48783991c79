"""Poses between the states, and the rotations that follow from them."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.clock import NS_PER_S
from mission.export.errors import ExportError
from mission.export.poses import ENU_FROM_NED, Floats, Track, heading_deg, inverse, product, rotated
from mission.eyes import StateHistory
from mission.log.reader import Flight

angles = st.floats(-math.pi, math.pi)


def rotation_matrix(roll_rad: float, pitch_rad: float, yaw_rad: float) -> Floats:
    """ned_from_frd by three turns, one after the other."""
    (cr, cp, cy), (sr, sp, sy) = np.cos([roll_rad, pitch_rad, yaw_rad]), np.sin([roll_rad, pitch_rad, yaw_rad])
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    about_z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    return np.asarray(about_z @ about_y @ about_x)


def test_poses_are_those_that_the_flight_worked_with(flight: Flight) -> None:
    track = Track(flight.states)
    history = StateHistory(span_s=1e6)
    for state in flight.states:
        history.add(state)
    times_ns = [(a.t_ns + 2 * b.t_ns) // 3 for a, b in pairwise(flight.states)] + [
        state.t_ns for state in flight.states
    ]
    poses = track.at(times_ns)
    assert poses.is_known.all()
    for k in range(0, len(times_ns), 7):
        state = history.at(times_ns[k])
        assert state is not None
        np.testing.assert_allclose(poses.ned_m[k], (state.north_m, state.east_m, state.down_m), atol=1e-9)
        np.testing.assert_allclose(np.cos(poses.attitude_rad[k, 2] - state.yaw_rad), 1.0, atol=1e-12)


def test_yaw_goes_the_short_way_round(flight: Flight) -> None:
    first, second = flight.states[:2]
    track = Track([replace(first, yaw_rad=3.1), replace(second, yaw_rad=-3.1)])
    assert math.cos(track.at([(first.t_ns + second.t_ns) // 2]).attitude_rad[0, 2]) == pytest.approx(-1.0)


def test_a_pose_far_from_any_state_is_not_known(flight: Flight) -> None:
    first = flight.states[0]
    t_ns = first.t_ns
    track = Track([first, first, replace(first, t_ns=t_ns + 2 * NS_PER_S)])
    asked_s = [-0.3, -0.2, 0.0, 0.2, 1.0, 1.9, 2.0, 2.2, 2.3]
    poses = track.at([t_ns + round(s * NS_PER_S) for s in asked_s])
    assert poses.is_known.tolist() == [False, True, True, True, False, True, True, True, False]


def test_without_states_there_is_no_track() -> None:
    with pytest.raises(ExportError, match="no state"):
        Track(())


@given(roll=angles, pitch=angles, yaw=angles)
def test_attitudes_turn_as_their_three_turns_do(flight: Flight, roll: float, pitch: float, yaw: float) -> None:
    state = replace(flight.states[0], roll_rad=roll, pitch_rad=pitch, yaw_rad=yaw)
    ned_from_frd = Track([state]).at([state.t_ns]).ned_from_frd
    np.testing.assert_allclose(rotated(ned_from_frd[0], np.eye(3)).T, rotation_matrix(roll, pitch, yaw), atol=1e-12)
    np.testing.assert_allclose(product(ned_from_frd, inverse(ned_from_frd)), [[1, 0, 0, 0]], atol=1e-12)


def test_enu_is_east_north_up() -> None:
    np.testing.assert_allclose(rotated(ENU_FROM_NED, np.array([[1.0, 2.0, 3.0]])), [[2.0, 1.0, -3.0]], atol=1e-12)


@pytest.mark.parametrize(("yaw_deg", "expected"), [(0.0, 0.0), (-90.0, 270.0), (179.0, 179.0), (-0.001, 0.0)])
def test_headings_are_a_compass(yaw_deg: float, expected: float) -> None:
    assert heading_deg(math.radians(yaw_deg)) == pytest.approx(expected)
