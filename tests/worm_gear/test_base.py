"""The base model: balance of power, statics, the SKF model, oil, and the way down to the ideal gear."""

import math

import numpy as np
import pytest

from specan.models import varying
from specan.models.catalogue import example_model
from specan.worm_gear.model.power import chart_constant, exponential, vogel

MODEL = example_model("worm-gear")
BASE = MODEL.assemble(MODEL.base_effects)
SPEED, TORQUE, TEMPERATURE = (
    axis.ravel() for axis in np.meshgrid([300, 1000, 2000, 3000.0], [0, 5, 40, 100.0], [25, 58, 80.0])
)
GRID = {
    "worm_speed": SPEED * np.pi / 30,
    "indicated_output_torque": TORQUE,
    "indicated_oil_temperature": TEMPERATURE + 273.15,
}


def at(speed_rpm=1500.0, torque=50.0, celsius=58.0, uses=BASE.uses, values=None):
    return MODEL.assemble(uses).evaluate(
        {
            "worm_speed": speed_rpm * math.pi / 30,
            "indicated_output_torque": np.float64(torque),
            "indicated_oil_temperature": celsius + 273.15,
        },
        values,
    )


def test_no_power_is_made_or_lost():
    found = BASE.evaluate(GRID)
    into, out = found["input_torque"] * GRID["worm_speed"], TORQUE * found["wheel_speed"]
    losses = found["mesh_loss"] + found["bearing_loss"] + found["no_load_loss"]
    np.testing.assert_allclose(into, out + losses, rtol=1e-13)


def test_an_ideal_gear_loses_nothing():
    found = MODEL.assemble().evaluate(GRID)
    assert np.all(found["power_loss"] == 0)
    np.testing.assert_allclose(found["input_torque"], TORQUE / 7.5, rtol=1e-14)
    np.testing.assert_allclose(found["indicated_efficiency"][TORQUE > 0], 1.0, rtol=1e-14)


def test_each_base_effect_adds_its_own_loss_only():
    for effect, quantity in [
        ("tooth-friction", "mesh_loss"),
        ("churning", "no_load_loss"),
        ("bearing-friction", "bearing_loss"),
    ]:
        found = MODEL.assemble([effect]).evaluate(GRID)
        np.testing.assert_allclose(found["power_loss"], found[quantity])
        assert np.all(found[quantity][TORQUE > 0] > 0)


def test_losses_grow_with_speed_and_torque_and_fall_with_warm_oil():
    loss = BASE.evaluate(GRID)["power_loss"].reshape(4, 4, 3)  # torque, speed, temperature
    assert np.all(np.diff(loss, axis=0) > 0)
    assert np.all(np.diff(loss, axis=1) > 0)
    assert np.all(np.diff(loss, axis=2) < 0)


def test_the_model_is_smooth_where_it_is_used():
    torque = np.linspace(0.5, 100, 400)
    found = BASE.evaluate({**{k: v[:1] for k, v in GRID.items()}, "indicated_output_torque": torque})
    curve = found["input_torque"]
    assert np.all(np.isfinite(curve))
    assert np.max(np.abs(np.diff(curve, 3))) < 1e-3


@pytest.mark.parametrize("mu", [0.01, 0.05, 0.135])
def test_mesh_efficiency_is_that_of_a_screw(mu):
    """tan(gamma) / tan(gamma + rho') with tan(rho') = mu / cos(alpha_n): Niemann and Winter III."""
    lead, pressure = math.radians(18.92), math.radians(20.0)
    expected = math.tan(lead) / math.tan(lead + math.atan(mu / math.cos(pressure)))
    found = at(uses=["tooth-friction"], values={"tooth-friction.mu": mu})
    # the rounded lead angle of the rig closes the geometry to 3 parts in 10 000
    assert float(found["indicated_efficiency"]) == pytest.approx(expected, abs=3e-4)


def test_start_up_efficiency_of_the_data_sheet_is_friction_of_0_13():
    """67 %: flanks at rest, where nothing churns."""
    assert at(uses=["tooth-friction"], values={"tooth-friction.mu": 0.135})[
        "indicated_efficiency"
    ] == pytest.approx(0.67, abs=1e-3)


def test_a_wheel_driven_backwards_still_loses_power():
    found = at(torque=-1.0)
    assert found["mesh_loss"] > 0
    assert found["bearing_loss"] > 0


def test_tooth_forces_are_in_equilibrium():
    found = at(values={"tooth-friction.mu": 0.05})
    axial, tangential = found["worm_axial_force"], found["worm_tangential_force"]
    normal = 50.0 * found["normal_force_per_torque"]
    lead, pressure = math.radians(18.92), math.radians(20.0)
    radial = found["radial_force"]
    # normal force and friction, squared and added, are the three forces
    assert axial**2 + tangential**2 + radial**2 == pytest.approx(normal**2 * (1 + 0.05**2), rel=1e-12)
    assert axial == pytest.approx(50.0 / 0.045)
    assert radial == pytest.approx(normal * math.sin(pressure))
    assert tangential == pytest.approx(
        normal * (math.cos(pressure) * math.sin(lead) + 0.05 * math.cos(lead)), rel=1e-12
    )


