"""Temperature and viscosity of the oil where it is sheared."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from specan.models.quantity import Quantity, constant, quantity
from specan.models.worm_gear.rig import Choice, Oil

T_40, T_100 = 313.15, 373.15


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
        viscosity_at, source = (
            vogel(*points, oil.vogel_constant_C),
            "Vogel 1921; its constant by Cameron 1981",
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


Law = Callable[[NDArray[np.float64]], NDArray[np.float64]]


def vogel(at_40: float, at_100: float, constant: float = 95.0) -> Law:
    """Vogel's law through two points, ``nu = K exp(B / (theta + c))`` with theta in degC.

    Cameron (Basic Lubrication Theory, 3rd ed., 1981) found c = 95 degC to serve all mineral oils; against the
    chart of ASTM D341 they ask for 97 to 101, polyglycols of a high viscosity index for up to 160.

    Examples
    --------
    >>> law = vogel(220e-6, 36e-6)
    >>> round(1e6 * float(law(np.float64(313.15))), 6), round(1e6 * float(law(np.float64(373.15))), 6)
    (220.0, 36.0)
    """
    offset = constant - 273.15
    b = math.log(at_40 / at_100) / (1 / (T_40 + offset) - 1 / (T_100 + offset))
    log_k = math.log(at_40) - b / (T_40 + offset)
    return lambda temperature: np.exp(log_k + b / (temperature + offset))


def exponential(at_40: float, at_100: float) -> Law:
    """The article's eq. 2 through two points, ``nu = nu_0 exp(-b T)``."""
    b = math.log(at_40 / at_100) / (T_100 - T_40)
    return lambda temperature: at_40 * np.exp(-b * (temperature - T_40))
