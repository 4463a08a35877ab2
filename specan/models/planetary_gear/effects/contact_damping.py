"""How strongly the meshes are damped."""

import math

from specan.models import Parameter, effect


@effect(
    "contact-damping",
    scales="damping_scale",
    neutral={"change": 0.0},
    aliases=("mesh-damping",),
    separate_by="a run over speed through a resonance",
    reference="damping ratios of gear meshes from 0.01 to 0.1: Kahraman and Singh, J. Sound Vib. 142 (1990) 49",
    instrument=True,
)
def contact_damping(
    *,
    change=Parameter(
        -1.0, "1", min=-3.0, max=1.0, lower=-6.0, upper=4.0, doc="natural logarithm of the factor"
    ),
):
    """Meshes lose more or less energy than the rig file's contact law says, by one factor for all."""
    return math.exp(change)
