"""What can be hidden in a simulated room: each function changes the truth, the rig file keeps silent.

Strengths are amplitudes that a catalogue's effect could come back with; what a strength leaves open (place, resonance,
delay) is drawn, or given behind an ``@``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from specan.errors import RequestError, nearest
from specan.testing.room.box import WALLS, Disc
from specan.testing.room.branch import Lining, Motion, Plug
from specan.testing.room.field import Room
from specan.testing.room.layout import Layout, Point, as_point, at_temperature, draw_on_wall
from specan.testing.room.line import Real


@dataclass(frozen=True)
class Truth:
    """The room and the instruments as they are.

    Attributes
    ----------
    gain_dB, delay_s : array (microphones,)
        Errors that the calibration left; positive delays are late.
    vibrometer_gain, vibrometer_delay_s : float
        Relative error, and how late the vibrometer is.
    vibrometer_noise : float
        RMS of its additional noise over the RMS of the velocity.
    breakup : tuple of float
        Strength, frequency (Hz) and loss factor of the diaphragm's own resonance.
    details : dict
        Per hidden effect what was drawn for it.
    """

    layout: Layout
    room: Room
    temperature_C: float
    gain_dB: Real
    delay_s: Real
    vibrometer_gain: float
    vibrometer_delay_s: float
    vibrometer_noise: float
    breakup: tuple[float, float, float]
    details: dict[str, dict[str, float | str]]


Details = dict[str, float | str]
Install = Callable[[Truth, float, str, np.random.Generator], tuple[Truth, Details]]


@dataclass(frozen=True)
class HiddenRoomEffect:
    """One effect that can be hidden: the unit of its strength, a usual range of it, and what it does."""

    unit: str
    low: float
    high: float
    install: Install


def _wall(truth: Truth, at: str, rng: np.random.Generator) -> str:
    free = [wall for wall in WALLS if wall != truth.layout.piston.wall]
    drawn = free[rng.integers(len(free))]
    if at and at not in free:
        raise RequestError(f"nothing can be hidden in the wall {at!r}", remedy=nearest(at, free))
    return at or drawn


def _number(at: str, n: int, drawn: int, what: str) -> int:
    """Number counted from 0 of a microphone or card: ``3`` or ``Mic 3``."""
    text = at.split()[-1] if at else str(drawn + 1)
    if not text.isdigit() or not 1 <= int(text) <= n:
        raise RequestError(f"there is no {what} {at!r}", expected=f"a number from 1 to {n}")
    return int(text) - 1


def _with_part(truth: Truth, part: Lining | Plug) -> Truth:
    return replace(truth, room=replace(truth.room, parts=(*truth.room.parts, part)))


def _swinging(
    truth: Truth, strength: float, wall: str, frequency_hz: float, quality: float
) -> tuple[Truth, Details]:
    """A lining whose admittance over that of air is `strength` at its resonance."""
    resistance = truth.room.density * truth.room.sound_speed / strength
    omega = 2.0 * np.pi * frequency_hz
    mass = quality * resistance / omega
    motion = Motion(mass=mass, resistance=resistance, stiffness=omega**2 * mass)
    details: Details = {"wall": wall, "frequency_hz": frequency_hz, "quality": quality, "mass_kg_m2": mass}
    return _with_part(truth, Lining(wall, motion)), details


def _wall_impedance(
    truth: Truth, strength: float, at: str, rng: np.random.Generator
) -> tuple[Truth, Details]:
    wall = _wall(truth, at, rng)
    return _swinging(truth, strength, wall, rng.uniform(150.0, 450.0), rng.uniform(0.3, 0.8))


def _panel(truth: Truth, strength: float, at: str, rng: np.random.Generator) -> tuple[Truth, Details]:
    wall = _wall(truth, at, rng)
    return _swinging(truth, strength, wall, rng.uniform(100.0, 350.0), rng.uniform(5.0, 15.0))


def _resonator(truth: Truth, strength: float, at: str, rng: np.random.Generator) -> tuple[Truth, Details]:
    """A neck before a cavity of `strength` cubic metres: mass of the air plug, spring of the enclosed air."""
    wall = _wall(truth, at, rng)
    radius, frequency, quality = rng.uniform(0.02, 0.03), rng.uniform(120.0, 450.0), rng.uniform(8.0, 20.0)
    place = draw_on_wall(rng, truth.layout.dims_m, wall, 0.08)
    disc = Disc(wall, place, radius)
    omega, rho = 2.0 * np.pi * frequency, truth.room.density
    stiffness = rho * truth.room.sound_speed**2 * disc.area_m2 / strength
    mass = stiffness / omega**2
    motion = Motion(mass=mass, resistance=omega * mass / quality, stiffness=stiffness)
    details: Details = {"wall": wall, "place_m": str(place), "frequency_hz": frequency, "quality": quality}
    return _with_part(truth, Plug(disc, motion)), details | {"neck_radius_m": radius, "length_m": mass / rho}


def _leak(truth: Truth, strength: float, at: str, rng: np.random.Generator) -> tuple[Truth, Details]:
    """An opening of `strength` square metres to the outside: a plug of air with some resistance."""
    wall = _wall(truth, at, rng)
    radius = float(np.sqrt(strength / np.pi))
    place = draw_on_wall(rng, truth.layout.dims_m, wall, radius + 0.05)
    length = rng.uniform(0.01, 0.03) + 0.85 * radius
    rho, c = truth.room.density, truth.room.sound_speed
    motion = Motion(mass=rho * length, resistance=rng.uniform(0.005, 0.03) * rho * c, stiffness=0.0)
    return _with_part(truth, Plug(Disc(wall, place, radius), motion)), {
        "wall": wall,
        "place_m": str(place),
        "length_m": length,
        "resistance_Pa_s_m": motion.resistance,
    }


def _temperature(truth: Truth, strength: float, at: str, rng: np.random.Generator) -> tuple[Truth, Details]:
    warmer = truth.temperature_C + strength
    return replace(truth, temperature_C=warmer, room=at_temperature(truth.room, warmer)), {}


def _dimension(truth: Truth, strength: float, at: str, rng: np.random.Generator) -> tuple[Truth, Details]:
    drawn = "xyz"[rng.integers(3)]
    edge = at or drawn
    if edge not in ("x", "y", "z"):
        raise RequestError(f"there is no edge {at!r}", remedy=nearest(at, "xyz"))
    dims = np.array(truth.room.dims_m)
    dims["xyz".index(edge)] *= 1.0 + strength
    return replace(truth, room=replace(truth.room, dims_m=as_point(dims))), {"edge": edge}


def _position(truth: Truth, strength: float, at: str, rng: np.random.Generator) -> tuple[Truth, Details]:
    n = len(truth.room.position_m)
    mic = _number(at, n, int(rng.integers(n)), "microphone")
    way = rng.standard_normal(3)
    way *= strength / np.linalg.norm(way)
    place = np.array(truth.room.position_m[mic])
    dims = np.array(truth.room.dims_m)
    way = np.where((place + way < 0.01) | (place + way > dims - 0.01), -way, way)
    places: list[Point] = list(truth.room.position_m)
    places[mic] = as_point(place + way)
    room = replace(truth.room, position_m=tuple(places))
    return replace(truth, room=room), {"microphone": float(mic + 1), "moved_m": str(as_point(way))}


def _delay(truth: Truth, strength: float, at: str, rng: np.random.Generator) -> tuple[Truth, Details]:
    cards = truth.layout.cards
    card = _number(at, len(cards), int(rng.integers(len(cards))), "card")
    delay = truth.delay_s.copy()
    delay[cards[card][0] - 1 : cards[card][1]] += strength
    return replace(truth, delay_s=delay), {"card": float(card + 1)}


def _gain(truth: Truth, strength: float, at: str, rng: np.random.Generator) -> tuple[Truth, Details]:
    n = len(truth.gain_dB)
    mic = _number(at, n, int(rng.integers(n)), "microphone")
    gain = truth.gain_dB.copy()
    gain[mic] += strength
    return replace(truth, gain_dB=gain), {"microphone": float(mic + 1)}


def _piston_size(truth: Truth, strength: float, at: str, rng: np.random.Generator) -> tuple[Truth, Details]:
    piston = replace(truth.room.piston, radius_m=truth.room.piston.radius_m * (1.0 + strength))
    return replace(truth, room=replace(truth.room, piston=piston)), {}


def _breakup(truth: Truth, strength: float, at: str, rng: np.random.Generator) -> tuple[Truth, Details]:
    frequency, loss = rng.uniform(650.0, 1200.0), rng.uniform(0.05, 0.2)
    details: Details = {"frequency_hz": frequency, "loss_factor": loss}
    return replace(truth, breakup=(strength, frequency, loss)), details


def _flanking(truth: Truth, strength: float, at: str, rng: np.random.Generator) -> tuple[Truth, Details]:
    wall = _wall(truth, at, rng)
    place = draw_on_wall(rng, truth.layout.dims_m, wall, 0.12)
    late = rng.uniform(0.0, 0.002)
    second = Disc(wall, place, truth.layout.piston.radius_m)
    room = replace(truth.room, second=second, second_gain=strength, second_delay_s=late)
    return replace(truth, room=room), {"wall": wall, "place_m": str(place), "delay_s": late}


def _noise(truth: Truth, strength: float, at: str, rng: np.random.Generator) -> tuple[Truth, Details]:
    return replace(truth, vibrometer_noise=strength), {}


EFFECTS: dict[str, HiddenRoomEffect] = {
    "wall-impedance": HiddenRoomEffect("rho c / Z at resonance", 0.02, 0.2, _wall_impedance),
    "panel-resonance": HiddenRoomEffect("rho c / Z at resonance", 0.05, 0.5, _panel),
    "helmholtz-resonator": HiddenRoomEffect("m^3", 3e-4, 3e-3, _resonator),
    "leak": HiddenRoomEffect("m^2", 3e-4, 5e-3, _leak),
    "temperature": HiddenRoomEffect("K", 2.0, 5.0, _temperature),
    "dimension-error": HiddenRoomEffect("1", 0.003, 0.01, _dimension),
    "microphone-position": HiddenRoomEffect("m", 0.008, 0.02, _position),
    "microphone-delay": HiddenRoomEffect("s", 5e-6, 5e-5, _delay),
    "microphone-gain": HiddenRoomEffect("dB", 0.5, 1.5, _gain),
    "piston-size": HiddenRoomEffect("1", -0.2, 0.2, _piston_size),
    "piston-breakup": HiddenRoomEffect("1", 0.05, 0.5, _breakup),
    "flanking-source": HiddenRoomEffect("1", 0.02, 0.3, _flanking),
    "vibrometer-noise": HiddenRoomEffect("1", 0.02, 0.2, _noise),
}
POSITIVE = ("wall-impedance", "panel-resonance", "helmholtz-resonator", "leak", "vibrometer-noise")


def check(effects: dict[str, float]) -> None:
    """Refuse names that are not known and strengths that cannot be."""
    for full, strength in effects.items():
        name = full.partition("@")[0]
        if name not in EFFECTS:
            raise RequestError(f"no effect {name!r} can be hidden", remedy=nearest(name, EFFECTS))
        if not np.isfinite(strength) or (name in POSITIVE and strength <= 0.0):
            wanted = "a positive number" if name in POSITIVE else "a finite number"
            raise RequestError(f"the strength of {full} is {strength}", expected=wanted)


def hide(truth: Truth, effects: dict[str, float], seed: int) -> Truth:
    """The truth with the effects in it; each draws from a stream of its own."""
    names = sorted(EFFECTS)
    for full in sorted(effects):
        name, _, at = full.partition("@")
        rng = np.random.default_rng([seed, 100 + names.index(name)])
        truth, details = EFFECTS[name].install(truth, effects[full], at, rng)
        truth = replace(truth, details={**truth.details, full: details})
    return truth
