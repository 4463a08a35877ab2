"""Effects of the oil: how warm it is in the contacts, and how it flows there."""

import numpy as np

from specan.models import Parameter, effect

REFERENCE_VISCOSITY = 1e-4  # m^2/s
SUPPLY = Parameter(
    1.0, "1", min=0.0, max=3.0, lower=-1.0, upper=6.0, doc="power of the oil level in the oil supplied",
    needs=("oil_level",),
)  # fmt: skip
IDLE_TORQUE = Parameter(
    2.0, "N*m", min=0.5, max=5.0, doc="output torque below which a run counts as idle", fixed=True
)


@effect(
    "oil-heating",
    adds_to="contact_temperature",
    aliases=("starvation", "shear-thinning"),
    separate_by="torque varied at constant speed and sump temperature, or a thermocouple in the gear",
    reference="steady thermal network of one resistance; DIN 3996 takes the wheel's temperature above the "
    "sump's from the loss in the same way; the resistance is left free here",
)
def oil_heating(
    power_loss,
    *,
    resistance=Parameter(0.02, "K/W", min=0.005, max=0.1, lower=0.0, upper=0.5, doc="contact to sump"),
):
    """The power loss heats the oil in the contacts, before it reaches the thermometer in the sump.

    Warmer oil is thinner and causes less loss; this loop is solved for its fixed point. The loss at high
    torque and speed is lower than expected from the sump temperature: a cross term of torque and speed.
    """
    return resistance * power_loss


@effect(
    "thermal-lag",
    adds_to="contact_temperature",
    neutral={"idle_offset": 0.0, "time": 0.0},
    aliases=("torque-zero-error", "oil-heating", "brake-drag", "mesh-starvation"),
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
    idle_torque=IDLE_TORQUE,
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


@effect(
    "shear-thinning",
    scales="kinematic_viscosity",
    aliases=("churning", "starvation", "torque-zero-error"),
    separate_by="an oil without polymers of the same viscosity, or a rheometer",
    reference="Carreau 1972, Trans. Soc. Rheol. 16: eta = eta_0 (1 + (lambda x shear rate)^2)^(-m/2) with the "
    "relaxation time lambda proportional to the viscosity, so that it sets in at a shear stress (Eyring: m = 1); "
    "the shear rate is taken proportional to the sliding speed, both constants are left free here",
)
def shear_thinning(
    sliding_speed,
    kinematic_viscosity,
    *,
    exponent=Parameter(0.2, "1", min=0.05, max=1.0, lower=0.0, upper=1.0, doc="of the fall at high stress"),
    speed=Parameter(
        3.0,
        "m/s",
        min=0.2,
        max=30.0,
        lower=0.05,
        upper=100.0,
        doc="sliding speed at which it sets in, for oil of 100 mm^2/s",
    ),
):
    """Long molecules align in strongly sheared oil, and its viscosity falls below that of the data sheet.

    The shear stress, viscosity times speed, decides: cold oil thins at a lower speed than warm oil. Viscous
    losses grow less with speed and with the viscosity than they should.
    """
    stress = sliding_speed * kinematic_viscosity / REFERENCE_VISCOSITY
    return (1.0 + (stress / speed) ** 2) ** (-0.5 * exponent)
