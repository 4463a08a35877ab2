"""Vibration in the plane of a planetary set in an elastic ring, integrated in time by central differences.

Lin and Parker (J. Vib. Acoust. 121 (1999) 316): sun, planets and ring move and turn, in a frame that turns with the
carrier. The ring bends in 2 to 4 lobes and sits on bolts. Meshes are springs whose stiffness is a table over the
pitch, with profile errors of the flanks; a mesh that would pull lets go.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

Real = NDArray[np.float64]

STEPS_HZ = 102_400.0
SETTLE_S = 0.6
PITCH = 720  # places of the tables over a pitch
ROUNDED = 25.0  # harmonic of the mesh from which on the stiffness is smooth
LOBES = (1, 2, 3, 4)  # of the ring; one is its motion as a whole


@dataclass(frozen=True)
class Machine:
    """Numbers of one set in SI; what is hidden in it stands in `hidden`."""

    z_sun: int = 24
    z_planet: int = 21
    z_ring: int = 66
    planets: int = 3
    module: float = 2e-3
    pressure_angle: float = math.radians(20.0)
    pair_stiffness: float = 8e7
    roundness: float = 2.0  # power of the course of a pair's stiffness over its path
    ramp: float = 0.05  # part of the path over which a pair takes its load
    contact_ratio: tuple[float, float] = (1.586, 1.932)
    profile: tuple[tuple[complex, ...], tuple[complex, ...]] = ((), ())  # harmonics of the flanks' errors, m
    damping_ratio: float = 0.05
    sun_bearing: float = 8e7
    pin: float = 3e8
    ring_stiffness: float = 6e9  # of its bending in two lobes
    bolts: int = 8
    bolt: float = 1e9
    drive_inertia: float = 1e-2
    carrier_inertia: float = 8e-3
    planet_inertia: float = 6e-5
    hidden: dict[str, dict[str, float]] = field(default_factory=dict)

    @property
    def radii(self) -> tuple[float, float, float]:
        """Base radii of sun, planet and ring."""
        half = self.module * math.cos(self.pressure_angle) / 2
        return half * self.z_sun, half * self.z_planet, half * self.z_ring

    @property
    def arm(self) -> float:
        """From the axis to a pin."""
        return self.module * (self.z_sun + self.z_planet) / 2

    def places(self) -> Real:
        """Of the planets on the carrier."""
        return 2 * np.pi * np.arange(self.planets) / self.planets

    def value(self, effect: str, key: str, otherwise: float = 0.0) -> float:
        """A size of what is hidden."""
        return self.hidden.get(effect, {}).get(key, otherwise)

    def of_planet(self, effect: str, key: str) -> Real:
        """The same for each planet: nothing but at that it is hidden in."""
        found = np.zeros(self.planets)
        if effect in self.hidden:
            found[int(self.hidden[effect]["planet"]) - 1] = self.hidden[effect][key]
        return found


def ring_forces(machine: Machine, turn: Real, torque: float) -> Real:
    """Forces of the ring's meshes, (planets, steps), at turns of the carrier that are 1 / STEPS_HZ apart.

    The first `SETTLE_S` are left out.
    """
    mass, stiffness, fixed = _linear(machine)
    errors = _errors(machine, turn)
    tables = np.stack([_table(machine, side) for side in (0, 1)])
    phases = _phases(machine)
    meshes = _softening(machine, turn)
    load = torque / machine.arm * np.minimum(np.arange(turn.size) / (0.3 * SETTLE_S * STEPS_HZ), 1.0)
    if "torque-ripple" in machine.hidden:
        at = 2 * np.pi * turn * (1 + machine.z_ring / machine.z_sun) + machine.value("torque-ripple", "phase")
        load *= 1 + machine.value("torque-ripple", "part") * np.cos(at)
    typical = float(tables.mean())
    ratio = machine.damping_ratio * machine.value("mesh-damping", "damping", 1.0)
    drag = 2 * ratio * math.sqrt(typical * machine.planet_inertia) / machine.radii[1]
    pins = -machine.pin * _pin_factor(machine) * machine.of_planet("planet-position-error", "error_um") * 1e-6
    force = _integrate(
        mass, stiffness, _damping(mass, stiffness), fixed, np.array(LOBES, dtype=float), machine.places(),
        2 * np.pi * turn, tables, phases, errors, meshes, load, drag, pins, 1 / STEPS_HZ, machine.pressure_angle,
    )  # fmt: skip
    return force[:, round(SETTLE_S * STEPS_HZ) :]


def _pin_factor(machine: Machine) -> Real:
    return 1 / (1 + machine.of_planet("unequal-load-sharing", "softer"))


def _linear(machine: Machine) -> tuple[Real, Real, Real]:
    """Masses and stiffness of all that is no mesh; what each mesh's approach takes of the parts on the carrier."""
    n, (sun, planet, _) = machine.planets, machine.radii
    size = 4 + 3 * n + 1 + 2 * len(LOBES)
    mass, stiffness = np.zeros(size), np.zeros((size, size))
    mass[:4] = [0.35, 0.35, machine.drive_inertia / sun**2, machine.carrier_inertia / machine.arm**2]
    stiffness[0, 0] = stiffness[1, 1] = machine.sun_bearing
    # The drive holds the sun's angle by a soft coupling: the load has its resonance far below the mesh.
    stiffness[2, 2] = mass[3] * (2 * np.pi * 45.0) ** 2
    factor = _pin_factor(machine)
    for i in range(n):
        own = slice(4 + 3 * i, 7 + 3 * i)  # radial, tangential, turn
        mass[own] = [0.3, 0.3, machine.planet_inertia / planet**2]
        spring = machine.pin * factor[i]
        stiffness[4 + 3 * i, 4 + 3 * i] += spring
        tangential = np.zeros(size)
        tangential[5 + 3 * i], tangential[3] = -1.0, 1.0
        stiffness += spring * np.outer(tangential, tangential)
    last = 4 + 3 * n  # the ring's turn, then its lobes
    mass[last:] = 3.0
    stiffness[last, last] = machine.bolts * machine.bolt
    thin = 1 + machine.value("ring-flexibility", "thinner")
    angle = 2 * np.pi * np.arange(machine.bolts) / machine.bolts + 0.3
    shape = np.concatenate([[np.cos(k * angle), np.sin(k * angle)] for k in LOBES])
    stiffness[last + 1 :, last + 1 :] += machine.bolt / thin * shape @ shape.T
    for number, k in enumerate(LOBES):
        bending = machine.ring_stiffness / thin * (k * k * (k * k - 1) ** 2 / 36) / (k * k + 1) * 5 / 4
        for part in (1, 2):
            stiffness[last + 2 * number + part, last + 2 * number + part] += bending
    fixed = np.zeros((2 * n, size))
    alpha = machine.pressure_angle
    for i, place in enumerate(machine.places()):
        own = 4 + 3 * i
        fixed[i, [0, 1, 2]] = -math.sin(place - alpha), math.cos(place - alpha), 1.0
        fixed[i, [own, own + 1, own + 2]] = -math.sin(alpha), -math.cos(alpha), 1.0
        fixed[n + i, [own, own + 1, own + 2]] = math.sin(alpha), -math.cos(alpha), -1.0
        fixed[n + i, last] = 1.0
    return mass, stiffness, fixed


