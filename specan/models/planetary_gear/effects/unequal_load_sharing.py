"""P2: one planet carries more than the others."""

from specan.models import Parameter, effect


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
