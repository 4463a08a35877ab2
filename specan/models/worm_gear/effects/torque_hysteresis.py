"""A torque that is read differently on the way up and on the way down."""

import numpy as np

from specan.models import Parameter, effect

STILL = 0.02  # share of the largest torque that counts as a change


@effect(
    "torque-hysteresis",
    adds_to="indicated_input_torque",
    neutral={"half_width": 0.0},
    needs=("elapsed_time",),
    separate_by="approach the same torque once from below and once from above",
    reference="reversibility error of a torque measuring device, half the difference between increasing and decreasing "
    "torque (VDI/VDE 2646; ISO 376 for forces): taken as one width over the whole range",
    instrument=True,
)
def torque_hysteresis(
    output_torque,
    elapsed_time,
    *,
    half_width=Parameter(
        0.02, "N*m", min=-0.1, max=0.1, lower=-1.0, upper=1.0, doc="read too high after the load was raised"
    ),
):
    """The sensor, or dry friction in its coupling, lags behind the load.

    A reading after the load was raised is too high (or too low) by as much as one after it was lowered is
    too low.
    """
    return half_width * direction(np.asarray(output_torque, float), elapsed_time)


def direction(torque, elapsed_time):
    """+1 where the torque was raised last, -1 where it was lowered, 0 before the first change or without times."""
    if np.ndim(torque) == 0 or np.ndim(elapsed_time) == 0:
        return np.zeros_like(torque)
    order = np.argsort(elapsed_time, kind="stable")
    least = STILL * np.max(np.abs(torque), initial=0.0)
    out, state, before = np.zeros_like(torque), 0.0, torque[order[0]]
    for row in order:
        if abs(torque[row] - before) > least:
            state, before = float(np.sign(torque[row] - before)), torque[row]
        out[row] = state
    return out
