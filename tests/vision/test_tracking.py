"""The line over time: jumps are withheld, what repeats itself is believed, and a line that is gone is said to be."""

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vision.records import LineEstimate, Track, wrap_line_angle_rad
from vision.tracking import LineTracker, TrackSettings, seen_along

DIAGONAL_PX = 800.0
PERIOD_NS = 33_000_000


def at(angle_deg: float, offset_px: float = 0.0, n_lines: int = 3, spacing_px: float | None = 70.0) -> LineEstimate:
    return LineEstimate(wrap_line_angle_rad(math.radians(angle_deg)), offset_px, n_lines, spacing_px, 0.9, 0)


def track(estimates: list[LineEstimate | None], period_ns: int = PERIOD_NS) -> list[tuple[Track, bool]]:
    """The track after each frame, and whether its estimate counted."""
    tracker = LineTracker(TrackSettings())
    answers = []
    for seq, estimate in enumerate(estimates):
        t_ns = seq * period_ns
        if estimate is not None:
            estimate = replace(estimate, t_capture_ns=t_ns)
        state, counted = tracker.update(estimate, t_ns, DIAGONAL_PX)
        assert counted is None or counted == estimate  # nothing is made up
        answers.append((state, counted is not None))
    return answers


SEARCHING, TRACKING = (Track.SEARCHING, False), (Track.TRACKING, True)
DOUBTFUL, LOST = (Track.DOUBTFUL, False), (Track.LOST, False)


def test_two_frames_that_agree_begin_a_track() -> None:
    assert track([None, at(10), at(11), at(12)]) == [SEARCHING, SEARCHING, TRACKING, TRACKING]


def test_one_frame_alone_never_counts() -> None:
    assert track([at(10), None, at(10), None]) == [SEARCHING] * 4
    assert track([at(10), at(70), at(-40, 200.0), at(10)]) == [SEARCHING] * 4


@pytest.mark.parametrize("jump", [at(40), at(10, 200.0), at(100)])
def test_a_jump_is_withheld_and_the_line_goes_on_where_it_was(jump: LineEstimate) -> None:
    assert track([at(10), at(10), jump, at(11)]) == [SEARCHING, TRACKING, DOUBTFUL, TRACKING]


WEAK = replace(at(10), presence=0.8)


def test_where_a_line_was_a_moment_ago_less_is_enough_to_go_on_with_it() -> None:
    assert track([at(10), at(10), WEAK, WEAK, at(11)]) == [SEARCHING, *[TRACKING] * 4]
    assert track([WEAK] * 5) == [SEARCHING] * 5
    assert track([at(10), at(10), replace(WEAK, presence=0.5)])[-1] == DOUBTFUL
    assert not any(counts for _, counts in track([at(10), at(10), *[replace(at(80), presence=0.9)] * 8])[2:])


def test_it_is_not_enough_for_ever() -> None:
    answers = track([at(10), at(10), *[WEAK] * 70])
    assert answers[20] == TRACKING
    assert answers[40] == DOUBTFUL
    assert answers[-1] == LOST


def test_a_jump_that_repeats_itself_is_believed() -> None:
    answers = track([at(10), at(10), *[at(80)] * 6])
    assert answers == [SEARCHING, TRACKING, *[DOUBTFUL] * 4, TRACKING, TRACKING]


def test_jumps_to_and_fro_are_never_believed() -> None:
    answers = track([at(0), at(0), *[at(60), at(-60)] * 10])
    assert answers[2:] == [DOUBTFUL] * 20


def test_a_line_that_is_gone_is_doubtful_then_lost_and_found_again() -> None:
    answers = track([at(0), at(0), *[None] * 40, at(5), at(5)])
    states = [state for state, _ in answers]
    assert states[2:32] == [Track.DOUBTFUL] * 30  # up to 1 s
    assert states[32:43] == [Track.LOST] * 11
    assert answers[43] == TRACKING


def test_a_line_that_is_lost_has_to_be_confirmed_anew() -> None:
    assert track([at(0), at(0), *[None] * 40, at(0), None, at(0)])[-3:] == [LOST, LOST, LOST]


@pytest.mark.parametrize("rate_deg_s", [-90.0, 90.0])
def test_a_brisk_turn_is_followed_across_the_wrap(rate_deg_s: float) -> None:
    """At +-90 degrees the angle wraps, and the offset changes its sign with the normal."""
    turn_deg = rate_deg_s * PERIOD_NS / 1e9
    estimates = []
    for seq in range(60):
        angle_deg = seq * turn_deg
        is_wrapped = math.cos(math.radians(angle_deg) - at(angle_deg).angle_rad) < 0
        estimates.append(at(angle_deg, -120.0 if is_wrapped else 120.0))
    assert len({estimate.offset_px for estimate in estimates}) == 2
    assert track(list(estimates))[1:] == [TRACKING] * 59


@pytest.mark.parametrize("rate_hz", [0.5, 1.0, 2.0, 3.2, 4.0])
def test_a_slow_camera_tracks_from_frame_to_frame(rate_hz: float) -> None:
    answers = track([at(angle_deg) for angle_deg in range(10)], round(1e9 / rate_hz))
    assert answers == [SEARCHING, *[TRACKING] * 9]


def test_after_a_gap_the_line_is_confirmed_anew() -> None:
    assert track([at(0), at(0), *[None] * 12, at(2), at(2)])[-2:] == [DOUBTFUL, TRACKING]
    assert track([at(0), at(0), *[None] * 5, at(2)])[-1] == TRACKING


def test_the_middle_may_move_when_conductors_come_into_view() -> None:
    partial, whole = at(0, 120.0, n_lines=2), at(0, 55.0, n_lines=4)
    assert track([partial, partial, whole, whole])[1:] == [TRACKING] * 3
    same = at(0, 55.0, n_lines=2)
    assert track([partial, partial, same])[-1] == DOUBTFUL


@given(st.floats(-math.pi / 2, math.pi / 2), st.floats(-300, 300), st.floats(-4, 4))
def test_a_line_seen_along_another_direction_is_the_same_line(angle: float, offset: float, along: float) -> None:
    seen = seen_along(LineEstimate(angle, offset, 1, None, 1.0, 0), along)
    assert abs(seen.angle_rad - along) <= math.pi / 2 + 1e-9
    # The foot of the normal through the image centre is the same point.
    assert seen.offset_px * math.cos(seen.angle_rad) == pytest.approx(offset * math.cos(angle), abs=1e-6)
    assert seen.offset_px * math.sin(seen.angle_rad) == pytest.approx(offset * math.sin(angle), abs=1e-6)