def _damping(mass: Real, stiffness: Real) -> Real:
    """In proportion to the stiffness, and half critical where the drive holds the sun's angle."""
    found = 3e-6 * stiffness
    found[2, 2] += math.sqrt(stiffness[2, 2] * mass[2])
    return found


def _table(machine: Machine, side: int) -> Real:
    """Stiffness over a pitch of the sun's (0) or the ring's (1) meshes."""
    ratio, phase = machine.contact_ratio[side], np.arange(PITCH) / PITCH
    total = np.zeros(PITCH)
    for pair in range(math.ceil(ratio)):
        x = (phase + pair) / ratio
        inside = np.clip(1 - np.abs(2 * x - 1), 0, 1)
        course = 1 - 0.35 * np.abs(2 * x - 1) ** machine.roundness
        total += np.where(x < 1, course * (1 - np.exp(-inside / machine.ramp)), 0.0)
    # Teeth meet a little early and late as they bend; kinks would also have harmonics above half the steps' rate.
    spectrum = np.fft.rfft(total)
    smooth = np.fft.irfft(spectrum * np.exp(-((np.arange(spectrum.size) / ROUNDED) ** 2)), PITCH)
    return machine.pair_stiffness * (1 + machine.value("mesh-damping", "stiffness")) * smooth


def _phases(machine: Machine) -> Real:
    """Phase in pitches of every mesh at a turn of the carrier: constant part, and pitches a turn (meshes, 2)."""
    seat = (
        machine.places() + machine.of_planet("planet-position-error", "error_um") * 1e-6 / machine.arm
    ) / (2 * np.pi)
    start = np.concatenate([-machine.z_sun * seat, machine.z_ring * seat + 0.37])
    return np.stack([start, np.full(start.size, float(machine.z_ring))], axis=1)


def _softening(machine: Machine, turn: Real) -> Real:
    """Factor of the stiffness of the sun's meshes, (planets, steps), where a tooth is cracked; else nothing."""
    found = np.ones((machine.planets, turn.size if "tooth-crack" in machine.hidden else 1))
    if "tooth-crack" in machine.hidden:
        against = turn * machine.z_ring / machine.z_sun
        for i, place in enumerate(machine.places()):
            at = (against - place / (2 * np.pi) - machine.value("tooth-crack", "place")) % 1.0
            inside = at * machine.z_sun / machine.contact_ratio[0]
            dip = np.where(inside < 1, 4 * inside * (1 - inside), 0.0)
            found[i] -= machine.value("tooth-crack", "softer") * dip
    return found


