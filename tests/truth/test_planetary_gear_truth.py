"""The truth simulator of planetary gears: statics by hand, lines by arithmetic, and nothing shared with the model."""

import ast
import math
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("numba")
from truth.planetary_gear import draw, machine
from truth.planetary_gear.machine import Machine, contact_ratios, ring_forces

PERIOD = 28  # lcm of the turns after which 24 and 66, and 21 and 66 teeth meet as before
CARRIER_HZ, TORQUE = 8.0, 60.0


def lines(x: np.ndarray) -> np.ndarray:
    """Amplitude at each multiple of 1/28 of an order."""
    return np.abs(np.fft.rfft(x)) * 2 / x.size


@pytest.fixture(scope="module")
def healthy() -> np.ndarray:
    return ring_forces(Machine(), CARRIER_HZ, TORQUE)[1]


def test_it_imports_no_model() -> None:
    for path in Path(machine.__file__).parent.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom | ast.Import):
                assert "models" not in ast.unparse(node), path.name


@pytest.mark.long
def test_mean_force_by_statics(healthy: np.ndarray) -> None:
    """Each ring mesh carries T / (n (r_sun + r_ring)) on the base circles."""
    arm = 3 * (24 + 66) * 1e-3 * math.cos(math.radians(20))
    assert healthy.mean(axis=1) == pytest.approx(np.full(3, TORQUE / arm), rel=2e-3)


def test_a_healthy_set_is_heard_at_66h_and_multiples_of_three_beside_it_only(healthy: np.ndarray) -> None:
    turn = np.arange(healthy.shape[1]) * PERIOD / healthy.shape[1]
    window = [(0.5 + 0.5 * np.cos(2 * np.pi * (turn + i / 3))) ** 2 for i in range(3)]
    found = lines(np.sum(np.array(window) * healthy, axis=0))
    order = np.arange(found.size) / PERIOD
    allowed = np.isclose(order % 3, 0) | np.isclose(order % 3, 3)
    inside = (order > 10) & (order < 215)
    assert found[inside & allowed].max() > 1e4 * found[inside & ~allowed].max()


@pytest.mark.long
@pytest.mark.parametrize("exponent", [1.0, 1.5])
def test_planets_that_are_alike_have_the_same_forces_a_part_of_a_pitch_later(exponent: float) -> None:
    """Teeth 8/28/10: a third of a pitch lies between the planets, which no steps of a fortieth hold."""
    made = Machine(z_sun=8, z_planet=10, z_ring=28, exponent=exponent, contact_ratio=(1.6, 1.8))
    force = ring_forces(made, CARRIER_HZ, TORQUE)[1]
    harmonic = np.arange(1, 4)
    line = np.fft.rfft(force)[:, 28 * made.period * harmonic]
    line *= np.exp(-2j * np.pi * np.outer(np.arange(3) * 28 / 3, harmonic))
    assert line[1:] == pytest.approx(np.broadcast_to(line[0], (2, 3)), rel=1e-9)


def test_a_planet_whose_pin_lies_ahead_carries_less_by_stiffness_times_error(healthy: np.ndarray) -> None:
    """Springs of equal stiffness on a rigid carrier: -k cos(a) e (1 - 1/3), whatever the torque."""
    bent = Machine(hidden={"planet-position-error": {"planet": 2.0, "error_um": 0.5}}, ramp=0.5, drop=0.0)
    straight = Machine(ramp=0.5, drop=0.0)
    change = [
        (ring_forces(bent, CARRIER_HZ, t)[1] - ring_forces(straight, CARRIER_HZ, t)[1]).mean(axis=1)
        for t in (60.0, 120.0)
    ]
    assert change[0] == pytest.approx(change[1], abs=0.02 * abs(change[0][1]))
    assert change[0][1] < 0
    assert change[0][[0, 2]] == pytest.approx(-0.5 * change[0][1], rel=0.02)
    pairs = np.mean([0.5 * 1.586, 0.5 * 1.932])  # raised cosines over the whole path: half a pair on average
    expected = -7e7 * pairs * math.cos(math.radians(20)) * 0.5e-6 * 2 / 3
    assert change[0][1] == pytest.approx(expected, rel=0.1)


@pytest.mark.long
def test_springs_of_another_law_are_linear_at_exponent_one() -> None:
    """Two integrators of the same machine: mean forces alike, lines of the mesh within their steps' error."""
    from dataclasses import replace

    set_of_one_turn = Machine(
        z_sun=22, z_planet=22, z_ring=66, hidden={"planet-position-error": {"planet": 2.0, "error_um": 0.5}}
    )
    one = ring_forces(set_of_one_turn, CARRIER_HZ, TORQUE)[1]
    two = ring_forces(replace(set_of_one_turn, exponent=1.0 + 1e-9), CARRIER_HZ, TORQUE)[1]
    assert two.mean(axis=1) == pytest.approx(one.mean(axis=1), rel=2e-3)
    first, second = (np.abs(np.fft.rfft(f, axis=-1))[:, [66, 132]] for f in (one, two))
    assert second == pytest.approx(first, rel=0.2)


@pytest.mark.long
def test_a_pin_on_points_of_contact_goes_with_the_load() -> None:
    """F = K x^1.5: stiffness goes with F^(1/3), and so does the load that a pin takes off."""
    from dataclasses import replace

    straight = Machine(z_sun=22, z_planet=22, z_ring=66, exponent=1.5, ramp=0.5, drop=0.0)
    bent = replace(straight, hidden={"planet-position-error": {"planet": 2.0, "error_um": 0.1}})
    change = [
        (ring_forces(bent, CARRIER_HZ, t)[1] - ring_forces(straight, CARRIER_HZ, t)[1]).mean(axis=1)[1]
        for t in (60.0, 120.0)
    ]
    assert change[1] / change[0] == pytest.approx(2 ** (1 / 3), rel=0.05)


def test_a_case_is_drawn_the_same_again() -> None:
    one, two = draw(3, "sun-runout"), draw(3, "sun-runout")
    assert one.machine == two.machine
    assert np.array_equal(one.housing.resonance, two.housing.resonance)
    assert draw(3).machine.drop == one.machine.drop
    assert not draw(3).machine.hidden


def test_contact_ratios_of_the_article_and_periods_by_arithmetic() -> None:
    assert contact_ratios(24, 21, 66, math.radians(20)) == pytest.approx((1.586, 1.932), abs=2e-3)
    assert Machine().period == PERIOD
    assert Machine(z_sun=30, z_planet=24, z_ring=78).period == math.lcm(5, 4)


def test_drawn_sets_assemble_and_their_torques_span_a_factor() -> None:
    for seed in range(12):
        case = draw(seed, drawn_set=True)
        m = case.machine
        assert m.z_ring == m.z_sun + 2 * m.z_planet
        assert (m.z_sun + m.z_ring) % m.planets == 0
        assert case.runs[1].torque >= 2.4 * case.runs[0].torque
