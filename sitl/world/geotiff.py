"""Where a GeoTIFF lies on Earth: the few tags of it that tell."""

import struct
from dataclasses import dataclass
from pathlib import Path

_PIXEL_SCALE, _TIE_POINT, _GEO_KEYS, _NO_DATA = 33550, 33922, 34735, 42113
_MODEL_TYPE, _RASTER_TYPE = 1024, 1025
_GEOGRAPHIC, _PIXEL_IS_POINT = 2, 2
_FORMATS = {1: "B", 2: "s", 3: "H", 4: "I", 12: "d"}


@dataclass(frozen=True, slots=True)
class GeoPlace:
    """The middle of the top left pixel [degrees], and the step from pixel to pixel [degrees], southwards and eastwards.

    `no_data` is the value that stands for an unknown height.
    """

    latitude_deg: float
    longitude_deg: float
    south_step_deg: float
    east_step_deg: float
    no_data: float | None


def read_place(path: Path) -> GeoPlace | None:
    """The place of a TIFF; None when it tells none. Source: OGC 19-008r4, GeoTIFF 1.1.

    Raises ValueError, with a sentence, for one in a projected system.
    """
    try:
        tags = _tags(path.read_bytes())
    except struct.error:
        return None
    scale, tie, keys = tags.get(_PIXEL_SCALE), tags.get(_TIE_POINT), tags.get(_GEO_KEYS)
    if scale is None or tie is None or keys is None or len(scale) < 2 or len(tie) < 6:
        return None
    # Four numbers an entry: the key, where its value stands (0: right here), how many, the value.
    values = {keys[k]: keys[k + 3] for k in range(4, len(keys) - 3, 4) if keys[k + 1] == 0}
    if values.get(_MODEL_TYPE) != _GEOGRAPHIC:
        raise ValueError("it is in a projected system; bring it to latitude and longitude (gdalwarp -t_srs EPSG:4326)")
    half = 0.0 if values.get(_RASTER_TYPE) == _PIXEL_IS_POINT else 0.5
    return GeoPlace(
        latitude_deg=tie[4] - (half - tie[1]) * scale[1],
        longitude_deg=tie[3] + (half - tie[0]) * scale[0],
        south_step_deg=scale[1],
        east_step_deg=scale[0],
        no_data=_number(tags.get(_NO_DATA)),
    )


def _tags(data: bytes) -> dict[int, tuple[float, ...]]:
    """The tags of the first image of a classic TIFF, as numbers; text as its bytes' codes."""
    order = {b"II*\0": "<", b"MM\0*": ">"}.get(data[:4])
    if order is None:
        return {}
    (at,) = struct.unpack_from(f"{order}I", data, 4)
    (n_tags,) = struct.unpack_from(f"{order}H", data, at)
    tags: dict[int, tuple[float, ...]] = {}
    for k in range(n_tags):
        tag, kind, n = struct.unpack_from(f"{order}HHI", data, at + 2 + 12 * k)
        if tag not in (_PIXEL_SCALE, _TIE_POINT, _GEO_KEYS, _NO_DATA) or kind not in _FORMATS:
            continue
        code = "B" if kind == 2 else _FORMATS[kind]
        where = at + 2 + 12 * k + 8
        if n * struct.calcsize(code) > 4:
            (where,) = struct.unpack_from(f"{order}I", data, where)
        tags[tag] = struct.unpack_from(f"{order}{n}{code}", data, where)
    return tags


def _number(text: tuple[float, ...] | None) -> float | None:
    if text is None:
        return None
    try:
        return float(bytes(int(code) for code in text).rstrip(b"\0").decode("ascii"))
    except ValueError:
        return None
