"""P14: the angle is not known as well as the lines are sharp."""

import numpy as np

from specan.models import Parameter, effect


@effect(
    "speed-fluctuation",
    scales="line_coherence",
    neutral={"jitter": 0.0},
    separate_by="a tacho with more pulses a turn",
    reference="mean of exp(j o phi) of a gaussian angle: exp(-(o s)^2 / 2)",
    instrument=True,
)
def speed_fluctuation(
    order,
    *,
    jitter=Parameter(0.2, "degree", min=0.01, max=1.0, lower=0.0, upper=10.0, doc="of the carrier's angle"),
):
    """The speed varies faster than the tacho resolves, or the tacho is inaccurate: high orders lose amplitude."""
    return np.exp(-0.5 * (np.asarray(order) * jitter) ** 2)
