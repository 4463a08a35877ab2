"""A brake that still holds a little when it should not."""

import numpy as np

from specan.models import Parameter, effect


@effect(
    "brake-drag",
    adds_to="output_torque",
    neutral={"drag": 0.0},
    aliases=("torque-zero-error", "thermal-lag", "axial-preload"),
    separate_by="idle runs with the brake or belt taken off beside idle runs with it",
    reference="residual torque of powder, hysteresis and eddy current brakes and of belts: one half to some percent of "
    "their rated torque, in data sheets of such brakes; left free here",
)
def brake_drag(
    indicated_output_torque,
    brake_coupled,
    *,
    drag=Parameter(0.5, "N*m", min=0.05, max=3.0, lower=0.0, upper=20.0, doc="at the output, in runs without load"),
    idle_torque=Parameter(
        2.0, "N*m", min=0.5, max=5.0, doc="output torque below which a run counts as idle", fixed=True
    ),
):  # fmt: skip
    """The brake or its belt drags in runs that count as idle, and no sensor measures it.

    Set to a torque, the brake's control takes its drag into account; at zero it cannot. Idle runs then
    carry a small load; only they deviate.
    """
    return drag * brake_coupled * np.exp(-((indicated_output_torque / idle_torque) ** 2))
