"""R12: the diaphragm does not move as a whole."""

from specan.models import Parameter, effect


@effect(
    "piston-breakup",
    scales="piston_velocity_profile",
    neutral={"strength": 0.0},
    aliases=("vibrometer-noise", "piston-size"),
    separate_by="scanning other points of the cone",
    reference="modal superposition: 1 + a / (1 - (f / fn)^2 + j eta f / fn)",
)
def piston_breakup(
    frequency,
    *,
    strength=Parameter(0.2, "1", min=-1.0, max=1.0, lower=-3.0, upper=3.0, doc="mean over point, static"),
    resonance=Parameter(1200.0, "Hz", min=300.0, max=8000.0, doc="of the cone"),
    loss_factor=Parameter(0.1, "1", min=0.02, max=0.5, doc="of the cone"),
):
    """The laser sees one point; near a resonance of the cone the mean velocity differs.

    The factor is common to all microphones.
    """
    ratio = frequency / resonance
    return 1 + strength * ratio**2 / (1 - ratio**2 + 1j * loss_factor * ratio)
