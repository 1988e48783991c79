"""Whether the autopilot knows where it is: what PX4's estimator makes of having a GPS and losing it."""

_FIRST_S = 4.0  # after boot: GPS is used
_REGAIN_S = 2.0  # of good GPS until it is used again
# As recorded from PX4 v1.16 whose GPS was taken away in flight: dead reckoning ends 5.2 s later, and the bit that
# ground stations take for the global position only two seconds after that.
_DEAD_RECKONING_S = 5.18
_STILL_REPORTED_S = 7.2


class Positioning:
    """`is_valid`: the horizontal position can be flown by. `is_reported`: SYS_STATUS still says so."""

    def __init__(self) -> None:
        """Boot: no position yet."""
        self.is_valid = False
        self.is_reported = False
        self.has_gps = False
        self.lost_s: float | None = None
        """When GPS was lost [s, boot]; None while it is there."""
        self._since_s = 0.0

    def step(self, boot_s: float, *, has_gps: bool) -> None:
        """Look at the receiver at `boot_s` [s]."""
        if has_gps != self.has_gps:
            self.has_gps = has_gps
            self.lost_s = None if has_gps else boot_s
            self._since_s = boot_s
        if has_gps:
            if boot_s >= _FIRST_S and (self.is_valid or boot_s - self._since_s >= _REGAIN_S):
                self.is_valid = self.is_reported = True
            return
        without_s = boot_s - self._since_s
        self.is_valid = self.is_valid and without_s < _DEAD_RECKONING_S
        self.is_reported = self.is_reported and without_s < _STILL_REPORTED_S
