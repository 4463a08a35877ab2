"""Effects between mesh and reading: path, housing, sensor, tacho."""

import numpy as np

from specan.models import Parameter, effect


@effect(
    "transmission-path",
    scales="transfer_path",
    separate_by="a second sensor 60 degrees away",
    reference="Inalpolat and Kahraman, J. Sound Vib. 323 (2009) 677: a Hann window; its power is free here",
)
def transmission_path(
    carrier_turn,
    repeat_turns,
    planet_angle,
    sensor_angle,
    *,
    sharpness=Parameter(1.0, "1", min=-2.5, max=3.0, lower=-2.9, upper=8.0, doc="added power of the window"),
):
    """A planet is heard over a narrower or wider part of the turn than assumed.

    Only the sidebands that the set has anyway change: in phase, orders 66h +- 3k of the article's gear.
    """
    one = 2 * np.pi * carrier_turn[: carrier_turn.size // repeat_turns]  # turns are alike
    place = one + planet_angle[:, None] - sensor_angle[:, None, None]
    return np.tile(np.maximum(0.5 + 0.5 * np.cos(place), 1e-9) ** sharpness, repeat_turns)


@effect(
    "housing-resonance",
    adds_to="housing_response",
    aliases=("mesh-damping", "shaft-flexibility"),
    separate_by="a run over speed: it stays at its frequency in Hz, and every line that crosses it grows",
    reference="one mode: a (f/f0)^2 / (1 - (f/f0)^2 + 2 j z f/f0)",
)
def housing_resonance(
    order,
    sun_speed,
    carrier_ratio,
    *,
    strength=Parameter(
        1.0, "1", min=-3.0, max=3.0, lower=-50.0, upper=50.0, doc="of the mode against the rim"
    ),
    resonance=Parameter(
        1100.0, "Hz", min=300.0, max=8000.0, lower=50.0, upper=20000.0, doc="natural frequency"
    ),
    damping=Parameter(0.03, "1", min=0.005, max=0.1, lower=0.001, upper=0.5, doc="damping ratio"),
):
    """Housing or sensor have a resonance at a fixed frequency, whichever order excites it."""
    ratio = np.asarray(order) * sun_speed * carrier_ratio / resonance
    return strength * ratio**2 / (1 - ratio**2 + 2j * damping * ratio)


@effect(
    "tacho-angle",
    adds_to="tacho_angle",
    separate_by="measuring the angle between the mark of the tacho and planet 1",
    reference="a shift of turn zero by a turns each order o by o a",
    instrument=True,
)
def tacho_angle(
    *,
    angle=Parameter(
        1.0, "degree", min=-10.0, max=10.0, lower=-60.0, upper=60.0, doc="of planet 1 at a pulse"
    ),
):
    """The pulse is not at the angle in the rig file, with planet 1 at zero:

    the phase of a sideband changes with its distance from the mesh line.
    """
    return angle


@effect(
    "speed-fluctuation",
    scales="line_coherence",
    separate_by="a tacho with more pulses per turn",
    reference="mean of exp(j o phi) of a gaussian angle: exp(-(o s)^2 / 2)",
    instrument=True,
)
def speed_fluctuation(
    order,
    *,
    jitter=Parameter(0.2, "degree", min=0.01, max=1.0, lower=0.0, upper=10.0, doc="of the carrier's angle"),
):
    """The speed varies faster than the tacho resolves, or the tacho is inaccurate: high orders lose amplitude."""
    return np.exp(-0.5 * (np.asarray(order) * jitter) ** 2)
