"""How stiff teeth are at the middle of the loads."""

import math

from specan.models import Parameter, effect


@effect(
    "contact-stiffness",
    scales="contact_stiffness",
    neutral={"change": 0.0},
    separate_by="a static test: twist of the locked gear over torque",
    reference="ISO 6336-1:2019, clause 9: 14 to 20 N/(mm um) a mesh of steel gears, less at low load "
    "and with thin rims",
    instrument=True,
)
def contact_stiffness(
    *,
    change=Parameter(
        -0.2, "1", min=-1.0, max=0.7, lower=-3.0, upper=3.0, doc="natural logarithm of the factor"
    ),
):
    """Teeth are stiffer or softer than the rig file's contact law says, by one factor for all meshes.

    It decides by how much a pin out of place changes the loads, and where the set resonates.
    """
    return math.exp(change)
