"""Errors of the microphones and the vibrometer."""

import numpy as np

from specan.models import Parameter, effect

AWAY = Parameter(0.005, "m", min=-0.05, max=0.05, lower=-0.1, upper=0.1, doc="along that axis")
LATE = Parameter(2e-5, "s", min=-1e-3, max=1e-3, lower=-2e-3, upper=2e-3, doc="lateness")


@effect(
    "microphone-position",
    adds_to="receiver_position",
    at="place",
    neutral={"dx": 0.0, "dy": 0.0, "dz": 0.0},
    separate_by="measuring the place again",
    reference="the pressure's gradient at the microphone",
    instrument=True,
)
def microphone_position(*, dx=AWAY, dy=AWAY, dz=AWAY):
    """One microphone reads the pressure of another place; most at the nodal planes, more with frequency."""
    return np.array([dx, dy, dz])


@effect(
    "microphone-gain",
    adds_to="receiver_gain",
    at="microphone",
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


@effect(
    "microphone-delay",
    adds_to="card_delay",
    at="card",
    separate_by="one signal on all inputs",
    reference="a factor exp(-j w tau); a skew is common to the channels of a card",
    instrument=True,
)
def microphone_delay(*, delay=LATE):
    """A card starts late: the phase of its microphones falls in proportion to frequency; levels do not change."""
    return delay


@effect(
    "vibrometer-gain",
    scales="vibrometer_gain",
    separate_by="a vibration calibrator",
    reference="a factor 1 + g on the velocity",
    instrument=True,
)
def vibrometer_gain(
    *, gain=Parameter(0.02, "1", min=-0.05, max=0.05, lower=-0.3, upper=0.5, doc="relative error")
):
    """The velocity reads too high or too low: all transfer functions are wrong by the same factor."""
    return 1 + gain


@effect(
    "vibrometer-delay",
    adds_to="vibrometer_delay",
    aliases=("microphone-delay", "temperature"),
    separate_by="one signal on all inputs; the demodulator's data sheet",
    reference="a factor exp(-j w tau)",
    instrument=True,
)
def vibrometer_delay(*, delay=LATE):
    """The demodulator delays the velocity: every microphone seems early, by a phase proportional to frequency."""
    return delay


@effect(
    "vibrometer-noise",
    scales="vibrometer_gain",
    needs=("velocity_psd",),
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
