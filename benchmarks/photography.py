"""What exposure, motion, lens and sensor cost beside the rendering, in processor time of one core.

Run it with `python -m benchmarks.photography [--repeats N]`.
"""

import argparse
import math
import statistics
import time
from collections.abc import Callable

import cv2
import numpy as np

from sitl.control import quaternion_of
from sitl.pose import Pose
from sitl.render.exposure import ExposureMeter
from sitl.render.glare import sample
from sitl.render.lens import pinhole
from sitl.render.motion import Motion, Shutter
from sitl.render.photographer import Photographer
from sitl.render.renderer import Renderer
from sitl.world.file import load_world

POSE = Pose(0, 11.3, 4.1, -16.0, quaternion_of(0.05, -0.1, math.radians(110.0)))
FLYING = Motion(POSE, (-1.0, 3.5, 0.0), (0.1, 0.1, 0.2))


def measure(name: str, work: Callable[[], object], repeats: int) -> None:
    """Print the median of the processor time that `work` takes."""
    work()
    took_ms = []
    for _ in range(repeats):
        start = time.thread_time()
        work()
        took_ms.append(1e3 * (time.thread_time() - start))
    print(f"{name:<48}{statistics.median(took_ms):>6.1f} ms")


def main(repeats: int) -> None:
    """Print all figures."""
    cv2.setNumThreads(1)
    renderer = Renderer(load_world(), pinhole(640, 480, math.radians(80.0)))
    light = renderer.light(POSE).copy()
    meter, sun = ExposureMeter(), np.array([0.2, -0.3, 0.9])
    exposure = meter.settle(sample(light), 0)
    print("640 x 480 colour, one core")
    measure("light at a pose", lambda: renderer.light(POSE), repeats)
    measure("metering", lambda: meter.follow(sample(light), 0), repeats)
    measure("sensor", lambda: renderer.sensor.expose(light, exposure, 1, np.zeros(3)), repeats)
    measure("sensor, the sun in view", lambda: renderer.sensor.expose(light, exposure, 1, sun), repeats)
    for name, shutter, exposure_s in (
        ("in flight, 0.25 ms", Shutter(), 0.00025),
        ("in flight, 2 ms", Shutter(), 0.002),
        ("in flight, 8 ms", Shutter(), 0.008),
        ("in flight, 0.25 ms, rolling 20 ms", Shutter(readout_s=0.02), 0.00025),
        ("in flight, 8 ms, rolling 20 ms", Shutter(readout_s=0.02), 0.008),
    ):
        photographer = Photographer(renderer, shutter)
        smear_px = photographer.smear_px(FLYING, exposure_s)

        def gather(photographer: Photographer = photographer, exposure_s: float = exposure_s) -> object:
            return photographer.gather(FLYING, exposure_s)

        measure(f"light {name} ({smear_px:.1f} px at most)", gather, max(3, repeats // 4))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=40, help="runs of each")
    main(parser.parse_args().repeats)
