"""P12: the tips of the teeth are relieved."""

from specan.models import Parameter, effect


@effect(
    "tip-relief",
    adds_to="tip_relief",
    neutral={"depth": 0.0},
    aliases=("mesh-damping",),
    separate_by="torque: at one torque the first harmonic of the mesh is least",
    reference="ISO 21771:2007, 7.3; linear relief over the parts of double contact (Munro 1989)",
)
def tip_relief(*, depth=Parameter(5.0, "um", min=0.0, max=40.0, lower=0.0, upper=200.0, doc="at the tip")):
    """Material taken off the tips lets pairs take their load gradually: the mesh is quietest at one torque."""
    return depth
