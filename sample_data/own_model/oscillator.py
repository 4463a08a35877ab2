"""A mass on a spring.

Change names, units and formulas into those of your own machine.
"""

from specan import shelf
from specan.models import Model, Signal, State

# The function dx gives the rate of the state x, per second. Arguments are states, recorded inputs, time, parameters,
# or other functions. Terms that an effect may change are functions of their own: spring, damper.


def spring(x, stiffness):
    """Force of the spring."""
    return stiffness * x


def damper(v, damping):
    """Force of the damper."""
    return damping * v


def dx(v):
    """Velocity."""
    return v


def dv(force, spring, damper, mass):
    """Acceleration."""
    return (force - spring - damper) / mass


model = Model.from_rates(
    dx,
    dv,
    spring,
    damper,
    states={"x": State("m"), "v": State("m/s")},
    inputs={"force": "N"},  # channels of the recording
    observables={"x": Signal("mm", 0.05)},  # unit, standard deviation of the noise (may be left out)
    parameters={
        "stiffness": (1e4, 1e3, 1e5, "N/m"),  # start, lowest, highest plausible
        "damping": (20, 1, 200, "N*s/m"),
        "mass": (1, 0.1, 10, "kg"),
    },
    units={"spring": "N", "damper": "N"},
    # what may be missing, in the sizes that your recordings have
    effects=shelf.mechanics(force="spring", x="x", v="v") + shelf.sensor(of="x"),
)
