"""P3: the pin of a planet does not lie where it is drawn."""

from specan.models import Parameter, effect


@effect(
    "planet-position-error",
    adds_to="planet_position",
    at="planet",
    neutral={"error": 0.0},
    aliases=("unequal-load-sharing",),
    separate_by="two torques, or harmonics of the mesh beyond the first",
    reference="Parker and Lin, J. Mech. Des. 126 (2004) 365 (phase); Bodas and Kahraman, JSME Int. J. C 47 (2004) 908 "
    "(load sharing in inverse proportion to torque)",
)
def planet_position_error(
    *,
    error=Parameter(
        2.0, "um", min=-50.0, max=50.0, lower=-500.0, upper=500.0, doc="tangential, ahead positive"
    ),
):
    """A pin is ahead of its position: its planet carries less (the sun drives), and meets the ring earlier.

    Its effect on the load falls with 1/torque and is the same at every harmonic; its effect on the phase
    grows with the harmonic and does not depend on the torque.
    """
    return error
