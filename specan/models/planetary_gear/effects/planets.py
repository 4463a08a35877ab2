"""Planets that do not carry alike."""

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


@effect(
    "unequal-load-sharing",
    adds_to="load_share",
    at="planet",
    neutral={"share": 0.0},
    aliases=("planet-position-error",),
    separate_by="several harmonics of the mesh and several torques: a position error also shifts the phase, with h",
    reference="Inalpolat and Kahraman, J. Sound Vib. 323 (2009) 677, section 2; IEC 61400-4 mesh load factor",
)
def unequal_load_sharing(
    *,
    share=Parameter(0.1, "1", min=-0.3, max=0.3, lower=-0.9, upper=2.0, doc="part by which it carries more"),
):
    """One planet carries more, by the same fraction at every torque; the others carry less.

    Lines at 66h +- 1, +- 2 appear, in the same ratio to the mesh at every harmonic.
    """
    return share
