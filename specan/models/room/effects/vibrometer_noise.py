"""R19: the reference is noisy."""

from specan.models import Parameter, effect


@effect(
    "vibrometer-noise",
    scales="vibrometer_gain",
    neutral={"density": 0.0},
    needs=("velocity_psd",),
    aliases=("piston-breakup",),
    separate_by="the three-channel estimator with the generator as instrument",
    reference="Bendat & Piersol, Random Data, ch. 6: H1 is low by 1 / (1 + Gmm / Gvv)",
    instrument=True,
)
def vibrometer_noise(
    velocity_psd,
    *,
    density=Parameter(1e-13, "m^2/s", min=1e-16, max=1e-8, lower=0.0, doc="noise of the velocity signal"),
):
    """Speckle drop-outs add noise to the velocity: H1 is low where the diaphragm hardly moves."""
    return 1 + density / velocity_psd
