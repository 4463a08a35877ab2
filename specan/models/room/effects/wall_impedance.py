"""R1: a locally reacting wall."""

import numpy as np

from specan.models import Parameter, effect


@effect(
    "wall-impedance",
    adds_to="wall_admittance",
    at="wall",
    neutral={"conductance": 0.0},
    aliases=("porous-absorber", "panel-resonance"),
    separate_by="a wide band: a porous layer takes more with frequency, a panel around its resonance only; "
    "microphones near the wall",
    reference="Kuttruff, Room Acoustics, ch. 2 (locally reacting walls); surfaces in parallel add. A matched lining "
    "has a resistance of rho c to 2 rho c, a conductance of 0.5 to 1 (ibid., absorption near one)",
)
def wall_impedance(
    frequency,
    density,
    sound_speed,
    third_octave_hz,
    *,
    conductance=Parameter(0.05, "1", min=0.001, max=1.2, lower=0.0, upper=3.0, doc="rho c over resistance"),
    mass=Parameter(0.0, "kg/m^2", min=0.0, max=500.0, lower=0.0, doc="surface mass"),
    stiffness=Parameter(0.0, "Pa/m", min=0.0, max=2e9, lower=0.0, doc="stiffness a unit area"),
):
    """One wall absorbs energy (resistance) and shifts the modes that reach it (mass, stiffness).

    Its surface impedance is Z = R + j (w m - s / w); each point of the wall responds to the pressure at that
    point only. Modes that move along the wall's normal broaden most. With parameters that a study
    makes free in every third octave (per = "third_octave"), they are joined by straight lines over the
    logarithm of frequency; a mass that may be negative then represents any reactance.
    """
    omega = 2 * np.pi * frequency
    g, m, s = (_at(frequency, third_octave_hz, value) for value in (conductance, mass, stiffness))
    reactance = (omega * m - s / omega) / (density * sound_speed)
    return g / (1 + 1j * g * reactance)


def _at(frequency, third_octave_hz, value):
    """A number as it is; one a third octave, line by line."""
    if np.ndim(value) == 0 or np.shape(value) != np.shape(third_octave_hz):
        return value
    return np.interp(np.log(frequency), np.log(third_octave_hz), value)
