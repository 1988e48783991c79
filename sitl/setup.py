"""How the simulated vehicle is set up before it follows lines: PX4's defaults, but for these parameters.

A real vehicle needs the same, and pre-flight checks ask for it: with PX4's defaults a lost stream of setpoints makes a
vehicle without a pilot's sticks sink where it is.
"""

SETUP: dict[str, float | int] = {
    "COM_OBL_RC_ACT": 3,  # setpoints stop: return
    "COM_RC_OVERRIDE": 3,  # the sticks take over in automatic modes and in offboard
    "RTL_RETURN_ALT": 30.0,  # above the line, and below a mission's fence
}
"""Parameter values by name."""
