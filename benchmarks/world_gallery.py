"""Take the pictures of docs/worlds.md anew, every shipped world from above and from the front, and one in all lights.

    python -m benchmarks.world_gallery [--out FOLDER]

The same code gives the same pictures.
"""

import argparse
from pathlib import Path

import cv2

from mission.simulated.pictures import picture_camera, render_picture
from sitl.render.truth.sampling import CameraName
from sitl.world.light import LightName

FOLDER = Path(__file__).resolve().parent.parent / "docs" / "images" / "worlds"
WIDTH_PX, HEIGHT_PX = 480, 360
JPEG_QUALITY = 85

# As for `lineflight world render --pose`: north, east, down [m], yaw, pitch, roll [degrees].
Pose = tuple[float, float, float, float, float, float]
POSES: dict[str, dict[CameraName, Pose]] = {
    "medium_voltage": {"down": (1.8, 27.3, -16.2, 118, 0, 0), "front": (9, -1, -14, 106, -4, 0)},
    "village": {"down": (19, 4, -21, 90, 0, 0), "front": (3, -24, -17, 62, 0, 0)},
    "forest": {"down": (-13, 17, -19, 150, 0, 0), "front": (12, 5, -17, 154, -5, 0)},
    "hills": {"down": (-30, 0, -22.6, -142, 0, 0), "front": (0, 12, -24, -156, -6, 0)},
    "corner": {"down": (-36, 20.5, -16.5, 178, 0, 0), "front": (-12, 17, -14.5, 176, 0, 0)},
    "crossing": {"down": (-9, -27, -16, -60, 0, 0), "front": (-8.5, -10, -17, -80, -8, 0)},
    "high_voltage": {"down": (-2.2, 133.6, -35, 108, 0, 0), "front": (17.5, 99.5, -19.9, 108, 0, 0)},
}
IN_ALL_LIGHTS = "village"
OTHER_LIGHTS: tuple[LightName, ...] = ("low_sun", "overcast", "dusk")  # beside its own, noon


def take(world: str, light: LightName | None, camera: CameraName, out: Path) -> None:
    """Write one picture, taken at the size that is flown with and made smaller."""
    image, _ = render_picture(world, light, POSES[world][camera], camera, picture_camera(640, 480, 80.0))
    small = cv2.resize(image, (WIDTH_PX, HEIGHT_PX), interpolation=cv2.INTER_AREA)
    out.write_bytes(cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])[1].tobytes())
    print(f"{out}: {out.stat().st_size / 1000:.0f} kB")


def main() -> None:
    """Take them all."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--out", type=Path, default=FOLDER)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    for world, cameras in POSES.items():
        for camera in cameras:
            take(world, None, camera, options.out / f"{world}_{camera}.jpg")
    for light in OTHER_LIGHTS:
        take(IN_ALL_LIGHTS, light, "front", options.out / f"{IN_ALL_LIGHTS}_{light}.jpg")


if __name__ == "__main__":
    main()
