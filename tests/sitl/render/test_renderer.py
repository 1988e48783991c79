"""The renderer shows the world where it is, with the coverage it has, and the same every time."""

import dataclasses
import functools
import math

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from drivers.camera.camera import Intrinsics
from sitl.pose import Pose
from sitl.render.lens import CameraMount, camera_pose, lens_vector, pinhole, ray_table
from sitl.render.linework import build_linework, cast_shadow
from sitl.render.map import render_map
from sitl.render.merge import DECAL, ROUND, SHADOW
from sitl.render.projection import project_point
from sitl.render.renderer import Renderer
from sitl.render.sensor import Optics, develop, fall_off, noise_table, tone_curve
from sitl.world.file import load_world
from sitl.world.height_grid import HeightGrid
from sitl.world.records import Conductor, Strip, World

FLAWLESS = Optics(blur_px=0.0, corner_light=1.0, read_noise=0.0, shot_noise=0.0)
CAMERA = pinhole(320, 240, math.radians(70.0))
BENT = dataclasses.replace(CAMERA, distortion=(-0.22, 0.06, 0.001, -0.0005, 0.0))
FISHEYE = Intrinsics(320, 240, 160.0, 161.0, 158.0, 121.0, (-0.03, 0.006, -0.004, 0.001), "fisheye")


@functools.cache
def world() -> World:
    return load_world()


def turned(yaw_rad: float, pitch_rad: float = 0.0, roll_rad: float = 0.0) -> tuple[float, float, float, float]:
    """The quaternion of yaw, then pitch, then roll."""
    cy, sy = math.cos(yaw_rad / 2), math.sin(yaw_rad / 2)
    cp, sp = math.cos(pitch_rad / 2), math.sin(pitch_rad / 2)
    cr, sr = math.cos(roll_rad / 2), math.sin(roll_rad / 2)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


def over_the_line(height_m: float, heading_deg: float = 110.0, pitch_rad: float = 0.0, roll_rad: float = 0.0) -> Pose:
    return Pose(0, 11.276, 4.104, -height_m, turned(math.radians(heading_deg), pitch_rad, roll_rad))


def linear(image: NDArray[np.uint8]) -> NDArray[np.float64]:
    """The inverse of the sRGB transfer function."""
    v = image.astype(np.float64) / 255.0
    return np.where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4)


def dim(scene: World) -> World:
    """The same in less light, so that nothing reaches white and light can be summed."""
    return dimmed(scene, 0.4)


def dimmed(scene: World, level: float) -> World:
    light = scene.light
    return dataclasses.replace(
        scene, light=dataclasses.replace(light, direct=level * light.direct, sky=level * light.sky)
    )


def only(*conductors: Conductor) -> World:
    """The world with these conductors and no supports."""
    line = dataclasses.replace(world().line, supports=(), conductors=conductors)
    return dataclasses.replace(world(), lines=(line,))


def one_wire(diameter_m: float) -> World:
    """The world with one level wire, 10 m up over the vehicle's start, and no poles."""
    points = np.array([[0.0, -200.0, -10.0], [0.0, 200.0, -10.0]])
    return only(Conductor(diameter_m, points))


NO_WIRE = only()


@pytest.mark.parametrize("heading_deg", [0.0, 7.0, 31.0, 45.0, 68.0, 90.0])
def test_a_conductor_thinner_than_a_pixel_adds_its_true_light(heading_deg: float) -> None:
    """0.4 px of wire add a tenth of the light that 4 px add, at every angle."""
    height_m = 16.0
    diameter_m = 0.4 * (height_m - 10.0) / CAMERA.fx_px
    pose = Pose(0, 0.05, 0.0, -height_m, turned(math.radians(heading_deg)))
    none, thin, thick = (
        linear(Renderer(dim(scene), CAMERA, optics=FLAWLESS).render(pose, 0)).sum()
        for scene in (NO_WIRE, one_wire(diameter_m), one_wire(10.0 * diameter_m))
    )
    assert (thin - none) / (thick - none) == pytest.approx(0.1, rel=0.03)


