"""P6: the teeth of one planet are off its axis."""

import numpy as np

from specan.models import Parameter, effect


@effect(
    "planet-runout",
    adds_to=("sun_error", "ring_error"),
    at="planet",
    neutral={"cosine": 0.0, "sine": 0.0},
    aliases=("pitch-errors",),
    separate_by="the phase of its lines shows which planet",
    reference="approach of an eccentric gear, e sin(angle against the line of action), in both its meshes",
)
def planet_runout(
    carrier_turn,
    pressure_angle,
    planet_order,
    *,
    cosine=Parameter(10.0, "um", min=-30.0, max=30.0, lower=-500.0, upper=500.0, doc="part in phase"),
    sine=Parameter(5.0, "um", min=-30.0, max=30.0, lower=-500.0, upper=500.0, doc="part in quadrature"),
):
    """An eccentric planet presses sun and ring in turn, once a turn of the planet against the carrier.

    The loads of all planets add up to the torque, so the lines are one carrier order beside those of the
    planet: for the article's
    gear 66h +- 3.1429 +- 1.
    """
    at = 2 * np.pi * planet_order * carrier_turn
    inner, outer = at - pressure_angle, at + np.pi + pressure_angle
    return {
        "sun_error": cosine * np.cos(inner) + sine * np.sin(inner),
        "ring_error": cosine * np.cos(outer) + sine * np.sin(outer),
    }
