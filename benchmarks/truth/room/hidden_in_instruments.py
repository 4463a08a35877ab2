"""What can be hidden in the instruments: microphones, their cards, the vibrometer and what it looks at."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from specan.errors import RequestError
from truth.room.layout import Point, as_point
from truth.room.truth import Details, Shaking, Truth

SHAKEN = 4  # microphones on one stand


def _number(at: str, n: int, drawn: int, what: str) -> int:
    """Number counted from 0 of a microphone or card: ``3`` or ``Mic 3``."""
    text = at.split()[-1] if at else str(drawn + 1)
    if not text.isdigit() or not 1 <= int(text) <= n:
        raise RequestError(f"there is no {what} {at!r}", expected=f"a number from 1 to {n}")
    return int(text) - 1


def position(truth: Truth, strength: float, at: str, rng: np.random.Generator) -> tuple[Truth, Details]:
    """A microphone stands `strength` metres away from its place, in a random direction."""
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


def delay(truth: Truth, strength: float, at: str, rng: np.random.Generator) -> tuple[Truth, Details]:
    """A card is late."""
    cards = truth.layout.cards
    card = _number(at, len(cards), int(rng.integers(len(cards))), "card")
    late = truth.delay_s.copy()
    late[cards[card][0] - 1 : cards[card][1]] += strength
    return replace(truth, delay_s=late), {"card": float(card + 1)}


def gain(truth: Truth, strength: float, at: str, rng: np.random.Generator) -> tuple[Truth, Details]:
    """A microphone has become more sensitive since it was calibrated."""
    n = len(truth.gain_dB)
    mic = _number(at, n, int(rng.integers(n)), "microphone")
    louder = truth.gain_dB.copy()
    louder[mic] += strength
    return replace(truth, gain_dB=louder), {"microphone": float(mic + 1)}


def piston_size(truth: Truth, strength: float, at: str, rng: np.random.Generator) -> tuple[Truth, Details]:
    """The diaphragm is larger."""
    piston = replace(truth.room.piston, radius_m=truth.room.piston.radius_m * (1.0 + strength))
    return replace(truth, room=replace(truth.room, piston=piston)), {}


def breakup(truth: Truth, strength: float, at: str, rng: np.random.Generator) -> tuple[Truth, Details]:
    """The centre of the diaphragm, at which the vibrometer looks, moves otherwise than its mean."""
    frequency, loss = rng.uniform(650.0, 1200.0), rng.uniform(0.05, 0.2)
    details: Details = {"frequency_hz": frequency, "loss_factor": loss}
    return replace(truth, breakup=(strength, frequency, loss)), details


def vibrometer_noise(
    truth: Truth, strength: float, at: str, rng: np.random.Generator
) -> tuple[Truth, Details]:
    """Speckles add noise to the velocity."""
    return replace(truth, vibrometer_noise=strength), {}


def shaken(truth: Truth, strength: float, at: str, rng: np.random.Generator) -> tuple[Truth, Details]:
    """A stand with some microphones shakes at its resonance, whatever the sound around them does.

    `strength` is the pressure that a microphone seems to hear there, over rho c times the diaphragm's velocity.
    """
    n = len(truth.gain_dB)
    chosen = np.sort(rng.choice(n, min(SHAKEN, n), replace=False))
    frequency, quality = rng.uniform(150.0, 500.0), rng.uniform(10.0, 40.0)
    pressure = np.zeros(n)
    pressure[chosen] = rng.choice([-1.0, 1.0], len(chosen)) * rng.uniform(0.6, 1.0, len(chosen))
    pressure *= strength * truth.room.density * truth.room.sound_speed
    details: Details = {"microphones": ",".join(str(m + 1) for m in chosen)}
    details |= {"frequency_hz": frequency, "quality": quality}
    return replace(truth, shaking=Shaking(pressure, frequency, quality)), details
