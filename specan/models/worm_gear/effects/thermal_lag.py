"""The gear is not as warm as its sump."""

import numpy as np

from specan.models import Parameter, effect


@effect(
    "thermal-lag",
    adds_to="contact_temperature",
    neutral={"idle_offset": 0.0, "time": 0.0},
    aliases=("torque-zero-error", "oil-heating", "axial-preload", "brake-drag"),
    separate_by="dwell at each condition until the loss is constant, go up and down in steps, record the time",
    reference="first-order lag of a body behind its surroundings; both constants are left free here",
)
def thermal_lag(
    oil_temperature,
    elapsed_time,
    output_torque,
    *,
    idle_offset=Parameter(
        -5.0,
        "K",
        min=-20.0,
        max=20.0,
        lower=-40.0,
        upper=40.0,
        doc="contacts against sump in runs without load",
    ),
    time=Parameter(
        600.0,
        "s",
        min=0.0,
        max=3600.0,
        lower=0.0,
        upper=14400.0,
        doc="time constant",
        needs=("elapsed_time",),
    ),
    idle_torque=Parameter(
        2.0, "N*m", min=0.5, max=5.0, doc="output torque below which a run counts as idle", fixed=True
    ),
):
    """The mesh and the bearings follow the oil sump late, and runs without load find them at another temperature.

    A gear that idles at the start of the day is colder inside than one that has carried load for an hour,
    though both sump thermometers may say the same. If the time of each reading is known, the lag itself is
    modelled.
    """
    idle = np.exp(-((output_torque / idle_torque) ** 2))
    return idle_offset * idle + lag(np.asarray(oil_temperature, float), elapsed_time, time)


def lag(temperature, elapsed_time, time_constant):
    """What a first-order body is behind a temperature that runs straight between readings (negative: colder).

    Nothing where the times are not known, and nothing at the first reading.
    """
    if np.ndim(temperature) == 0 or np.ndim(elapsed_time) == 0 or time_constant <= 0:
        return np.zeros_like(temperature)
    order = np.argsort(elapsed_time, kind="stable")
    steps, slopes = np.diff(elapsed_time[order]), np.diff(temperature[order])
    behind = np.zeros_like(temperature)
    state = 0.0
    for row, step, rise in zip(order[1:], steps, slopes, strict=True):
        if step > 0:
            decay = np.exp(-step / time_constant)
            state = state * decay - rise * (time_constant / step) * (1 - decay)
        else:
            state -= rise
        behind[row] = state
    return behind
