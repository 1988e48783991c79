"""Motion smears and shears what the camera sees by as much as geometry says; the fast way shows what the slow does."""

import dataclasses
import math

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from sitl.control import quaternion_of
from sitl.pose import Pose
from sitl.render.lens import CameraMount, pinhole, ray_table
from sitl.render.motion import Motion, Shutter, light_by_sub_frames, motion_between
from sitl.render.photographer import Photographer, nearest_wire_m
from sitl.render.renderer import Renderer
from sitl.render.smear import find_flow, grid_places, spread_flow
from sitl.world.file import load_world
from sitl.world.records import Conductor, World

CAMERA = pinhole(320, 240, math.radians(80.0))
GLOBAL = Shutter()
SPEED_M_S = 8.0
EXPOSURE_S = 0.02


def bare_world(*wires: Conductor) -> World:
    """The world with these wires and no supports."""
    world = load_world()
    return dataclasses.replace(world, lines=(dataclasses.replace(world.line, supports=(), conductors=wires),))


def wire_along_east(height_m: float, diameter_m: float = 0.03) -> Conductor:
    return Conductor(diameter_m, np.array([[0.0, -60.0, -height_m], [0.0, 60.0, -height_m]]))


def wire_along_north(height_m: float) -> Conductor:
    return Conductor(0.06, np.array([[-60.0, 0.0, -height_m], [60.0, 0.0, -height_m]]))


class OverBlack(Renderer):
    """Sees the wires alone, over a black ground."""

    def ground_light(self, pose: Pose) -> NDArray[np.float32]:
        light = super().ground_light(pose)
        light[:] = 0.0
        return light


def width_px(profile: NDArray[np.float64]) -> float:
    """The width of an even band: that of a box has a standard deviation of 1 / sqrt(12) of it."""
    places = np.arange(len(profile))
    mean = (places * profile).sum() / profile.sum()
    return math.sqrt(12.0 * ((places - mean) ** 2 * profile).sum() / profile.sum())


@pytest.mark.parametrize("depth_m", [6.0, 16.0])
@pytest.mark.parametrize("is_fast", [True, False])
def test_a_wire_is_smeared_by_its_own_depth(depth_m: float, is_fast: bool) -> None:
    """Nearer things smear more, by f v t / z. The wire 16 m below lies where the ground would."""
    height_m = 16.5
    renderer = OverBlack(bare_world(wire_along_east(height_m - depth_m)), CAMERA)
    squares = []
    for shift_px in (0.1, 0.35, 0.6, 0.85):  # how a smear falls on the rows must not count
        pose = Pose(0, shift_px * depth_m / CAMERA.fy_px, 0.0, -height_m, quaternion_of(0, 0, 0))
        motion = Motion(pose, (SPEED_M_S, 0.0, 0.0))
        if is_fast:
            light = Photographer(renderer).gather(motion, EXPOSURE_S)
        else:
            light = light_by_sub_frames(renderer.light, motion, GLOBAL, EXPOSURE_S, 24, 240)
        squares.append(width_px(light[:, 150:170].mean(axis=(1, 2))) ** 2)
    still_px = CAMERA.fy_px * 0.03 / depth_m
    expected_px = CAMERA.fy_px * SPEED_M_S * EXPOSURE_S / depth_m
    assert math.sqrt(np.mean(squares)) == pytest.approx(
        math.hypot(expected_px, still_px, 1.0), rel=0.05
    )  # 1 px: a pixel's own width


def test_the_ground_is_smeared_by_its_depth() -> None:
    """Along the flight, the ground's own variation is averaged over f v t / z; across it, nothing changes."""
    height_m = 16.0
    motion = Motion(Pose(0, 0.0, 0.0, -height_m, quaternion_of(0, 0, 0)), (2.0 * SPEED_M_S, 0.0, 0.0))
    length_px = CAMERA.fy_px * 2.0 * SPEED_M_S * EXPOSURE_S / height_m
    renderer = Renderer(bare_world(), CAMERA)
    still = renderer.light(motion.pose)[:, :, 1].copy()
    moved = Photographer(renderer).gather(motion, EXPOSURE_S)[:, :, 1]
    # The length whose box explains the smeared picture best.
    lengths = np.linspace(0.7, 1.3, 25) * length_px
    errors = [np.abs(_boxed(still, length)[30:-30] - moved[30:-30]).mean() for length in lengths]
    assert lengths[int(np.argmin(errors))] == pytest.approx(length_px, rel=0.05)


def _boxed(image: NDArray[np.float32], length_px: float, n: int = 64) -> NDArray[np.float64]:
    """The mean over a vertical way, by linear interpolation between rows."""
    rows = np.arange(image.shape[0], dtype=float)
    total = np.zeros(image.shape)
    for shift in length_px * ((np.arange(n) + 0.5) / n - 0.5):
        place = np.clip(rows + shift, 0, len(rows) - 1.001)
        low = place.astype(int)
        total += image[low] + (place - low)[:, None] * (image[low + 1] - image[low])
    return total / n