def test_bearing_positions_are_those_of_the_articles_equations():
    """Without friction: 35.169 T and 21.947 T of eqs 6, 7; the couple 41.45 T of eqs 4, 5."""
    found = at(torque=7.5, values={"tooth-friction.mu": 0.0, "bearing-friction.scale": 0.0})
    tangential = float(found["worm_tangential_force"])  # for 1 N*m at the worm
    assert tangential == pytest.approx(1 / 0.0175, rel=1e-3)
    assert tangential * 65.3 / 106 == pytest.approx(35.169, rel=1e-3)
    assert tangential * 40.7 / 106 == pytest.approx(21.947, rel=1e-3)
    assert tangential * 0.045 / 0.062 == pytest.approx(41.45, rel=1e-3)
    loads = found["bearing_radial_load"]
    across = np.array([tangential * 65.3 / 106, tangential * 40.7 / 106])
    assert np.all(loads[:2] > across)


def test_loads_of_a_shaft_hold_its_forces():
    """Sum of forces and of moments, from the loads alone: the radial plane of the worm shaft."""
    found = at(torque=60.0)
    along, across, apart = (
        float(found[n]) for n in ("worm_axial_force", "worm_tangential_force", "radial_force")
    )
    loads = found["bearing_radial_load"][:2]
    lateral = np.sqrt(loads**2 - 10.0**2 - np.array([across * 65.3 / 106, across * 40.7 / 106]) ** 2)
    signs = np.array([1.0, np.sign(apart * 40.7 - along * 17.5)])
    assert (signs * lateral).sum() == pytest.approx(apart, rel=1e-9)
    assert (signs * lateral) @ [-40.7, 65.3] == pytest.approx(-along * 17.5, rel=1e-9)


def test_bearing_moments_are_the_catalogues():
    """The formulas of the SKF catalogue in its own units, written out for one locating and one free bearing."""
    found = at(2000.0, 60.0, 40.0)
    viscosity = 1e6 * float(found["kinematic_viscosity"])
    radial, axial = found["bearing_radial_load"], found["bearing_axial_load"]

    # 6009, locating, worm shaft: d = 45, D = 75, C0 = 14.6 kN
    n, dm, fr, fa = 2000.0, 60.0, radial[0], axial[0]
    alpha = math.radians(24.6 * (fa / 14600) ** 0.24)
    g_rr = 4.1e-7 * dm**1.96 * (fr + 1.7 / math.sin(alpha) * fa) ** 0.54
    g_sl = 3.73e-3 * dm**-0.145 * (fr**5 + 14.6 * dm**1.5 / math.sin(alpha) * fa**4) ** (1 / 3)
    blend = math.exp(-2.6e-8 * (n * viscosity) ** 1.4 * dm)
    assert found["bearing_rolling_moment"][0] == pytest.approx(1e-3 * g_rr * (viscosity * n) ** 0.6, rel=1e-9)
    assert found["bearing_sliding_moment"][0] == pytest.approx(
        1e-3 * g_sl * (blend * 0.12 + (1 - blend) * 0.04), rel=1e-9
    )

    # 6211, free, wheel shaft: d = 55, D = 100
    n, dm, fr = 2000.0 / 7.5, 77.5, radial[3]
    assert axial[3] == 0
    assert found["bearing_rolling_moment"][3] == pytest.approx(
        1e-3 * 3.9e-7 * dm**1.96 * fr**0.54 * (viscosity * n) ** 0.6, rel=1e-9
    )
    blend = math.exp(-2.6e-8 * (n * viscosity) ** 1.4 * dm)
    assert found["bearing_sliding_moment"][3] == pytest.approx(
        1e-3 * 3.23e-3 * dm**-0.26 * fr ** (5 / 3) * (blend * 0.12 + (1 - blend) * 0.04), rel=1e-9
    )