def _errors(machine: Machine, turn: Real) -> Real:
    """What the flanks have too much at each mesh, (meshes, steps), m."""
    n, places, alpha = machine.planets, machine.places(), machine.pressure_angle
    against = 2 * np.pi * turn * machine.z_ring / machine.z_sun
    planet = 2 * np.pi * turn * machine.z_ring / machine.z_planet
    phases = _phases(machine)
    found = np.zeros((2 * n, turn.size))
    for m in range(2 * n):
        at = 2 * np.pi * (phases[m, 0] + phases[m, 1] * turn)
        for h, part in enumerate(machine.profile[m // n], 1):
            found[m] += part.real * np.cos(h * at) - part.imag * np.sin(h * at)
    for i in range(n):
        for wheel, at in (
            ("sun-runout", against - places[i] + alpha),
            ("carrier-runout", 2 * np.pi * turn + places[i] + alpha),
        ):
            if wheel in machine.hidden:
                size = 1e-6 * machine.value(wheel, "eccentricity_um")
                found[i + n * (wheel == "carrier-runout")] += size * np.sin(
                    at + machine.value(wheel, "phase")
                )
        own = 1e-6 * machine.of_planet("planet-runout", "eccentricity_um")[i]
        if own:
            at = planet + machine.value("planet-runout", "phase")
            found[i] += own * np.sin(at - alpha)
            found[n + i] -= own * np.sin(at + alpha)
        if "pitch-errors" in machine.hidden:
            found[i] += np.interp((against - places[i]) % (2 * np.pi), *_pitches(machine), period=2 * np.pi)
    return found


def _pitches(machine: Machine) -> tuple[Real, Real]:
    """Angles of the sun's teeth, and cumulative errors of their pitches without the part once a turn."""
    rng = np.random.default_rng(int(machine.value("pitch-errors", "seed")))
    walk = np.cumsum(rng.standard_normal(machine.z_sun))
    spectrum = np.fft.rfft(walk - np.linspace(0, walk[-1], machine.z_sun))
    spectrum[:2] = 0
    error = np.fft.irfft(spectrum, machine.z_sun)
    size = 1e-6 * machine.value("pitch-errors", "cumulative_um")
    return 2 * np.pi * np.arange(machine.z_sun) / machine.z_sun, size * error / np.ptp(error)


@njit(cache=True)
def _integrate(
    mass,
    stiffness,
    damping,
    fixed,
    lobes,
    places,
    angle,
    tables,
    phases,
    errors,
    soft,
    load,
    drag,
    pins,
    step,
    alpha,
):
    """Forces of the ring's meshes by central differences; dampers act on the velocity half a step before."""
    size, planets, meshes = mass.size, places.size, fixed.shape[0]
    last = 4 + 3 * planets
    q, v, force = np.zeros(size), np.zeros(size), np.zeros(size)
    out = np.zeros((planets, angle.size))
    row, pitch = np.zeros(size), tables.shape[1]
    for k in range(angle.size):
        force[:] = -(stiffness @ q) - damping @ v
        force[3] -= load[k]
        for i in range(planets):
            force[5 + 3 * i] -= pins[i]
            force[3] += pins[i]
        for m in range(meshes):
            row[:] = fixed[m]
            factor = 1.0
            if m >= planets:
                at = angle[k] + places[m - planets]
                for j in range(lobes.size):
                    c, s = math.cos(lobes[j] * at), math.sin(lobes[j] * at)
                    # tangential motion over the lobes, radial motion: what a thin ring does without being stretched
                    row[last + 1 + 2 * j] = -math.cos(alpha) * s / lobes[j] - math.sin(alpha) * c
                    row[last + 2 + 2 * j] = math.cos(alpha) * c / lobes[j] - math.sin(alpha) * s
            elif soft.shape[1] > 1:
                factor = soft[m, k]
            approach, speed = errors[m, k], 0.0
            for j in range(size):
                approach += row[j] * q[j]
                speed += row[j] * v[j]
            at = (phases[m, 0] + phases[m, 1] * angle[k] / (2 * math.pi)) % 1.0 * pitch
            low = int(at)
            part = at - low
            spring = (
                tables[m // planets, low % pitch] * (1 - part)
                + tables[m // planets, (low + 1) % pitch] * part
            )
            press = spring * factor * approach + drag * speed
            if approach <= 0 or press <= 0:
                press = 0.0
            if m >= planets:
                out[m - planets, k] = press
            for j in range(size):
                force[j] -= row[j] * press
        for j in range(size):
            v[j] += step * force[j] / mass[j]
            q[j] += step * v[j]
    return out


def with_hidden(machine: Machine, hidden: dict[str, dict[str, float]]) -> Machine:
    """The same set with something wrong in it."""
    return replace(machine, hidden=hidden)
