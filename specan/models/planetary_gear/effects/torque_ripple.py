"""P13: the drive's torque varies once a turn of its shaft."""

import numpy as np

from specan.models import Parameter, effect


@effect(
    "torque-ripple",
    adds_to="torque_ripple",
    neutral={"cosine": 0.0, "sine": 0.0},
    aliases=("sun-runout",),
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
