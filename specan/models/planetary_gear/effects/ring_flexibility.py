"""P10: the ring bends between its supports."""

import numpy as np

from specan.models import Parameter, effect


@effect(
    "ring-flexibility",
    adds_to=("stiffness_change", "ring_error"),
    neutral={"compliance": 0.0},
    aliases=("transmission-path",),
    separate_by="torque: the lobes grow with the load",
    reference="Kahraman and Vijayakar, J. Mech. Des. 123 (2001) 408: deflection of an internal gear on its supports",
)
def ring_flexibility(
    carrier_turn,
    planet_angle,
    mean_load,
    load_stiffness,
    *,
    compliance=Parameter(
        0.2, "1", min=0.01, max=1.0, lower=-0.4, upper=10.0, doc="of the rim over that of the teeth"
    ),
    supports=Parameter(3.0, "1", min=2.0, max=12.0, doc="supports around the ring", fixed=True),
):
    """A thin ring deflects between its supports: its meshes are softer, and softest midway.

    As many lobes a turn as supports; lines about 66h at multiples of them grow, frequencies of the set fall.
    """
    at = round(supports) * (2 * np.pi * carrier_turn[None, :] + planet_angle[:, None])
    lobe = compliance * np.mean(mean_load / load_stiffness) * (0.5 - 0.5 * np.cos(at))
    return {
        "stiffness_change": np.array([0.0, -0.5 * compliance / (1.0 + 0.5 * compliance)]),
        "ring_error": -lobe,
    }
