"""How long the simulated camera takes for a frame, and how truly it shows conductors thinner than a pixel.

Run it with `python -m benchmarks.render [--repeats N]`.
"""

import argparse
import itertools
import math
import statistics
import time

import cv2
import numpy as np

from sitl.pose import Pose
from sitl.render.coverage import add_strip
from sitl.render.lens import CameraMount, pinhole
from sitl.render.renderer import Renderer
from sitl.world.file import load_world, shipped_worlds


def looking_ahead(pitch_rad: float) -> CameraMount:
    """A camera that looks forward, `pitch_rad` below the horizon."""
    axis, right = np.array([math.cos(pitch_rad), 0.0, math.sin(pitch_rad)]), np.array([0.0, 1.0, 0.0])
    return CameraMount(body_from_camera=np.stack([right, np.cross(axis, right), axis], axis=1))


def measure_frames(repeats: int) -> None:
    """Print the median and the slowest tenth of the processor time per frame, over each world, down and ahead."""
    cv2.setNumThreads(1)
    print(f"{'640 x 480 colour, one core':<40}{'median':>9}{'p90':>9}")
    for name in shipped_worlds():
        world = load_world(name)
        axis = np.array(world.line.axis_ne_m)
        middle = len(axis) // 2 - 1
        here, along = axis[middle], axis[middle + 1] - axis[middle]
        yaw_rad = math.atan2(along[1], along[0])
        top_m = max(-support.top_ned_m[2] for support in world.supports)
        down = Renderer(world, pinhole(640, 480, math.radians(70.0)))
        ahead = Renderer(world, pinhole(640, 480, math.radians(70.0)), looking_ahead(math.radians(20.0)))
        for view, renderer, part, over_m in (
            ("down, 6 m over the line", down, 0.3, 6.0),
            ("down, 20 m over the line", down, 0.1, 20.0),
            ("ahead, 5 m over the line", ahead, -0.2, 5.0),
        ):
            place = here + part * along
            quaternion = (math.cos(yaw_rad / 2), 0.0, 0.0, math.sin(yaw_rad / 2))
            pose = Pose(0, float(place[0]), float(place[1]), -(top_m + over_m), quaternion)
            renderer.render(pose, 0)
            took_ms = []
            for seq in range(repeats):
                start = time.thread_time()
                renderer.render(pose, seq)
                took_ms.append(1e3 * (time.thread_time() - start))
            p90_ms = statistics.quantiles(took_ms, n=10)[-1]
            print(f"{name + ': ' + view:<40}{statistics.median(took_ms):>6.1f} ms{p90_ms:>6.1f} ms")


def measure_coverage() -> None:
    """Print shown coverage over true coverage, and its ripple along the conductor, over 90 angles."""
    print(f"\n{'conductor':<12}{'shown / true':>22}{'ripple':>10}")
    for width_px in (0.2, 0.4, 1.0, 3.0):
        ratios, ripples = [], []
        for angle_deg in np.arange(0.5, 180.0, 2.0):
            direction = np.array([math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))])
            ends = np.array([99.6, 100.2]) + np.linspace(-150.0, 150.0, 8)[:, None] * direction
            layer = np.zeros((2, 200, 200), dtype=np.float32)
            for start, end in itertools.pairwise(ends):
                add_strip(layer[0], layer[1], np.array([*start, width_px, *end, width_px]), np.eye(6)[0])
            across = layer[0].sum(axis=0 if abs(direction[0]) >= abs(direction[1]) else 1)[60:140]
            true = width_px / np.abs(direction).max()
            ratios.append(across.mean() / true)
            ripples.append(across.std() / true)
        print(f"{width_px:>6.1f} px   {min(ratios):>10.4f} to {max(ratios):.4f}{max(ripples):>10.2%}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=30, help="frames per view")
    measure_frames(parser.parse_args().repeats)
    measure_coverage()
