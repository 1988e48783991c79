"""Read telemetry logs (.tlog) and ArduPilot's dataflash logs (.bin): the one file of mission that knows pymavlink."""

import contextlib
import io
import math
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pymavlink import mavutil
from pymavlink.DFReader import DFReader_binary

from drivers.clock import NS_PER_S
from mission.imports.autopilot_log import AutopilotLog, Collector, Tell, measured, share
from mission.imports.errors import AutopilotLogError
from mission.log.imported import (
    ImportedActuators,
    ImportedMode,
    ImportedPower,
    ImportedSetpoint,
    ImportedState,
    ImportedText,
)

_TELL_PERIOD = 2_000  # messages
_RESTART_NS = 2 * NS_PER_S  # a boot time this far behind the newest is no late message
_MAX_SILENCE_NS = 10 * NS_PER_S
_AUTOPILOT_COMPONENT = 1
_NO_AUTOPILOT = 8  # MAV_AUTOPILOT_INVALID: a ground station, a camera
_UNKNOWN_MV, _N_OUTPUTS = 65535, 8
_KINDS = {3: "ArduPilot", 12: "PX4"}  # MAV_AUTOPILOT
_DATAFLASH_MAGIC = b"\xa3\x95"
_MOTOR_FUNCTIONS = (*range(33, 41), *range(82, 86))  # ArduPilot's SERVOn_FUNCTION of motors 1 to 12
_DATAFLASH_TYPES = [
    *("XKF1", "NKF1", "XKF4", "NKF4", "PSCN", "PSCE", "PSCD", "RCOU", "BAT", "MSG", "MODE", "VER", "PARM"),
]


def read_telemetry_log(path: Path, tell: Tell) -> list[AutopilotLog]:
    """Read a telemetry log: for each time that the autopilot was started, what it told from then on.

    The autopilot's times are those of LOCAL_POSITION_NED and ATTITUDE; what carries none is placed between them by the
    time at which it was received. Other vehicles and what was sent to the autopilot are left out. Raises
    AutopilotLogError when no autopilot speaks in it; OSError when it cannot be opened.
    """
    runs = [_Telemetry()]
    n_bad = end = 0
    os.environ["MAVLINK20"] = (
        "1"  # whose parser takes both versions; the library would settle on that of the first byte
    )
    mavutil.set_dialect("all")
    with contextlib.closing(mavutil.mavlogfile(str(path))) as source, _muted():
        for index, message in enumerate(iter(source.recv_msg, None)):
            if index % _TELL_PERIOD == 0:
                tell(source.percent / 100)
            if message.get_type() == "BAD_DATA":
                n_bad += 1
            elif not runs[-1].take(message):
                runs.append(runs[-1].after_restart())
                runs[-1].take(message)
            end = source.f.tell()
        breaks_off = end < source.filesize  # within a message, or the time before it
    if runs[-1].system is None:
        raise AutopilotLogError(f"{path} holds no message of an autopilot; name a telemetry log (.tlog).")
    return [run.log(is_damaged=n_bad > 0, breaks_off=breaks_off) for run in runs]


