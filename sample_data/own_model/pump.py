"""A centrifugal pump.

Change names, units and formulas into those of your own set-up.
"""

import numpy as np

from specan.models import Model, Parameter, effect

# A function is a quantity of its own name. Its arguments are conditions, parameters, or other functions.
# It receives and returns numbers in the units given below, for arrays: one value a row of the table.


def head(flow, speed, loss, shutoff):
    """Head of the pump."""
    return shutoff * (speed / 2900) ** 2 - loss


def loss(flow, friction):
    """Head lost to friction in the passages."""
    return friction * flow**2


# Effects that may be missing. An effect can act on quantities that have a name: `loss` is a function of its
# own, so that an effect can add to it, scale it or read it. Where `neutral` holds, the effect does nothing;
# min to max is plausible, lower to upper is where a fit may look.


@effect("cavitation", adds_to="loss", neutral={"size": 0.0})
def cavitation(flow, *, size=Parameter(0.01, "m/(m3/h)^2", min=1e-4, max=0.1, lower=0, upper=1),
               onset=Parameter(40, "m3/h", min=20, max=55)):  # fmt: skip
    """Above some flow the water boils in the inlet, and the head falls ever more."""
    return size * np.maximum(flow - onset, 0) ** 2


@effect("slip", adds_to="head", neutral={"size": 0.0})
def slip(flow, speed, *, size=Parameter(-0.1, "m/(m3/h)", min=-0.3, max=-0.01, lower=-1, upper=1)):
    """The water leaves the wheel at an angle, which costs head in proportion to flow and speed."""
    return size * flow * speed / 2900


@effect("recirculation", adds_to="loss", neutral={"size": 0.0})
def recirculation(flow, speed, *, size=Parameter(5, "m", min=0.5, max=15, lower=0, upper=50)):
    """Below a third of the design flow, 13 m3/h at 2900 1/min, water turns back in the inlet."""
    return size * np.maximum(speed / 2900 - flow / 13, 0) ** 2


model = Model.from_function(
    head,
    loss,
    conditions={"flow": ("m3/h", 5, 60), "speed": ("1/min", 1800, 2900)},  # unit, lowest, highest
    observables={"head": ("m", 0.1)},  # unit, standard uncertainty of one reading
    parameters={"shutoff": (32.0, 20, 50, "m"), "friction": (0.004, 0.001, 0.01, "m/(m3/h)^2")},
    units={"loss": "m"},
    effects=[cavitation, slip, recirculation],
)
