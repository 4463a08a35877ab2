"""A worm drive 60:1 that lifts and lowers a load."""

import numpy as np

from specan.models import Model, Parameter, effect


def torque(speed, bearing, viscous, grip, teeth):
    """Torque of the motor, negative while it lifts. The teeth rub by the load that they carry."""
    return np.sign(speed) * (bearing + viscous * np.abs(speed) + grip * np.abs(teeth)) - teeth


def teeth(speed, load, shaft):
    """Load of the teeth, felt at the motor: friction of the wheel's shaft adds to it while lifting, and relieves."""
    return load - np.sign(speed) * shaft


RISE = Parameter(0.3, "mN*m", min=0.03, max=2, lower=0, upper=5)
SCALE = Parameter(5, "rpm", min=0.5, max=50)


@effect("stribeck-teeth", scales="grip", neutral={"rise": 0.0})
def stribeck_teeth(speed, *, rise=Parameter(0.5, min=0.05, max=2, lower=0, upper=10), speed_scale=SCALE):
    """Below a certain speed the oil film between the teeth breaks."""
    return 1 + rise * np.exp(-((speed / speed_scale) ** 2))


@effect("stribeck-bearing", adds_to="bearing", neutral={"rise": 0.0})
def stribeck_bearing(speed, *, rise=RISE, speed_scale=SCALE):
    """Below a certain speed the oil film in the bearings of motor and worm breaks."""
    return rise * np.exp(-((speed / speed_scale) ** 2))


@effect("windage", adds_to="bearing", neutral={"size": 0.0})
def windage(speed, *, size=Parameter(1e-6, "mN*m/rpm^2", min=1e-7, max=1e-4, lower=-1e-3, upper=1e-3)):
    """Air and oil are thrown about, with the square of the speed."""
    return size * speed**2


LOAD = 0.157  # mN m at the motor: 0.096 kg on a pulley of 20 mm, divided by 60
GRIP = 0.1 / np.tan(np.radians(2.8625))  # friction of greased steel on bronze over the slope of the thread
model = Model.from_function(
    torque,
    teeth,
    conditions={"speed": ("rpm", -200, 200)},
    observables={"torque": ("mN*m", 0.03)},
    parameters={
        "bearing": (0.9, 0, 5, "mN*m"),
        "viscous": (1e-3, 0, 0.1, "mN*m/rpm"),
        "shaft": (0.1, 0, 1, "mN*m"),
        "load": {"value": LOAD, "unit": "mN*m", "vary": False},
        "grip": {"value": GRIP, "vary": False},
    },
    units={"teeth": "mN*m"},
    effects=[stribeck_teeth, stribeck_bearing, windage],
)
