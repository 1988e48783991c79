"""Reads terrain from a picture or an array of heights."""

import math
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from sitl.place import EARTH_RADIUS_M, Origin
from sitl.world.errors import WrongKey
from sitl.world.geotiff import GeoPlace, read_place
from sitl.world.height_grid import HeightGrid
from sitl.world.models import HeightMapModel

_KEY = "terrain.file"


def read_height_map(model: HeightMapModel, over: HeightGrid, origin: Origin, folder: Path) -> HeightGrid:
    """The heights of a map at the nodes of `over`, smoothly between its pixels.

    Raises WrongKey when the file cannot be read, does not tell its place, or does not reach over the whole grid.
    """
    path = folder / model.file
    if not path.is_file():
        raise WrongKey(_KEY, f"there is no file {path}")
    up_m, place = _read(path)
    rows, columns = over.up_m.shape
    norths_m = over.south_m + over.cell_m * np.arange(rows, dtype=np.float64)
    easts_m = over.west_m + over.cell_m * np.arange(columns, dtype=np.float64)
    if place is not None and model.cell_m is None:
        y, x = _pixels_on_earth(place, norths_m, easts_m, origin)
        if place.no_data is not None:
            up_m = np.where(up_m == np.float32(place.no_data), np.float32(np.nan), up_m)
    elif model.cell_m is None:
        raise WrongKey("terrain.cell_m", f"{path.name} does not tell how far its pixels are apart; say it")
    else:
        half_m = [0.5 * model.cell_m * (n - 1) for n in up_m.shape]
        south_m, west_m = model.south_west_ne_m or (-half_m[0], -half_m[1])
        y = (up_m.shape[0] - 1) - (norths_m - south_m) / model.cell_m
        x = (easts_m - west_m) / model.cell_m
    if min(y[-1], x[0]) < 0.0 or y[0] > up_m.shape[0] - 1 or x[-1] > up_m.shape[1] - 1:
        south, west, north, east = (round(edge) for edge in over.bounds_ne_m)
        raise WrongKey(
            _KEY,
            f"{path.name} does not reach over the world: {south} m to {north} m north and {west} m to {east} m east",
        )
    # Heights are taken from their own level: float32 keeps millimetres only near 0.
    level_m = np.float32(np.nanmedian(up_m))
    sampled = _smooth(_smooth(up_m - level_m, y).T, x).T
    if not np.isfinite(sampled).all():
        raise WrongKey(_KEY, f"{path.name} has pixels without a height within the world")
    return HeightGrid(over.south_m, over.west_m, over.cell_m, model.scale_m * sampled)


def _read(path: Path) -> tuple[NDArray[np.float32], GeoPlace | None]:
    """The pixels, and the place of a GeoTIFF."""
    place = None
    try:
        if path.suffix.lower() == ".npy":
            pixels = np.load(path, allow_pickle=False)
        else:
            pixels = _read_picture(path)
            place = read_place(path)
    except (ValueError, EOFError, OSError, cv2.error) as error:
        raise WrongKey(_KEY, f"{path.name} cannot be used: {error}") from error
    if pixels is None or pixels.dtype.kind not in "uif" or pixels.ndim != 2 or min(pixels.shape) < 2:
        raise WrongKey(_KEY, f"{path.name} is no grey picture or array of heights of 2 x 2 pixels or more")
    return np.asarray(pixels, dtype=np.float32), place


def _read_picture(path: Path) -> NDArray[np.generic] | None:
    """The pixels as they are in the file; OpenCV's warnings of GeoTIFF's tags are kept from the console."""
    before = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_ERROR)
    try:
        return cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    finally:
        cv2.utils.logging.setLogLevel(before)


def _pixels_on_earth(
    place: GeoPlace, norths_m: NDArray[np.float64], easts_m: NDArray[np.float64], origin: Origin
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The rows and the columns that lie at these places; as Origin.global_of has the Earth."""
    latitudes = np.degrees(origin.latitude_rad + norths_m / EARTH_RADIUS_M)
    longitudes = np.degrees(origin.longitude_rad + easts_m / (EARTH_RADIUS_M * math.cos(origin.latitude_rad)))
    return (
        (place.latitude_deg - latitudes) / place.south_step_deg,
        (longitudes - place.longitude_deg) / place.east_step_deg,
    )


def _smooth(values: NDArray[np.float32], places: NDArray[np.float64]) -> NDArray[np.float32]:
    """The rows of `values` (n, m) at `places` (k,), counted in rows, by cubic convolution; (k, m).

    Source: Keys 1981, "Cubic convolution interpolation for digital image processing", with a = -1/2. The slope has no
    step at a row, as it would have between straight pieces: a coarse map would look like facets.
    """
    before = np.minimum(np.floor(places).astype(np.int64), len(values) - 1)
    part = (places - before).astype(np.float32)[:, None]
    last = len(values) - 1
    a, b, c, d = (values[np.clip(before + step, 0, last)] for step in (-1, 0, 1, 2))
    return np.asarray(b + 0.5 * part * (c - a + part * (2 * a - 5 * b + 4 * c - d + part * (3 * (b - c) + d - a))))
