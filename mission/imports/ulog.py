"""Read PX4's own log, ULog (docs.px4.io, "ULog File Format"): the only file that imports pyulog."""

import contextlib
import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pyulog import ULog

from mission.imports.autopilot_log import AutopilotLog, Collector, measured, share
from mission.imports.errors import AutopilotLogError
from mission.log.imported import (
    ImportedActuators,
    ImportedMode,
    ImportedPower,
    ImportedSetpoint,
    ImportedState,
    ImportedText,
)

_MAGIC = b"ULog\x01\x12\x35"
_POSITION, _ATTITUDE = "vehicle_local_position", "vehicle_attitude"
_SETPOINT, _TASK_SETPOINT = "vehicle_local_position_setpoint", "trajectory_setpoint"
_MOTORS, _OUTPUTS, _BATTERY, _STATUS = "actuator_motors", "actuator_outputs", "battery_status", "vehicle_status"
_TOPICS = [_POSITION, _ATTITUDE, _SETPOINT, _TASK_SETPOINT, _MOTORS, _OUTPUTS, _BATTERY, _STATUS]
_MAX_ATTITUDE_AGE_S = 0.5
_NO_OUTPUT_BELOW = 2.0  # outputs are pulses [us], or 0 to 1 in PX4's own simulators

# PX4 v1.16 msg/versioned/VehicleStatus.msg, NAVIGATION_STATE_*, in the words of MAVLink's ground stations.
_MODES = {
    0: "MANUAL", 1: "ALTCTL", 2: "POSCTL", 3: "MISSION", 4: "LOITER", 5: "RTL", 6: "POSITION_SLOW", 10: "ACRO",
    12: "DESCEND", 13: "TERMINATION", 14: "OFFBOARD", 15: "STABILIZED", 17: "TAKEOFF", 18: "LAND",
    19: "FOLLOW_TARGET", 20: "PRECLAND", 21: "ORBIT", 22: "VTOL_TAKEOFF",
}  # fmt: skip

Columns = dict[str, NDArray[Any]]


def read_ulog(path: Path) -> AutopilotLog:
    """Read a ULog file, also one that breaks off or is damaged in places, as far as it goes.

    Raises AutopilotLogError when it is no ULog file, or nothing can be read of it; OSError when it cannot be opened.
    """
    with path.open("rb") as file:
        if file.read(len(_MAGIC)) != _MAGIC:
            raise AutopilotLogError(f"{path} is not a ULog file; name the .ulg file that PX4 wrote.")
        file.seek(0)
        try:
            with contextlib.redirect_stdout(io.StringIO()):  # it prints its doubts
                log = ULog(file, _TOPICS)
            collector = _collect(log)
        except OSError:
            raise
        except Exception as error:  # the parser has no error of its own for most of what may be wrong
            raise AutopilotLogError(
                f"The log {path} is damaged ({type(error).__name__}: {error}); fetch it from the vehicle once more."
            ) from error
    version = " ".join(part for part in ("PX4", log.get_version_info_str() or "") if part)
    vehicle = " ".join(str(log.msg_info_dict[key]) for key in ("ver_hw", "sys_uuid") if key in log.msg_info_dict)
    return collector.log("ulog", version, vehicle, is_damaged=bool(log.file_corruption))


def _collect(log: Any) -> Collector:
    topics: dict[str, Columns] = {data.name: data.data for data in log.data_list if data.multi_id == 0}
    collector = Collector()
    if _POSITION in topics and _ATTITUDE in topics:
        for state in _states(topics[_POSITION], topics[_ATTITUDE]):
            collector.add(state)
    if _SETPOINT in topics:
        _add_setpoints(collector, topics[_SETPOINT], ("x", "y", "z"), ("vx", "vy", "vz"))
    elif _TASK_SETPOINT in topics:
        _add_setpoints(collector, topics[_TASK_SETPOINT], _axes("position"), _axes("velocity"))
    for actuators in _actuators(topics):
        collector.add(actuators)
    for power in _power(topics.get(_BATTERY, {})):
        collector.add(power)
    status = topics.get(_STATUS, {})
    for t_us, number in zip(status.get("timestamp", ()), status.get("nav_state", ()), strict=True):
        collector.add(ImportedMode(int(t_us) * 1000, _MODES.get(int(number), f"mode {int(number)}")))
    for message in log.logged_messages:
        collector.add(ImportedText(message.timestamp * 1000, message.message.strip()))
    return collector


