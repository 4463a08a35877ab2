"""P5: the sun's teeth are off its axis."""

import numpy as np

from specan.models import Parameter, effect


@effect(
    "sun-runout",
    adds_to="sun_error",
    neutral={"cosine": 0.0, "sine": 0.0},
    aliases=("pitch-errors", "torque-ripple"),
    separate_by="the torque of the sun's shaft: a ripple is in it, a runout is not",
    reference="approach of an eccentric gear, e sin(angle against the line of action)",
)
def sun_runout(
    carrier_turn,
    planet_angle,
    pressure_angle,
    sun_order,
    *,
    cosine=Parameter(10.0, "um", min=-30.0, max=30.0, lower=-500.0, upper=500.0, doc="part in phase"),
    sine=Parameter(5.0, "um", min=-30.0, max=30.0, lower=-500.0, upper=500.0, doc="part in quadrature"),
):
    """An eccentric sun presses one planet after the other, once a turn of the sun against the carrier.

    To a sensor on the ring that is the order of the sun's shaft: for the article's gear 66h +- 3.75 and 66h +- 0.75,
    as for a torque ripple, but in another ratio. 66h +- 2.75 appears where the planets are not alike.
    """
    at = 2 * np.pi * sun_order * carrier_turn[None, :] - planet_angle[:, None] + pressure_angle
    return cosine * np.cos(at) + sine * np.sin(at)
