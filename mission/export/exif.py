"""EXIF in the photographs: the only file that imports Pillow, which is an optional extra.

The tags are those of EXIF 2.32 (CIPA DC-008). Nothing of the image itself is touched.
"""

import math
from dataclasses import dataclass

from PIL.ExifTags import GPS, IFD, Base
from PIL.Image import Exif
from PIL.TiffImagePlugin import IFDRational

from drivers.camera.camera import Intrinsics
from mission.autopilot import GlobalPoint
from mission.export.errors import ExportError
from mission.export.poses import heading_deg
from mission.export.times import utc

MAKE = "lineflight"
_FILM_DIAGONAL_MM = math.hypot(36.0, 24.0)
_START_OF_IMAGE = b"\xff\xd8"
_APP1 = b"\xff\xe1"
_PER_DEGREE = 3600 * 10**5  # seconds of an arc with five decimals: 0.3 mm


@dataclass(frozen=True, slots=True)
class Shot:
    """What EXIF tells of a photograph: when, from where (None: not known), and the heading of the image's top [rad]."""

    unix_ns: int
    place: GlobalPoint | None
    yaw_rad: float
    camera: Intrinsics


def with_exif(jpeg: bytes, shot: Shot) -> bytes:
    """Return a JPEG with an EXIF segment spliced in behind its first marker; all its other bytes are as they were.

    Raises ExportError when it is no JPEG.
    """
    if not jpeg.startswith(_START_OF_IMAGE):
        raise ExportError("The log holds a frame that is not a JPEG image; such a log cannot be exported as images.")
    content = _exif(shot)
    return _START_OF_IMAGE + _APP1 + (len(content) + 2).to_bytes(2, "big") + content + jpeg[len(_START_OF_IMAGE) :]


def focal_35mm(camera: Intrinsics) -> int:
    """The focal length [mm] that sees as much on 35 mm film, by the diagonals; whole millimetres, as EXIF wants."""
    focal_px = (camera.fx_px + camera.fy_px) / 2
    return max(1, round(focal_px * _FILM_DIAGONAL_MM / math.hypot(camera.width_px, camera.height_px)))


def _exif(shot: Shot) -> bytes:
    taken = utc(shot.unix_ns)
    date, sub_second = f"{taken:%Y:%m:%d %H:%M:%S}", f"{taken.microsecond // 1000:03d}"
    exif = Exif()
    exif[Base.Make] = MAKE
    exif[Base.Model] = MAKE
    exif[Base.Software] = MAKE
    exif[Base.DateTime] = date
    details = exif.get_ifd(IFD.Exif)
    details[Base.ExifVersion] = b"0232"
    details[Base.DateTimeOriginal] = date
    details[Base.SubsecTime] = details[Base.SubsecTimeOriginal] = sub_second
    details[Base.OffsetTime] = details[Base.OffsetTimeOriginal] = "+00:00"
    details[Base.FocalLengthIn35mmFilm] = focal_35mm(shot.camera)
    details[Base.ExifImageWidth], details[Base.ExifImageHeight] = shot.camera.width_px, shot.camera.height_px
    if shot.place is not None:
        place, gps = shot.place, exif.get_ifd(IFD.GPSInfo)
        gps[GPS.GPSVersionID] = b"\x02\x03\x00\x00"
        gps[GPS.GPSLatitudeRef] = "S" if place.latitude_rad < 0 else "N"
        gps[GPS.GPSLatitude] = _degrees_minutes_seconds(place.latitude_rad)
        gps[GPS.GPSLongitudeRef] = "W" if place.longitude_rad < 0 else "E"
        gps[GPS.GPSLongitude] = _degrees_minutes_seconds(place.longitude_rad)
        gps[GPS.GPSAltitudeRef] = b"\x01" if place.altitude_m < 0 else b"\x00"  # below sea level, or above
        gps[GPS.GPSAltitude] = IFDRational(round(abs(place.altitude_m) * 1000), 1000)
        gps[GPS.GPSImgDirectionRef] = "T"  # true north
        gps[GPS.GPSImgDirection] = IFDRational(round(heading_deg(shot.yaw_rad) * 100), 100)
        gps[GPS.GPSMapDatum] = "WGS-84"
        gps[GPS.GPSDateStamp] = f"{taken:%Y:%m:%d}"
        seconds = IFDRational(taken.second * 1000 + taken.microsecond // 1000, 1000)
        gps[GPS.GPSTimeStamp] = (IFDRational(taken.hour, 1), IFDRational(taken.minute, 1), seconds)
    return exif.tobytes()


def _degrees_minutes_seconds(angle_rad: float) -> tuple[IFDRational, IFDRational, IFDRational]:
    whole = round(abs(math.degrees(angle_rad)) * _PER_DEGREE)
    degrees, rest = divmod(whole, _PER_DEGREE)
    minutes, rest = divmod(rest, _PER_DEGREE // 60)
    return IFDRational(degrees, 1), IFDRational(minutes, 1), IFDRational(rest, 10**5)
