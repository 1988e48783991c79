"""Open the camera that a person named in a mission file or on the command line."""

from pathlib import Path

from drivers.camera.camera import Camera, CameraError, CameraSettings
from drivers.camera.recorded import open_recording
from drivers.camera.v4l2 import open_v4l2
from drivers.clock import ScaledClock

ALLOWED_SPECS = "v4l2:DEVICE (v4l2:/dev/video0) or file:PATH (a video, an image, a folder of images, or a flight log)"


def parse_spec(spec: str) -> tuple[str, Path]:
    """The kind of camera, `v4l2` or `file`, and its place. Raises CameraError when the spec is neither."""
    kind, _, place = spec.partition(":")
    if kind not in ("v4l2", "file") or not place:
        raise CameraError(f"The camera '{spec}' is not of a kind we know; name it as {ALLOWED_SPECS}.")
    return kind, Path(place)


def open_camera(spec: str, settings: CameraSettings, clock: ScaledClock) -> Camera:
    """Open the camera that `spec` names; use what it returns as a context manager.

    `spec` is `v4l2:DEVICE` or `file:PATH`; `clock` gives the frames their capture time. Raises CameraError when the
    spec is not one of these, when there is no such camera, or when it does not give what `settings` ask for.
    """
    kind, place = parse_spec(spec)
    opener = open_v4l2 if kind == "v4l2" else open_recording
    return opener(place, settings, clock)
