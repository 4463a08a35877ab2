"""R16: a leak or an opening in a wall."""

import numpy as np

from specan.models import Parameter, effect
from specan.models.room.field import LocalLoad, WallPlace, opening

_RADIUS = 0.01  # m, of the patch over which it acts; the result hardly depends on it


@effect(
    "leak",
    joins="local_loads",
    at="wall",
    neutral={"area": 0.0},
    aliases=("helmholtz-resonator", "panel-resonance"),
    separate_by="sealing it; the lowest frequencies, where the response leaves the stiffness line",
    reference="Kinsler et al., Fundamentals of Acoustics, ch. 10 (open side branch): Z = r + j w rho l / S",
)
def leak(
    frequency,
    density,
    *,
    area=Parameter(1e-3, "m^2", min=1e-4, max=1e-2, lower=0.0, doc="open area"),
    length=Parameter(0.03, "m", min=0.003, max=0.2, doc="of the opening, end corrections included"),
    resistance=Parameter(5.0, "Pa*s/m", min=0.0, max=1000.0, doc="of a unit area", fixed=True),
    across=Parameter(0.3, "1", min=0.0, max=1.0, doc="place over the wall's first edge"),
    along=Parameter(0.3, "1", min=0.0, max=1.0, doc="place over the wall's second edge"),
):
    """Air flows through an opening; its mass forms a low resonance with the stiffness of the room.

    Below that resonance the pressure falls off instead of following rho c^2 / (j w V).
    """
    impedance = resistance + 2j * np.pi * frequency * density * length
    return LocalLoad(
        WallPlace(across, along, _RADIUS), opening(area, impedance, 2j * np.pi * frequency * density, _RADIUS)
    )
