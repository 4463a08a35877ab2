"""What can be hidden in a simulated room: each function changes the truth, the rig file keeps silent.

Strengths are amplitudes that a catalogue's effect could come back with; what a strength leaves open (place, resonance,
delay) is drawn, or given behind an ``@``.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from specan.errors import RequestError, nearest
from truth.room import hidden_in_instruments as instruments
from truth.room import hidden_in_the_room as inside
from truth.room import hidden_in_walls as walls
from truth.room.truth import HiddenRoomEffect, Truth

EFFECTS: dict[str, HiddenRoomEffect] = {
    "wall-impedance": HiddenRoomEffect("rho c / Z at resonance", 0.02, 0.2, walls.wall_impedance, "wall-impedance"),
    "porous-absorber": HiddenRoomEffect("covered part", 0.1, 1.0, walls.porous, "porous-absorber"),
    "panel-resonance": HiddenRoomEffect("rho c / Z at resonance", 0.05, 0.5, walls.panel, "panel-resonance"),
    "helmholtz-resonator": HiddenRoomEffect("m^3", 3e-4, 3e-3, walls.resonator, "helmholtz-resonator"),
    "leak": HiddenRoomEffect("m^2", 3e-4, 5e-3, walls.leak, "leak"),
    "flanking-source": HiddenRoomEffect("1", 0.02, 0.3, walls.flanking, "flanking-source", both_signs=True),
    "extended-reaction": HiddenRoomEffect("rho c / Z at resonance", 0.05, 0.5, walls.extended_reaction, None),
    "air-absorption": HiddenRoomEffect("% humidity", 10.0, 40.0, inside.humidity, "air-absorption", both_signs=True),
    "temperature": HiddenRoomEffect("K", 2.0, 5.0, inside.temperature, "temperature", both_signs=True),
    "dimension-error": HiddenRoomEffect("1", 0.003, 0.01, inside.dimension, "dimension-error", both_signs=True),
    "scatterer": HiddenRoomEffect("m^3", 3e-4, 5e-3, inside.scatterer, "scatterer"),
    "drifting-air": HiddenRoomEffect("K", 0.5, 4.0, inside.drift, None, both_signs=True),
    "microphone-position": HiddenRoomEffect("m", 0.008, 0.02, instruments.position, "microphone-position"),
    "microphone-delay": HiddenRoomEffect("s", 5e-6, 5e-5, instruments.delay, "microphone-delay", both_signs=True),
    "microphone-gain": HiddenRoomEffect("dB", 0.5, 1.5, instruments.gain, "microphone-gain", both_signs=True),
    "piston-size": HiddenRoomEffect("1", 0.03, 0.2, instruments.piston_size, "piston-size", both_signs=True),
    "piston-breakup": HiddenRoomEffect("1", 0.05, 0.5, instruments.breakup, "piston-breakup", both_signs=True),
    "vibrometer-noise": HiddenRoomEffect("1", 0.02, 0.2, instruments.vibrometer_noise, "vibrometer-noise"),
    "shaken-microphone": HiddenRoomEffect("rho c", 0.005, 0.1, instruments.shaken, None),
}  # fmt: skip
_POSITIVE = (
    "wall-impedance", "porous-absorber", "panel-resonance", "extended-reaction", "helmholtz-resonator", "leak",
    "scatterer", "vibrometer-noise",
)  # fmt: skip
# Streams hang on these numbers: a new effect gets the next one.
_STREAM = {name: 100 + k for k, name in enumerate((
    "dimension-error", "flanking-source", "helmholtz-resonator", "leak", "microphone-delay", "microphone-gain",
    "microphone-position", "panel-resonance", "piston-breakup", "piston-size", "temperature", "vibrometer-noise",
    "wall-impedance", "porous-absorber", "scatterer", "air-absorption", "extended-reaction", "drifting-air",
    "shaken-microphone",
))}  # fmt: skip


def check(effects: dict[str, float]) -> None:
    """Refuse names that are not known and strengths that cannot be."""
    for full, strength in effects.items():
        name = full.partition("@")[0]
        if name not in EFFECTS:
            raise RequestError(f"no effect {name!r} can be hidden", remedy=nearest(name, EFFECTS))
        if not np.isfinite(strength) or (name in _POSITIVE and strength <= 0.0):
            wanted = "a positive number" if name in _POSITIVE else "a finite number"
            raise RequestError(f"the strength of {full} is {strength}", expected=wanted)
        if name == "porous-absorber" and strength > 1.0:
            raise RequestError(f"{full} is to cover {strength:g} of a wall", expected="at most 1")


def hide(truth: Truth, effects: dict[str, float], seed: int) -> Truth:
    """The truth with the effects in it; each draws from a stream of its own."""
    for full in sorted(effects):
        name, _, at = full.partition("@")
        rng = np.random.default_rng([seed, _STREAM[name]])
        truth, details = EFFECTS[name].install(truth, effects[full], at, rng)
        truth = replace(truth, details={**truth.details, full: details})
    return truth
