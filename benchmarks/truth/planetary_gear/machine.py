"""Torsional vibration of a planetary set with prescribed mesh stiffness, integrated in time.

Carrier and planets turn, the sun's speed is given, the ring is fixed. A pair of teeth is a linear spring whose
stiffness is a parabola over its path of contact, highest in its middle, taken in and let go by raised cosines; a mesh
is the sum of the pairs in contact. So the load changes no stiffness, and no pair comes late; Newmark's method
integrates it, as long as no mesh would pull. Or the mesh stiffens with its load, F = k(t) x (x / x0)^(n - 1) where it
is in contact, and teeth part where it is not; Runge-Kutta's method of the fourth order integrates that.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np
from numba import njit
from numpy.typing import NDArray

Real = NDArray[np.float64]

STEPS_A_TOOTH = 48  # of thirds and quarters of a pitch: planets that are alike are then integrated alike
SETTLE_TURNS = 3
SUBSTEPS = 6  # of Runge-Kutta's method, whose steps are bound by the planets' natural frequency
KNEE_N = 150.0  # load of a mesh at which a mesh of any exponent has the same stiffness


@dataclass(frozen=True)
class Machine:
    """Numbers of one set in SI; what is hidden in it stands in `hidden`."""

    z_sun: int = 24
    z_planet: int = 21
    z_ring: int = 66
    planets: int = 3
    module: float = 2e-3
    pressure_angle: float = math.radians(20.0)
    pair_stiffness: float = 7e7
    form: str = "parabola"
    drop: float = 0.3
    ramp: float = 0.06
    exponent: float = 1.0
    contact_ratio: tuple[float, float] = (1.586, 1.932)
    lead: float = 0.0
    damping_ratio: float = 0.05
    carrier_inertia: float = 8e-3
    planet_inertia: float = 6e-5
    hidden: dict[str, dict[str, float]] = field(default_factory=dict)

    @property
    def base_radii(self) -> tuple[float, float, float]:
        """Of sun, planet and ring."""
        half = self.module * math.cos(self.pressure_angle) / 2
        return half * self.z_sun, half * self.z_planet, half * self.z_ring

    @property
    def arm(self) -> float:
        """From the axis to a planet's pin."""
        return self.module * (self.z_sun + self.z_planet) / 2

    @property
    def period(self) -> int:
        """Turns of the carrier after which all teeth meet as before."""
        sun, planet = Fraction(self.z_ring, self.z_sun), Fraction(self.z_ring, self.z_planet)
        return math.lcm(sun.denominator, planet.denominator)

    def angles(self) -> Real:
        """Places of the planets as drawn."""
        return 2 * np.pi * np.arange(self.planets) / self.planets


def ring_forces(machine: Machine, carrier_hz: float, torque: float) -> tuple[Real, Real]:
    """Turns of the carrier over one period, and the forces of the ring's meshes there, (planets, steps)."""
    a_turn = machine.z_ring * STEPS_A_TOOTH
    turn = np.arange(-SETTLE_TURNS * a_turn, machine.period * a_turn) / a_turn
    stiffness, offset, load = _excitation(machine, turn, torque)
    sun, planet, ring = machine.base_radii
    n = machine.planets
    geometry = np.zeros((2 * n, n + 1))  # what a turn of carrier and planets takes off each mesh's approach
    geometry[:n, 0], geometry[n:, 0] = sun + planet, ring - planet
    for i in range(n):
        geometry[i, 1 + i], geometry[n + i, 1 + i] = planet, -planet
    mass = np.array([machine.carrier_inertia, *([machine.planet_inertia] * n)])
    typical = float(stiffness.mean())
    ratio = machine.damping_ratio * machine.hidden.get("mesh-damping", {}).get("times", 1.0)
    damping = 2 * ratio * math.sqrt(typical * machine.planet_inertia / planet**2)
    step = 1.0 / (carrier_hz * a_turn)
    rate = np.gradient(offset, step, axis=0)
    linear = machine.exponent == 1.0
    if linear:
        force = _newmark(mass, geometry, stiffness, offset, rate, load, damping, step)
    if not linear or force.min() < 0:  # teeth part, and do not pull
        knee = machine.exponent * KNEE_N / typical  # where the slope of k x (x / x0)^(n - 1) / n is k
        force = _runge_kutta(
            mass, geometry, stiffness / machine.exponent, offset, rate, load, damping, step, machine.exponent, knee
        )  # fmt: skip
    if (
        "tooth-friction" in machine.hidden
    ):  # turns with the sliding, at the pitch point in the middle of the path
        sliding = machine.z_ring * (turn[:, None] + machine.angles() / (2 * np.pi)) - 0.5
        friction = machine.hidden["tooth-friction"]["coefficient"] * np.tanh(8 * np.sin(2 * np.pi * sliding))
        force[:, n:] *= 1 + friction
    return turn[SETTLE_TURNS * a_turn :], force[SETTLE_TURNS * a_turn :, n:].T.copy()


