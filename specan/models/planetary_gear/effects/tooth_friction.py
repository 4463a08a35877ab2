"""P15: friction turns with the sliding of the teeth."""

import numpy as np

from specan.models import Parameter, effect

HARMONICS = 3


@effect(
    "tooth-friction",
    adds_to="friction_share",
    neutral={"coefficient": 0.0},
    aliases=("tip-relief",),
    separate_by="a sensor across the line of action",
    reference="mu F sign(sliding), which turns at the pitch point; Vaishya and Singh, J. Sound Vib. 243 (2001)",
)
def tooth_friction(
    carrier_turn,
    planet_phase,
    ring_teeth,
    *,
    coefficient=Parameter(0.05, "1", min=0.02, max=0.1, lower=-0.5, upper=1.0, doc="coefficient of friction"),
):
    """Sliding reverses at the pitch point, and with it the friction: a square wave at the order of the mesh."""
    at = 2 * np.pi * (ring_teeth * carrier_turn[None, :] + planet_phase[1][:, None])
    return coefficient * 4 / np.pi * sum(np.sin((2 * k - 1) * at) / (2 * k - 1) for k in range(1, HARMONICS))