class _Telemetry:
    """What one autopilot tells by MAVLink, from one start to the next."""

    def __init__(self) -> None:
        self.system: int | None = None
        self._autopilot = 0
        self._version = ""
        self._uid = ""
        self._collector = Collector()
        self._boot_ns: int | None = None
        self._received_s = 0.0
        self._attitude: tuple[float, float, float] | None = None
        self._text = (0, 0)  # id and number of the newest piece
        self._outputs: dict[int, int] = {}  # SERVOn_FUNCTION by n

    def after_restart(self) -> "_Telemetry":
        """The same autopilot, started anew."""
        new = _Telemetry()
        new.system, new._autopilot, new._version, new._uid = self.system, self._autopilot, self._version, self._uid
        return new

    def log(self, *, is_damaged: bool, breaks_off: bool) -> AutopilotLog:
        version = " ".join(part for part in (_KINDS.get(self._autopilot, ""), self._version) if part)
        return self._collector.log("telemetry", version, self._uid, is_damaged=is_damaged, breaks_off=breaks_off)

    def take(self, message: Any) -> bool:
        """Take a message; False when it shows that the autopilot was started anew, and has to go to the next run."""
        kind = message.get_type()
        if message.get_srcComponent() != _AUTOPILOT_COMPONENT:
            return True
        if self.system is None and kind == "HEARTBEAT" and message.autopilot != _NO_AUTOPILOT:
            self.system, self._autopilot = message.get_srcSystem(), message.autopilot
        if message.get_srcSystem() != self.system:
            return True
        if kind in ("LOCAL_POSITION_NED", "ATTITUDE"):
            boot_ns = message.time_boot_ms * 1_000_000
            if self._boot_ns is not None and boot_ns < self._boot_ns - _RESTART_NS:
                return False
            self._boot_ns = boot_ns if self._boot_ns is None else max(boot_ns, self._boot_ns)
            self._received_s = message._timestamp
        if self._boot_ns is not None:
            handler = getattr(self, f"_on_{kind.lower()}", None)
            if handler is not None:
                handler(message)
        elif kind == "AUTOPILOT_VERSION":
            self._on_autopilot_version(message)
        return True

    def _now_ns(self, message: Any) -> int:
        """The autopilot's time of a message that carries none: what it last told, and what has passed since."""
        assert self._boot_ns is not None  # noqa: S101
        since_ns: int = round((message._timestamp - self._received_s) * NS_PER_S)
        return self._boot_ns + min(max(since_ns, 0), _MAX_SILENCE_NS)

    def _on_attitude(self, message: Any) -> None:
        self._attitude = (message.roll, message.pitch, message.yaw)

    def _on_local_position_ned(self, message: Any) -> None:
        if self._attitude is not None:
            position = (message.x, message.y, message.z, message.vx, message.vy, message.vz)
            self._collector.add(ImportedState(message.time_boot_ms * 1_000_000, *position, *self._attitude))

    def _on_position_target_local_ned(self, message: Any) -> None:
        names = ("x", "y", "z", "vx", "vy", "vz", "yaw")
        # The type mask says what is ignored; bits 0 to 5 in the order of the names, 10 the yaw.
        used = [message.type_mask & (1 << bit) == 0 for bit in (0, 1, 2, 3, 4, 5, 10)]
        values = (measured(getattr(message, name)) if use else None for name, use in zip(names, used, strict=True))
        self._collector.add(ImportedSetpoint(message.time_boot_ms * 1_000_000, *values))

    def _on_servo_output_raw(self, message: Any) -> None:
        if message.port == 0:
            pulses = {n: getattr(message, f"servo{n}_raw", 0) or 0 for n in range(1, 17)}
            motors = _motors(pulses, self._outputs, {})
            self._collector.add(ImportedActuators(self._now_ns(message), motors))

    def _on_param_value(self, message: Any) -> None:
        _note_function(self._outputs, message.param_id, message.param_value)

    def _on_sys_status(self, message: Any) -> None:
        is_told = message.voltage_battery not in (0, _UNKNOWN_MV)
        self._collector.add(
            ImportedPower(
                self._now_ns(message),
                message.voltage_battery / 1000 if is_told else None,
                measured(message.current_battery / 100, least=0.0),
                measured(message.battery_remaining / 100, least=0.0),
            )
        )

    def _on_statustext(self, message: Any) -> None:
        number, piece = getattr(message, "id", 0), getattr(message, "chunk_seq", 0)
        if piece and (number, piece - 1) == self._text:
            self._collector.extend_text(message.text.rstrip("\t"))
        else:
            self._collector.add(ImportedText(self._now_ns(message), message.text.rstrip("\t")))
        self._text = (number, piece)

    def _on_heartbeat(self, message: Any) -> None:
        self._collector.add(ImportedMode(self._now_ns(message), mavutil.mode_string_v10(message)))

    def _on_autopilot_version(self, message: Any) -> None:
        number = message.flight_sw_version  # a byte each: major, minor, patch, kind of release
        self._version = ".".join(str(number >> shift & 0xFF) for shift in (24, 16, 8))
        self._uid = f"{message.uid:016x}" if message.uid else ""


def read_dataflash_log(path: Path, tell: Tell) -> AutopilotLog:
    """Read a dataflash log of ArduPilot: one start of the autopilot, and the estimate of its primary EKF.

    Raises AutopilotLogError when it is no dataflash log or nothing can be read of it; OSError when it cannot be opened.
    """
    with path.open("rb") as file:
        if file.read(len(_DATAFLASH_MAGIC)) != _DATAFLASH_MAGIC:
            raise AutopilotLogError(f"{path} is not a dataflash log; name the .bin file that ArduPilot wrote.")
    doubts = io.StringIO()
    try:
        with _muted(doubts), contextlib.closing(DFReader_binary(str(path))) as source:
            flight = _Dataflash(source)
            for index, message in enumerate(_dataflash_messages(source)):
                if index % _TELL_PERIOD == 0:
                    tell(source.percent / 100)
                flight.take(message)
    except OSError:
        raise
    except Exception as error:  # the parser has no error of its own for what may be wrong
        raise AutopilotLogError(
            f"The log {path} is damaged ({type(error).__name__}: {error}); fetch it from the vehicle once more."
        ) from error
    return flight.log(is_damaged=bool(doubts.getvalue()))


def _dataflash_messages(source: Any) -> Iterator[Any]:
    while (message := source.recv_match(type=_DATAFLASH_TYPES)) is not None:
        yield message


