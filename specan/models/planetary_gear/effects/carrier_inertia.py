"""What turns with the carrier."""

import math

from specan.models import Parameter, effect


@effect(
    "carrier-inertia",
    scales="carrier_inertia",
    neutral={"change": 0.0},
    separate_by="the drawings of carrier, shaft and brake",
    reference="a disc of the carrier's size; shaft and load that are fixed to it come on top",
    instrument=True,
)
def carrier_inertia(
    *,
    change=Parameter(
        1.0, "1", min=-0.7, max=3.0, lower=-3.0, upper=7.0, doc="natural logarithm of the factor"
    ),
):
    """The inertia of carrier, shaft and load differs from that of a disc.

    At the mesh the torque holds still, and the carrier moves as little as it is heavy: lines of the ideal set, to which
    all planets contribute alike, grow with it, and lines of planets that are not alike do not.
    """
    return math.exp(change)
