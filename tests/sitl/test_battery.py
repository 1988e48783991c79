"""The pack loses what is drawn, sags under load, and never goes below empty."""

import pytest

from sitl.battery import Battery, Pack


def test_a_full_pack_without_load_has_the_cells_full_voltage() -> None:
    assert Battery().voltage_v == pytest.approx(4 * 4.20)


def test_voltage_sags_under_load_and_comes_back() -> None:
    battery = Battery()
    battery.step(0.004, 400.0)
    loaded_v = battery.voltage_v
    assert loaded_v == pytest.approx(battery.open_circuit_v - battery.current_a * battery.pack.resistance_ohm, rel=1e-3)
    battery.step(0.004, 0.0)
    assert loaded_v < battery.voltage_v < 4 * 4.20


def test_a_constant_load_empties_the_pack_in_its_energy_over_the_power() -> None:
    battery, power_w, time_s = Battery(Pack(base_load_w=0.0, resistance_ohm=1e-6)), 300.0, 0.0
    while battery.remaining > 0.0:
        battery.step(0.5, power_w)
        time_s += 0.5
    assert time_s == pytest.approx(battery.pack.energy_j / power_w, rel=0.05)


def test_an_empty_pack_stays_empty() -> None:
    battery = Battery(remaining=0.0)
    battery.step(10.0, 300.0)
    assert battery.remaining == 0.0
    assert battery.voltage_v < 4 * 3.4
