"""A pilot's sticks: where they stand, whether they still come, and whether they were moved."""

import math
from dataclasses import dataclass

from sitl.control import clamp
from sitl.parameters import Parameters

_NOTICE_S = 0.15  # until PX4 acts on sticks that are gone, as recorded


@dataclass(frozen=True, slots=True)
class Sticks:
    """Stick positions (MANUAL_CONTROL x, y, z, r): pitch forward, roll and yaw right -1 to 1, throttle 0 to 1.

    Centred is 0, but 0.5 for the throttle.
    """

    pitch: float = 0.0
    roll: float = 0.0
    throttle: float = 0.5
    yaw: float = 0.0

    @property
    def climb(self) -> float:
        """The throttle around its centre, -1 (down) to 1 (up)."""
        return 2 * self.throttle - 1


class Pilot:
    """The stream of sticks, as PX4's manual_control module sees it."""

    def __init__(self, parameters: Parameters, speed: float) -> None:
        """No pilot yet. As PX4 does, COM_RC_LOSS_T is scaled by the simulation's `speed`: it stays wall time."""
        self._parameters = parameters
        self._speed = speed
        self.sticks: Sticks | None = None
        """Where the sticks stand; None while none come."""
        self.is_moving = False
        """Whether a stick is farther than COM_RC_STICK_OV from where it rested."""
        self._rest = Sticks()
        self._last_s = 0.0

    def take(self, sticks: Sticks, boot_s: float) -> None:
        """Take new stick positions at `boot_s` [s]; what is not finite is refused, the rest is clipped."""
        values = (sticks.pitch, sticks.roll, sticks.throttle, sticks.yaw)
        if not all(map(math.isfinite, values)):
            return
        pitch, roll, yaw = (clamp(value, -1.0, 1.0) for value in (sticks.pitch, sticks.roll, sticks.yaw))
        clipped = Sticks(pitch, roll, clamp(sticks.throttle, 0.0, 1.0), yaw)
        if self.sticks is None:
            self._rest = clipped
        self.sticks = clipped
        self._last_s = boot_s
        threshold = self._parameters.get("COM_RC_STICK_OV") / 100
        rest = self._rest
        moved = (
            clipped.pitch - rest.pitch,
            clipped.roll - rest.roll,
            clipped.climb - rest.climb,
            clipped.yaw - rest.yaw,
        )
        self.is_moving = max(map(abs, moved)) > threshold

    def rest(self) -> None:
        """The mode has just changed: from here on a stick counts as moved."""
        if self.sticks is not None:
            self._rest = self.sticks
        self.is_moving = False

    def step(self, boot_s: float) -> None:
        """Sticks that have not come for COM_RC_LOSS_T [s] are none."""
        if (
            self.sticks is not None
            and boot_s - self._last_s > self._parameters.get("COM_RC_LOSS_T") * self._speed + _NOTICE_S
        ):
            self.sticks = None
            self.is_moving = False
