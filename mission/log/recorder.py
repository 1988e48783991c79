"""Write a flight to an MCAP log, from a thread of its own so that the flight never waits for the disk."""

import hashlib
import json
import math
import threading
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import foxglove
import numpy as np
from foxglove import channels as fox_channels
from foxglove import messages as fox
from foxglove.mcap import MCAPWriteOptions, MCAPWriter

from drivers.camera.camera import Intrinsics
from drivers.clock import NS_PER_S, Clock, ScaledClock
from mission.autopilot import GlobalPoint, Setpoint, VehicleState
from mission.geodesy import point_at
from mission.log import channels
from mission.log.backlog import Backlog
from mission.log.disk import LogFile
from mission.log.records import LoggedMission, LogHealth, SentSetpoint, StatusText, VisionEntry
from mission.log.wording import line_of
from mission.records import (
    Attachment,
    AutopilotTarget,
    ClockSync,
    ControlTick,
    Event,
    LineFix,
    MissionEnded,
    Origin,
    PreflightCheck,
    Severity,
    TaskEnded,
    TaskStarted,
    TrueLine,
    TruePose,
)
from vision.records import VisionReport

_MAX_RECORDS = 20_000  # a minute or more of all streams
_MAX_IMAGES = 50
_CHUNK_BYTES = 256 * 1024
_FLUSH_PERIOD_S = 1.0
_CLOSE_TIMEOUT_S = 10.0

_MAP_FROM_NED = fox.Quaternion(x=math.sqrt(0.5), y=math.sqrt(0.5), z=0.0, w=0.0)  # ENU, which viewers hold upright
_FRD_FROM_CAMERA = fox.Quaternion(x=0.0, y=0.0, z=math.sqrt(0.5), w=math.sqrt(0.5))  # looks down, its top forward
_DISTORTION_MODEL = {"pinhole": "plumb_bob", "fisheye": "kannala_brandt"}
_IDENTITY = fox.Pose(position=fox.Vector3(), orientation=fox.Quaternion(w=1.0))
_LINE_COLOR = fox.Color(r=1.0, g=0.72, b=0.1, a=1.0)
_SUPPORT_COLOR = fox.Color(r=0.55, g=0.45, b=0.35, a=1.0)
_LOG_LEVEL = {
    Severity.INFO: fox.LogLevel.Info,
    Severity.WARNING: fox.LogLevel.Warning,
    Severity.ERROR: fox.LogLevel.Error,
}


