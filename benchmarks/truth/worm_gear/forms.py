"""Published forms of the parts of a gear, of which a simulated truth draws one each.

One simulator is one opinion: a search that is tuned on it knows that opinion. Here bearings, oil drag, viscosity,
boundary friction, noise and sensor each follow one of several published laws, drawn by the seed; none is the model's.

Bearings: ball by ball as in `bearings`; Palmgren's moments with the constants of Harris (Rolling Bearing Analysis)
and with those of the SKF General Catalogue 1989; the moment of ISO/TR 14179-1, which knows neither speed nor oil.
Oil drag, as powers of speed and viscosity from T = rho w^2 R^3 S C_m / 2: Terekhov (1991; C_m ~ Re^-0.6 Fr^-0.25),
Changenet and Velex (2007; C_m ~ Re^-0.21 Fr^-0.6), ISO/TR 14179-2 (exponential in the pitch line speed, whatever the
oil), and drag that saturates.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from truth.worm_gear.gear import VISCOSITY_40, VISCOSITY_100, Array, Bearing, Gear, viscosity

STATIC_RATING = {"6009": 14600.0, "6202": 3750.0, "6211": 29000.0}  # N, catalogue
BEARING_FORMS = ("ball by ball", "Harris", "SKF 1989", "ISO/TR 14179-1")
DRAG_FORMS = ("saturating", "Terekhov", "Changenet and Velex", "ISO/TR 14179-2")
OIL_FORMS = ("DIN 51563", "ASTM D341", "Vogel")
BOUNDARY_FORMS = ("cubic", "Gauss", "exponential")
NOISE_FORMS = ("normal", "uniform", "Student 5")


@dataclass(frozen=True)
class Forms:
    """Which form each part has, and the constants that its publication leaves open.

    Parameters
    ----------
    bearing, drag, oil, boundary, noise : str
        Names in the lists above.
    f0, z : float
        Palmgren's factors of the moments without and with load.
    vogel : float
        Constant of Vogel's law, degC.
    reading : float
        Part of the noise of a reading that grows with it, percent.
    curvature : float
        Deviation of the torque sensor from a straight line at 10 Nm, percent of the reading.
    step : float
        Printed step of the input torque, Nm.
    """

    bearing: str = "ball by ball"
    drag: str = "saturating"
    oil: str = "DIN 51563"
    boundary: str = "cubic"
    noise: str = "normal"
    f0: float = 2.0
    z: float = 0.0005
    vogel: float = 100.0
    reading: float = 0.0
    curvature: float = 0.0
    step: float = 0.001


def draw_forms(rng: np.random.Generator) -> Forms:
    """Draw a form of every part."""
    bearing = str(rng.choice(BEARING_FORMS))
    z = {"Harris": (0.0004, 0.0006)}.get(bearing, (0.0006, 0.0009))
    return Forms(
        bearing=bearing,
        drag=str(rng.choice(DRAG_FORMS)),
        oil=str(rng.choice(OIL_FORMS)),
        boundary=str(rng.choice(BOUNDARY_FORMS)),
        noise=str(rng.choice(NOISE_FORMS)),
        f0=rng.uniform(1.5, 2.0),
        z=rng.uniform(*z),
        vogel=rng.uniform(90.0, 115.0),
        reading=rng.uniform(0.05, 0.3),
        curvature=rng.uniform(-0.02, 0.02),
        step=float(rng.choice([0.001, 0.002, 0.005])),
    )


def bearing_moment(
    forms: Forms,
    bearing: Bearing,
    radial: Array,
    axial: Array,
    speed: Array,
    viscosity: Array,
    rolling: Array,
) -> Array:
    """Moment of one bearing, Nm; `rolling` is the product of the factors on what the oil makes of it."""
    diameter, rating = 1e3 * bearing.pitch_diameter, STATIC_RATING[bearing.designation]
    static = np.maximum(0.6 * radial + 0.5 * axial, radial)
    if forms.bearing == "ISO/TR 14179-1":
        load = np.maximum(3.0 * axial - 0.1 * radial, radial)
        return 1e-3 * forms.z * (static / rating) ** 0.55 * load * diameter
    exponent, load = (
        (0.55, np.maximum(0.9 * axial / np.tan(np.deg2rad(15.0)) - 0.1 * radial, radial))
        if forms.bearing == "Harris"
        else (0.5, np.maximum(3.3 * axial - 0.1 * radial, radial))
    )
    flow = np.maximum(viscosity * np.abs(speed) * 30.0 / np.pi, 2000.0)
    idle = forms.f0 * 1e-7 * flow ** (2.0 / 3.0) * diameter**3
    return 1e-3 * (idle * rolling + forms.z * (static / rating) ** exponent * load * diameter)


# torque over that at 1500 rpm and the reference viscosity: power of the speed, power of the viscosity
_POWERS = {"Terekhov": (0.9, 0.6), "Changenet and Velex": (0.59, 0.21)}


def drag_shape(forms: Forms, saturation: float) -> Callable[[Array, Array], Array]:
    """Oil drag over that at the reference, a function of speed (1500 rpm) and viscosity (reference), both relative."""

    def shape(speed: Array, viscosity: Array) -> Array:
        if forms.drag == "ISO/TR 14179-2":
            return np.exp(0.25 * (speed - 1.0)) * np.ones_like(viscosity)
        if forms.drag in _POWERS:
            n, nu = _POWERS[forms.drag]
            return speed**n * viscosity**nu
        return viscosity * speed * (1.0 + saturation) / (speed + saturation)

    return shape


def oil(forms: Forms, gear: Gear, temperature: Array) -> Array:
    """Viscosity of the oil in the gear, mm^2/s; every form goes through the data sheet's values at 40 and 100 degC."""
    if forms.oil != "Vogel":
        return viscosity(gear, temperature, {"DIN 51563": 0.8, "ASTM D341": 0.7}[forms.oil])
    at_40, at_100, c = VISCOSITY_40, VISCOSITY_100, forms.vogel
    slope = np.log(at_40 / at_100) / (1 / (40 + c) - 1 / (100 + c))
    return gear.oil_batch * at_100 * np.exp(slope * (1 / (temperature + c) - 1 / (100 + c)))


def boundary_share(forms: Forms, sliding: Array, fading: float) -> Array:
    """Boundary friction over that at standstill; small above 0.1 m/s, whatever the form."""
    x = sliding / fading
    if forms.boundary == "Gauss":
        return np.exp(-0.5 * x**2)
    return np.exp(-x) if forms.boundary == "exponential" else 1.0 / (1.0 + x**3)


def noise(forms: Forms, rng: np.random.Generator, size: int) -> Array:
    """Noise of unit variance."""
    if forms.noise == "uniform":
        return rng.uniform(-np.sqrt(3.0), np.sqrt(3.0), size)
    if forms.noise == "Student 5":
        return rng.standard_t(5, size) / np.sqrt(5.0 / 3.0)
    return rng.standard_normal(size)
