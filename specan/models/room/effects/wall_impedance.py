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
    reference="Kuttruff, Room Acoustics, ch. 2 (locally reacting walls); surfaces in parallel add",
)
def wall_impedance(
    frequency,
    density,
    sound_speed,
    *,
    conductance=Parameter(0.05, "1", min=0.001, max=0.5, lower=0.0, upper=1.0, doc="rho c over resistance"),
    mass=Parameter(0.0, "kg/m^2", min=0.0, max=20.0, lower=0.0, doc="surface mass"),
    stiffness=Parameter(0.0, "Pa/m", min=0.0, max=5e6, lower=0.0, doc="stiffness a unit area"),
):
    """One wall takes energy (resistance) and shifts the modes that touch it (mass, stiffness).

    Its surface impedance is Z = R + j (w m - s / w); each point of the wall answers to the pressure at
    that point alone. Modes that move along the wall's normal broaden most.
    """
    omega = 2 * np.pi * frequency
    reactance = (omega * mass - stiffness / omega) / (density * sound_speed)
    return conductance / (1 + 1j * conductance * reactance)
