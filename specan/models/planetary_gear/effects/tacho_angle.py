"""Where the carrier stands when its tacho gives a pulse."""

from specan.models import Parameter, effect


@effect(
    "tacho-angle",
    adds_to="tacho_angle",
    neutral={"angle": 0.0},
    separate_by="measuring the angle between the mark of the tacho and planet 1",
    reference="a shift of turn zero by a turns each order o by o a",
    instrument=True,
)
def tacho_angle(
    *,
    angle=Parameter(
        1.0, "degree", min=-10.0, max=10.0, lower=-60.0, upper=60.0, doc="of planet 1 at a pulse"
    ),
):
    """The pulse is not at the angle in the rig file, with planet 1 at zero:

    the phase of a sideband changes with its distance from the mesh line.
    """
    return angle
