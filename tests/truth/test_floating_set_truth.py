"""The simulator of floating sets: statics by hand, lines by arithmetic, rings by Love's formula."""

import ast
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("numba")
from truth.floating_set import draw, machine
from truth.floating_set.housing import PULSES, RATE, _pulses
from truth.floating_set.machine import SETTLE_S, STEPS_HZ, Machine, ring_forces

CARRIER_HZ, TORQUE, TURNS = 8.0, 60.0, 4
SHARE_ON_BASE_CIRCLES = 3 * (24 + 66) * 1e-3 * math.cos(math.radians(20))


def forces(made: Machine, torque: float = TORQUE, turns: int = TURNS) -> np.ndarray:
    """Over whole turns at the end."""
    kept = round(turns / CARRIER_HZ * STEPS_HZ)
    time = np.arange(round(SETTLE_S * STEPS_HZ) + kept) / STEPS_HZ
    return ring_forces(made, CARRIER_HZ * time, torque)[:, -kept:]


def heard(force: np.ndarray, turns: int = TURNS) -> np.ndarray:
    """Amplitudes at multiples of one over `turns`, of what a sensor hears through a window that all harmonics share."""
    angle = 2 * np.pi * np.arange(force.shape[1]) * turns / force.shape[1]
    window = np.exp(2 * np.cos(angle + 2 * np.pi * np.arange(3)[:, None] / 3))
    return np.abs(np.fft.rfft(np.sum(window * force, axis=0))) * 2 / force.shape[1]


@pytest.fixture(scope="module")
def healthy() -> np.ndarray:
    return forces(Machine())


def test_it_imports_no_model() -> None:
    for path in Path(machine.__file__).parent.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom | ast.Import):
                assert "models" not in ast.unparse(node), path.name
                assert "specan.planetary_gear" not in ast.unparse(node), path.name


@pytest.mark.long
def test_mean_forces_hold_the_torque(healthy: np.ndarray) -> None:
    assert healthy.mean(axis=1) == pytest.approx(np.full(3, TORQUE / SHARE_ON_BASE_CIRCLES), rel=1e-3)


def test_planets_that_are_alike_are_heard_at_multiples_of_three_only(healthy: np.ndarray) -> None:
    order, lines = np.arange(healthy.shape[1] // 2 + 1) / TURNS, heard(healthy)
    inside = (order > 10) & (order < 215)
    assert lines[inside & (order % 3 == 0)].max() > 1e4 * lines[inside & (order % 3 != 0)].max()


def test_a_pin_ahead_takes_the_same_load_off_its_planet_at_every_torque() -> None:
    bent = Machine(hidden={"planet-position-error": {"planet": 2.0, "error_um": 0.5}})
    change = [(forces(bent, t) - forces(Machine(), t)).mean(axis=1) for t in (60.0, 120.0)]
    assert change[0][1] < 0
    assert change[0][[0, 2]] == pytest.approx(-0.5 * change[0][1], rel=0.02)
    assert change[1] == pytest.approx(change[0], rel=0.02)


def test_a_softer_pin_takes_the_same_share_at_every_torque() -> None:
    soft = Machine(hidden={"unequal-load-sharing": {"planet": 1.0, "softer": 1.0}})
    share = [forces(soft, t).mean(axis=1) * SHARE_ON_BASE_CIRCLES / t for t in (60.0, 120.0)]
    assert share[0][0] < 0.95
    assert share[1] == pytest.approx(share[0], rel=0.01)


def test_an_eccentric_sun_is_heard_a_turn_of_its_shaft_beside_the_mesh() -> None:
    lines = heard(forces(Machine(hidden={"sun-runout": {"eccentricity_um": 2.0, "phase": 0.4}})))
    around = lines[4 * 63 : 4 * 70]
    order = np.arange(4 * 63, 4 * 70) / 4
    strongest = set(order[np.argsort(around)[-7:]])
    assert {66.75, 69.75} <= strongest
    assert lines[round(4 * 68.75)] < 1e-3 * lines[round(4 * 69.75)]


def test_lobes_of_a_ring_bend_as_thin_rings_do() -> None:
    """Love: n^2 (n^2 - 1)^2 / (n^2 + 1) for the square of the frequency; three lobes over two."""
    made = Machine(bolt=0.0, sun_bearing=0.0)
    _, stiffness, _ = machine._linear(made)
    two, three = stiffness[-5, -5], stiffness[-3, -3]  # pairs for 1 to 4 lobes stand at the end
    assert three / two == pytest.approx((9 * 64 / 10) / (4 * 9 / 5))


def test_marks_that_are_off_move_their_pulses() -> None:
    turn = 10 * np.arange(round(2 * RATE)) / RATE
    even, uneven = (
        _pulses(turn, PULSES, np.zeros(PULSES)),
        _pulses(turn, PULSES, np.where(np.arange(PULSES) == 5, 2e-3, 0.0)),
    )

    def rises(volts: np.ndarray) -> np.ndarray:
        up = np.flatnonzero((volts[:-1] < 2.5) & (volts[1:] >= 2.5))
        return up + (2.5 - volts[up]) / (volts[up + 1] - volts[up])

    shift = (rises(uneven) - rises(even)) / RATE * 10
    assert np.sort(np.abs(shift))[-20:] == pytest.approx(np.full(20, 2e-3), rel=0.1)
    assert np.count_nonzero(np.abs(shift) > 1e-4) == 20


def test_a_case_is_drawn_the_same_again_and_its_sets_assemble() -> None:
    assert draw(3, "sun-runout").machine == draw(3, "sun-runout").machine
    assert replace(draw(3, "sun-runout").machine, hidden={}) == draw(3).machine
    for seed in range(12):
        made = draw(seed).machine
        assert made.z_ring == made.z_sun + 2 * made.z_planet
        assert (made.z_sun + made.z_ring) % made.planets == 0
