"""What PX4 says before a flight about a GPS without a fix, when it boots and when it has disarmed."""

from sitl.failsafes import Say
from sitl.modes import Severity
from sitl.parameters import Parameters

# After boot, as recorded [s]: with COM_ARM_WO_GPS as it is by default, and where a fix is required (0).
_WARNINGS = ((2.4, "Preflight: GPS fix too low"), (4.1, "Preflight: GPS fix too low"))
_FAILURES = (
    (2.4, "Preflight Fail: Global position estimate required"),
    (4.1, "Preflight Fail: GPS fix too low"),
    (4.16, "Preflight Fail: Global position estimate required"),
)
_AFTER_FLIGHT_S = 0.05


class Preflight:
    """Reports what the arming checks find."""

    def __init__(self, parameters: Parameters, say: Say) -> None:
        """Boot."""
        self._parameters = parameters
        self._say = say
        self._since_s = 0.0

    def disarmed(self, boot_s: float) -> None:
        """A flight has ended at `boot_s` [s]: look again, and say the last thing first."""
        self._since_s = boot_s + _AFTER_FLIGHT_S - self._schedule[-1][0]

    @property
    def _schedule(self) -> tuple[tuple[float, str], ...]:
        return _WARNINGS if int(self._parameters.get("COM_ARM_WO_GPS")) else _FAILURES

    def step(self, dt_s: float, boot_s: float, *, has_gps: bool, is_armed: bool) -> None:
        """Say what came due in the last `dt_s` [s]."""
        if has_gps or is_armed:
            return
        after_s = boot_s - self._since_s
        for due_s, text in self._schedule:
            if after_s - dt_s < due_s <= after_s:
                self._say(Severity.CRITICAL if "Fail" in text else Severity.WARNING, text)
