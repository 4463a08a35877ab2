"""The integration in time against scipy's Radau method, and its linear equations against dense ones."""

import math
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from specan.planetary_gear.model import contact_steps, dynamics
from specan.planetary_gear.model.geometry import pair_mesh
from specan.planetary_gear.model.rig import read_rig
from specan.planetary_gear.model.simulated_recording import tacho_channel

DATA = Path(__file__).parents[2] / "sample_data" / "planetary_gear"
RATE = 204800.0
# Three planets out of phase (their number does not divide the teeth of sun and ring), so that the carrier shakes.
UNEQUAL = {
    "gear": {"z_sun": 31, "z_planet": 31, "z_ring": 95, "planets": 3, "module_mm": 1.0, "backlash_mm": 0.0},
    "contact": {"K_N_mm_e": 3e5, "exponent": 1.3, "C_Ns_mm": 3000.0, "depth_mm": 0.3},
    "operation": {"sun_speed_hz": 30.0, "carrier_torque_Nm": 60.0},
}


def pair():
    return read_rig(tomllib.loads((DATA / "pair.toml").read_text()))


def advanced(system, seconds):
    every = math.ceil(1 / (RATE * system.step))
    return system.advance(round(seconds * RATE), every, 1 / (RATE * every), 0.0)


def pair_force(t, x, v, rig, mesh):
    """Equations 3 and 4 of the article for the pairs of teeth that are in reach, N; x in mm."""
    law = rig.contact
    pitch = 1e3 * mesh.base_pitch
    base = rig.pair.z_driver * rig.pair.driver_speed_hz * t % 1.0
    total = 0.0
    for place in (base - 1, base, base + 1, base + 2):
        beyond = max(-place, place - mesh.contact_ratio, 0.0) * pitch
        coefficient = mesh.gap_before if place < 0 else mesh.gap_after
        depth = x - 1e-3 * coefficient * beyond**2
        if depth > 0:
            p = min(depth / law.depth_mm, 1.0)
            total += law.K_N_mm_e * depth**law.exponent + law.C_Ns_mm * (3 * p**2 - 2 * p**3) * v
    return total


@pytest.mark.long
def test_the_overdamped_pair_moves_as_radau_says():
    rig = pair()
    system = dynamics._system(rig)
    radius, inertia = -system.machine[5][0, 0], system.machine[3][0]
    seconds, load = 0.006, 200.0 * 21 / 24 / radius  # one mesh period and a half
    mass = inertia / radius**2
    start = [-1e3 * radius * system.state[0], 0.0]
    found = advanced(system, seconds)[:, 0]
    mesh = pair_mesh(rig.pair)

    def rates(t, y):
        return [y[1], 1e3 * (load - pair_force(t, y[0], y[1], rig, mesh)) / mass]

    times = np.arange(found.size) / RATE
    known = solve_ivp(rates, (0, seconds), start, "Radau", t_eval=times, rtol=1e-9, atol=1e-11, max_step=1e-4)
    force = np.array([pair_force(t, x, v, rig, mesh) for t, x, v in zip(times, *known.y)])
    # The first pairs of teeth start with the force of both and let go of it within less than a step.
    assert force[0] == pytest.approx(2 * load, rel=1e-3)
    settled = slice(20, None)
    error = (found - force)[settled]
    assert np.abs(error).max() < 5e-5 * load
    assert error.std() < 1e-2 * force[settled].std()


