"""A flight's records in Foxglove's words and channels, for whichever sink listens: a log or a live stream."""

import functools
import json
import math
from collections.abc import Callable
from typing import Any, get_args

import foxglove
import numpy as np
from foxglove import channels as fox_channels
from foxglove import messages as fox

from drivers.camera.camera import Intrinsics
from drivers.clock import NS_PER_S
from mission.autopilot import GlobalPoint, Setpoint, VehicleState
from mission.geodesy import point_at
from mission.log import channels, scene
from mission.log.records import LoggedMission, VisionEntry
from mission.log.wording import Worded, line_of
from mission.records import LineFix, Origin, PreflightCheck, Severity, TrueLine
from vision.records import VisionReport

_LASTING = (LoggedMission, Origin, TrueLine, PreflightCheck)  # what who comes later wants to be told, too

_MAP_FROM_NED = fox.Quaternion(x=math.sqrt(0.5), y=math.sqrt(0.5), z=0.0, w=0.0)  # its own inverse: NED, ENU
_FRD_FROM_CAMERA = fox.Quaternion(x=0.0, y=0.0, z=math.sqrt(0.5), w=math.sqrt(0.5))  # looks down, its top forward
_DISTORTION_MODEL = {"pinhole": "plumb_bob", "fisheye": "kannala_brandt"}
_LINE_COLOR = fox.Color(r=1.0, g=0.72, b=0.1, a=1.0)
_LOG_LEVEL = {
    Severity.INFO: fox.LogLevel.Info,
    Severity.WARNING: fox.LogLevel.Warning,
    Severity.ERROR: fox.LogLevel.Error,
}


