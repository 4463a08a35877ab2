"""R10: a microphone indicates too much or too little."""

from specan.models import Parameter, effect


@effect(
    "microphone-gain",
    adds_to="receiver_gain",
    at="microphone",
    neutral={"gain": 0.0},
    aliases=("microphone-position",),
    separate_by="a calibrator",
    reference="a factor 1 + g, flat in frequency",
    instrument=True,
)
def microphone_gain(
    *, gain=Parameter(0.06, "1", min=-0.12, max=0.12, lower=-0.5, upper=1.0, doc="relative error")
):
    """One microphone is louder or softer than its calibration says, by the same factor at every frequency."""
    return gain
