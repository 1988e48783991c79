"""Linework is laid over the ground in the right order, and only where nothing nearer stands."""

import numpy as np
import pytest

from sitl.render.coverage import add_strip
from sitl.render.lens import camera_pose
from sitl.render.linework import build_linework
from sitl.render.merge import DECAL, ROUND, SHADOW, arrange, merge_strips
from sitl.render.renderer import Renderer
from sitl.world.records import Conductor, Member, Support
from tests.sitl.render.scenes import CAMERA, FLAWLESS, ahead, looking_down, scene, wire

STRIP = np.array([2.0, 3.0, 2.5, 15.0, 9.0, 1.5, 0.1, 0.2])
FLAT = np.array([0.8, 0.0, 0.0, 0.0, 0.0, 0.0])


@pytest.mark.parametrize("kind", [ROUND, DECAL, SHADOW])
def test_compiled_merging_equals_plain_python(kind: int) -> None:
    rng = np.random.default_rng(4)
    light = rng.random((12, 20, 3), dtype=np.float32)
    inverse = rng.uniform(0.05, 0.2, (12, 20)).astype(np.float32)
    shine = rng.random((6, 4, 6), dtype=np.float32)
    results = []
    for kernel in (merge_strips, merge_strips.py_func):
        mine, nearest, layer = light.copy(), np.zeros((12, 20), np.float32), np.zeros((2, 12, 20), np.float32)
        for _ in range(2):  # twice the same strip: more than a pixel's worth
            add_strip(layer[0], layer[1], STRIP[:6].copy(), FLAT)
        kernel(
            mine, inverse, nearest, *layer, STRIP[None], np.array([0.2, 0.4, 0.6]), kind, 0.1, shine,
            np.array([0.5, 0.5, 0.5]), 0.001,
        )  # fmt: skip
        assert not layer.any()
        results.append((mine, nearest))
    np.testing.assert_allclose(results[0][0], results[1][0], rtol=1e-5)
    np.testing.assert_allclose(results[0][1], results[1][1], rtol=1e-5)
    assert np.any(results[0][0] != light)
    assert results[0][1].any() == (kind == ROUND)


def test_what_the_ground_hides_is_not_merged() -> None:
    shown = []
    for ground in (0.05, 0.5):
        light, layer = np.zeros((12, 20, 3), np.float32), np.zeros((2, 12, 20), np.float32)
        add_strip(layer[0], layer[1], STRIP[:6].copy(), FLAT)
        merge_strips(
            light, np.full((12, 20), ground, np.float32), np.empty((0, 0), np.float32), *layer, STRIP[None],
            np.ones(3), ROUND, 0.1, np.zeros((6, 4, 6), np.float32), np.zeros(3), 0.0,
        )  # fmt: skip
        shown.append(light.sum())
    assert shown[0] > 5.0
    assert shown[1] == 0.0


def test_what_is_far_comes_first_and_what_is_behind_not_at_all() -> None:
    above = Conductor(0.05, np.array([[-3.0, 0.0, -30.0], [3.0, 0.0, -30.0]]))
    lines = build_linework(scene(above, wire(14.0), wire(4.0)))
    centre, ned_from_camera = camera_pose(looking_down(0.0, 0.0, 20.0), Renderer(scene(), CAMERA).mount)
    reach = np.array([-0.8, 0.8, -0.6, 0.6])
    arguments = (
        lines.spans, lines.looks, lines.members, centre, np.ascontiguousarray(ned_from_camera.T), reach, CAMERA.fx_px
    )  # fmt: skip
    order = arrange(*arguments)
    np.testing.assert_array_equal(order, arrange.py_func(*arguments))
    kinds = lines.looks[order, 6]
    assert np.all(np.diff((kinds == SHADOW).astype(int)) <= 0)  # shadows first
    heights_m = -lines.looks[order, 9][kinds == ROUND]
    assert heights_m.tolist() == [4.0, 14.0]


def test_a_near_pole_hides_a_far_one() -> None:
    """One wooden, one of concrete, in a row: from either side the nearer one's colour is seen."""
    supports = tuple(
        Support(
            kind, (n, 0.0, 0.0), (n, 0.0, -12.0), 0.0, (Member((n, 0.0, 0.0), (n, 0.0, -12.0), 0.6, 0.6, material),)
        )
        for n, kind, material in ((10.0, "wood_pole", "wood"), (14.0, "concrete_pole", "concrete"))
    )
    world = scene()
    line = type(world.line)(world.line.axis_ne_m, supports, ())
    seen = []
    for pose in (looking_down(0.0, 0.0, 6.0), looking_down(24.0, 0.0, 6.0)):
        mount = ahead()
        if pose.north_m > 12.0:
            pose = type(pose)(0, pose.north_m, 0.0, pose.down_m, (0.0, 0.0, 0.0, 1.0))
        renderer = Renderer(scene(lines=(line,)), CAMERA, mount, optics=FLAWLESS)
        seen.append(renderer.light(pose)[118:122, 159:161].mean())
    assert seen[1] > 1.8 * seen[0]


def test_the_light_with_and_without_the_line() -> None:
    renderer = Renderer(scene(wire(8.0, diameter_m=0.2)), CAMERA)
    pose = looking_down(0.0, 0.0, 20.0)
    ground = renderer.ground_light(pose).copy()
    whole = ground.copy()
    renderer.add_line(whole, pose)
    np.testing.assert_array_equal(whole, renderer.light(pose))
    changed = np.any(whole != ground, axis=2)
    assert 0.01 < changed.mean() < 0.2