def test_the_line_is_seen_where_it_is_projected() -> None:
    """Bright ridges run along the projected conductors, also through a bent lens and a tilted camera."""
    for camera in (CAMERA, BENT, FISHEYE):
        renderer = Renderer(world(), camera, optics=FLAWLESS)
        pose = over_the_line(15.0, 75.0, math.radians(-9.0), math.radians(7.0))
        image = linear(renderer.render(pose, 0)).mean(axis=2).astype(np.float32)
        for pieces in renderer.project(pose):
            assert len(pieces) > 5
            middles = (pieces[:, :2] + pieces[:, 2:]) / 2
            along = pieces[:, 2:] - pieces[:, :2]
            normal = np.stack([-along[:, 1], along[:, 0]], axis=-1) / np.linalg.norm(along, axis=1)[:, None]
            inside = np.all((middles > 8) & (middles < [310, 230]), axis=1)
            profile = np.stack(
                [
                    cv2.remap(image, *(middles + shift * normal).astype(np.float32).T, cv2.INTER_LINEAR).ravel()[inside]
                    for shift in range(-4, 5)
                ]
            )
            assert np.argmax(profile.mean(axis=1)) == 4


def test_the_image_hangs_together_with_the_vehicle() -> None:
    """Up in the image is ahead, right is right; the nose down looks back, the right side down looks left."""
    renderer = Renderer(one_wire(0.05), CAMERA)

    def seen_at(pose: Pose) -> NDArray[np.float64]:
        (pieces,) = renderer.project(pose)
        return np.array([pieces[:, [0, 2]].mean(), pieces[:, [1, 3]].mean()])

    ahead = seen_at(Pose(0, -1.0, 0.0, -16.0, turned(0.0)))  # the wire is north of a vehicle that looks north
    assert ahead == pytest.approx([159.5, 119.5 - CAMERA.fy_px / 6.0])
    right = seen_at(Pose(0, -1.0, 0.0, -16.0, turned(-math.pi / 2)))  # and right of one that looks west
    assert right == pytest.approx([159.5 + CAMERA.fx_px / 6.0, 119.5])
    # Nose up by 0.1 rad turns the camera's axis forward, so what is below moves back in the image.
    pitched = seen_at(Pose(0, 0.0, 0.0, -16.0, turned(0.0, 0.1)))
    assert pitched[1] == pytest.approx(119.5 + CAMERA.fy_px * math.tan(0.1))
    # Right side down turns the camera's axis to the left, so what is below moves right in the image.
    rolled = seen_at(Pose(0, 0.0, 0.0, -16.0, turned(-math.pi / 2, 0.0, 0.1)))
    assert rolled[0] == pytest.approx(159.5 + CAMERA.fx_px * math.tan(0.1))


@given(
    north_m=st.floats(-30, 30), yaw_rad=st.floats(-3, 3), pitch_rad=st.floats(-0.4, 0.4), roll_rad=st.floats(-0.4, 0.4)
)
@settings(max_examples=40)
@pytest.mark.parametrize("camera", [BENT, FISHEYE], ids=["bent", "fisheye"])
def test_rays_and_projection_are_inverse(
    camera: Intrinsics, north_m: float, yaw_rad: float, pitch_rad: float, roll_rad: float
) -> None:
    rays = ray_table(camera)
    centre, ned_from_camera = camera_pose(
        Pose(0, north_m, 2.0, -14.0, turned(yaw_rad, pitch_rad, roll_rad)), CameraMount((0.1, 0.0, 0.05))
    )
    for v, u in ((0, 0), (120, 160), (239, 319), (30, 300)):
        ray = ned_from_camera @ np.array([*rays[:, v, u].astype(float), 1.0])
        point = centre + 7.0 * ray
        x, y, z = ned_from_camera.T @ (point - centre)
        assert project_point(x, y, z, lens_vector(camera)) == pytest.approx((u, v), abs=2e-3)