@pytest.mark.parametrize("is_fast", [True, False])
def test_a_rolling_shutter_shears_a_line_ahead(is_fast: bool) -> None:
    """A line straight ahead, seen while flying right, leans by f v readout / z over the picture's height."""
    shutter = Shutter(exposure_s=0.0005, readout_s=0.02)
    motion = Motion(Pose(0, 0.0, 0.0, -16.0, quaternion_of(0, 0, 0)), (0.0, 5.0, 0.0))
    renderer = OverBlack(bare_world(wire_along_north(10.0)), CAMERA)
    if is_fast:
        light = Photographer(renderer, shutter).gather(motion, 0.0005)
    else:
        light = light_by_sub_frames(renderer.light, motion, shutter, 0.0005, 1, 8)
    seen = light.sum(axis=2)
    centres = (seen * np.arange(320)).sum(axis=1) / seen.sum(axis=1)
    slope, _ = np.polyfit(np.arange(240), centres, 1)
    # The vehicle flies right, so later rows see the line further left.
    assert slope * 239 == pytest.approx(-CAMERA.fx_px * 5.0 * 0.02 / 6.0, rel=0.05)


@pytest.mark.parametrize("readout_s", [0.0, 0.02])
def test_the_fast_way_shows_what_sub_frames_show(readout_s: float) -> None:
    """Over the real line, tilted, turning and climbing: the difference is far below what motion changes."""
    shutter = Shutter(readout_s=readout_s)
    pose = Pose(0, 11.3, 4.1, -16.0, quaternion_of(0.1, -0.15, math.radians(100.0)))
    motion = Motion(pose, (6.0, 8.0, -2.0), (0.2, -0.3, 0.4))
    renderer = Renderer(load_world(), CAMERA)
    still = renderer.light(pose).copy()
    slow = light_by_sub_frames(renderer.light, motion, shutter, 2.0 * EXPOSURE_S, 24, 8)
    fast = Photographer(renderer, shutter).gather(motion, 2.0 * EXPOSURE_S)
    # The ground's finest grain is drawn by dithering, which no two ways of averaging share.
    still, slow, fast = (cv2.GaussianBlur(light, (0, 0), 2.0)[12:-12, 12:-12] for light in (still, slow, fast))
    assert np.abs(fast - slow).mean() < 0.5 * np.abs(still - slow).mean()


def test_a_camera_that_hardly_moves_is_sharp() -> None:
    motion = Motion(Pose(0, 11.3, 4.1, -16.0, quaternion_of(0, 0, 1.9)), (0.0, 5.0, 0.0))
    renderer = Renderer(load_world(), CAMERA)
    sharp = renderer.light(motion.pose).copy()
    np.testing.assert_array_equal(Photographer(renderer).gather(motion, 0.0002), sharp)
    assert np.any(Photographer(renderer).gather(motion, 0.008) != sharp)


small = st.floats(-3.0, 3.0)


@given(
    velocity=st.tuples(small, small, small),
    rates=st.tuples(small, small, small),
    dt_s=st.floats(0.002, 0.1),
)
def test_two_poses_tell_the_motion_between_them(
    velocity: tuple[float, float, float], rates: tuple[float, float, float], dt_s: float
) -> None:
    motion = Motion(Pose(10**9, 1.0, 2.0, -3.0, quaternion_of(0.2, -0.1, 2.5)), velocity, rates)
    dt_s = round(dt_s, 6)
    found = motion_between(motion.pose_at(-dt_s), motion.pose)
    assert found.velocity_ned_m_s == pytest.approx(velocity, abs=1e-5)
    assert found.rates_frd_rad_s == pytest.approx(rates, abs=1e-5)


def test_poses_that_are_no_step_of_a_flight_tell_no_motion() -> None:
    now = Pose(10**9, 1.0, 2.0, -3.0, quaternion_of(0, 0, 0))
    for before in (None, now, dataclasses.replace(now, t_ns=0), dataclasses.replace(now, t_ns=2 * 10**9)):
        assert motion_between(before, now).is_still


@pytest.mark.parametrize("arguments", [(0.0, 0.0), (-1.0, 0.0), (None, -0.1), (math.nan, 0.0)])
def test_an_impossible_shutter_is_refused(arguments: tuple[float | None, float]) -> None:
    with pytest.raises(ValueError, match="shutter"):
        Shutter(*arguments)


def test_compiled_smearing_equals_plain_python() -> None:
    camera = pinhole(40, 30, 1.3)
    motion = Motion(Pose(0, 0.0, 0.0, -5.0, quaternion_of(0.1, 0.2, 0.3)), (6.0, -3.0, 1.0), (1.0, 0.5, -2.0))
    depth_m = np.full((len(grid_places(30)), len(grid_places(40))), 5.0, dtype=np.float32)
    flow = find_flow(motion, Shutter(readout_s=0.02), 0.02, CameraMount(), camera, ray_table(camera), depth_m)
    assert np.abs(flow).max() > 1.0
    results = []
    for kernel in (spread_flow, spread_flow.py_func):
        maps = np.full((2, 30, 40), np.nan, dtype=np.float32)
        kernel(flow, 0.3, grid_places(30), grid_places(40), maps[0], maps[1])
        results.append(maps)
    assert np.isfinite(results[0]).all()
    np.testing.assert_allclose(results[0], results[1], atol=1e-4)


def test_the_nearest_wire_is_found_between_its_points_too() -> None:
    rng = np.random.default_rng(2)
    wires, place = rng.normal(0.0, 5.0, (7, 6)), np.array([1.0, -2.0, 0.5])
    parts = np.linspace(0.0, 1.0, 4001)[:, None]
    sampled = min(float(np.linalg.norm(w[:3] + parts * (w[3:] - w[:3]) - place, axis=1).min()) for w in wires)
    assert nearest_wire_m(wires, place) == pytest.approx(sampled, rel=1e-3)
    assert nearest_wire_m(wires, place) == pytest.approx(nearest_wire_m.py_func(wires, place))
    assert nearest_wire_m(np.empty((0, 6)), place) == math.inf
