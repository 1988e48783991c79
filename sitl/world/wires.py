"""The wires that lines are strung with."""

from dataclasses import dataclass

STANDARD_GRAVITY_M_S2 = 9.80665


@dataclass(frozen=True, slots=True)
class Wire:
    """A stranded wire: `area_m2` is its metal's, `expansion_per_k` how much longer it gets for a kelvin."""

    diameter_m: float
    mass_kg_m: float
    area_m2: float
    modulus_pa: float
    expansion_per_k: float
    strength_n: float

    @property
    def weight_n_m(self) -> float:
        """Weight of a metre [N/m]."""
        return self.mass_kg_m * STANDARD_GRAVITY_M_S2


WIRES: dict[str, Wire] = {
    "sparrow": Wire(0.00803, 0.136, 39.2e-6, 81e9, 19.2e-6, 12_700.0),
    "raven": Wire(0.01011, 0.216, 62.4e-6, 81e9, 19.2e-6, 19_500.0),
    "penguin": Wire(0.01431, 0.433, 125.1e-6, 81e9, 19.2e-6, 37_200.0),
    "hawk": Wire(0.02179, 0.976, 281.1e-6, 77e9, 18.9e-6, 86_700.0),
    "drake": Wire(0.02814, 1.628, 468.6e-6, 77e9, 18.9e-6, 140_100.0),
    "steel_9mm": Wire(0.00914, 0.407, 51.1e-6, 186e9, 11.5e-6, 68_500.0),
}
"""Aluminium conductors, steel reinforced, by the bird names of ASTM B232, with the moduli and expansions that DIN 48204
gives for their stranding (6/1 and 26/7); and the 3/8 inch steel strand of ASTM A475 for shield wires."""