def test_drag_and_seals_of_bearings_come_from_the_rig():
    import copy

    from specan.worm_gear.model import EXAMPLE_RIG, build

    rig = copy.deepcopy(EXAMPLE_RIG)
    rig["bearing"][1] |= {"oil_height_mm": 20.0, "drag_loss_factor": 1e-4, "seal_torque_Nm": 0.05}
    found = (
        build(rig)
        .assemble()
        .evaluate(
            {
                "worm_speed": 100 * math.pi,
                "indicated_output_torque": 10.0,
                "indicated_oil_temperature": 313.15,
            }
        )
    )
    assert found["bearing_seal"] == pytest.approx([0.05, 0, 0, 0])
    d, big, dm, n, nu = 45.0, 75.0, 60.0, 3000.0, 220.0
    k_ball = 3.1 * (d + big) / (big - d) * 1e-12
    t = 2 * math.acos((0.6 * dm - 20.0) / (0.6 * dm))
    r_s = 0.36 * dm**2 * (t - math.sin(t)) * 0.05 * 3.1 * (big + d) / (big - d)
    drag = (
        0.4 * 1e-4 * k_ball * dm**5 * n**2
        + 1.093e-7 * n**2 * dm**3 * (n * dm**2 * math.sin(t / 2) / nu) ** -1.379 * r_s
    )
    assert found["bearing_drag_moment"] == pytest.approx([1e-3 * drag, 0, 0, 0], rel=1e-6)


def test_viscosity_goes_through_the_data_sheet():
    for law in (vogel(220e-6, 36e-6, 95.0), exponential(220e-6, 36e-6)):
        assert law(np.array([313.15, 373.15])) == pytest.approx([220e-6, 36e-6])
    assert at(celsius=40.0)["kinematic_viscosity"] == pytest.approx(220e-6)


@pytest.mark.parametrize("at_100", [19.0, 36.0])
def test_viscosity_follows_the_standard_chart(at_100):
    """ASTM D341, log log (nu + 0.7) over log T, for a mineral oil and a polyglycol of ISO VG 220."""
    kelvin = np.linspace(293.15, 373.15, 20)

    def ordinate(viscosity):
        return np.log10(np.log10(viscosity + 0.7))

    slope = (ordinate(220) - ordinate(at_100)) / np.log10(373.15 / 313.15)
    chart = 10 ** (10 ** (ordinate(220) - slope * np.log10(kelvin / 313.15))) - 0.7
    law = vogel(220e-6, 1e-6 * at_100, chart_constant(220e-6, 1e-6 * at_100))
    warm = kelvin >= 313.15
    np.testing.assert_allclose(1e6 * law(kelvin)[warm], chart[warm], rtol=0.004)
    np.testing.assert_allclose(1e6 * law(kelvin), chart, rtol=0.04)


def test_oil_level_changes_churning_only():
    standard, low = at(), at()
    conditions = {"worm_speed": 157.0, "indicated_output_torque": 50.0, "oil_level": np.array([1.0, 0.5])}
    found = BASE.evaluate(conditions, {"churning.level_exponent": 1.0})
    assert found["no_load_loss"][1] == pytest.approx(0.5 * found["no_load_loss"][0])
    assert found["mesh_loss"] == pytest.approx(standard["mesh_loss"], rel=2e-3)
    assert low["mesh_loss"] == standard["mesh_loss"]


def test_the_articles_form_goes_by_the_power_put_in():
    from specan.worm_gear.model import EXAMPLE_RIG, build

    model = build({**EXAMPLE_RIG, "model": {"mesh": "article", "viscosity": "exponential"}})
    found = model.assemble(model.base_effects).evaluate(GRID, {"tooth-friction.mu": 0.07})
    into = found["input_torque"] * GRID["worm_speed"]
    np.testing.assert_allclose(found["mesh_loss"], 2.3 * 0.07 * (1 / 4 + 1 / 30) * into, rtol=1e-10)
    lever = 0.00564 + 0.0166 * 0.07
    couple = (0.024 - 0.00567 * 0.07) / (0.000598 + 0.00176 * 0.07)
    np.testing.assert_allclose(
        found["bearing_radial_load"][0], found["input_torque"] * np.hypot(35.169, couple), rtol=1e-10
    )
    np.testing.assert_allclose(
        found["bearing_radial_load"][2],
        found["input_torque"] * np.hypot(0.0548 / lever - 41.45, 0.468 * (0.939 - 0.324 * 0.07) / lever),
        rtol=1e-10,
    )
    assert np.all(found["bearing_axial_load"] == 0)


def test_what_the_data_cannot_tell_is_held():
    """At one temperature and oil level, powers of them say nothing; over a kelvin the viscosity changes by 5 %."""
    always = {
        "tooth-friction.mu",
        "bearing-friction.scale",
        "churning.power",
        "churning.exponent",
        "churning.constant",
    }
    assert set(BASE.free(varying([GRID]))) == always | {"churning.viscosity_exponent"}
    for spread, told in ((0.05, set()), (0.5, {"churning.viscosity_exponent"})):  # K, either way
        warm = {**GRID, "indicated_oil_temperature": 331.0 + spread * np.sin(np.arange(SPEED.size))}
        assert set(BASE.free(varying([warm]))) == always | told
    levels = [{**GRID, "oil_level": np.ones(3)}, {**GRID, "oil_level": np.full(3, 0.6)}]
    assert set(BASE.free(varying(levels))) == always | {
        "churning.viscosity_exponent",
        "churning.level_exponent",
    }
