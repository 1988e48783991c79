"""The camera of a flight that is not a dry-run: a real one, a recording, or one simulated at the telemetry's pose."""

import functools
from collections.abc import Callable
from types import TracebackType
from typing import Self

from drivers.camera.camera import Camera, CameraError, CameraSettings, Intrinsics
from drivers.camera.spec import open_camera
from drivers.clock import ScaledClock
from mission.autopilot import VehicleState
from mission.camera_plan import SIM_PREFIX, check_source
from mission.plan import CameraPlan


class LiveCamera:
    """What opens the camera of `source`, v4l2:DEVICE, file:PATH or sim:WORLD. A context manager.

    Raises CameraError for a source that does not exist; WorldErrors are said as CameraError too. `feed_pose` must be
    given the telemetry when it is not None.
    """

    def __init__(self, source: str, plan: CameraPlan, camera: Intrinsics) -> None:
        self.clock = ScaledClock()
        self.feed_pose: Callable[[VehicleState], None] | None = None
        self._close: Callable[[], None] = lambda: None
        self.open_camera: Callable[[], Camera]
        if source.startswith(SIM_PREFIX):
            self._hang_on_telemetry(source.removeprefix(SIM_PREFIX), camera, plan.rate_hz)
        else:
            check_source(source)  # a misspelt one is told now, not by the worker in the middle of getting ready
            settings = camera_settings(plan)
            self.open_camera = functools.partial(open_camera, source, settings, self.clock)

    def _hang_on_telemetry(self, world: str, intrinsics: Intrinsics, rate_hz: float) -> None:
        from mission.simulated.simulation import TelemetryCamera, WorldError, world_path_or_name

        try:
            camera = TelemetryCamera(world_path_or_name(world or None), self.clock, intrinsics, rate_hz)
        except WorldError as error:
            raise CameraError(str(error)) from None
        self._close = camera.close
        self.feed_pose = camera.feed
        self.open_camera = camera.open_camera

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._close()


def camera_settings(plan: CameraPlan) -> CameraSettings:
    """What a mission's camera section asks of a camera."""
    return CameraSettings(plan.width_px, plan.height_px, plan.rate_hz, plan.pixel_format, tuple(plan.controls.items()))


__all__ = ["CameraError", "LiveCamera", "camera_settings"]
