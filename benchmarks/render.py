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
from sitl.render.lens import pinhole
from sitl.render.renderer import Renderer
from sitl.world.file import load_world

VIEWS = {
    "on the ground, 0.1 m": (0.0, 0.0, 0.1, 20.0, 0.0),
    "5 m": (0.0, 0.0, 5.0, 20.0, 0.0),
    "over the line, 12 m": (11.3, 4.1, 12.0, 110.0, 0.0),
    "over the line, 16 m": (11.3, 4.1, 16.0, 110.0, 0.0),
    "over the line, 16 m, tilted": (11.3, 4.1, 16.0, 80.0, -15.0),
    "over a pole, 14 m": (16.8, -10.6, 14.0, 110.0, 0.0),
    "25 m": (5.0, 10.0, 25.0, 0.0, 0.0),
}


def measure_frames(repeats: int) -> None:
    """Print the median and the slowest tenth of the processor time per frame, for each view."""
    cv2.setNumThreads(1)
    renderer = Renderer(load_world(), pinhole(640, 480, math.radians(70.0)))
    print(f"{'640 x 480 colour, one core':<32}{'median':>9}{'p90':>9}")
    for name, (north_m, east_m, height_m, yaw_deg, pitch_deg) in VIEWS.items():
        yaw, pitch = math.radians(yaw_deg) / 2, math.radians(pitch_deg) / 2
        quaternion = (
            math.cos(yaw) * math.cos(pitch),
            -math.sin(yaw) * math.sin(pitch),
            math.cos(yaw) * math.sin(pitch),
            math.sin(yaw) * math.cos(pitch),
        )
        pose = Pose(0, north_m, east_m, -height_m, quaternion)
        renderer.render(pose, 0)
        took_ms = []
        for seq in range(repeats):
            start = time.thread_time()
            renderer.render(pose, seq)
            took_ms.append(1e3 * (time.thread_time() - start))
        print(f"{name:<32}{statistics.median(took_ms):>6.1f} ms{statistics.quantiles(took_ms, n=10)[-1]:>6.1f} ms")


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
    parser.add_argument("--repeats", type=int, default=60, help="frames per view")
    measure_frames(parser.parse_args().repeats)
    measure_coverage()