def _excitation(machine: Machine, turn: Real, torque: float) -> tuple[Real, Real, Real]:
    """Stiffness and offset of every mesh, and the torque, at each step."""
    hidden, places = machine.hidden, machine.angles()
    z_sun, z_ring = machine.z_sun, machine.z_ring
    against = turn * z_ring / z_sun  # turns of the sun against the carrier
    stiffness = np.empty((turn.size, 2 * machine.planets))
    offset = np.zeros_like(stiffness)
    for i, place in enumerate(places):
        ahead = 0.0
        if "planet-position-error" in hidden and int(hidden["planet-position-error"]["planet"]) == i + 1:
            ahead = hidden["planet-position-error"]["error_um"] * 1e-6
        seat = place + ahead / machine.arm
        on_sun = against - seat / (2 * np.pi)
        k_sun = _mesh(machine, z_sun * on_sun, machine.contact_ratio[0])
        k_ring = _mesh(machine, z_ring * (turn + seat / (2 * np.pi)) + machine.lead, machine.contact_ratio[1])
        if "tooth-crack" in hidden:
            crack = hidden["tooth-crack"]
            inside = ((on_sun - crack["place"]) % 1.0) * z_sun / machine.contact_ratio[0]
            k_sun = k_sun * (
                1 - crack["softer"] * np.where(inside < 1, 0.5 - 0.5 * np.cos(2 * np.pi * inside), 0.0)
            )
        if "unequal-load-sharing" in hidden and int(hidden["unequal-load-sharing"]["planet"]) == i + 1:
            k_sun, k_ring = (k * (1 + hidden["unequal-load-sharing"]["share"]) for k in (k_sun, k_ring))
        stiffness[:, i], stiffness[:, machine.planets + i] = k_sun, k_ring
        # The planet is pushed forward by sun and ring and held back by its pin: a pin ahead lets both flanks go.
        offset[:, [i, machine.planets + i]] -= ahead * math.cos(machine.pressure_angle)
        if "carrier-runout" in hidden:
            runout = hidden["carrier-runout"]
            at = 2 * np.pi * turn + place + runout["phase"]
            offset[:, machine.planets + i] += runout["eccentricity_um"] * 1e-6 * np.sin(at)
        if "planet-runout" in hidden and int(hidden["planet-runout"]["planet"]) == i + 1:
            runout = hidden["planet-runout"]
            at = 2 * np.pi * turn * z_ring / machine.z_planet + runout["phase"]
            offset[:, i] += runout["eccentricity_um"] * 1e-6 * np.sin(at - machine.pressure_angle)
            offset[:, machine.planets + i] -= (
                runout["eccentricity_um"] * 1e-6 * np.sin(at + machine.pressure_angle)
            )
        if "sun-runout" in hidden:
            runout = hidden["sun-runout"]
            at = 2 * np.pi * against - place + runout["phase"]
            offset[:, i] += runout["eccentricity_um"] * 1e-6 * np.sin(at + machine.pressure_angle)
        if "pitch-errors" in hidden:
            pitch = hidden["pitch-errors"]
            rng = np.random.default_rng(int(pitch["seed"]))
            wave = np.zeros_like(turn)
            for k, phase in enumerate(rng.uniform(0, 2 * np.pi, 9), 2):  # the first harmonic is a runout
                wave += np.cos(2 * np.pi * k * on_sun + phase) / k
            offset[:, i] += pitch["cumulative_um"] * 1e-6 * wave
    load = np.full(turn.size, float(torque))
    if "torque-ripple" in hidden:
        ripple = hidden["torque-ripple"]
        load *= 1 + ripple["part"] * np.cos(2 * np.pi * (against + turn) + ripple["phase"])
    return stiffness, offset, load


def contact_ratios(z_sun: int, z_planet: int, z_ring: int, angle: float) -> tuple[float, float]:
    """Of sun and planet, of planet and ring, with addenda of one module (path of contact over base pitch)."""
    cos, sin = math.cos(angle), math.sin(angle)

    def reach(z: int, addendum: float) -> float:
        return math.sqrt((z / 2 + addendum) ** 2 - (z / 2 * cos) ** 2)

    outer = reach(z_sun, 1.0) + reach(z_planet, 1.0) - (z_sun + z_planet) / 2 * sin
    inner = reach(z_planet, 1.0) - reach(z_ring, -1.0) + (z_ring - z_planet) / 2 * sin
    return outer / (math.pi * cos), inner / (math.pi * cos)


def _mesh(machine: Machine, phase: Real, ratio: float) -> Real:
    """Stiffness of all pairs at a phase in pitches."""
    total = np.zeros_like(phase)
    base = phase - np.floor(phase)
    for pair in range(math.ceil(ratio)):
        x = (base + pair) / ratio
        ramp = machine.ramp * machine.hidden.get("tip-relief", {}).get("longer", 1.0)
        edge = np.clip(np.minimum(x, 1 - x) / ramp, 0, 1)
        if machine.form == "trapezoid":
            total += machine.pair_stiffness * (1 - machine.drop * np.abs(2 * x - 1)) * edge
        else:
            parabola = 1 - machine.drop * (2 * x - 1) ** 2
            total += machine.pair_stiffness * parabola * (0.5 - 0.5 * np.cos(np.pi * edge))
    return total


