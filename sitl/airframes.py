"""The multirotors that can be flown, by name, and what each is made of."""

import math
from dataclasses import dataclass
from typing import Literal

from sitl.battery import Pack

GRAVITY_M_S2 = 9.80665

AirframeName = Literal["f550", "x500"]
_Axes = tuple[float, float, float]
_Rotors = tuple[tuple[float, float, float], ...]
_DRAG_TORQUE_M = 0.016  # of each rotor's thrust, about the vertical


def _ring(n_rotors: int, arm_m: float, first_rad: float) -> _Rotors:
    """Rotors at the same distances around the middle, which turn this way and that way in turn."""
    angles_rad = [first_rad + k * math.tau / n_rotors for k in range(n_rotors)]
    return tuple(
        (arm_m * math.cos(angle), arm_m * math.sin(angle), _DRAG_TORQUE_M * (-1.0) ** k)
        for k, angle in enumerate(angles_rad)
    )


_F550_PACK = Pack()
_F550_ROTORS = _ring(6, 0.275, math.pi / 6)


class AirframeError(Exception):
    """There is no airframe of that name; the message is one sentence for a person."""


@dataclass(frozen=True, slots=True)
class Airframe:
    """What a multirotor is made of; the default is a hexacopter of the DJI F550's class, loaded with a camera.

    `max_thrust_n` is all motors together at the pack's nominal voltage; `max_torque_n_m` what they give about body
    x, y, z around hover. `motor_time_constant_s` is their lag when they speed up, `motor_slowing_s` when they slow
    down (what a propeller's drag gives; None: the same). Drag against the air is a = -(linear + quadratic * |v|) v:
    rotors give the linear part, frame and payload the quadratic one; the linear part lies within what is measured on
    multirotors (0.2 to 0.55 1/s: Faessler et al., IEEE RA-L 2018), and hovering in 8 m/s takes 24 degrees of tilt.
    `disk_area_m2` and `figure_of_merit` set the power that thrust costs (momentum theory). `radius_m` is the sphere
    around its centre that nothing may come into: half the diagonal and a propeller's radius. `rotors` are where each
    one is, forward and right of the middle [m], and its torque about the vertical [m, of its thrust]; they matter only
    where one of them is weak.
    """

    mass_kg: float = 2.4
    inertia_kg_m2: _Axes = (0.030, 0.030, 0.050)
    max_thrust_n: float = 48.0
    max_torque_n_m: _Axes = (4.4, 4.4, 0.55)
    motor_time_constant_s: float = 0.05
    motor_slowing_s: float | None = None
    linear_drag_1_s: float = 0.45
    quadratic_drag_1_m: float = 0.012
    rotational_drag_n_m_s: _Axes = (0.02, 0.02, 0.05)
    disk_area_m2: float = 6 * math.pi * (0.239 / 2) ** 2
    figure_of_merit: float = 0.42
    radius_m: float = 0.40
    rotors: _Rotors = _F550_ROTORS
    pack: Pack = _F550_PACK

    @property
    def hover_thrust(self) -> float:
        """The part of the full thrust that hovers, 0 to 1."""
        return self.mass_kg * GRAVITY_M_S2 / self.max_thrust_n


F550 = Airframe()
"""DJI F550: 550 mm, 9.4-inch propellers, whose E305 motors pull 850 g each at 4S; 4S 5.2 Ah."""

X500 = Airframe(
    mass_kg=2.064,
    inertia_kg_m2=(0.0217, 0.0217, 0.0400),
    max_thrust_n=34.2,
    max_torque_n_m=(4.2, 4.2, 0.55),
    motor_time_constant_s=0.0125,
    motor_slowing_s=0.025,
    linear_drag_1_s=0.35,
    quadratic_drag_1_m=0.012,
    rotational_drag_n_m_s=(0.015, 0.015, 0.04),
    disk_area_m2=4 * math.pi * 0.127**2,
    figure_of_merit=0.50,
    radius_m=0.38,
    rotors=_ring(4, 0.246, math.pi / 4),
    pack=Pack(n_cells=4, capacity_ah=5.0, resistance_ohm=0.018),
)
"""Holybro X500 V2 with its payload: 500 mm, four 10-inch propellers, 4S 5 Ah.

Mass, inertia, motor lags, thrust (4 x 8.55e-6 N/(rad/s)^2 at 1000 rad/s) and drag torque (0.016 m of thrust, arms of
0.174 m on both axes) are those of PX4's own model of it (PX4-gazebo-models, x500 and x500_base). A torque of 1 is what
PX4's allocation of a quadrotor in X makes of it: 1 / sqrt(2) of every motor's thrust about x and y, all of it about z.
Drag lies in the middle of what is measured (Faessler et al., IEEE RA-L 2018), since the model's rotors give only
0.12 1/s; hovering draws 260 W, which the pack gives for a quarter of an hour.
"""

AIRFRAMES: dict[str, Airframe] = {"f550": F550, "x500": X500}
"""By name."""


def airframe_of(name: str) -> Airframe:
    """The airframe of that name; raises AirframeError with the names there are."""
    try:
        return AIRFRAMES[name]
    except KeyError:
        known = ", ".join(AIRFRAMES)
        raise AirframeError(f"There is no airframe '{name}': choose one of {known}.") from None
