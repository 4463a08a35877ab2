"""The vibrometer's channel is late against the microphones."""

from specan.models import Parameter, effect


@effect(
    "vibrometer-delay",
    adds_to="vibrometer_delay",
    neutral={"delay": 0.0},
    aliases=("microphone-delay", "temperature"),
    separate_by="one signal on all inputs; the demodulator's data sheet",
    reference="a factor exp(-j w tau)",
    instrument=True,
)
def vibrometer_delay(
    *, delay=Parameter(2e-5, "s", min=-1e-3, max=1e-3, lower=-2e-3, upper=2e-3, doc="lateness")
):
    """The demodulator delays the velocity: every microphone seems early, by a phase proportional to frequency."""
    return delay
