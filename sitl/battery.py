"""A LiPo pack: the energy that thrust takes, and the voltage that is left under load."""

import math
from dataclasses import dataclass

# Open-circuit voltage of a LiPo cell at 0, 10 ... 100 % of its charge [V].
_CELL_V = (3.30, 3.60, 3.69, 3.73, 3.77, 3.80, 3.85, 3.92, 4.00, 4.08, 4.20)
_NOMINAL_CELL_V = 3.7

_FAILURE_S = 1.0  # a failed pack's charge falls with this time constant, as PX4's simulator was recorded


@dataclass(frozen=True, slots=True)
class Pack:
    """A battery pack; the default is the 4S 5.2 Ah of a DJI F550's class. `base_load_w` is the avionics' own."""

    n_cells: int = 4
    capacity_ah: float = 5.2
    resistance_ohm: float = 0.02
    base_load_w: float = 12.0

    @property
    def energy_j(self) -> float:
        """Energy of the full pack [J]."""
        return self.capacity_ah * 3600 * self.n_cells * sum(_CELL_V) / len(_CELL_V)

    @property
    def nominal_v(self) -> float:
        """The voltage that the pack is sold by, and at which motors' thrust is stated [V]."""
        return _NOMINAL_CELL_V * self.n_cells


class Battery:
    """The charge that is left. `remaining` is 0 to 1, `voltage_v` and `current_a` those under the last load."""

    __slots__ = ("consumed_ah", "current_a", "has_failed", "pack", "remaining", "voltage_v")

    def __init__(self, pack: Pack | None = None, remaining: float = 1.0) -> None:
        """Start with `remaining` (0 to 1) of the pack's charge, and no load. Set `has_failed` to make it fail."""
        self.pack = pack or Pack()
        self.remaining = remaining
        self.consumed_ah = 0.0
        self.has_failed = False
        self.current_a = 0.0
        self.voltage_v = self.open_circuit_v

    @property
    def open_circuit_v(self) -> float:
        """The pack's voltage without load [V]."""
        place = min(max(self.remaining, 0.0), 1.0) * (len(_CELL_V) - 1)
        low = min(int(place), len(_CELL_V) - 2)
        return self.pack.n_cells * (_CELL_V[low] + (place - low) * (_CELL_V[low + 1] - _CELL_V[low]))

    @property
    def thrust_share(self) -> float:
        """How much of the full thrust the voltage under load leaves, 0 to 1.

        A motor's speed goes with the voltage, and thrust with its square. More than the nominal voltage is not made use
        of: that is the autopilot's full thrust.
        """
        share = max(self.voltage_v, 0.0) / self.pack.nominal_v
        return min(1.0, share * share)

    def step(self, dt_s: float, motor_power_w: float) -> None:
        """Draw `motor_power_w` and the base load for `dt_s`; the voltage sags by the current in the resistance."""
        power_w = motor_power_w + self.pack.base_load_w
        self.current_a = power_w / max(self.voltage_v, 1.0)
        self.voltage_v = self.open_circuit_v - self.current_a * self.pack.resistance_ohm
        drawn_ah = self.current_a * dt_s / 3600
        self.consumed_ah += drawn_ah
        self.remaining = max(0.0, self.remaining - drawn_ah / self.pack.capacity_ah)
        if self.has_failed:
            self.remaining *= math.exp(-dt_s / _FAILURE_S)

    def drain(self, dt_s: float, *, empty_after_s: float, least: float) -> None:
        """Lose charge by the clock, down to `least` (0 to 1): SIM_BAT_DRAIN and SIM_BAT_MIN_PCT of PX4's simulator."""
        if self.remaining > least:
            self.remaining = max(least, self.remaining - (1.0 - least) * dt_s / empty_after_s)
