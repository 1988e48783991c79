"""A wire's tension follows its equation of state, and what hangs by it sags as it must."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitl.world.catenary import catenary_parameter_m, hang_at, sag_m_of
from sitl.world.tension import ruling_span_m, tension_at_n
from sitl.world.wires import WIRES, Wire

wires = st.sampled_from(sorted(WIRES)).map(WIRES.__getitem__)
spans = st.floats(20.0, 600.0)
shares = st.floats(0.05, 0.35)
temperatures = st.floats(-30.0, 90.0)


def length_m(wire: Wire, span_m: float, tension_n: float) -> float:
    """A level catenary's length less what its tension stretches it: what only temperature changes."""
    a = tension_n / wire.weight_n_m
    hung_m = 2.0 * a * math.sinh(span_m / (2.0 * a))
    return hung_m - span_m * tension_n / (wire.modulus_pa * wire.area_m2)


@given(wire=wires, span_m=spans, share=shares, warmth_k=st.floats(0.1, 80.0))
def test_a_warmer_wire_pulls_less_and_sags_more(wire: Wire, span_m: float, share: float, warmth_k: float) -> None:
    cold_n = share * wire.strength_n
    warm_n = tension_at_n(wire, span_m, cold_n, 10.0, 10.0 + warmth_k)
    assert 0.0 < warm_n < cold_n
    assert sag_m_of(warm_n / wire.weight_n_m, span_m, 0.0) > sag_m_of(cold_n / wire.weight_n_m, span_m, 0.0)


@given(wire=wires, span_m=spans, share=shares, at_c=temperatures, now_c=temperatures)
def test_the_equation_of_state_holds_at_both_temperatures(
    wire: Wire, span_m: float, share: float, at_c: float, now_c: float
) -> None:
    def state_n(tension_n: float, temperature_c: float) -> float:
        stiffness_n = wire.modulus_pa * wire.area_m2
        bow_n = stiffness_n * (wire.weight_n_m * span_m / tension_n) ** 2 / 24.0
        return tension_n - bow_n + stiffness_n * wire.expansion_per_k * temperature_c

    then_n = share * wire.strength_n
    now_n = tension_at_n(wire, span_m, then_n, at_c, now_c)
    scale_n = wire.modulus_pa * wire.area_m2 * wire.expansion_per_k * 100.0 + then_n
    assert state_n(now_n, now_c) == pytest.approx(state_n(then_n, at_c), abs=1e-9 * scale_n)
    assert tension_at_n(wire, span_m, now_n, now_c, at_c) == pytest.approx(then_n, rel=1e-6)


@pytest.mark.parametrize("name", sorted(WIRES))
def test_a_catenary_gains_the_length_that_warmth_gives_its_metal(name: str) -> None:
    """The equation is that of the parabola; at a line's sags the true catenary's length must agree."""
    wire = WIRES[name]
    cold_n = 0.2 * wire.strength_n
    warm_n = tension_at_n(wire, 250.0, cold_n, 0.0, 50.0)
    gained_m = length_m(wire, 250.0, warm_n) - length_m(wire, 250.0, cold_n)
    assert gained_m == pytest.approx(250.0 * wire.expansion_per_k * 50.0, rel=0.01)


@given(span_m=spans, n=st.integers(1, 9))
def test_equal_spans_rule_themselves(span_m: float, n: int) -> None:
    assert ruling_span_m([span_m] * n) == pytest.approx(span_m)


@given(lengths_m=st.lists(spans, min_size=2, max_size=8))
def test_a_ruling_span_lies_among_its_spans_towards_the_long_ones(lengths_m: list[float]) -> None:
    ruling_m = ruling_span_m(lengths_m)
    assert min(lengths_m) - 1e-9 <= ruling_m <= max(lengths_m) + 1e-9
    assert ruling_m >= sum(lengths_m) / len(lengths_m) - 1e-9


@given(span_m=spans, slope=st.floats(-0.4, 0.4), share=shares)
def test_sag_and_parameter_are_two_sides_of_one_curve(span_m: float, slope: float, share: float) -> None:
    parameter_m = share * WIRES["penguin"].strength_n / WIRES["penguin"].weight_n_m
    sag_m = sag_m_of(parameter_m, span_m, slope * span_m)
    assert catenary_parameter_m(span_m, slope * span_m, sag_m) == pytest.approx(parameter_m, rel=1e-6)
    points = hang_at((0.0, 0.0, -20.0), (span_m, 0.0, -20.0 - slope * span_m), parameter_m, span_m / 2.0)
    assert points[1, 2] == pytest.approx(-20.0 - 0.5 * slope * span_m + sag_m)


def test_a_level_span_sags_as_the_textbook_says() -> None:
    # a (cosh(L / 2a) - 1), for H = 17 kN and w = 9.57 N/m over 280 m.
    assert sag_m_of(17_000.0 / 9.57, 280.0, 0.0) == pytest.approx(
        17_000.0 / 9.57 * (math.cosh(140.0 * 9.57 / 17_000.0) - 1.0)
    )


def test_a_wire_far_too_long_for_its_span_is_refused() -> None:
    with pytest.raises(ValueError, match="hangs"):
        hang_at((0.0, 0.0, -50.0), (100.0, 0.0, -50.0), 1.0, 1.0)
