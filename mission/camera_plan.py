"""The camera that a plan means: calibrated, or a pinhole of the given field of view."""

import math
from pathlib import Path

from drivers.camera.calibration_file import read_calibration
from drivers.camera.camera import CameraError, Intrinsics
from drivers.camera.spec import parse_spec
from mission.plan import CameraPlan

__all__ = ["SIM_PREFIX", "CameraError", "check_source", "pinhole_intrinsics", "planned_camera"]

SIM_PREFIX = "sim:"
"""A camera simulated at the pose that telemetry tells: sim:WORLD."""


def check_source(source: str) -> None:
    """Raise CameraError for a camera of no kind we know; whether it is there shows when it is opened."""
    if not source.startswith(SIM_PREFIX):
        parse_spec(source)


def planned_camera(plan: CameraPlan, folder: Path) -> Intrinsics:
    """The camera of a plan whose mission file lies in `folder`. Raises CameraError for an unusable calibration."""
    if plan.calibration is None:
        return pinhole_intrinsics(plan)
    try:
        camera = read_calibration(folder / Path(plan.calibration).expanduser())
    except RuntimeError:  # ~somebody who is not on this computer
        raise CameraError(f"The calibration {plan.calibration} is in no home that there is.") from None
    if (camera.width_px, camera.height_px) != (plan.width_px, plan.height_px):
        raise CameraError(
            f"The calibration is of {camera.width_px} x {camera.height_px} px, but the mission's camera of "
            f"{plan.width_px} x {plan.height_px} px; set width_px and height_px, or calibrate at that size."
        )
    return camera


def pinhole_intrinsics(plan: CameraPlan) -> Intrinsics:
    """The camera of a plan without calibration: square pixels, no distortion, the principal point in the middle."""
    focal_px = plan.width_px / 2 / math.tan(math.radians(plan.hfov_deg) / 2)
    return Intrinsics(
        width_px=plan.width_px,
        height_px=plan.height_px,
        fx_px=focal_px,
        fy_px=focal_px,
        cx_px=(plan.width_px - 1) / 2,
        cy_px=(plan.height_px - 1) / 2,
    )
