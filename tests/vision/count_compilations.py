"""Count what a detector compiles, or loads from its cache, in its warm-up and after it: prints both numbers.

python -m tests.vision.count_compilations DETECTOR LENS
"""

import sys
from typing import cast

import numpy as np

from drivers.camera.camera import Intrinsics
from tests.vision.nadir_frames import nadir_frame
from vision.pipeline import Detector, LineFinder, VisionSettings

LENSES = {
    "none": None,
    "mild": Intrinsics(640, 480, 381.0, 381.0, 319.5, 239.5, (-0.005, 0.0, 0.0, 0.0, 0.0)),
    "wide": Intrinsics(640, 480, 381.0, 381.0, 319.5, 239.5, (-0.24, 0.05, 0.0, 0.0, 0.0)),
    "fisheye": Intrinsics(640, 480, 250.0, 250.0, 319.5, 239.5, (0.0, 0.0, 0.0, 0.0), "fisheye"),
}


def n_signatures() -> int:
    """For how many types of arguments the kernels of the vision room are ready."""
    modules = [module for name, module in sys.modules.items() if name.startswith("vision.")]
    values = [value for module in modules for value in vars(module).values() if hasattr(value, "signatures")]
    kernels = {id(value): value for value in values}
    return sum(len(kernel.signatures) for kernel in kernels.values())


def main() -> None:
    """Warm up, then show the finder images of every kind that a camera may give."""
    camera = LENSES[sys.argv[2]]
    finder = LineFinder(VisionSettings(detector=cast("Detector", sys.argv[1]), camera=camera))
    finder.warm_up()
    n_warm = n_signatures()
    for height, width in ((480, 640), (400, 300), (120, 90))[: None if camera is None else 1]:
        for grey in (nadir_frame(3, 0.4, 10.0)[:height, :width].copy(), np.zeros((height, width), np.uint8)):
            locked = grey.copy()
            locked.setflags(write=False)
            views = [grey, locked, np.repeat(grey[:, :, None], 3, axis=2), grey[:, ::-1]]
            for image in views if camera is not None else [*views, grey.T]:
                finder.find(image)
    sys.stdout.write(f"{n_warm} {n_signatures() - n_warm}\n")


if __name__ == "__main__":
    main()
