"""The virtual camera, from outside: pull its plug, put it back, and turn its controls. It needs root, and `vivid`."""

import fcntl
import os
import struct
import time
from enum import IntEnum
from pathlib import Path

DEVICE = Path("/dev/video0")

_DRIVER = Path("/sys/bus/platform/drivers/vivid")
_NAME = "vivid.0"
_PLUG_TIMEOUT_S = 10.0
_VIDIOC_G_CTRL = 0xC008561B
_VIDIOC_S_CTRL = 0xC008561C


class Control(IntEnum):
    """Controls of vivid's own, by their V4L2 id (drivers/media/test-drivers/vivid/vivid-ctrls.c)."""

    TEST_PATTERN = 0x00F0F000  # RED, GREEN, BLUE below
    OSD_TEXT = 0x00F0F001  # 2: none
    TIMESTAMP_SOURCE = 0x00F0F018  # 0: end of frame, which vivid foretells; 1: start of exposure
    WRAP_TIMESTAMP = 0x00F0F027  # 0: CLOCK_MONOTONIC; 1, 2: far from it
    DROPPED_PERCENT = 0x00F0F040
    DISCONNECT = 0x00F0F041
    FATAL_STREAMING_ERROR = 0x00F0F046


RED, GREEN, BLUE = 7, 8, 9


def unplug() -> None:
    """Take the camera away, whoever uses it; nothing happens when it is away."""
    if (_DRIVER / _NAME).exists():
        (_DRIVER / "unbind").write_text(_NAME)


def plug_in() -> None:
    """Put the camera back, with all controls as they were at first; nothing happens when it is there.

    As with any V4L2 camera, it is another device than DEVICE while somebody holds DEVICE open: that is a TimeoutError.
    """
    if not (_DRIVER / _NAME).exists():
        (_DRIVER / "bind").write_text(_NAME)
    deadline_s = time.monotonic() + _PLUG_TIMEOUT_S
    while not DEVICE.exists():
        if time.monotonic() > deadline_s:
            others = [str(path) for path in Path("/dev").glob("video*")]
            raise TimeoutError(f"The camera came back as {others}, not as {DEVICE}: somebody holds that open.")
        time.sleep(0.01)


def set_control(control: int, value: int = 1) -> None:
    """Set a control of the camera, by its V4L2 id; a button is pressed by any value."""
    _control(_VIDIOC_S_CTRL, control, value)


def get_control(control: int) -> int:
    """The value of a control of the camera, by its V4L2 id."""
    return _control(_VIDIOC_G_CTRL, control, 0)


def _control(request: int, control: int, value: int) -> int:
    device = os.open(DEVICE, os.O_RDWR)
    try:
        answer = fcntl.ioctl(device, request, struct.pack("=Ii", control, value))
    finally:
        os.close(device)
    return int(struct.unpack("=Ii", answer)[1])
