"""How the stiffness of a pair of teeth changes with its load."""

from specan.models import Parameter, effect


@effect(
    "contact-exponent",
    adds_to="contact_exponent",
    neutral={"change": 0.0},
    separate_by="a static test: twist of the locked gear over torque",
    reference="1 for teeth that bend (ISO 6336-1:2019, clause 9), 10/9 for contact along a line, 3/2 for Hertz's "
    "point contact",
    instrument=True,
)
def contact_exponent(
    *,
    change=Parameter(
        -0.1, "1", min=-0.3, max=0.2, lower=-0.3, upper=1.0, doc="added to that of the contact law"
    ),
):
    """Teeth that bend are as stiff at every load; points of contact become stiffer with it.

    The stiffness at the middle of the loads stays as it is. It decides how lines beside the mesh go with the torque.
    """
    return change