@pytest.mark.parametrize(
    "pose",
    [
        Pose(0, 0.0, 0.0, -0.1, turned(0.35)),
        Pose(0, 0.0, 0.0, 0.0, turned(0.35)),
        over_the_line(10.0),
        over_the_line(9.6),
        over_the_line(15.0, 30.0, 1.2, 0.8),
        Pose(0, 16.748, -10.930, -10.001, turned(0.3)),
        Pose(0, 0.0, 0.0, -400.0, turned(0.0, 0.6)),
    ],
)
def test_any_pose_gives_an_image_with_something_in_it(pose: Pose) -> None:
    image = Renderer(world(), BENT).render(pose, 3)
    assert image.shape == (240, 320, 3)
    assert image.dtype == np.uint8
    assert 20.0 < image.mean() < 240.0
    assert image.std() > 3.0


def test_the_same_pose_and_seed_give_the_same_image() -> None:
    pose = over_the_line(16.0)
    one, other = Renderer(world(), CAMERA, seed=5), Renderer(world(), CAMERA, seed=5)
    first = one.render(pose, 7)
    one.render(over_the_line(3.0), 8)
    np.testing.assert_array_equal(first, one.render(pose, 7))
    np.testing.assert_array_equal(first, other.render(pose, 7))
    assert np.any(first != one.render(pose, 8))
    assert np.any(first != Renderer(world(), CAMERA, seed=6).render(pose, 7))


def test_less_light_makes_a_darker_image() -> None:
    dusk = dimmed(world(), 0.2)
    pose = over_the_line(16.0)
    day, evening = (linear(Renderer(w, CAMERA, optics=FLAWLESS).render(pose, 0)).mean() for w in (world(), dusk))
    assert evening / day == pytest.approx(0.2, abs=0.01)


def test_the_ground_has_contrast_at_every_height() -> None:
    for height_m in (0.5, 5.0, 12.0, 25.0):
        image = Renderer(NO_WIRE, CAMERA, optics=FLAWLESS).render(over_the_line(height_m), 0)
        assert cv2.cvtColor(image, cv2.COLOR_BGR2GRAY).std() > 6.0


def test_a_shadow_takes_away_as_much_sun_as_its_wire_stops() -> None:
    sun_ned = np.array([0.0, 0.6, -0.8])
    wire = np.array([[3.0, 0.0, -8.0, 7.0, 0.0, -8.0, 0.014, 0.014, 1.0]])
    (shadow,) = cast_shadow(wire, sun_ned, HeightGrid.flat(-50.0, -50.0, 50.0, 50.0))
    assert shadow[:6] == pytest.approx([3.0, -6.0, 0.0, 7.0, -6.0, 0.0])
    assert shadow[6] == pytest.approx(10.0 * math.radians(0.53))
    assert shadow[6] * shadow[8] == pytest.approx(0.014)


def test_a_shadow_falls_on_the_slope_that_is_there() -> None:
    """The ground rises by 0.1 to the west, where the shadow falls: it meets the sun's ray sooner than a level one."""
    sun_ned = np.array([0.0, 0.6, -0.8])
    up_m = np.tile(-0.1 * np.arange(-50.0, 51.0), (101, 1))
    wire = np.array([[0.0, 0.0, -8.0, 4.0, 0.0, -8.0, 0.014, 0.014, 1.0]])
    (shadow,) = cast_shadow(wire, sun_ned, HeightGrid(-50.0, -50.0, 1.0, up_m))
    away_m = 8.0 / (0.8 / 0.6 + 0.1)
    assert shadow[[1, 4]] == pytest.approx([-away_m, -away_m], abs=1e-3)
    assert shadow[[2, 5]] == pytest.approx([-0.1 * away_m, -0.1 * away_m], abs=1e-3)


