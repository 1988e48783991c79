"""What Foxglove's 3D panel shows, in NED and in the vehicle's own axes (FRD): lines, supports, the vehicle."""

import math
from collections.abc import Iterable

from foxglove import messages as fox

from mission.records import LineFix, TrueLine

_IDENTITY = fox.Pose(position=fox.Vector3(), orientation=fox.Quaternion(w=1.0))
_LINE_COLOR = fox.Color(r=1.0, g=0.72, b=0.1, a=1.0)
_SUPPORT_COLOR = fox.Color(r=0.55, g=0.45, b=0.35, a=1.0)
_KNOWN_COLOR = fox.Color(r=0.2, g=0.9, b=1.0, a=1.0)
_FRONT_COLOR = fox.Color(r=1.0, g=0.35, b=0.2, a=1.0)
_BODY_COLOR = fox.Color(r=0.55, g=0.6, b=0.7, a=1.0)

_KNOWN_HALF_M = 30.0  # so far before and behind the vehicle
_KNOWN_FOR_S = 2  # a line that nothing told of for longer is shown no more
_ARM_M = 0.8  # three times those of an F550: it is looked at from afar
_ROTOR_M = 0.7
_N_ROTORS = 6


def true_line(line: TrueLine, stamp: fox.Timestamp) -> fox.SceneUpdate:
    """The simulated conductors and supports."""
    wires = [_polyline(conductor, 0.05, _LINE_COLOR) for conductor in line.conductors_ned_m]
    poles = [_polyline(((n, e, d), (n, e, 0.0)), 0.3, _SUPPORT_COLOR) for n, e, d in line.supports_ned_m]
    return _scene(fox.SceneEntity(timestamp=stamp, frame_id="ned", id="power line", lines=[*wires, *poles]))


def known_line(fix: LineFix, vehicle_down_m: float, stamp: fox.Timestamp) -> fox.SceneUpdate | None:
    """The line where it is known to be, around the vehicle; None while place or depth are not known."""
    depth_m = fix.height_m if fix.depth_m is None else fix.depth_m
    if depth_m is None or not fix.is_placed:
        return None
    down_m = vehicle_down_m + depth_m
    along_n, along_e = _KNOWN_HALF_M * math.cos(fix.heading_rad), _KNOWN_HALF_M * math.sin(fix.heading_rad)
    ends = [(fix.north_m + way * along_n, fix.east_m + way * along_e, down_m) for way in (-1, 1)]
    entity = fox.SceneEntity(
        timestamp=stamp,
        frame_id="ned",
        id="known line",
        lifetime=fox.Duration(sec=_KNOWN_FOR_S, nsec=0),
        lines=[_polyline(ends, 0.15, _KNOWN_COLOR)],
    )
    return _scene(entity)


def vehicle(stamp: fox.Timestamp) -> fox.SceneUpdate:
    """A hexacopter that moves with the frame `vehicle`; its two front rotors are red."""
    arms, rotors = [], []
    for index in range(_N_ROTORS):
        angle_rad = math.radians(30 + 60 * index)
        x, y = _ARM_M * math.cos(angle_rad), _ARM_M * math.sin(angle_rad)
        arms.append(_polyline(((0.0, 0.0, 0.0), (x, y, 0.0)), 0.12, _BODY_COLOR))
        rotors.append(
            fox.CylinderPrimitive(
                pose=fox.Pose(position=fox.Vector3(x=x, y=y, z=-0.1), orientation=fox.Quaternion(w=1.0)),
                size=fox.Vector3(x=_ROTOR_M, y=_ROTOR_M, z=0.06),
                bottom_scale=1.0,
                top_scale=1.0,
                color=_FRONT_COLOR if index in (0, _N_ROTORS - 1) else _BODY_COLOR,
            )
        )
    return _scene(
        fox.SceneEntity(
            timestamp=stamp, frame_id="vehicle", id="vehicle", frame_locked=True, lines=arms, cylinders=rotors
        )
    )


def _scene(entity: fox.SceneEntity) -> fox.SceneUpdate:
    return fox.SceneUpdate(entities=[entity])


def _polyline(points_m: Iterable[tuple[float, float, float]], width_m: float, color: fox.Color) -> fox.LinePrimitive:
    points = [fox.Point3(x=x, y=y, z=z) for x, y, z in points_m]
    return fox.LinePrimitive(
        type=fox.LinePrimitiveLineType.LineStrip, thickness=width_m, points=points, color=color, pose=_IDENTITY
    )