class Recorder:
    """Records a flight; a context manager, which opens the file and closes it.

    Entering raises LogError when the file cannot be made (it must not exist yet). From then on no method raises or
    waits: when the disk will not take more, `failure` says so in a sentence and the flight goes on. `clock` ties flight
    time to Unix time once, at the start; `metadata` is kept beside the mission file.
    """

    def __init__(
        self,
        path: Path,
        *,
        mission_text: str,
        mission_name: str,
        metadata: dict[str, str],
        clock: Clock | None = None,
    ) -> None:
        self.path = path
        self._clock = ScaledClock() if clock is None else clock
        start_ns = self._clock.now_ns()
        self._mission = LoggedMission(
            name=mission_name,
            text=mission_text,
            sha256=hashlib.sha256(mission_text.encode()).hexdigest(),
            start_ns=start_ns,
            unix_minus_flight_ns=time.time_ns() - start_ns,
            metadata=dict(metadata),
        )
        self._backlog = Backlog(_MAX_RECORDS, _MAX_IMAGES)
        self._thread = threading.Thread(target=self._write_all, name="flight log", daemon=True)
        self._file: LogFile | None = None
        self._fault: str | None = None

    @property
    def failure(self) -> str | None:
        """Why the log is not complete, in a sentence; None while it is."""
        if self._fault is not None:
            return self._fault
        if self._file is not None and self._file.failure is not None:
            return self._file.failure
        if self._backlog.n_dropped_records or self._backlog.n_dropped_images:
            return (
                f"The disk was too slow for the log {self.path}: {self._backlog.n_dropped_records} records and "
                f"{self._backlog.n_dropped_images} images are missing."
            )
        return None

    def record(self, item: object) -> None:
        """Log a record: any type of mission.log.channels, a VisionReport, the camera's Intrinsics, an Attachment."""
        self._backlog.put(item)

    def record_setpoint(self, t_ns: int, setpoint: Setpoint) -> None:
        """Log a setpoint that was sent at `t_ns`."""
        sent = SentSetpoint(t_ns, setpoint.north_m, setpoint.east_m, setpoint.down_m, setpoint.yaw_rad)
        self._backlog.put(sent)

    def record_status_text(self, t_ns: int, text: str) -> None:
        """Log the autopilot's own words, which came at `t_ns`."""
        self._backlog.put(StatusText(t_ns, text))

    def __enter__(self) -> Self:
        self._file = LogFile(self.path)
        self._backlog.put(self._mission)
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._backlog.close()
        self._thread.join(_CLOSE_TIMEOUT_S)
        if self._thread.is_alive() and self._fault is None:
            self._fault = f"The log {self.path} was not finished: the disk did not take it in {_CLOSE_TIMEOUT_S:g} s."

    def _write_all(self) -> None:
        # Whatever goes wrong here, a bug included, must not end a flight: it becomes `failure`.
        assert self._file is not None  # noqa: S101
        try:
            log = _FlightLog(self._file, self._mission)
            next_flush_s = time.monotonic() + _FLUSH_PERIOD_S
            while (records := self._backlog.take(_FLUSH_PERIOD_S)) is not None:
                for record in records:
                    if self._file.failure is None:
                        self._write(log, record)
                if time.monotonic() >= next_flush_s:
                    self._write(log, self._health(log.newest_ns, self._file))
                    log.flush()
                    next_flush_s = time.monotonic() + _FLUSH_PERIOD_S
            log.close()
        except Exception as error:
            self._fault = f"The log {self.path} was given up: {type(error).__name__}: {error}."
        finally:
            self._file.close()

    def _health(self, t_ns: int, file: LogFile) -> LogHealth:
        backlog = self._backlog
        return LogHealth(
            t_ns,
            file.n_bytes,
            backlog.n_waiting,
            backlog.n_dropped_images,
            backlog.n_dropped_records,
            time.thread_time(),
        )

    def _write(self, log: "_FlightLog", record: object) -> None:
        try:
            log.write(record)
        except (KeyError, ValueError, TypeError) as error:
            name = type(record).__name__
            self._fault = f"The log {self.path} lacks a {name} that it could not encode ({error})."


