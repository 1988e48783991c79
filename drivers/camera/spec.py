"""Open the camera that a person named in a mission file or on the command line."""

from pathlib import Path

from drivers.camera.camera import Camera, CameraError, CameraSettings
from drivers.camera.recorded import open_recording
from drivers.camera.v4l2 import open_v4l2
from drivers.clock import ScaledClock

ALLOWED_SPECS = "v4l2:DEVICE (v4l2:/dev/video0) or file:PATH (a video, an image, or a folder of images)"


def open_camera(spec: str, settings: CameraSettings, clock: ScaledClock) -> Camera:
    """Open the camera that `spec` names; use what it returns as a context manager.

    `spec` is `v4l2:DEVICE` or `file:PATH`; `clock` gives the frames their capture time. Raises CameraError when the
    spec is not one of these, when there is no such camera, or when it does not give what `settings` ask for.
    """
    kind, colon, place = spec.partition(":")
    if colon and place:
        if kind == "v4l2":
            return open_v4l2(Path(place), settings, clock)
        if kind == "file":
            return open_recording(Path(place), settings, clock)
    raise CameraError(f"The camera '{spec}' is not of a kind we know; name it as {ALLOWED_SPECS}.")
