"""Rays meet the surface where it is: on planes, ramps, houses, trees; nearer things hide farther ones."""

import math

import cv2
import numpy as np
import pytest

from drivers.camera.camera import Intrinsics
from sitl.pose import Pose
from sitl.render.depth import find_inverse_depth
from sitl.render.lens import CameraMount, camera_pose, lens_vector
from sitl.render.projection import project_point
from sitl.render.relief import Relief, height_at, highest_leaves, march
from sitl.render.renderer import Renderer
from sitl.world.height_grid import HeightGrid
from sitl.world.records import Building, Tree
from sitl.world.surface import surface_of
from tests.sitl.render.scenes import CAMERA, FLAWLESS, ahead, looking_down, scene, wire

HOUSE = Building((0.0, 0.0), 0.0, 12.0, 8.0, 4.0, 4.0, "flat")


def ramp(slope: float) -> HeightGrid:
    """Rising to the north, 0 at the origin."""
    norths = np.arange(-60.0, 61.0)
    return HeightGrid(-60.0, -60.0, 1.0, np.tile(slope * norths[:, None], (1, 121)))


@pytest.mark.parametrize("slope", [0.0, 0.15, -0.3])
def test_depths_on_a_ramp_are_those_of_a_plane(slope: float) -> None:
    """In closed form: a ray n, e, u meets u0 + z u = slope (n0 + z n) at z = (slope n0 - u0) / (u - slope n)."""
    pose = looking_down(-6.0, 5.0, 12.0)
    depth = Renderer(scene(terrain=ramp(slope)), CAMERA).depth(pose)
    v, u = np.mgrid[0:240, 0:320]
    x, y = (u - CAMERA.cx_px) / CAMERA.fx_px, (v - CAMERA.cy_px) / CAMERA.fy_px
    expected = (12.0 - slope * -6.0) / (1.0 + slope * -y)
    assert depth == pytest.approx(expected, rel=2e-3)
    assert np.all(np.isfinite(x))


def test_the_horizon_parts_sky_and_ground() -> None:
    depth = Renderer(scene(), CAMERA, ahead(math.radians(10.0))).depth(looking_down(0.0, 0.0, 15.0))
    horizon = CAMERA.cy_px - CAMERA.fy_px * math.tan(math.radians(10.0))
    assert np.all(np.isinf(depth[: math.floor(horizon)]))
    assert np.all(np.isfinite(depth[math.ceil(horizon) + 1 :]))
    below_rad = math.radians(10.0) + math.atan((200 - CAMERA.cy_px) / CAMERA.fy_px)
    along = 15.0 / math.sin(below_rad) * math.cos(math.atan((200 - CAMERA.cy_px) / CAMERA.fy_px))
    assert depth[200, 160] == pytest.approx(along, rel=1e-3)


def test_a_roof_is_as_near_as_it_is_high() -> None:
    depth = Renderer(scene(buildings=(HOUSE,)), CAMERA).depth(looking_down(0.0, 0.0, 20.0))
    assert depth[120, 160] == pytest.approx(16.0, abs=0.02)
    assert depth[120, 5] == pytest.approx(20.0, abs=0.02)
    # The roof's edge, 4 m east of the middle, is seen within a pixel or two.
    edge = np.flatnonzero(np.abs(np.diff(depth[120])) > 1.0)
    assert edge.max() == pytest.approx(CAMERA.cx_px + CAMERA.fx_px * 4.0 / 16.0, abs=2.5)


def test_heights_go_on_mirrored() -> None:
    up_m = np.random.default_rng(3).uniform(0.0, 2.0, (25, 25))
    grid = HeightGrid(-48.0, -48.0, 4.0, up_m)
    place = np.array([-48.0, -48.0, 4.0, 0.0, 2.0])
    for north_m, east_m in ((50.0, 3.0), (3.0, -51.5), (147.0, 60.0), (47.9, 47.9)):
        here = height_at(grid.up_m, place, north_m, east_m)
        assert here == pytest.approx(grid.at(north_m, east_m), abs=1e-5)
        assert height_at.py_func(grid.up_m, place, north_m, east_m) == pytest.approx(here, abs=1e-5)
    assert height_at(grid.up_m, place, 48.0 + 1.3, 7.0) == pytest.approx(
        height_at(grid.up_m, place, 48.0 - 1.3, 7.0), abs=1e-5
    )
    # What a ray sees has no step at the bounds either.
    depth = Renderer(scene(terrain=grid), CAMERA).depth(looking_down(48.0, 0.0, 15.0))
    assert np.abs(np.diff(depth, axis=0)).max() < 0.3


@pytest.mark.parametrize(
    ("up_m", "is_seen"), [(9.0, True), (1.5, False)], ids=["wire over the roof", "wire under the roof"]
)
def test_a_roof_hides_what_is_below_it_alone(up_m: float, is_seen: bool) -> None:
    pose = looking_down(0.0, 0.0, 20.0)
    with_wire, without = (
        Renderer(scene(*conductors, buildings=(HOUSE,)), CAMERA, optics=FLAWLESS).light(pose).copy()
        for conductors in ((wire(up_m),), ())
    )
    shown = np.abs(with_wire - without).sum(axis=2)
    over_roof, beyond = shown[100:140, 155:165], shown[2:20, 155:165]
    assert (over_roof.max() > 0.05) == is_seen
    assert beyond.max() > 0.05


