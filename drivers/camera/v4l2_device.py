"""V4L2 devices asked directly: what they are, which modes they offer, and their controls (linux/videodev2.h).

OpenCV opens and reads a device, but cannot list its modes nor name its controls. Each class below is one of the
kernel's structures; every ioctl goes through `_Device.ask`.
"""

import ctypes
import errno
import fcntl
import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Self

from drivers.camera.camera import CameraError

_READ, _WRITE = 2, 1
_CAPTURE = 1  # V4L2_BUF_TYPE_VIDEO_CAPTURE, and V4L2_CAP_VIDEO_CAPTURE
_HAS_DEVICE_CAPS = 0x80000000
_DISCRETE = 1
_NEXT_CONTROL = 0x80000000
_DISABLED, _READ_ONLY = 0x0001, 0x0004
_PLAIN_CONTROLS = {1: "integer", 2: "boolean", 3: "menu", 8: "bitmask", 9: "menu"}


class _Capability(ctypes.Structure):
    _fields_ = (
        ("driver", ctypes.c_char * 16),
        ("card", ctypes.c_char * 32),
        ("bus_info", ctypes.c_char * 32),
        ("version", ctypes.c_uint32),
        ("capabilities", ctypes.c_uint32),
        ("device_caps", ctypes.c_uint32),
        ("reserved", ctypes.c_uint32 * 3),
    )


class _Format(ctypes.Structure):
    _fields_ = (
        ("index", ctypes.c_uint32),
        ("type", ctypes.c_uint32),
        ("flags", ctypes.c_uint32),
        ("description", ctypes.c_char * 32),
        ("pixelformat", ctypes.c_uint32),
        ("mbus_code", ctypes.c_uint32),
        ("reserved", ctypes.c_uint32 * 3),
    )


class _FrameSize(ctypes.Structure):
    # Discrete: width and height. Else min, max and step of the width, then of the height.
    _fields_ = (
        ("index", ctypes.c_uint32),
        ("pixel_format", ctypes.c_uint32),
        ("type", ctypes.c_uint32),
        ("size", ctypes.c_uint32 * 6),
        ("reserved", ctypes.c_uint32 * 2),
    )


class _FrameInterval(ctypes.Structure):
    # Discrete: numerator and denominator [s]. Else those of the shortest, the longest and the step.
    _fields_ = (
        ("index", ctypes.c_uint32),
        ("pixel_format", ctypes.c_uint32),
        ("width", ctypes.c_uint32),
        ("height", ctypes.c_uint32),
        ("type", ctypes.c_uint32),
        ("interval", ctypes.c_uint32 * 6),
        ("reserved", ctypes.c_uint32 * 2),
    )


class _ControlQuery(ctypes.Structure):
    _fields_ = (
        ("id", ctypes.c_uint32),
        ("type", ctypes.c_uint32),
        ("name", ctypes.c_char * 32),
        ("minimum", ctypes.c_int32),
        ("maximum", ctypes.c_int32),
        ("step", ctypes.c_int32),
        ("default_value", ctypes.c_int32),
        ("flags", ctypes.c_uint32),
        ("reserved", ctypes.c_uint32 * 2),
    )


class _ControlValue(ctypes.Structure):
    _fields_ = (("id", ctypes.c_uint32), ("value", ctypes.c_int32))


def _request(direction: int, number: int, structure: type[ctypes.Structure]) -> int:
    """An ioctl's number, as the kernel's _IOC makes it."""
    return direction << 30 | ctypes.sizeof(structure) << 16 | ord("V") << 8 | number


_QUERY_CAPABILITY = _request(_READ, 0, _Capability)
_LIST_FORMATS = _request(_READ | _WRITE, 2, _Format)
_GET_CONTROL = _request(_READ | _WRITE, 27, _ControlValue)
_SET_CONTROL = _request(_READ | _WRITE, 28, _ControlValue)
_QUERY_CONTROL = _request(_READ | _WRITE, 36, _ControlQuery)
_LIST_SIZES = _request(_READ | _WRITE, 74, _FrameSize)
_LIST_INTERVALS = _request(_READ | _WRITE, 75, _FrameInterval)


@dataclass(frozen=True, slots=True)
class Mode:
    """One way a camera can deliver frames; `rates_hz` the highest first, empty where the driver does not say.

    A camera that scales freely gives its largest size.
    """

    pixel_format: str
    width_px: int
    height_px: int
    rates_hz: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Control:
    """A control of a camera, under the name that v4l2-ctl gives it. `value` is None where it cannot be read."""

    name: str
    kind: str
    minimum: int
    maximum: int
    step: int
    default: int
    value: int | None
    is_read_only: bool
    identity: int


@dataclass(frozen=True, slots=True)
class DeviceInfo:
    """A camera that the kernel knows."""

    path: Path
    name: str
    driver: str
    bus: str
    modes: tuple[Mode, ...]


def list_devices(folder: Path = Path("/dev")) -> list[DeviceInfo]:
    """Every device in `folder` that captures video, by number; those that cannot be asked are left out."""
    paths = [path for path in folder.glob("video*") if path.name.removeprefix("video").isdigit()]
    found = []
    for path in sorted(paths, key=lambda path: int(path.name.removeprefix("video"))):
        try:
            with _Device(path) as device:
                info = device.info()
        except CameraError:
            continue
        if info is not None:
            found.append(info)
    return found


