"""P4: the carrier does not turn about the ring's axis."""

import numpy as np

from specan.models import Parameter, effect


@effect(
    "carrier-runout",
    adds_to="ring_error",
    neutral={"cosine": 0.0, "sine": 0.0},
    aliases=("planet-position-error", "torque-ripple"),
    separate_by="turn the ring in its housing by an angle: the phase goes with it",
    reference="eccentric gears: e sin(angle) on the line of action; Gu and Velex, Mech. Mach. Theory 61 (2013)",
)
def carrier_runout(
    carrier_turn,
    planet_angle,
    pressure_angle,
    *,
    cosine=Parameter(
        10.0, "um", min=-30.0, max=30.0, lower=-500.0, upper=500.0, doc="towards the first sensor"
    ),
    sine=Parameter(5.0, "um", min=-30.0, max=30.0, lower=-500.0, upper=500.0, doc="a quarter turn on"),
):
    """The ring's teeth are eccentric to the axis of the carrier by a fixed vector: every planet is loaded once a turn.

    Each planet is loaded once a turn, the planets one after the other; lines about 66h +- 1 are locked to
    the angle.
    """
    at = 2 * np.pi * carrier_turn[None, :] + planet_angle[:, None] + pressure_angle
    return cosine * np.sin(at) - sine * np.cos(at)