class _Dataflash:
    """What ArduPilot logs: EKF, position control, outputs, battery, messages and modes."""

    def __init__(self, source: Any) -> None:
        self._source = source
        self._collector = Collector()
        self._version = ""
        self._primary = 0
        self._target: dict[str, tuple[float, float]] = {}
        self._outputs: dict[int, int] = {}
        self._parameters: dict[str, float] = {}

    def log(self, *, is_damaged: bool) -> AutopilotLog:
        return self._collector.log("dataflash", self._version, "", has_own_origin=True, is_damaged=is_damaged)

    def take(self, message: Any) -> None:
        handler = getattr(self, f"_on_{message.get_type().lower()}", None)
        if handler is not None and hasattr(message, "TimeUS"):
            handler(message, int(message.TimeUS) * 1000)

    def _on_xkf1(self, message: Any, t_ns: int) -> None:
        if getattr(message, "C", 0) == self._primary:
            attitude_rad = (math.radians(angle) for angle in (message.Roll, message.Pitch, message.Yaw))
            roll_rad, pitch_rad, yaw_rad = (math.remainder(angle, math.tau) for angle in attitude_rad)
            position = (message.PN, message.PE, message.PD, message.VN, message.VE, message.VD)
            self._collector.add(ImportedState(t_ns, *position, roll_rad, pitch_rad, yaw_rad))

    _on_nkf1 = _on_xkf1

    def _on_xkf4(self, message: Any, _: int) -> None:
        self._primary = int(getattr(message, "PI", 0))

    _on_nkf4 = _on_xkf4

    def _on_pscn(self, message: Any, _: int) -> None:
        self._target["north"] = message.TPN, message.TVN

    def _on_psce(self, message: Any, _: int) -> None:
        self._target["east"] = message.TPE, message.TVE

    def _on_pscd(self, message: Any, t_ns: int) -> None:
        """The last of the three axes, which are logged together."""
        self._target["down"] = message.TPD, message.TVD
        axes = [self._target.get(axis, (math.nan, math.nan)) for axis in ("north", "east", "down")]
        (north_m, v_north_m_s), (east_m, v_east_m_s), (down_m, v_down_m_s) = axes
        values = (north_m, east_m, down_m, v_north_m_s, v_east_m_s, v_down_m_s, math.nan)
        self._collector.add(ImportedSetpoint(t_ns, *map(measured, values)))
        self._target.clear()

    def _on_rcou(self, message: Any, t_ns: int) -> None:
        pulses = {n: getattr(message, f"C{n}", 0) for n in range(1, 17)}
        self._collector.add(ImportedActuators(t_ns, _motors(pulses, self._outputs, self._parameters)))

    def _on_bat(self, message: Any, t_ns: int) -> None:
        if getattr(message, "Inst", getattr(message, "Instance", 0)) == 0:
            remaining = measured(getattr(message, "RemPct", math.nan), least=0.0)
            self._collector.add(
                ImportedPower(
                    t_ns,
                    measured(message.Volt, least=0.001),
                    measured(message.Curr, least=0.0),
                    None if remaining is None else remaining / 100,
                )
            )

    def _on_msg(self, message: Any, t_ns: int) -> None:
        if not self._version and message.Message.startswith("Ardu"):
            self._version = message.Message.strip()
        self._collector.add(ImportedText(t_ns, message.Message.strip()))

    def _on_ver(self, message: Any, _: int) -> None:
        self._version = str(getattr(message, "FWS", "")).strip() or self._version

    def _on_mode(self, _: Any, t_ns: int) -> None:
        self._collector.add(ImportedMode(t_ns, self._source.flightmode))

    def _on_parm(self, message: Any, _: int) -> None:
        _note_function(self._outputs, message.Name, message.Value)
        if message.Name in ("MOT_PWM_MIN", "MOT_PWM_MAX"):
            self._parameters[message.Name] = message.Value


def _note_function(outputs: dict[int, int], name: str, value: float) -> None:
    """Remember what an output is for, when the parameter says so (ArduPilot's SERVOn_FUNCTION)."""
    number = name.removeprefix("SERVO").removesuffix("_FUNCTION")
    if name == f"SERVO{number}_FUNCTION" and number.isdecimal() and math.isfinite(value):
        outputs[int(number)] = int(value)


def _motors(pulses_us: dict[int, float], functions: dict[int, int], parameters: dict[str, float]) -> tuple[float, ...]:
    """The motors among the outputs, in their order; as long as no parameter names them, the first 8 outputs in use."""
    by_motor = {function: n for n, function in functions.items() if function in _MOTOR_FUNCTIONS and n in pulses_us}
    used = [by_motor[function] for function in _MOTOR_FUNCTIONS if function in by_motor]
    if not used:
        used = [n for n in range(1, _N_OUTPUTS + 1) if pulses_us[n] > 0]
    low_us, high_us = parameters.get("MOT_PWM_MIN", 0), parameters.get("MOT_PWM_MAX", 0)
    if not 0 < low_us < high_us:
        low_us, high_us = 1000.0, 2000.0
    return tuple(share(pulses_us[n], low_us, high_us) for n in used)


@contextlib.contextmanager
def _muted(doubts: io.StringIO | None = None) -> Iterator[None]:
    """The library prints what it finds wrong; that goes to `doubts`."""
    heard = io.StringIO() if doubts is None else doubts
    with contextlib.redirect_stdout(heard), contextlib.redirect_stderr(heard):
        yield
