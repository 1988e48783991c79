"""The calibration file that missions name: a camera's intrinsics as YAML."""

from pathlib import Path
from typing import Literal

import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from drivers.camera.camera import CameraError, Intrinsics, Lens
from drivers.camera.distortion import is_plausible

_MAX_BYTES = 64 * 1024


class CalibrationFile(BaseModel):
    """What the file says; pixels, and OpenCV's distortion coefficients (k1 k2 p1 p2 k3, fisheye: k1 k2 k3 k4)."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)

    version: Literal[1] = 1
    lens: Lens = "pinhole"
    width_px: int = Field(gt=0, le=100_000)
    height_px: int = Field(gt=0, le=100_000)
    fx_px: float = Field(ge=1, lt=1e6)
    fy_px: float = Field(ge=1, lt=1e6)
    cx_px: float = Field(gt=-1e5, lt=1e6)
    cy_px: float = Field(gt=-1e5, lt=1e6)
    distortion: list[float]
    rms_px: float | None = Field(None, ge=0)
    made_from: str = ""


def read_calibration(path: Path) -> Intrinsics:
    """Read the intrinsics of a calibration file. Raises CameraError when it is missing or says nothing usable."""
    try:
        with path.open("rb") as file:
            raw = file.read(_MAX_BYTES + 1)
    except (OSError, ValueError) as error:
        why = error.strerror if isinstance(error, OSError) else error
        raise CameraError(
            f"The calibration {path} cannot be read ({why}); make one with lineflight camera calibrate."
        ) from None
    if len(raw) > _MAX_BYTES:
        raise CameraError(f"The calibration {path} is larger than 64 KB, so this is no calibration file.")
    try:
        said = CalibrationFile.model_validate(yaml.safe_load(raw))
        focal_px, centre_px = (said.fx_px, said.fy_px), (said.cx_px, said.cy_px)
        camera = Intrinsics(said.width_px, said.height_px, *focal_px, *centre_px, tuple(said.distortion), said.lens)
        if not is_plausible(camera):
            raise ValueError(
                "no lens is like this: it folds the image, moves its corners too far, or its view is too wide or narrow"
            )
        return camera
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(map(str, first["loc"])) or "the file"
        raise CameraError(f"The calibration {path} is wrong at {key}: {first['msg'].lower()}.") from None
    except ValueError as error:
        raise CameraError(f"The calibration {path} describes no camera: {error}.") from None
    except RecursionError:
        raise CameraError(f"The calibration {path} is nested too deeply to be one.") from None
    except yaml.YAMLError as error:
        raise CameraError(f"The calibration {path} is not YAML: {' '.join(str(error).split())}.") from None


def write_calibration(path: Path, camera: Intrinsics, rms_px: float, made_from: str) -> None:
    """Write a calibration file. Raises CameraError.

    `rms_px` is how far the board's corners were from where the model has them, `made_from` says what it was made from.
    """
    said = CalibrationFile(
        lens=camera.lens,
        width_px=camera.width_px,
        height_px=camera.height_px,
        fx_px=round(camera.fx_px, 4),
        fy_px=round(camera.fy_px, 4),
        cx_px=round(camera.cx_px, 4),
        cy_px=round(camera.cy_px, 4),
        distortion=[round(value, 8) for value in camera.distortion],
        rms_px=round(rms_px, 4),
        made_from=made_from,
    )
    text = "# A camera's calibration, for camera.calibration of a mission file.\n"
    text += yaml.safe_dump(said.model_dump(mode="json"), sort_keys=False, default_flow_style=None)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise CameraError(f"The calibration {path} cannot be written: {error.strerror}.") from None
