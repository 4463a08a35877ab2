"""R9: the channels of one card are late."""

from specan.models import Parameter, effect


@effect(
    "microphone-delay",
    adds_to="card_delay",
    at="card",
    neutral={"delay": 0.0},
    aliases=("vibrometer-delay",),
    separate_by="one signal on all inputs",
    reference="a factor exp(-j w tau); a skew is common to the channels of a card",
    instrument=True,
)
def microphone_delay(
    *, delay=Parameter(2e-5, "s", min=-1e-3, max=1e-3, lower=-2e-3, upper=2e-3, doc="of a card")
):
    """A card starts late: the phase of its microphones falls in proportion to frequency; levels do not change."""
    return delay