class Encoder:
    """The channels of one flight.

    Each record goes to its own JSON channel, and where a viewer can show it, to Foxglove's own. Every sink of `context`
    hears them. `newest_ns` is the newest time [ns, flight] of any record by our own clock.
    """

    def __init__(self, context: foxglove.Context, mission: LoggedMission) -> None:
        self._context = context  # its channels close when it goes
        self._offset_ns = mission.unix_minus_flight_ns
        self._start_ns = self.newest_ns = mission.start_ns
        self._limits = {
            channel.record: channels.RateLimit(channel.max_rate_hz)
            for channel in channels.RECORD_CHANNELS
            if channel.max_rate_hz is not None
        }
        self._origin: GlobalPoint | None = None
        self._down_m: float | None = None
        self._location_limit = channels.RateLimit(channels.LOCATION_RATE_HZ)
        self._known_line_limit = channels.RateLimit(channels.KNOWN_LINE_RATE_HZ)
        self._lasting: dict[str, list[Callable[[], None]]] = {}
        self._json = {
            channel.record: foxglove.Channel(
                channel.topic,
                schema=foxglove.Schema(
                    name=f"lineflight.{channel.record.__name__}",
                    encoding="jsonschema",
                    data=json.dumps(channels.json_schema(channel.record)).encode(),
                ),
                message_encoding="json",
                metadata={"what": channel.what, "rate": channel.rate},
                context=context,
            )
            for channel in channels.RECORD_CHANNELS
        }
        self._foxglove = {
            channel.topic: getattr(fox_channels, channel.schema.removeprefix("foxglove.") + "Channel")(
                channel.topic, metadata={"what": channel.what, "rate": channel.rate}, context=context
            )
            for channel in channels.FOXGLOVE_CHANNELS
        }

    def write(self, record: object) -> None:
        """Write a record to every channel that shows it. Raises KeyError for a type that the table lacks."""
        _SHOWN.get(type(record), Encoder.write_plain)(self, record)

    @staticmethod
    def knows(record: object) -> bool:
        """Whether records of this type can be written."""
        return type(record) in _SHOWN or type(record) in channels.CHANNEL_OF

    def repeat(self, topic: str) -> None:
        """Write again what a topic said once and for all, for a viewer who came later."""
        for write in self._lasting.get(topic, []):
            write()

    def write_plain(self, record: Any) -> None:
        """Write a record as JSON; a channel with a rate limit skips what comes sooner."""
        t_ns = getattr(record, "t_ns", self._start_ns)
        if not isinstance(record, channels.CAPTURE_TIMED):
            self.newest_ns = max(self.newest_ns, t_ns)
        limit = self._limits.get(type(record))
        if limit is None or limit.admits(t_ns):
            self._log(self._json[type(record)], channels.encode(record), t_ns, is_lasting=type(record) in _LASTING)

    def write_vision(self, report: VisionReport) -> None:
        """Write what vision saw, with the frame and the lines on it where the report has it."""
        lines_px = np.round(report.power_lines, 2).tolist()
        self.write_plain(
            VisionEntry(
                t_ns=report.t_capture_ns,
                seq=report.seq,
                estimate=report.estimate,
                track=report.track,
                trouble=report.trouble,
                power_lines_px=tuple((x1, y1, x2, y2) for x1, y1, x2, y2 in lines_px),
                latency_ns=report.latency_ns,
                work_ns=report.work_ns,
                n_dropped=report.n_dropped,
                has_image=report.jpeg is not None,
            )
        )
        if report.jpeg is None:
            return
        stamp = self._stamp(report.t_capture_ns)
        image = fox.CompressedImage(timestamp=stamp, frame_id="camera", data=report.jpeg, format="jpeg")
        self._show(channels.IMAGE, report.t_capture_ns, image)
        ends = [fox.Point2(x=x, y=y) for x1, y1, x2, y2 in lines_px for x, y in ((x1, y1), (x2, y2))]
        lines = fox.PointsAnnotation(
            timestamp=stamp, type=fox.PointsAnnotationType.LineList, points=ends, outline_color=_LINE_COLOR, thickness=2
        )
        annotations = fox.ImageAnnotations(timestamp=stamp, points=[lines] if ends else [])
        self._show(channels.ANNOTATIONS, report.t_capture_ns, annotations)

    def write_state(self, state: VehicleState) -> None:
        """Write the vehicle, its pose, and its place on Earth once the origin is known."""
        self.write_plain(state)
        stamp = self._stamp(state.t_ns)
        position = fox.Vector3(x=state.north_m, y=state.east_m, z=state.down_m)
        attitude = _quaternion(state.roll_rad, state.pitch_rad, state.yaw_rad)
        pose = fox.Pose(position=position, orientation=attitude)
        self._show(channels.POSE, state.t_ns, fox.PoseInFrame(timestamp=stamp, frame_id="ned", pose=pose))
        self._place(channels.TRANSFORM, state.t_ns, ("ned", "vehicle"), position, attitude)
        self._place(channels.CHASE, state.t_ns, ("ned", "chase"), position, _MAP_FROM_NED)
        self._down_m = state.down_m
        if self._origin is not None and self._location_limit.admits(state.t_ns):
            here = point_at(Setpoint(state.north_m, state.east_m, state.down_m, state.yaw_rad), self._origin)
            fix = fox.LocationFix(
                timestamp=stamp,
                frame_id="vehicle",
                latitude=math.degrees(here.latitude_rad),
                longitude=math.degrees(here.longitude_rad),
                altitude=here.altitude_m,
            )
            self._show(channels.LOCATION, state.t_ns, fix)

    def write_origin(self, origin: Origin) -> None:
        """Write where the local frame lies; from now on the vehicle's places on Earth are known."""
        self.write_plain(origin)
        self._origin = GlobalPoint(origin.latitude_rad, origin.longitude_rad, origin.altitude_m)

    def write_camera(self, camera: Intrinsics) -> None:
        """Write the camera's calibration, and how it is mounted."""
        stamp = self._stamp(self._start_ns)
        fx, fy, cx, cy = camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px
        calibration = fox.CameraCalibration(
            timestamp=stamp,
            frame_id="camera",
            width=camera.width_px,
            height=camera.height_px,
            distortion_model=_DISTORTION_MODEL[camera.lens],
            D=list(camera.distortion),
            K=[fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
            P=[fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
        )
        self._show(channels.CALIBRATION, self._start_ns, calibration, is_lasting=True)
        here = fox.Vector3()
        self._place(channels.MOUNT, self._start_ns, ("vehicle", "camera"), here, _FRD_FROM_CAMERA, is_lasting=True)

    def write_mission(self, mission: LoggedMission) -> None:
        """Write what is flown, how the map lies, and what the vehicle looks like."""
        self.write_plain(mission)
        here = fox.Vector3()
        self._place(channels.MAP, self._start_ns, ("map", "ned"), here, _MAP_FROM_NED, is_lasting=True)
        self._place(channels.CHASE, self._start_ns, ("ned", "chase"), here, _MAP_FROM_NED)
        shape = scene.vehicle(self._stamp(self._start_ns))
        self._show(channels.SHAPE, self._start_ns, shape, is_lasting=True)

    def write_true_line(self, line: TrueLine) -> None:
        """Write the simulated line, and its scene."""
        self.write_plain(line)
        seen = scene.true_line(line, self._stamp(self._start_ns))
        self._show(channels.SCENE, self._start_ns, seen, is_lasting=True)

    def write_fix(self, fix: LineFix) -> None:
        """Write where the line is, as far as known."""
        self.write_plain(fix)
        if self._down_m is None:
            return
        seen = scene.known_line(fix, self._down_m, self._stamp(fix.t_ns))
        if seen is not None and self._known_line_limit.admits(fix.t_ns):
            self._show(channels.KNOWN_LINE, fix.t_ns, seen)

    def write_worded(self, record: Any) -> None:
        """Write a record that also reads as a line of text."""
        self.write_plain(record)
        name, severity, text = line_of(record)
        message = fox.Log(timestamp=self._stamp(record.t_ns), level=_LOG_LEVEL[severity], name=name, message=text)
        self._show(channels.LOG, record.t_ns, message)

    def _place(
        self,
        channel: channels.FoxgloveChannel,
        t_ns: int,
        parent_and_child: tuple[str, str],
        translation: fox.Vector3,
        rotation: fox.Quaternion,
        *,
        is_lasting: bool = False,
    ) -> None:
        parent, child = parent_and_child
        transform = fox.FrameTransform(
            timestamp=self._stamp(t_ns),
            parent_frame_id=parent,
            child_frame_id=child,
            translation=translation,
            rotation=rotation,
        )
        self._show(channel, t_ns, transform, is_lasting=is_lasting)

    def _show(self, channel: channels.FoxgloveChannel, t_ns: int, message: Any, *, is_lasting: bool = False) -> None:
        self._log(self._foxglove[channel.topic], message, t_ns, is_lasting=is_lasting)

    def _log(self, channel: Any, message: Any, t_ns: int, *, is_lasting: bool) -> None:
        write = functools.partial(channel.log, message, log_time=t_ns + self._offset_ns)
        if is_lasting:
            self._lasting.setdefault(channel.topic(), []).append(write)
        write()

    def _stamp(self, t_ns: int) -> fox.Timestamp:
        return fox.Timestamp(*divmod(t_ns + self._offset_ns, NS_PER_S))


# How what a viewer can show is written; all else that the log's table names is written as JSON alone.
_SHOWN: dict[type, Callable[[Encoder, Any], None]] = {
    **dict.fromkeys(get_args(Worded), Encoder.write_worded),
    LoggedMission: Encoder.write_mission,
    VehicleState: Encoder.write_state,
    VisionReport: Encoder.write_vision,
    Origin: Encoder.write_origin,
    Intrinsics: Encoder.write_camera,
    TrueLine: Encoder.write_true_line,
    LineFix: Encoder.write_fix,
}


def _quaternion(roll_rad: float, pitch_rad: float, yaw_rad: float) -> fox.Quaternion:
    """ned_from_frd of an attitude in yaw, pitch, roll order."""
    cr, sr = math.cos(roll_rad / 2), math.sin(roll_rad / 2)
    cp, sp = math.cos(pitch_rad / 2), math.sin(pitch_rad / 2)
    cy, sy = math.cos(yaw_rad / 2), math.sin(yaw_rad / 2)
    return fox.Quaternion(
        w=cr * cp * cy + sr * sp * sy,
        x=sr * cp * cy - cr * sp * sy,
        y=cr * sp * cy + sr * cp * sy,
        z=cr * cp * sy - sr * sp * cy,
    )
