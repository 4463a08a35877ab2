"""R13: sound enters at a second place."""

import numpy as np

from specan.models import Parameter, effect
from specan.models.room.field import Source, WallPlace


@effect(
    "flanking-source",
    joins="sources",
    at="wall",
    neutral={"ratio": 0.0},
    aliases=("piston-size",),
    separate_by="blocking the cone and measuring what is left",
    reference="superposition: + a G(x, x2) exp(-j w tau)",
)
def flanking_source(
    frequency,
    piston_radius,
    *,
    ratio=Parameter(
        0.1, "1", min=-0.5, max=0.5, lower=-2.0, upper=2.0, doc="volume velocity over the piston's"
    ),
    delay=Parameter(0.0, "s", min=0.0, max=2e-3, lower=0.0, doc="of the second path"),
    across=Parameter(0.3, "1", min=0.0, max=1.0, doc="place over the wall's first edge"),
    along=Parameter(0.3, "1", min=0.0, max=1.0, doc="place over the wall's second edge"),
):
    """The cabinet, a port or the rear of the cone radiates too: an additional source at its own position."""
    strength = ratio * np.pi * piston_radius**2 * np.exp(-2j * np.pi * frequency * delay)
    return Source(WallPlace(across, along, 0.02), strength)
