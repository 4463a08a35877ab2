"""From shaft to shaft: speeds, oil, forces and sliding in the mesh, the balance of power and what indicates it."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from specan.models.quantity import Quantity, constant, quantity
from specan.worm_gear.model.bearings import AXES
from specan.worm_gear.model.rig import Choice, Oil, Rig

SMALL = 1e-9  # exponents below it are the logarithm to many digits
IDLE = 0.05  # share of the largest output torque below which a run is one without load
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


def viscosity(oil: Oil, choice: Choice) -> Quantity:
    """Kinematic viscosity by the law that the rig file chooses."""
    points = (1e-6 * oil.viscosity_40C_mm2_s, 1e-6 * oil.viscosity_100C_mm2_s)
    if choice.viscosity == "vogel":
        viscosity_at = vogel(*points, oil.vogel_constant_C or chart_constant(*points))
        source = "Vogel 1921; its constant by the chart of ASTM D341 unless the rig file gives it"
    else:
        viscosity_at, source = exponential(*points), "Bizon, Dziedziech, Macheta 2012, eq. 2"

    @quantity(unit="m^2/s", reference=source)
    def kinematic_viscosity(contact_temperature):
        """Kinematic viscosity of the oil where it is sheared."""
        return viscosity_at(contact_temperature)

    return kinematic_viscosity


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


def constants(rig: Rig) -> list[Quantity]:
    """Constants of the gear and its bench, SI."""
    gear, largest = rig.gear, max(map(abs, rig.limits.output_torque_Nm))
    below = IDLE * largest if rig.operation.idle_uncoupled else -1.0
    listed = [
        ("gear_ratio", gear.z_wheel / gear.z_worm, "1", "Speed of the worm over that of the wheel."),
        ("worm_radius", 5e-4 * gear.worm_pitch_diameter_mm, "m", "Pitch radius of the worm."),
        ("wheel_radius", 5e-4 * gear.wheel_pitch_diameter_mm, "m", "Pitch radius of the wheel."),
        ("lead_angle", math.radians(gear.lead_angle_deg), "rad", "Lead angle of the worm."),
        ("normal_pressure_angle", math.radians(gear.normal_pressure_angle_deg), "rad",
         "Pressure angle in the section normal to the flank."),
        ("wheel_width", 1e-3 * gear.wheel_width_mm, "m", "Face width of the wheel."),
        ("bearing_dead_load", gear.bearing_dead_load_N, "N", "Load that keeps an idle bearing rolling."),
        ("uncoupled_below", below, "N*m", "Indicated output torque up to which the brake is uncoupled."),
        ("friction_coefficient", 0.0, "1", "Coefficient of friction between the flanks; an ideal gear has none."),
        ("viscous_loss", 0.0, "W", "Power that the oil's viscosity takes without load; an ideal gear loses none."),
        ("worm_bearing_torque", 0.0, "N*m", "What the bearings take from the worm shaft; an ideal gear's take none."),
        ("wheel_bearing_torque", 0.0, "N*m", "What the bearings take from the wheel shaft; an ideal gear's take none."),
    ]  # fmt: skip
    return [constant(*one) for one in listed]


@quantity(unit="rad/s")
def wheel_speed(worm_speed, gear_ratio):
    """Speed of the wheel shaft."""
    return worm_speed / gear_ratio


@quantity(unit="m/s", reference="ISO/TS 14521:2020, sliding velocity at the mean diameter")
def sliding_speed(worm_speed, worm_radius, lead_angle):
    """Speed at which the worm's flank slides along the wheel's."""
    return worm_speed * (worm_radius / math.cos(lead_angle))


@quantity(unit="N*m")
def output_torque(indicated_output_torque, brake_coupled):
    """True torque at the output shaft; none where the brake is uncoupled, whatever its sensor indicates."""
    return indicated_output_torque * brake_coupled


@quantity(unit="1")
def brake_coupled(coupled, indicated_output_torque, uncoupled_below):
    """Whether the brake is coupled to the output, 1 or 0; where the rig says so, by the torque that is indicated."""
    return coupled * (np.abs(indicated_output_torque) > uncoupled_below)


@quantity(unit="N*m")
def wheel_torque(output_torque, wheel_bearing_torque):
    """Torque that the mesh puts on the wheel: the output torque and what the wheel's bearings take."""
    return output_torque + wheel_bearing_torque


@quantity(unit="N/m")
def tooth_load(output_torque, wheel_radius, wheel_width):
    """Tangential force on the wheel over its face width: how hard the flanks are loaded."""
    return output_torque / (wheel_radius * wheel_width)


@quantity(unit="1/m", reference="statics of the flank: normal force and friction along the lead")
def normal_force_per_torque(friction_coefficient, wheel_radius, lead_angle, normal_pressure_angle):
    """Normal force between the flanks for a torque of 1 N*m on the wheel."""
    axial = math.cos(normal_pressure_angle) * math.cos(lead_angle)
    return 1.0 / (wheel_radius * (axial - friction_coefficient * math.sin(lead_angle)))


@quantity(unit="W", reference="friction force times sliding speed")
def mesh_loss(friction_coefficient, normal_force_per_torque, wheel_torque, sliding_speed):
    """Power lost in tooth engagement: what the sliding flanks take."""
    # A wheel that is driven backwards loads the other flank: the loss stays a loss.
    return friction_coefficient * normal_force_per_torque * np.abs(wheel_torque) * sliding_speed


