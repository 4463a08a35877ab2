"""Temperature and viscosity of the oil where it is sheared."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from specan.models.quantity import Quantity, constant, quantity
from specan.models.worm_gear.rig import Choice, Oil

T_40, T_100 = 313.15, 373.15
LEAST_CONSTANT, MOST_CONSTANT = 60.0, 273.0  # of Vogel's law, degC


@quantity(unit="K")
def oil_temperature(indicated_oil_temperature):
    """True temperature of the oil sump."""
    return indicated_oil_temperature


@quantity(unit="K")
def contact_temperature(oil_temperature):
    """Temperature of the oil where it is sheared: in the mesh, the bearings, the churned layer."""
    return oil_temperature


def viscosity_quantities(oil: Oil, choice: Choice) -> list[Quantity]:
    """Kinematic viscosity by the law that the rig file chooses, and the density."""
    points = (1e-6 * oil.viscosity_40C_mm2_s, 1e-6 * oil.viscosity_100C_mm2_s)
    if choice.viscosity == "vogel":
        constant_c = oil.vogel_constant_C
        viscosity_at, source = (
            vogel(*points, chart_constant(*points) if constant_c is None else constant_c),
            "Vogel 1921; its constant by the chart of ASTM D341 unless the rig file gives it",
        )
    else:
        viscosity_at, source = exponential(*points), "Bizon, Dziedziech, Macheta 2012, eq. 2"

    @quantity(unit="m^2/s", reference=source)
    def kinematic_viscosity(contact_temperature):
        """Kinematic viscosity of the oil where it is sheared."""
        return viscosity_at(contact_temperature)

    return [
        oil_temperature,
        contact_temperature,
        kinematic_viscosity,
        constant("oil_density", oil.density_kg_m3, "kg/m^3", "Density of the oil."),
    ]


Law = Callable[[Any], Any]  # kelvin to m^2/s, numbers or arrays


def vogel(at_40: float, at_100: float, constant: float) -> Law:
    """Vogel's law through two points, ``nu = K exp(B / (theta + c))`` with theta in degC.

    Examples
    --------
    >>> law = vogel(220e-6, 36e-6, 150.0)
    >>> round(1e6 * float(law(np.float64(313.15))), 6), round(1e6 * float(law(np.float64(373.15))), 6)
    (220.0, 36.0)
    """
    offset = constant - 273.15
    b = math.log(at_40 / at_100) / (1 / (T_40 + offset) - 1 / (T_100 + offset))
    log_k = math.log(at_40) - b / (T_40 + offset)
    return lambda temperature: np.exp(log_k + b / (temperature + offset))


def chart_constant(at_40: float, at_100: float) -> float:
    """Vogel's constant c, degC, with which the law meets the chart of ASTM D341 half-way between its points.

    The chart, ``log log (nu + 0.7)`` over ``log T`` with nu in mm^2/s, is what laboratories interpolate with. For
    mineral oils c is near 95 (Cameron, Basic Lubrication Theory, 3rd ed., 1981, gives that for all of them), for
    polyglycols of a high viscosity index up to 160.

    Examples
    --------
    >>> round(chart_constant(220e-6, 19e-6)), round(chart_constant(220e-6, 36e-6))
    (94, 144)
    """
    middle = (T_40 + T_100) / 2
    ends = [math.log10(math.log10(1e6 * nu + 0.7)) for nu in (at_40, at_100)]
    place = math.log(middle / T_40) / math.log(T_100 / T_40)
    wanted = 1e-6 * (10 ** (10 ** (ends[0] + place * (ends[1] - ends[0]))) - 0.7)
    low, high = LEAST_CONSTANT, MOST_CONSTANT
    for _ in range(50):  # the larger c, the straighter the law and the higher its middle
        c = (low + high) / 2
        low, high = (c, high) if vogel(at_40, at_100, c)(np.float64(middle)) < wanted else (low, c)
    return (low + high) / 2


def exponential(at_40: float, at_100: float) -> Law:
    """The article's eq. 2 through two points, ``nu = nu_0 exp(-b T)``."""
    b = math.log(at_40 / at_100) / (T_100 - T_40)
    return lambda temperature: at_40 * np.exp(-b * (temperature - T_40))
