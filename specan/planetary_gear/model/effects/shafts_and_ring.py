"""Effects of the drive, the shafts, the carrier and the ring."""

import numpy as np

from specan.models import Parameter, effect


@effect(
    "torque-ripple",
    adds_to="torque_ripple",
    neutral={"cosine": 0.0, "sine": 0.0},
    separate_by="the torque of the sun's shaft: a ripple is in it, a runout is not",
    reference="a torque T (1 + m cos(turn of the shaft))",
)
def torque_ripple(
    carrier_turn,
    sun_order,
    *,
    cosine=Parameter(
        0.02, "1", min=-0.05, max=0.05, lower=-0.5, upper=0.5, doc="part of the torque, in phase"
    ),
    sine=Parameter(0.01, "1", min=-0.05, max=0.05, lower=-0.5, upper=0.5, doc="part in quadrature"),
):
    """The drive torque varies, or the drive is unbalanced:

    all meshes are loaded together, once a turn of the shaft of the sun.

    For the article's gear lines at 66h +- 3.75 and at the shaft's own order.
    """
    at = 2 * np.pi * (sun_order + 1.0) * carrier_turn
    return cosine * np.cos(at) + sine * np.sin(at)


@effect(
    "shaft-flexibility",
    adds_to="sun_shaft",
    separate_by="a run over speed, and the torque of the sun's shaft",
    reference="one torsional mode: c / (1 - (f/f0)^2 + 2 j z f/f0)",
)
def shaft_flexibility(
    *,
    compliance=Parameter(2e-5, "rad/(N*m)", min=1e-6, max=1e-3, lower=0.0, upper=0.1, doc="static twist"),
    resonance=Parameter(900.0, "Hz", min=50.0, max=5000.0, lower=10.0, upper=20000.0, doc="of sun on shaft"),
    damping=Parameter(0.03, "1", min=0.005, max=0.2, lower=0.001, upper=0.5, doc="damping ratio"),
):
    """The sun follows the forces of its meshes on a shaft that twists: sidebands near a fixed frequency change."""
    # nothing of a shaft that does not twist
    return np.array([compliance, resonance, damping]) * (compliance > 0)


@effect(
    "ring-flexibility",
    adds_to=("stiffness_change", "ring_error"),
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