def power_step(ratio: ArrayLike, exponent: ArrayLike) -> NDArray[np.float64]:
    """``(x^a - 1) / (2^a - 1)``: 0 at x = 1, 1 at x = 2, and the binary logarithm for a = 0.

    Adding a multiple c of it to a coefficient mu_0 gives the power law mu_0 x^a where c = mu_0 (2^a - 1); unlike
    a factor x^a it stays visible where mu_0 vanishes, and c enters linearly.

    Examples
    --------
    >>> power_step([1.0, 2.0, 4.0], 0.0)
    array([0., 1., 2.])
    >>> power_step([1.0, 2.0, 4.0], 1.0)
    array([0., 1., 3.])
    """
    a = np.asarray(exponent, dtype=float)
    a = np.where(np.abs(a) < SMALL, SMALL, a)
    step: NDArray[np.float64] = np.expm1(a * np.log(ratio)) / np.expm1(a * np.log(2.0))
    return step


@quantity(unit="W")
def no_load_loss(viscous_loss):
    """Power lost whether the gear carries load or not: to the oil, to seals, to the air."""
    return viscous_loss


@quantity(unit="W")
def power_loss(mesh_loss, bearing_loss, no_load_loss):
    """Power that the gear turns into heat."""
    return mesh_loss + bearing_loss + no_load_loss


@quantity(unit="W")
def output_power(output_torque, wheel_speed):
    """Power at the output shaft."""
    return output_torque * wheel_speed


@quantity(unit="N*m")
def input_torque(output_power, power_loss, worm_speed):
    """True torque at the input shaft."""
    return (output_power + power_loss) / worm_speed


@quantity(unit="N*m")
def indicated_input_torque(input_torque):
    """Input torque as its sensor indicates it."""
    return input_torque


@quantity(unit="1")
def indicated_efficiency(indicated_output_torque, indicated_input_torque, gear_ratio):
    """Efficiency as it is worked out from what the two torque sensors indicate; none where nothing goes in."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.true_divide(indicated_output_torque, gear_ratio * indicated_input_torque)


@quantity(unit="W")
def indicated_power_loss(indicated_output_torque, indicated_input_torque, gear_ratio, worm_speed):
    """Power loss as it is worked out from what the two torque sensors indicate."""
    return (indicated_input_torque - indicated_output_torque / gear_ratio) * worm_speed


QUANTITIES = [
    oil_temperature, contact_temperature, wheel_speed, sliding_speed, brake_coupled, output_torque, wheel_torque,
    tooth_load, normal_force_per_torque, mesh_loss, no_load_loss, power_loss,
    output_power, input_torque, indicated_input_torque, indicated_efficiency, indicated_power_loss,
]  # fmt: skip


# The equations of the article as printed: tooth engagement (eq. 1) and loads of the bearings (eqs 4-7).
#
# M. Bizon, K. Dziedziech, A. Macheta, Worm gear analysis in terms of numerical modelling, Mechanics and Control 31
# (2012) 4, 133-140. A rig file chooses them by ``mesh = "article"`` under ``[model]``. Both go by what is put into
# the gear, so that bearing friction closes a loop.

SOURCE = "Bizon, Dziedziech, Macheta 2012"


def article_quantities(rig: Rig) -> list[Quantity]:
    """What takes the place of the worm mesh and of statics."""
    return [_mesh_loss(rig), bearing_radial_load, bearing_axial_load]


def _mesh_loss(rig: Rig) -> Quantity:
    factor = 2.3 * (1 / rig.gear.z_worm + 1 / rig.gear.z_wheel)

    @quantity(unit="W", reference=f"{SOURCE}, eq. 1 (after Gopinath and Mayuram): 2.3 mu (1/z1 + 1/z2) W")
    def mesh_loss(friction_coefficient, output_power, bearing_loss, no_load_loss):
        """Power lost in tooth engagement, a share of the power that is put in."""
        share = factor * friction_coefficient
        return share / (1 - share) * (np.abs(output_power) + bearing_loss + no_load_loss)

    return mesh_loss


@quantity(unit="N", axes=AXES, reference=f"{SOURCE}, eqs 4-7, whose numbers hold for its own gear")
def bearing_radial_load(input_torque, friction_coefficient):
    """Radial load of each bearing: C and D of the worm's shaft, A and B of the wheel's."""
    mu = friction_coefficient
    lever = 0.00564 + 0.0166 * mu
    along = (0.939 - 0.324 * mu) / lever
    couple = (0.024 - 0.00567 * mu) / (0.000598 + 0.00176 * mu)
    per_torque = [
        (35.169, couple),
        (21.947, 0.117 / lever - couple),
        (0.0548 / lever - 41.45, 0.468 * along),
        (0.0622 / lever + 41.45, 0.532 * along),
    ]
    return np.stack([np.hypot(x, y) * np.abs(input_torque) for x, y in per_torque])


@quantity(unit="N", axes=AXES, reference=f"{SOURCE}: eqs 4-7 leave the axial load out")
def bearing_axial_load(bearing_radial_load):
    """Axial load of each bearing: none."""
    return np.zeros_like(bearing_radial_load)
