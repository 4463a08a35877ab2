"""P9: an oil film between the teeth."""

import numpy as np

from specan.models import Parameter, effect


@effect(
    "mesh-damping",
    adds_to=("stiffness_change", "damping_scale"),
    neutral={"stiffness": 0.0, "damping": 0.0},
    aliases=("housing-resonance",),
    separate_by="a run over speed: it moves a resonance of the gears",
    reference="ISO 6336-1:2019, clause 9 (mesh stiffness within 30 %); Kahraman and Singh 1990 (damping 0.01 to 0.1)",
)
def mesh_damping(
    *,
    stiffness=Parameter(
        0.1, "1", min=-0.3, max=0.3, lower=-0.9, upper=3.0, doc="relative change of the stiffness"
    ),
    damping=Parameter(
        1.0, "1", min=-0.9, max=4.0, lower=-0.95, upper=50.0, doc="relative change of the damping"
    ),
):
    """Lubricated teeth are stiffer and more damped, or less, than the dry contact law says.

    The ratios of the mesh harmonics change, and no new line appears.
    """
    return {"stiffness_change": stiffness * np.ones(2), "damping_scale": damping}
