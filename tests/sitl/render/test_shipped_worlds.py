"""Every shipped world can be seen, from above and looking ahead."""

import math

import numpy as np
import pytest

from sitl.pose import Pose
from sitl.render.renderer import Renderer
from sitl.world.file import load_world, shipped_worlds
from tests.sitl.render.scenes import CAMERA, ahead


@pytest.mark.parametrize("name", shipped_worlds())
def test_a_shipped_world_is_seen(name: str) -> None:
    world = load_world(name)
    axis = np.array(world.line.axis_ne_m)
    place = axis[len(axis) // 2] + [1.0, 2.0]
    up_m = 8.0 + max(-support.top_ned_m[2] for support in world.supports)
    along = axis[-1] - axis[0]
    yaw_rad = math.atan2(along[1], along[0])
    pose = Pose(0, *place, -up_m, (math.cos(yaw_rad / 2), 0.0, 0.0, math.sin(yaw_rad / 2)))
    for mount in (None, ahead(math.radians(20.0))):
        renderer = Renderer(world, CAMERA, mount)
        image = renderer.render(pose, 1)
        assert image.shape == (240, 320, 3)
        assert image.std() > 8.0
        assert sum(len(pieces) for pieces in renderer.project(pose)) > 10
        ground = renderer.ground_light(pose).copy()
        assert np.mean(np.any(renderer.light(pose) != ground, axis=2)) > 0.005
        depth = renderer.depth(pose)
        assert np.nanmin(depth) > 1.0
        assert np.isfinite(depth[-1]).all()
    assert np.isinf(depth[0]).any()
    np.testing.assert_array_equal(image, Renderer(world, CAMERA, mount).render(pose, 1))