def test_planets_out_of_phase_move_as_radau_says():
    system = dynamics._system(read_rig(UNEQUAL))
    n, seconds, started = len(system.machine[3]) - 1, 0.002, system.state.copy()  # one mesh period and a half
    found = advanced(system, seconds)
    forces, slopes = np.zeros(2 * n), np.zeros((2 * n, contact_steps.SLOPES))

    def rates(t, y):
        change = np.zeros_like(y)
        contact_steps.rates(t, system.machine, y, change, forces, slopes)
        return change

    times = np.arange(found.shape[0]) / RATE
    atol = np.r_[np.full(n + 1, 1e-13), np.full(n + 1, 1e-9)]
    known = solve_ivp(rates, (0, seconds), started, "Radau", t_eval=times, rtol=1e-9, atol=atol)
    known_force = []
    for t, y in zip(times, known.y.T):
        rates(t, y)
        known_force.append(forces.copy())
    top = np.abs(known_force).max()
    apart = np.ptp(known.y[1 : n + 1], axis=0)  # planets that do not move alike
    assert apart.max() > 0.05 * np.abs(known.y[1 : n + 1]).max()
    assert np.abs(found[:, : 2 * n] - known_force).max() < 1e-3 * top


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_linear_equations_are_those_of_the_differences(side):
    """(1/span - J) u = right, J and the slope in time from differences; -1 presses the other flanks."""
    system = dynamics._system(read_rig(UNEQUAL))
    own, span, time = system.machine[3:6], 1e-6, 3.1e-4
    n = len(own[0]) - 1
    random = np.random.default_rng(1)
    state = side * system.state * np.r_[1.5, random.uniform(1.5, 2.0, 2 * n + 1)]
    state[n + 1 : 2 * n + 2] = random.standard_normal(n + 1)
    slopes, forces = np.zeros((2 * n, contact_steps.SLOPES)), np.zeros(2 * n)

    def rates(t, y):
        change = np.zeros(y.size)
        contact_steps.rates(t, system.machine, y, change, forces, np.zeros((2 * n, contact_steps.SLOPES)))
        return change

    contact_steps.rates(time, system.machine, state, np.zeros(state.size), forces, slopes)
    assert np.count_nonzero(forces) >= n
    delta = np.r_[np.full(n + 1, 1e-9), np.full(n + 1, 1e-5)]
    steps = np.diag(delta)
    columns = [(rates(time, state + d) - rates(time, state - d)) / (2 * d.sum()) for d in steps]
    dense = np.eye(state.size) / span - np.array(columns).T
    right = np.abs(dense).max(axis=1) * delta * random.standard_normal(state.size)
    u, matrix = right.copy(), np.zeros((2, n + 1))
    contact_steps.factor(*own, slopes, span, matrix)
    contact_steps.solve(*own, slopes, span, matrix, u)
    assert u == pytest.approx(np.linalg.solve(dense, right), rel=1e-4)
    slope = np.zeros(state.size)
    contact_steps.time_slope(*own, slopes, slope)
    in_time = (rates(time + 1e-8, state) - rates(time - 1e-8, state)) / 2e-8
    assert slope == pytest.approx(in_time, rel=1e-4)


@pytest.mark.parametrize("name", ["pair", "rig"])
def test_loops_of_python_give_what_compiled_ones_do(name) -> None:
    rig = read_rig(tomllib.loads((DATA / f"{name}.toml").read_text()))
    code = f"""
import sys
from specan.planetary_gear.model import compiled
compiled.HAS_NUMBA = False
sys.path.insert(0, {str(Path(__file__).parent)!r})
from test_contact_steps import advanced, dynamics, read_rig, tomllib
rig = read_rig(tomllib.loads(open({str(DATA / name)!r} + ".toml").read()))
print(*advanced(dynamics._system(rig), 2e-4).ravel())
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    plain = np.array(done.stdout.split(), dtype=float)
    compiled = advanced(dynamics._system(rig), 2e-4).ravel()
    assert plain.size == compiled.size > 80
    assert plain == pytest.approx(compiled, rel=1e-12, abs=1e-18)


@pytest.mark.parametrize("pulses", [1, 3, 32])
def test_pulses_lie_where_the_angle_says_also_on_samples(pulses):
    """At 30 turns a second and 12800 samples edges, and places half way between them, fall exactly on samples."""
    turns = 30 * np.arange(12800) / 12800
    volts = tacho_channel("Tacho", 2 * np.pi * turns, pulses).samples
    assert volts.min() >= 0.0
    assert volts.max() <= 5.0
    part = turns * pulses % 1.0
    high = part < (0.1 if pulses == 1 else 0.5)
    clear = np.minimum(np.abs(part - 0.5), np.minimum(part, 1 - part)) > 0.1
    if pulses == 1:
        clear = (np.abs(part - 0.1) > 0.01) & (np.minimum(part, 1 - part) > 0.01)
    assert volts[clear] == pytest.approx(np.where(high, 5.0, 0.0)[clear])
