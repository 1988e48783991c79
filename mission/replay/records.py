"""What a replay leaves in a reference log: what the program made of the log's frames and states when it was written."""

from dataclasses import dataclass

from vision.records import LineEstimate, Track, Trouble


@dataclass(frozen=True, slots=True)
class ReplayedEstimate:
    """What vision made of the frame taken at `t_ns`; as in VisionReport."""

    t_ns: int
    seq: int
    estimate: LineEstimate | None
    track: Track
    trouble: Trouble | None


@dataclass(frozen=True, slots=True)
class ReplayedSetpoint:
    """What the task made of the control tick at `t_ns`: NED [m], yaw [rad]."""

    t_ns: int
    north_m: float
    east_m: float
    down_m: float
    yaw_rad: float
