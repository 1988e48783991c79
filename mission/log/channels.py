"""The table of everything a flight log holds: which topic carries what, in which schema, how often."""

import enum
from dataclasses import dataclass
from typing import Any

from pydantic import TypeAdapter, ValidationError

from drivers.clock import NS_PER_S
from drivers.mcap_stream import IMAGE_TOPIC
from mission.autopilot import VehicleState
from mission.log.imported import (
    ImportedActuators,
    ImportedLog,
    ImportedMode,
    ImportedPower,
    ImportedSetpoint,
    ImportedState,
    ImportedText,
)
from mission.log.records import LoggedMission, LogHealth, SentSetpoint, StatusText, VisionEntry
from mission.log.viewer_schema import simple_schema
from mission.records import (
    AutopilotTarget,
    ClockSync,
    ControlTick,
    Event,
    FlightStart,
    LineFix,
    MissionEnded,
    Origin,
    PreflightCheck,
    TaskEnded,
    TaskStarted,
    TrueLine,
    TruePose,
)
from mission.replay.records import ReplayedEstimate, ReplayedSetpoint

PROFILE = "lineflight"


class Kept(enum.StrEnum):
    """How much of a stream the log keeps."""

    ALWAYS = "always"
    SAMPLED = "sampled"


@dataclass(frozen=True, slots=True)
class RecordChannel:
    """A topic of records as JSON, one record type each: all that a report needs.

    The JSON Schema follows from the record's fields, so units stand in their names. `max_rate_hz` [1/s, flight] thins
    what comes more often; None keeps all.
    """

    topic: str
    record: type
    what: str
    rate: str
    max_rate_hz: float | None = None

    @property
    def kept(self) -> Kept:
        """Whether all of it is kept."""
        return Kept.ALWAYS if self.max_rate_hz is None else Kept.SAMPLED


@dataclass(frozen=True, slots=True)
class FoxgloveChannel:
    """A topic in one of Foxglove's own schemas (protobuf), for its panels; nothing of ours reads it but the images."""

    topic: str
    schema: str
    what: str
    rate: str
    kept: Kept = Kept.ALWAYS


RECORD_CHANNELS = (
    RecordChannel("/mission", LoggedMission, "the mission file, and how log times belong to flight times", "once"),
    RecordChannel("/preflight/check", PreflightCheck, "what each check before arming found", "once each"),
    RecordChannel("/mission/start", FlightStart, "where the mission began", "once"),
    RecordChannel("/vehicle/origin", Origin, "where on Earth the local frame lies", "once"),
    RecordChannel("/vehicle/state", VehicleState, "the vehicle as telemetry tells it", "every control tick"),
    RecordChannel(
        "/vehicle/target", AutopilotTarget, "where the autopilot says that it flies to", "at most 10 Hz", 10.0
    ),
    RecordChannel("/vehicle/clock", ClockSync, "the autopilot's clock against ours, and the link's latency", "1 Hz"),
    RecordChannel("/setpoint", SentSetpoint, "the offboard setpoints", "every control tick while offboard"),
    RecordChannel("/control/tick", ControlTick, "how punctual the control loop is", "every control tick"),
    RecordChannel("/vision/report", VisionEntry, "line estimates and power lines", "every frame worked on"),
    RecordChannel("/line", LineFix, "where the line is, as far as known", "every frame that showed it"),
    RecordChannel("/task/started", TaskStarted, "the executive entered a task", "on change"),
    RecordChannel("/task/ended", TaskEnded, "the executive left a task, and why", "on change"),
    RecordChannel("/mission/ended", MissionEnded, "how the flight ended", "once"),
    RecordChannel("/event", Event, "what happened and what was done about it", "on change"),
    RecordChannel("/status_text", StatusText, "the autopilot's own words", "on change"),
    RecordChannel("/replayed/estimate", ReplayedEstimate, "what a reference replay saw", "only in a reference log"),
    RecordChannel("/replayed/setpoint", ReplayedSetpoint, "where a reference replay went", "only in a reference log"),
    RecordChannel("/log/health", LogHealth, "how the log itself does", "1 Hz"),
    RecordChannel("/truth/pose", TruePose, "where a simulated vehicle truly was", "at most 20 Hz", 20.0),
    RecordChannel("/truth/line", TrueLine, "the simulated power line", "once"),
    # Nothing writes these in flight: `lineflight import` adds them to a copy of the log.
    RecordChannel("/imported/log", ImportedLog, "the autopilot's own log, and how its clock was aligned", "once"),
    RecordChannel("/imported/state", ImportedState, "the vehicle as the autopilot logged it", "at most 20 Hz", 20.0),
    RecordChannel("/imported/setpoint", ImportedSetpoint, "what its position control flew to", "at most 20 Hz", 20.0),
    RecordChannel("/imported/actuators", ImportedActuators, "what the motors were told", "at most 10 Hz", 10.0),
    RecordChannel("/imported/power", ImportedPower, "the battery as the autopilot measured it", "at most 2 Hz", 2.0),
    RecordChannel("/imported/text", ImportedText, "the messages that the autopilot logged", "on change"),
    RecordChannel("/imported/mode", ImportedMode, "the flight mode by the autopilot's own name", "on change"),
)