def read_controls(path: Path) -> list[Control]:
    """The controls of a device, in the driver's order. Raises CameraError when it cannot be asked."""
    with _Device(path) as device:
        return list(device.controls())


def set_controls(path: Path, wanted: Sequence[tuple[str, int]]) -> None:
    """Set controls in the order given, and check that each took its value.

    Raises CameraError for a control that the device has not, a value out of its range, and one that did not take.
    """
    with _Device(path) as device:
        known = {control.name: control for control in device.controls()}
        for name, value in wanted:
            control = known.get(name)
            if control is None:
                raise CameraError(f"The camera {path} has no control '{name}'; it has {', '.join(sorted(known))}.")
            if not control.minimum <= value <= control.maximum:
                raise CameraError(
                    f"The control {name} of {path} takes {control.minimum} to {control.maximum}, not {value}."
                )
            device.set_control(control, value)


def control_name(title: str) -> str:
    """A control's title as a name: 'Exposure Time, Absolute' is exposure_time_absolute."""
    return re.sub(r"[^a-z0-9]+", "_", title.lower()).strip("_")


class _Device:
    """An open device node; its methods raise CameraError when the device has gone."""

    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            self._file = os.open(path, os.O_RDWR | os.O_NONBLOCK)
        except OSError as error:
            raise CameraError(f"The camera {path} cannot be opened: {error.strerror}.") from None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        os.close(self._file)

    def ask(self, request: int, question: ctypes.Structure) -> bool:
        """Let the kernel fill `question` in; False when it refuses: there is no such thing, or not now."""
        try:
            fcntl.ioctl(self._file, request, question)
        except OSError as error:
            # Only these say that the device is gone. USB cameras answer single controls with all kinds of errors.
            if error.errno in (errno.ENODEV, errno.ENXIO, errno.EBADF):
                raise CameraError(f"The camera {self._path} does not answer: {error.strerror}.") from None
            return False
        return True

    def info(self) -> DeviceInfo | None:
        """What the device is; None where it does not capture video (a codec, or a camera's metadata node)."""
        said = _Capability()
        if not self.ask(_QUERY_CAPABILITY, said):
            return None
        capabilities = said.device_caps if said.capabilities & _HAS_DEVICE_CAPS else said.capabilities
        if not capabilities & _CAPTURE:
            return None
        modes = tuple(self._modes())
        name, driver, bus = (word.decode(errors="replace") for word in (said.card, said.driver, said.bus_info))
        return DeviceInfo(self._path, name, driver, bus, modes)

    def _modes(self) -> Iterator[Mode]:
        form = _Format(type=_CAPTURE)
        while self.ask(_LIST_FORMATS, form):
            size = _FrameSize(pixel_format=form.pixelformat)
            while self.ask(_LIST_SIZES, size):
                is_discrete = size.type == _DISCRETE
                width_px, height_px = (size.size[0], size.size[1]) if is_discrete else (size.size[1], size.size[4])
                rates_hz = tuple(sorted(self._rates_hz(form.pixelformat, width_px, height_px), reverse=True))
                yield Mode(form.pixelformat.to_bytes(4, "little").decode("ascii", "replace"), width_px, height_px,
                           rates_hz)  # fmt: skip
                if not is_discrete:
                    break
                size.index += 1
            form.index += 1

    def _rates_hz(self, pixel_format: int, width_px: int, height_px: int) -> Iterator[float]:
        asked = _FrameInterval(pixel_format=pixel_format, width=width_px, height=height_px)
        while self.ask(_LIST_INTERVALS, asked):
            if asked.interval[0]:
                yield asked.interval[1] / asked.interval[0]
            if asked.type != _DISCRETE:
                return
            asked.index += 1

    def controls(self) -> Iterator[Control]:
        """The controls that hold one number."""
        asked = _ControlQuery(id=_NEXT_CONTROL)
        while self.ask(_QUERY_CONTROL, asked):
            if asked.type in _PLAIN_CONTROLS and not asked.flags & _DISABLED:
                value = _ControlValue(id=asked.id)
                yield Control(
                    name=control_name(asked.name.decode("utf-8", "replace")),
                    kind=_PLAIN_CONTROLS[asked.type],
                    minimum=asked.minimum,
                    maximum=asked.maximum,
                    step=asked.step,
                    default=asked.default_value,
                    value=value.value if self.ask(_GET_CONTROL, value) else None,
                    is_read_only=bool(asked.flags & _READ_ONLY),
                    identity=asked.id,
                )
            asked = _ControlQuery(id=asked.id | _NEXT_CONTROL)

    def set_control(self, control: Control, value: int) -> None:
        """Set one control; raises CameraError where it keeps another value."""
        if not self.ask(_SET_CONTROL, _ControlValue(id=control.identity, value=value)):
            raise CameraError(
                f"The camera {self._path} refuses {control.name} {value}; some controls need another one set first "
                "(exposure_time_absolute needs auto_exposure 1)."
            )
        took = _ControlValue(id=control.identity)
        if self.ask(_GET_CONTROL, took) and abs(took.value - value) > control.step // 2:
            raise CameraError(f"The camera {self._path} set {control.name} to {took.value} when asked for {value}.")
