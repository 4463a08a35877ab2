"""Unknown structure between mesh and sensor."""

from specan.models import Parameter, effect


@effect(
    "harmonic-gain",
    adds_to="harmonic_gain",
    at="harmonic",
    neutral={"real": 0.0, "imaginary": 0.0},
    aliases=("mesh-damping", "tip-relief", "housing-resonance"),
    separate_by="a hammer test of the housing",
    reference="a complex gain common to all lines of one mesh harmonic: evidence is in their pattern",
    instrument=True,
)
def harmonic_gain(
    *,
    real=Parameter(0.5, "1", min=-3.0, max=3.0, lower=-50.0, upper=50.0, doc="real part of what is added"),
    imaginary=Parameter(0.2, "1", min=-3.0, max=3.0, lower=-50.0, upper=50.0, doc="imaginary part"),
):
    """The path between mesh and sensor is unknown: all lines about one harmonic have the same gain and phase shift."""
    return real + 1j * imaginary
