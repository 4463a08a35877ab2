"""R4: a Helmholtz resonator or a slot in a wall."""

import numpy as np

from specan.models import Parameter, effect
from specan.models.room.field import LocalLoad, WallPlace, opening

_RADIUS = 0.01  # m, of the patch over which it acts; the result hardly depends on it


@effect(
    "helmholtz-resonator",
    joins="local_loads",
    at="wall",
    neutral={"neck_area": 0.0},
    aliases=("panel-resonance", "leak"),
    separate_by="a microphone at the neck; closing it",
    reference="Kinsler et al., Fundamentals of Acoustics, ch. 10: f0 = (c / 2 pi) sqrt(S / (V l'))",
)
def helmholtz_resonator(
    frequency,
    density,
    *,
    neck_area=Parameter(1e-3, "m^2", min=5e-5, max=3e-2, lower=0.0, doc="of the neck"),
    resonance=Parameter(150.0, "Hz", min=20.0, max=800.0, doc="resonance frequency"),
    quality=Parameter(15.0, "1", min=3.0, max=60.0, doc="quality factor"),
    neck_length=Parameter(0.03, "m", min=0.005, max=0.1, doc="with end corrections", fixed=True),
    across=Parameter(0.3, "1", min=0.0, max=1.0, doc="place over the wall's first edge"),
    along=Parameter(0.3, "1", min=0.0, max=1.0, doc="place over the wall's second edge"),
):
    """The air in a neck vibrates against the volume behind it and splits a mode near its own frequency.

    It acts at one place of the wall; the mode with a pressure maximum there changes most.
    """
    omega, omega0 = 2 * np.pi * frequency, 2 * np.pi * resonance
    impedance = density * neck_length * (omega0 / quality + 1j * (omega - omega0**2 / omega))
    return LocalLoad(
        WallPlace(across, along, _RADIUS), opening(neck_area, impedance, 1j * omega * density, _RADIUS)
    )