@njit(cache=True)
def _newmark(mass, geometry, stiffness, offset, rate, load, damping, step):
    """Forces of the meshes by Newmark's average acceleration (beta 1/4, gamma 1/2)."""
    steps, meshes = stiffness.shape
    size = mass.size
    force = np.zeros((steps, meshes))
    q, v, a = np.zeros(size), np.zeros(size), np.zeros(size)
    for k in range(steps):
        matrix, right = np.zeros((size, size)), np.zeros(size)
        drag = np.zeros((size, size))
        for m in range(meshes):
            spring = stiffness[k, m]
            given = spring * offset[k, m] + damping * rate[k, m]
            for i in range(size):
                right[i] += geometry[m, i] * given
                for j in range(size):
                    both = geometry[m, i] * geometry[m, j]
                    matrix[i, j] += both * spring
                    drag[i, j] += both * damping
        right[0] -= load[k]
        if k == 0:
            q = np.linalg.solve(matrix, right)
        else:
            whole = matrix + drag * (2 / step)
            known = drag @ (q * (2 / step) + v)
            for i in range(size):
                whole[i, i] += 4 * mass[i] / step**2
                known[i] += mass[i] * (q[i] * 4 / step**2 + v[i] * 4 / step + a[i])
            fresh = np.linalg.solve(whole, right + known)
            v_new = 2 / step * (fresh - q) - v
            a = 4 / step**2 * (fresh - q) - 4 / step * v - a
            q, v = fresh, v_new
        for m in range(meshes):
            approach, speed = offset[k, m], rate[k, m]
            for i in range(size):
                approach -= geometry[m, i] * q[i]
                speed -= geometry[m, i] * v[i]
            force[k, m] = stiffness[k, m] * approach + damping * speed
    return force


@njit(cache=True)
def _slope(q, v, mass, geometry, stiffness, offset, rate, load, damping, exponent, knee, force):
    """Accelerations; the forces of the meshes are put into `force`."""
    for m in range(stiffness.size):
        approach, speed = offset[m], rate[m]
        for i in range(mass.size):
            approach -= geometry[m, i] * q[i]
            speed -= geometry[m, i] * v[i]
        if approach > 0:
            force[m] = max(
                stiffness[m] * approach * (approach / knee) ** (exponent - 1) + damping * speed, 0.0
            )
        else:
            force[m] = 0.0
    found = geometry.T @ force
    found[0] -= load
    return found / mass


@njit(cache=True)
def _runge_kutta(mass, geometry, stiffness, offset, rate, load, damping, step, exponent, knee):
    """Forces of meshes whose stiffness goes with the load, by Runge-Kutta's method of the fourth order."""
    steps, meshes = stiffness.shape
    force, found = np.zeros(meshes), np.zeros((steps, meshes))
    whole = load[0] / geometry[:, 0].sum()
    q, v = np.zeros(mass.size), np.zeros(mass.size)
    q[0] = -((whole / stiffness[0].mean() * knee ** (exponent - 1)) ** (1 / exponent)) / geometry[:, 0].mean()
    h = step / SUBSTEPS
    for k in range(steps):
        after = min(k + 1, steps - 1)
        for part in range(SUBSTEPS):
            a = part / SUBSTEPS
            b, c = a + 0.5 / SUBSTEPS, a + 1.0 / SUBSTEPS
            begin = (stiffness[k] * (1 - a) + stiffness[after] * a, offset[k] * (1 - a) + offset[after] * a,
                     rate[k] * (1 - a) + rate[after] * a, load[k] * (1 - a) + load[after] * a)  # fmt: skip
            middle = (stiffness[k] * (1 - b) + stiffness[after] * b, offset[k] * (1 - b) + offset[after] * b,
                      rate[k] * (1 - b) + rate[after] * b, load[k] * (1 - b) + load[after] * b)  # fmt: skip
            end = (stiffness[k] * (1 - c) + stiffness[after] * c, offset[k] * (1 - c) + offset[after] * c,
                   rate[k] * (1 - c) + rate[after] * c, load[k] * (1 - c) + load[after] * c)  # fmt: skip
            a1 = _slope(q, v, mass, geometry, *begin, damping, exponent, knee, force)
            if part == 0:
                found[k] = force
            v2 = v + h / 2 * a1
            a2 = _slope(q + h / 2 * v, v2, mass, geometry, *middle, damping, exponent, knee, force)
            v3 = v + h / 2 * a2
            a3 = _slope(q + h / 2 * v2, v3, mass, geometry, *middle, damping, exponent, knee, force)
            v4 = v + h * a3
            a4 = _slope(q + h * v3, v4, mass, geometry, *end, damping, exponent, knee, force)
            q = q + h / 6 * (v + 2 * v2 + 2 * v3 + v4)
            v = v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    return found