def test_every_object_has_its_members() -> None:
    lines = build_linework(world())
    kinds = lines.looks[:, 6].astype(int)
    assert set(kinds) == {ROUND, SHADOW}
    assert lines.spans[-1, 1] == len(lines.members)
    assert np.all(lines.spans[1:, 0] == lines.spans[:-1, 1])
    uprights = [m for s in world().supports for m in s.members if m.start_ned_m[:2] == m.end_ned_m[:2]]
    assert len(lines.discs) == len([m for m in uprights if m.end_ned_m[2] < m.start_ned_m[2]])
    for (first, last, *_), look in zip(lines.spans, lines.looks, strict=True):
        ends = lines.members[first:last, :6].reshape(-1, 3)
        assert np.all(np.linalg.norm(ends - look[7:10], axis=1) <= look[10] + 1e-9)
    fine = sum(last - first for (first, last, *_), look in zip(lines.spans, lines.looks, strict=True) if look[14] < 1e3)
    assert fine == sum(len(c.points_ned_m) - 1 for c in world().conductors)


def test_a_road_has_lines_and_a_railway_rails() -> None:
    points = ((-40.0, -40.0), (0.0, 0.0), (40.0, 0.0))
    strips = (Strip("road", points, 6.0), Strip("railway", points, 4.0), Strip("fence", points, 0.1))
    lines = build_linework(dataclasses.replace(NO_WIRE, strips=strips))
    decals = np.concatenate(
        [lines.members[a:b] for (a, b, *_), k in zip(lines.spans, lines.looks[:, 6], strict=True) if k == DECAL]
    )
    away_m = np.abs(decals[decals[:, 0] > 5.0][:, 1])
    assert set(np.round(away_m, 2)) == {0.0, 2.78}
    rails = lines.members[(lines.members[:, 6] == 0.075) & (lines.members[:, 8] == 1.0)]
    north = rails[(rails[:, 0] > 5.0) & (rails[:, 2] < -0.1)]
    assert set(np.round(np.abs(north[:, 1]), 4)) == {0.7175}


def test_a_map_shows_the_line_where_it_runs() -> None:
    bounds_ne_m = (-20.0, -10.0, 30.0, 40.0)
    with_line = linear(render_map(world(), bounds_ne_m, 4.0)).mean(axis=2)
    without = linear(render_map(NO_WIRE, bounds_ne_m, 4.0)).mean(axis=2)
    assert with_line.shape == (200, 200)
    brighter = with_line - without
    for conductor in world().conductors:
        north_m, east_m, _ = conductor.points_ned_m.T
        inside = (abs(north_m - 5) < 24) & (abs(east_m - 15) < 24)
        columns = np.round((east_m[inside] + 10.0) * 4.0 - 0.5).astype(int)
        rows = np.round((30.0 - north_m[inside]) * 4.0 - 0.5).astype(int)
        assert brighter[rows, columns].mean() > 0.2
    assert np.median(np.abs(brighter)) < 1e-3


def test_a_map_without_an_area_is_refused() -> None:
    with pytest.raises(ValueError, match="no picture"):
        render_map(world(), (0.0, 0.0, 0.0, 10.0), 4.0)


def test_a_mount_must_be_a_rotation() -> None:
    with pytest.raises(ValueError, match="rotation"):
        CameraMount(body_from_camera=np.ones((3, 3)))


@pytest.mark.parametrize("arguments", [(0, 480, 1.0), (640, 480, 0.0), (640, 480, math.pi)])
def test_an_impossible_pinhole_is_refused(arguments: tuple[int, int, float]) -> None:
    with pytest.raises(ValueError, match="not"):
        pinhole(*arguments)


def test_compiled_developing_equals_plain_python() -> None:
    light = np.random.default_rng(5).random((9, 30), dtype=np.float32)
    results = []
    for kernel in (develop, develop.py_func):
        image = np.empty((9, 30), dtype=np.uint8)
        kernel(
            light, fall_off(10, 9, 0.7), 0.9, 0.003, 0.02, noise_table(1), np.arange(9) * 11, tone_curve(), image
        )  # fmt: skip
        results.append(image.astype(int))
    assert np.abs(results[0] - results[1]).max() <= 1
