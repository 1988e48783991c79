"""How tightly a wire is strung: its tension at another temperature, over the spans that share it."""

import math
from collections.abc import Sequence

from sitl.world.wires import Wire

_N_BISECTIONS = 100


def ruling_span_m(spans_m: Sequence[float]) -> float:
    """The one span that stands for all `spans_m` [m] between two supports that hold the wire fast.

    sqrt(sum L^3 / sum L): strings of insulators swing until all spans pull alike, and this span pulls as they do.
    """
    return math.sqrt(sum(span_m**3 for span_m in spans_m) / sum(spans_m))


def tension_at_n(wire: Wire, span_m: float, tension_n: float, at_c: float, temperature_c: float) -> float:
    """The horizontal tension [N] at `temperature_c` of a wire that has `tension_n` at `at_c` [degrees C].

    The equation of state of the ruling span `span_m`: H - E A (w L)^2 / (24 H^2) + E A alpha T is the same at both
    temperatures: what the warm wire gains in length it sags. The left side grows with H; H is bisected.
    """
    stiffness_n = wire.modulus_pa * wire.area_m2
    bow = stiffness_n * (wire.weight_n_m * span_m) ** 2 / 24.0
    state_n = tension_n - bow / tension_n**2 - stiffness_n * wire.expansion_per_k * (temperature_c - at_c)
    low_n, high_n = 0.0, max(tension_n, abs(state_n) + math.cbrt(bow))
    while high_n - bow / high_n**2 < state_n:
        high_n *= 2.0
    for _ in range(_N_BISECTIONS):
        middle_n = 0.5 * (low_n + high_n)
        if middle_n - bow / middle_n**2 < state_n:
            low_n = middle_n
        else:
            high_n = middle_n
    return 0.5 * (low_n + high_n)
