"""R8: a microphone does not stand where the drawing says."""

import numpy as np

from specan.models import Parameter, effect

_AWAY = 0.1  # m, domain of a displacement


@effect(
    "microphone-position",
    adds_to="receiver_position",
    at="microphone",
    neutral={"dx": 0.0, "dy": 0.0, "dz": 0.0},
    aliases=("microphone-gain",),
    separate_by="measuring the place again",
    reference="the pressure's gradient at the microphone",
    instrument=True,
)
def microphone_position(
    *,
    dx=Parameter(0.005, "m", min=-0.05, max=0.05, lower=-_AWAY, upper=_AWAY, doc="along x"),
    dy=Parameter(0.005, "m", min=-0.05, max=0.05, lower=-_AWAY, upper=_AWAY, doc="along y"),
    dz=Parameter(0.005, "m", min=-0.05, max=0.05, lower=-_AWAY, upper=_AWAY, doc="along z"),
):
    """One microphone reads the pressure of another place; most at the nodal planes, more with frequency."""
    return np.array([dx, dy, dz])