def test_a_tree_hides_the_wire_behind_it_and_not_the_one_before() -> None:
    tree = Tree("broadleaf", 12.0, 0.0, 12.0, 4.0)
    pose = looking_down(-10.0, 0.0, 5.0)
    across = [np.array([[n, -40.0, -5.0], [n, 40.0, -5.0]]) for n in (2.0, 30.0)]
    shown = []
    for points in across:
        conductor = type(wire(5.0))(0.08, points)
        depth = Renderer(scene(conductor, trees=(tree,)), CAMERA, ahead()).depth(pose)
        bare = Renderer(scene(trees=(tree,)), CAMERA, ahead()).depth(pose)
        shown.append(np.flatnonzero(np.any(depth < bare, axis=0)))
    middle = range(150, 170)
    assert set(middle) <= set(shown[0])
    assert not set(middle) & set(shown[1])
    assert {5, 310} <= set(shown[1])


def test_depth_counts_the_line() -> None:
    depth = Renderer(scene(wire(10.0)), CAMERA).depth(looking_down(0.0, 0.0, 16.0))
    assert depth[120].min() == pytest.approx(6.0, abs=0.01)
    assert depth[120, 20] == pytest.approx(16.0, abs=0.01)


@pytest.mark.parametrize("lens", ["brown", "fisheye"])
def test_points_are_projected_as_opencv_does(lens: str) -> None:
    rng = np.random.default_rng(4)
    points = np.column_stack([rng.uniform(-4, 4, 40), rng.uniform(-3, 3, 40), rng.uniform(5, 12, 40)])
    matrix = np.array([[410.0, 0, 318.0], [0, 405.0, 243.0], [0, 0, 1]])
    nothing = np.zeros(3)
    if lens == "fisheye":
        camera = Intrinsics(640, 480, 410.0, 405.0, 318.0, 243.0, (-0.03, 0.006, -0.004, 0.001), "fisheye")
        expected, _ = cv2.fisheye.projectPoints(points[:, None], nothing, nothing, matrix, np.array(camera.distortion))
    else:
        camera = Intrinsics(640, 480, 410.0, 405.0, 318.0, 243.0, (-0.2, 0.05, 0.001, -0.002, 0.01))
        expected, _ = cv2.projectPoints(points, nothing, nothing, matrix, np.array(camera.distortion))
    for point, pixel in zip(points, expected.reshape(-1, 2), strict=True):
        assert project_point(*point, lens_vector(camera)) == pytest.approx(pixel, abs=1e-6)


def test_compiled_marching_equals_plain_python() -> None:
    surface = surface_of(scene(trees=(Tree("conifer", 6.0, 3.0, 9.0, 2.5),), buildings=(HOUSE,)))
    relief = Relief.of(surface)
    fixed = (relief.up_m, relief.highest_m, relief.levels, relief.leaf_m, relief.place, relief.far_m)
    rng = np.random.default_rng(5)
    hits = 0
    for _ in range(60):
        ray = rng.normal(size=3) + np.array([0.0, 0.0, -0.5])
        arguments = (*fixed, *rng.uniform(-10, 10, 2), 11.0, *ray, 0.0, math.inf, 0.01)
        compiled = march(*arguments)
        assert compiled == pytest.approx(march.py_func(*arguments), rel=1e-6, abs=1e-9)
        hits += compiled > 0.0
    assert 20 < hits < 60
    leaves = (surface.up_m, surface.cell_m, relief.leaf_m, *relief.levels[0, 1:])
    np.testing.assert_array_equal(highest_leaves(*leaves), highest_leaves.py_func(*leaves))
    n = relief.levels[0, 1] * relief.levels[0, 2]
    assert relief.highest_m[:n].max() == relief.highest_m[-relief.levels[-1, 1] * relief.levels[-1, 2] :].max()


def test_compiled_depths_equal_plain_python() -> None:
    surface = surface_of(scene(buildings=(HOUSE,)))
    relief = Relief.of(surface)
    v, u = np.mgrid[0:33, 0:49].astype(np.float32)
    rays = np.stack([(u - 24) / 20, (v - 16) / 20])
    centre, ned_from_camera = camera_pose(Pose(0, 3.0, 1.0, -14.0, (0.98, 0.1, -0.12, 0.1)), CameraMount())
    results = []
    for kernel in (find_inverse_depth, find_inverse_depth.py_func):
        inverse, marched = np.empty((33, 49), np.float32), np.zeros((33, 49), np.uint8)
        odd, is_edge = np.zeros((16, 24), np.float32), np.zeros((8, 12), np.uint8)
        kernel(
            inverse, is_edge, marched, odd, rays, relief.up_m, relief.highest_m, relief.levels, relief.leaf_m,
            relief.place, relief.far_m, relief.is_flat, centre, ned_from_camera, 20.0,
        )  # fmt: skip
        results.append((inverse, is_edge))
    np.testing.assert_allclose(results[0][0], results[1][0], rtol=1e-5)
    np.testing.assert_array_equal(results[0][1], results[1][1])
    assert results[0][0].max() > 1.05 / 14.0