IMAGE = FoxgloveChannel(
    IMAGE_TOPIC,
    "foxglove.CompressedImage",
    "the camera's frames as JPEG",
    "vision.log_rate_hz; 0 turns it off",
    Kept.SAMPLED,
)
ANNOTATIONS = FoxgloveChannel(
    "/camera/lines",
    "foxglove.ImageAnnotations",
    "the power lines found on a frame, at its time",
    "with each frame kept",
    Kept.SAMPLED,
)
CALIBRATION = FoxgloveChannel("/camera/calibration", "foxglove.CameraCalibration", "the camera's intrinsics", "once")
# After a seek a viewer is handed the last message of each topic, so that what stands still has topics of its own.
MAP = FoxgloveChannel("/tf/map", "foxglove.FrameTransform", "ned in map (ENU, which viewers hold upright)", "once")
MOUNT = FoxgloveChannel("/tf/camera", "foxglove.FrameTransform", "camera in vehicle", "once")
TRANSFORM = FoxgloveChannel("/tf", "foxglove.FrameTransform", "vehicle (FRD) in ned", "as the state")
CHASE = FoxgloveChannel(
    "/tf/chase", "foxglove.FrameTransform", "chase (at the vehicle, ENU) in ned, for a view to follow", "as the state"
)
POSE = FoxgloveChannel("/vehicle/pose", "foxglove.PoseInFrame", "the vehicle's pose in ned", "as the state")
LOCATION = FoxgloveChannel(
    "/vehicle/location",
    "foxglove.LocationFix",
    "the vehicle on Earth, once the origin is known",
    "at most 2 Hz",
    Kept.SAMPLED,
)
LOG = FoxgloveChannel("/log", "foxglove.Log", "events, tasks and the autopilot's words to read along", "on change")
SHAPE = FoxgloveChannel("/vehicle/shape", "foxglove.SceneUpdate", "the vehicle to look at", "once")
KNOWN_LINE = FoxgloveChannel(
    "/line/scene", "foxglove.SceneUpdate", "the line where it is known to be", "at most 5 Hz", Kept.SAMPLED
)
SCENE = FoxgloveChannel("/truth/scene", "foxglove.SceneUpdate", "the simulated conductors and poles", "once")

LOCATION_RATE_HZ, KNOWN_LINE_RATE_HZ = 2.0, 5.0
FOXGLOVE_CHANNELS = (
    *(IMAGE, ANNOTATIONS, CALIBRATION),
    *(MAP, MOUNT, TRANSFORM, CHASE, POSE, LOCATION),
    *(LOG, SHAPE, KNOWN_LINE, SCENE),
)


CAPTURE_TIMED = (VisionEntry, LineFix)
"""What carries a frame's time of capture, as its camera tells it: where that clock is wrong, it says nothing about how
long the flight was. All else carries our own clock's time.
"""


class RateLimit:
    """Lets through at most `rate_hz` [1/s, flight] of a stream."""

    def __init__(self, rate_hz: float) -> None:
        self._period_ns = round(NS_PER_S / rate_hz)
        self._due_ns: int | None = None

    def admits(self, t_ns: int) -> bool:
        """Whether the stream's next record, at `t_ns`, is let through."""
        due_ns = t_ns if self._due_ns is None else self._due_ns
        if t_ns < due_ns - self._period_ns // 4:  # a source at just this rate may come a little early
            return False
        self._due_ns = max(due_ns, t_ns - self._period_ns) + self._period_ns
        return True


CHANNEL_OF = {channel.record: channel for channel in RECORD_CHANNELS}
CHANNEL_AT = {channel.topic: channel for channel in RECORD_CHANNELS}
_ADAPTERS: dict[type, TypeAdapter[Any]] = {channel.record: TypeAdapter(channel.record) for channel in RECORD_CHANNELS}


def encode(record: object) -> bytes:
    """Turn a record of the table into JSON, its fields as keys.

    Raises ValueError for a number that JSON does not have (NaN, infinity): as null it could not be read back.
    """
    adapter = _ADAPTERS[type(record)]
    body = adapter.dump_json(record)
    if b"null" in body:
        try:
            adapter.validate_json(body)
        except ValidationError as error:
            where = ".".join(map(str, error.errors()[0]["loc"]))
            raise ValueError(f"its {where} is no finite number") from None
    return body


def decode(topic: str, body: bytes) -> Any:
    """Read back what `encode` made for a topic of RECORD_CHANNELS. Raises ValueError when `body` does not fit."""
    return _ADAPTERS[CHANNEL_AT[topic].record].validate_json(body)


def json_schema(record: type) -> dict[str, Any]:
    """Describe a record type of the table as a JSON Schema that viewers can read."""
    return simple_schema(_ADAPTERS[record].json_schema())
