"""A worm drive 60:1 that lifts and lowers a load."""

import numpy as np

from specan.models import Model, Parameter, effect


def torque(speed, friction, load):
    """Torque of the motor."""
    return np.sign(speed) * friction - load


def friction(speed, coulomb, viscous):
    """Friction of the whole drive, felt at the motor."""
    return coulomb + viscous * np.abs(speed)


@effect("stribeck", adds_to="friction", neutral={"rise": 0.0})
def stribeck(speed, *, rise=Parameter(0.3, "mN*m", min=0.03, max=2, lower=0, upper=5),
             speed_scale=Parameter(5, "rpm", min=0.5, max=50)):
    """Below a certain speed the oil film breaks and friction rises."""
    return rise * np.exp(-((speed / speed_scale) ** 2))


@effect("windage", adds_to="friction", neutral={"size": 0.0})
def windage(speed, *, size=Parameter(1e-6, "mN*m/rpm^2", min=1e-7, max=1e-4, lower=-1e-3, upper=1e-3)):
    """Air and oil are thrown about, with the square of the speed."""
    return size * speed**2


@effect("direction", scales="friction", neutral={"change": 0.0})
def direction(speed, *, change=Parameter(0.1, min=-0.5, max=0.5, lower=-0.9, upper=0.9)):
    """The teeth rub harder while the load is lifted (negative speeds) than while it sinks."""
    return 1 - change * np.sign(speed)


model = Model.from_function(
    torque, friction,
    conditions={"speed": ("rpm", -200, 200)},
    observables={"torque": ("mN*m", 0.03)},
    parameters={"coulomb": (1.4, 0, 5, "mN*m"), "viscous": (1e-3, 0, 0.1, "mN*m/rpm"), "load": (0.2, 0, 2, "mN*m")},
    units={"friction": "mN*m"},
    effects=[stribeck, windage, direction],
)