class _FlightLog:
    """The MCAP writer: each record goes to its own JSON channel, and where a viewer can show it, to Foxglove's.

    `newest_ns` is the newest time [ns, flight] of any record.
    """

    def __init__(self, file: LogFile, mission: LoggedMission) -> None:
        context = self._context = foxglove.Context()  # its channels close when it goes
        # Without seeking, a chunk is written whole once it is full: a file cut anywhere holds only whole chunks.
        options = MCAPWriteOptions(
            profile=channels.PROFILE, chunk_size=_CHUNK_BYTES, disable_seeking=True, compression_threads=0
        )
        self._mcap: MCAPWriter = foxglove.open_mcap(file, context=context, writer_options=options)
        self._offset_ns = mission.unix_minus_flight_ns
        self._start_ns = self.newest_ns = mission.start_ns
        self._limits = {
            channel.record: channels.RateLimit(channel.max_rate_hz)
            for channel in channels.RECORD_CHANNELS
            if channel.max_rate_hz is not None
        }
        self._origin: GlobalPoint | None = None
        self._location_limit = channels.RateLimit(channels.LOCATION_RATE_HZ)
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
        self._mcap.write_metadata(
            channels.PROFILE,
            {
                **mission.metadata,
                "mission": mission.name,
                "mission_sha256": mission.sha256,
                "unix_minus_flight_ns": str(self._offset_ns),
            },
        )

    def write(self, record: object) -> None:
        """Write a record to every channel that shows it. Raises KeyError for a type that the table lacks."""
        _WRITE[type(record)](self, record)

    def flush(self) -> None:
        self._mcap.flush()

    def close(self) -> None:
        self._mcap.close()

    def write_plain(self, record: Any) -> None:
        """Write a record as JSON; a channel with a rate limit skips what comes sooner."""
        t_ns = getattr(record, "t_ns", self._start_ns)
        self.newest_ns = max(self.newest_ns, t_ns)
        limit = self._limits.get(type(record))
        if limit is None or limit.admits(t_ns):
            self._json[type(record)].log(channels.encode(record), log_time=t_ns + self._offset_ns)

    def write_vision(self, report: VisionReport) -> None:
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
        self.write_plain(state)
        stamp = self._stamp(state.t_ns)
        position = fox.Vector3(x=state.north_m, y=state.east_m, z=state.down_m)
        attitude = _quaternion(state.roll_rad, state.pitch_rad, state.yaw_rad)
        pose = fox.Pose(position=position, orientation=attitude)
        self._show(channels.POSE, state.t_ns, fox.PoseInFrame(timestamp=stamp, frame_id="ned", pose=pose))
        transform = fox.FrameTransform(
            timestamp=stamp, parent_frame_id="ned", child_frame_id="vehicle", translation=position, rotation=attitude
        )
        self._show(channels.TRANSFORM, state.t_ns, transform)
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
        self._show(channels.CALIBRATION, self._start_ns, calibration)
        mount = fox.FrameTransform(
            timestamp=stamp,
            parent_frame_id="vehicle",
            child_frame_id="camera",
            translation=fox.Vector3(),
            rotation=_FRD_FROM_CAMERA,
        )
        self._show(channels.TRANSFORM, self._start_ns, mount)

    def attach(self, attachment: Attachment) -> None:
        """Write a file."""
        now_ns = time.time_ns()
        self._mcap.attach(
            log_time=now_ns,
            create_time=now_ns,
            name=attachment.name,
            media_type=attachment.media_type,
            data=attachment.data,
        )

    def write_mission(self, mission: LoggedMission) -> None:
        self.write_plain(mission)
        world = fox.FrameTransform(
            timestamp=self._stamp(self._start_ns),
            parent_frame_id="map",
            child_frame_id="ned",
            translation=fox.Vector3(),
            rotation=_MAP_FROM_NED,
        )
        self._show(channels.TRANSFORM, self._start_ns, world)

    def write_line(self, line: TrueLine) -> None:
        self.write_plain(line)
        wires = [_polyline(conductor, 0.05, _LINE_COLOR) for conductor in line.conductors_ned_m]
        poles = [_polyline(((n, e, d), (n, e, 0.0)), 0.3, _SUPPORT_COLOR) for n, e, d in line.supports_ned_m]
        stamp = self._stamp(self._start_ns)
        entity = fox.SceneEntity(timestamp=stamp, frame_id="ned", id="power line", lines=[*wires, *poles])
        self._show(channels.SCENE, self._start_ns, fox.SceneUpdate(entities=[entity]))

    def write_worded(self, record: Any) -> None:
        """Write a record that also reads as a line of text."""
        self.write_plain(record)
        name, severity, text = line_of(record)
        message = fox.Log(timestamp=self._stamp(record.t_ns), level=_LOG_LEVEL[severity], name=name, message=text)
        self._show(channels.LOG, record.t_ns, message)

    def _show(self, channel: channels.FoxgloveChannel, t_ns: int, message: Any) -> None:
        self._foxglove[channel.topic].log(message, log_time=t_ns + self._offset_ns)

    def _stamp(self, t_ns: int) -> fox.Timestamp:
        return fox.Timestamp(*divmod(t_ns + self._offset_ns, NS_PER_S))


_WRITE: dict[type, Callable[[_FlightLog, Any], None]] = {
    LoggedMission: _FlightLog.write_mission,
    VehicleState: _FlightLog.write_state,
    SentSetpoint: _FlightLog.write_plain,
    VisionReport: _FlightLog.write_vision,
    PreflightCheck: _FlightLog.write_worded,
    TaskStarted: _FlightLog.write_worded,
    TaskEnded: _FlightLog.write_worded,
    MissionEnded: _FlightLog.write_worded,
    Event: _FlightLog.write_worded,
    StatusText: _FlightLog.write_worded,
    LineFix: _FlightLog.write_plain,
    AutopilotTarget: _FlightLog.write_plain,
    ClockSync: _FlightLog.write_plain,
    ControlTick: _FlightLog.write_plain,
    LogHealth: _FlightLog.write_plain,
    Origin: _FlightLog.write_origin,
    Intrinsics: _FlightLog.write_camera,
    Attachment: _FlightLog.attach,
    TruePose: _FlightLog.write_plain,
    TrueLine: _FlightLog.write_line,
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


def _polyline(
    points_ned_m: Iterable[tuple[float, float, float]], width_m: float, color: fox.Color
) -> fox.LinePrimitive:
    points = [fox.Point3(x=north, y=east, z=down) for north, east, down in points_ned_m]
    return fox.LinePrimitive(
        type=fox.LinePrimitiveLineType.LineStrip, thickness=width_m, points=points, color=color, pose=_IDENTITY
    )
