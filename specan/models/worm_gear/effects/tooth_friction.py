"""Friction between the flanks."""

from specan.models import Parameter, effect


@effect(
    "tooth-friction",
    adds_to="friction_coefficient",
    neutral={"mu": 0.0},
    reference="ISO/TS 14521:2020: mean coefficients of friction of 0.02 to 0.1 for bronze on steel",
)
def tooth_friction(*, mu=Parameter(0.05, "1", min=0.01, max=0.12, lower=0.0, upper=0.6, doc="coefficient")):
    """The flanks of a worm gear slide along each other much faster than they roll.

    A coefficient of friction that does not depend on load, speed or oil gives a loss proportional to the
    torque. Each dependence is a separate effect: speed-, viscosity-, load-dependent friction.
    """
    return mu