def _states(position: Columns, attitude: Columns) -> Iterator[ImportedState]:
    """Each position with the attitude nearest to it."""
    t_us, attitude_us = _true_times(position), _true_times(attitude)
    if not attitude_us.size:
        return
    after = np.clip(np.searchsorted(attitude_us, t_us), 1, max(attitude_us.size - 1, 1))
    after = np.minimum(after, attitude_us.size - 1)
    before = np.maximum(after - 1, 0)
    is_before_nearer = np.abs(attitude_us[before] - t_us) <= np.abs(attitude_us[after] - t_us)
    nearest = np.where(is_before_nearer, before, after)
    w, x, y, z = (attitude[f"q[{index}]"][nearest].astype(np.float64) for index in range(4))
    table = np.stack(
        [
            *(position[name].astype(np.float64) for name in ("x", "y", "z", "vx", "vy", "vz")),
            np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
            np.arcsin(np.clip(2 * (w * y - z * x), -1.0, 1.0)),
            np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)),
        ],
        axis=1,
    )
    is_near = np.abs(attitude_us[nearest] - t_us) <= _MAX_ATTITUDE_AGE_S * 1e6
    is_known = is_near
    for name in ("xy_valid", "z_valid", "v_xy_valid", "v_z_valid"):
        if name in position:
            is_known = is_known & (position[name] != 0)
    for when_us, row in zip(t_us[is_known].tolist(), table[is_known].tolist(), strict=True):
        yield ImportedState(when_us * 1000, *row)


def _true_times(columns: Columns) -> NDArray[np.int64]:
    """When the values were true [us, boot]: the sensors' time where it is told, else that of publishing them."""
    times = columns["timestamp"].astype(np.int64)
    sampled = columns.get("timestamp_sample")
    return times if sampled is None else np.where(sampled > 0, sampled.astype(np.int64), times)


def _add_setpoints(
    collector: Collector, columns: Columns, position: tuple[str, ...], velocity: tuple[str, ...]
) -> None:
    table = [columns[name].tolist() for name in ("timestamp", *position, *velocity, "yaw")]
    for t_us, *values in zip(*table, strict=True):
        collector.add(ImportedSetpoint(t_us * 1000, *map(measured, values)))


def _actuators(topics: dict[str, Columns]) -> Iterator[ImportedActuators]:
    """The motors as the control allocation has them, or the outputs' pulses of older versions."""
    if _MOTORS in topics:
        columns = topics[_MOTORS]
        rows = zip(*(columns[name].tolist() for name in columns if name.startswith("control[")), strict=True)
        for t_us, row in zip(columns["timestamp"].tolist(), rows, strict=True):
            used = [value for value in row if measured(value) is not None]  # NaN: there is no such motor
            yield ImportedActuators(t_us * 1000, tuple(min(max(value, 0.0), 1.0) for value in used))
    elif _OUTPUTS in topics:
        columns = topics[_OUTPUTS]
        rows = zip(*(columns[name].tolist() for name in columns if name.startswith("output[")), strict=True)
        for t_us, n_outputs, row in zip(columns["timestamp"].tolist(), columns["noutputs"].tolist(), rows, strict=True):
            pulses = [value for value in row[:n_outputs] if measured(value) is not None]
            is_share = max(pulses, default=0.0) < _NO_OUTPUT_BELOW
            yield ImportedActuators(
                t_us * 1000, tuple(min(max(value, 0.0), 1.0) if is_share else share(value) for value in pulses)
            )


def _power(columns: Columns) -> Iterator[ImportedPower]:
    if not columns:
        return
    names = ("timestamp", "voltage_v", "current_a", "remaining")
    for t_us, voltage_v, current_a, remaining in zip(*(columns[name].tolist() for name in names), strict=True):
        yield ImportedPower(
            t_us * 1000,
            measured(voltage_v, least=0.001),
            measured(current_a, least=0.0),
            measured(remaining, least=0.0),
        )


def _axes(name: str) -> tuple[str, ...]:
    return tuple(f"{name}[{axis}]" for axis in range(3))
