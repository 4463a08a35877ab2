"""R11: the diaphragm moves another area than drawn."""

from specan.models import Parameter, effect


@effect(
    "piston-size",
    scales="piston_radius",
    neutral={"error": 0.0},
    aliases=("vibrometer-gain", "piston-breakup"),
    separate_by="a laser scan of the cone",
    reference="volume velocity pi a^2 v; directivity 2 J1(k a sin) / (k a sin)",
)
def piston_size(*, error=Parameter(0.05, "1", min=-0.2, max=0.2, lower=-0.5, upper=0.5, doc="of the radius")):
    """The effective radius is not the nominal one: level as its square, directivity above k a = 1."""
    return 1 + error
