"""Temperature and viscosity of the oil where it is sheared."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from specan.models.quantity import Quantity, constant, quantity
from specan.models.worm_gear.rig import Choice, Oil

T_40, T_100 = 313.15, 373.15
# Cameron, Basic Lubrication Theory (3rd ed., 1981): one constant of Vogel's law serves all lubricating oils.
VOGEL_OFFSET = 95.0 - 273.15


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
    law = vogel if choice.viscosity == "vogel" else exponential
    viscosity_at = law(1e-6 * oil.viscosity_40C_mm2_s, 1e-6 * oil.viscosity_100C_mm2_s)

    @quantity(
        unit="m^2/s",
        reference="Vogel 1921 with Cameron's constant; or the article's eq. 2"
        if choice.viscosity == "vogel"
        else "Bizon, Dziedziech, Macheta 2012, eq. 2",
    )
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


def vogel(at_40: float, at_100: float) -> Law:
    """Vogel's law through two points, ``nu = K exp(B / (T + c))`` with c = 95 degC.

    Examples
    --------
    >>> law = vogel(220e-6, 36e-6)
    >>> round(1e6 * float(law(np.float64(313.15))), 6), round(1e6 * float(law(np.float64(373.15))), 6)
    (220.0, 36.0)
    """
    b = math.log(at_40 / at_100) / (1 / (T_40 + VOGEL_OFFSET) - 1 / (T_100 + VOGEL_OFFSET))
    log_k = math.log(at_40) - b / (T_40 + VOGEL_OFFSET)
    return lambda temperature: np.exp(log_k + b / (temperature + VOGEL_OFFSET))


def exponential(at_40: float, at_100: float) -> Law:
    """The article's eq. 2 through two points, ``nu = nu_0 exp(-b T)``."""
    b = math.log(at_40 / at_100) / (T_100 - T_40)
    return lambda temperature: at_40 * np.exp(-b * (temperature - T_40))
