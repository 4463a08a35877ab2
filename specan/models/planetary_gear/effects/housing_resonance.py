"""P16: housing or sensor resonates."""

import numpy as np

from specan.models import Parameter, effect


@effect(
    "housing-resonance",
    adds_to="housing_response",
    neutral={"strength": 0.0},
    aliases=("mesh-damping", "shaft-flexibility"),
    separate_by="a run over speed: it stays at its frequency in Hz, and every line that crosses it grows",
    reference="one mode: a (f/f0)^2 / (1 - (f/f0)^2 + 2 j z f/f0)",
)
def housing_resonance(
    order,
    sun_speed,
    carrier_ratio,
    *,
    strength=Parameter(
        1.0, "1", min=-3.0, max=3.0, lower=-50.0, upper=50.0, doc="of the mode against the rim"
    ),
    resonance=Parameter(
        1100.0, "Hz", min=300.0, max=8000.0, lower=50.0, upper=20000.0, doc="natural frequency"
    ),
    damping=Parameter(0.03, "1", min=0.005, max=0.1, lower=0.001, upper=0.5, doc="damping ratio"),
):
    """Housing or sensor have a resonance at a fixed frequency, whichever order excites it."""
    ratio = np.asarray(order) * sun_speed * carrier_ratio / resonance
    return strength * ratio**2 / (1 - ratio**2 + 2j * damping * ratio)
