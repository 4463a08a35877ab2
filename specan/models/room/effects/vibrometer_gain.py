"""The vibrometer's sensitivity is not the stated one."""

from specan.models import Parameter, effect


@effect(
    "vibrometer-gain",
    scales="vibrometer_gain",
    neutral={"gain": 0.0},
    aliases=("piston-size",),
    separate_by="a vibration calibrator",
    reference="a factor 1 + g on the velocity",
    instrument=True,
)
def vibrometer_gain(
    *, gain=Parameter(0.02, "1", min=-0.05, max=0.05, lower=-0.3, upper=0.5, doc="relative error")
):
    """The velocity reads too high or too low: all transfer functions are wrong by the same factor."""
    return 1 + gain
