"""Every effect of the worm gear keeps the rules and leaves the signature that physics says.

Adding an effect touches two places: its file, and one row in EFFECTS below.
"""

import math
from dataclasses import dataclass

import numpy as np
import pytest

from specan.models import check_effect
from specan.models.catalogue import example_model
from specan.worm_gear.model.effects import flanks
from specan.worm_gear.model.effects.oil import lag

MODEL = example_model("worm-gear")
BASE = MODEL.assemble(MODEL.base_effects)
TORQUE_OUT, TORQUE_IN = "indicated_output_torque", "indicated_input_torque"


@dataclass(frozen=True)
class Signature:
    """How the change of the power loss goes with torque, speed and viscosity: T^a n^b nu^c, and its sign.

    None: not a power law there; told by a test of its own.
    """

    torque: float | None = None
    speed: float | None = None
    viscosity: float | None = None
    sign: int = 1


# the catalogue's signatures, at 60 N*m, 1500 rpm, 50 degC
EFFECTS = {
    "axial-preload": Signature(),  # a sum of rolling and sliding
    "bearing-friction": Signature(),  # a sum of rolling and sliding
    "bearing-preload": Signature(torque=0, speed=1),
    "brake-drag": Signature(sign=0),  # only without load
    "churning": Signature(torque=0),  # its exponents are its parameters
    "exponential-churning": Signature(torque=0, viscosity=0),
    "inlet-shear-heating": Signature(sign=-1),
    "iso-bearings": Signature(torque=1.55, viscosity=0),
    "load-dependent-friction": Signature(speed=1, viscosity=0),
    "mesh-starvation": Signature(torque=1),
    "mesh-pocketing": Signature(torque=0, speed=2, viscosity=0),
    "oil-heating": Signature(sign=-1),
    "palmgren-bearings": Signature(),  # a sum of two
    "running-in": Signature(speed=1, viscosity=0),
    "seal-drag": Signature(torque=0, speed=1, viscosity=0),
    "shear-thinning": Signature(sign=-1),
    "speed-dependent-friction": Signature(torque=1, viscosity=0),
    "starvation": Signature(sign=-1),
    "temperature-bias": Signature(torque=None),
    "thermal-lag": Signature(sign=0),  # nothing under load in the steady state
    "tooth-friction": Signature(torque=1, speed=1, viscosity=0),
    "torque-gain-error": Signature(),
    "torque-hysteresis": Signature(sign=0),  # nothing in one reading
    "torque-zero-error": Signature(),
    "viscosity-dependent-friction": Signature(torque=1, speed=1, sign=-1),
    "windage": Signature(torque=0, speed=3, viscosity=0),
    "zero-drift": Signature(torque=0, speed=1, viscosity=0),
}


def conditions(speed_rpm=1500.0, torque=60.0, celsius=50.0):
    return {
        "worm_speed": np.atleast_1d(speed_rpm) * math.pi / 30,
        TORQUE_OUT: np.atleast_1d(torque),
        "indicated_oil_temperature": np.atleast_1d(celsius) + 273.15,
        "elapsed_time": np.full(1, 60.0),
    }


def change_of(name, quantity="indicated_power_loss", values=None, **where):
    """What an effect at its default values changes, beside the base effects."""
    without = MODEL.assemble([b for b in MODEL.base_effects if b != name])
    with_it = MODEL.assemble([*without.uses, name])
    at = conditions(**where)
    return with_it.evaluate(at, values)[quantity] - without.evaluate(at)[quantity]


def exponent(name, axis):
    """Exponent of the change over one axis, by a central difference of logarithms."""
    step = 1.02
    if axis == "torque":
        low, high = change_of(name, torque=60 / step), change_of(name, torque=60 * step)
        ratio = step**2
    elif axis == "speed":
        low, high = change_of(name, speed_rpm=1500 / step), change_of(name, speed_rpm=1500 * step)
        ratio = step**2
    else:
        low, high = change_of(name, celsius=50.5), change_of(name, celsius=49.5)
        thin, thick = (BASE.evaluate(conditions(celsius=c))["kinematic_viscosity"] for c in (50.5, 49.5))
        ratio = float((thick / thin)[0])
    return float(np.log(high / low)[0]) / math.log(ratio)


def test_every_effect_has_a_row():
    assert set(EFFECTS) == set(MODEL.effects)


RNG = np.random.default_rng(7)
ROWS = RNG.permutation(60)
GRID = {
    name: np.concatenate([axis.ravel()[ROWS], axis.ravel()[ROWS]])
    for name, axis in zip(
        ("worm_speed", TORQUE_OUT, "indicated_oil_temperature"),
        np.meshgrid(np.linspace(32, 314, 4), [0.0, 5, 20, 60, 100], [298.0, 331.0, 353.0]),
        strict=True,
    )
} | {"elapsed_time": np.arange(120) * 900.0, "oil_level": np.repeat([1.0, 0.6], 60)}


@pytest.mark.parametrize("name", EFFECTS)
def test_rules_are_kept(name):
    effect = MODEL.effects[name]
    check_effect(effect, MODEL, GRID)


@pytest.mark.parametrize("name", EFFECTS)
def test_an_engineer_learns_what_it_is(name):
    effect = MODEL.effects[name]
    assert len(effect.explanation) > 80
    assert effect.reference
    assert effect.separate_by or name in MODEL.base_effects
    for other in effect.aliases:
        assert other in MODEL.effects
    for parameter in effect.parameters.values():
        assert math.isfinite(parameter.min)
        assert math.isfinite(parameter.max)
        assert parameter.doc
        low, high = parameter.domain
        assert low <= parameter.min <= parameter.default <= parameter.max <= high


@pytest.mark.parametrize("name", [n for n, signature in EFFECTS.items() if signature.sign])
def test_the_sign_of_its_trace(name):
    assert np.sign(change_of(name)[0]) == EFFECTS[name].sign or name in (
        "temperature-bias",
        "torque-zero-error",
    )


@pytest.mark.parametrize(
    ("name", "axis"),
    [
        (n, a)
        for n, t in EFFECTS.items()
        for a in ("torque", "speed", "viscosity")
        if getattr(t, a) is not None
    ],
)
def test_exponents_of_its_trace(name, axis):
    # friction also moves the bearing loads a little: the exponents of mesh effects are not quite whole
    assert exponent(name, axis) == pytest.approx(getattr(EFFECTS[name], axis), abs=0.04)


def test_effects_commute_to_the_last_bit():
    rng = np.random.default_rng(3)
    names = list(MODEL.effects)
    first = MODEL.assemble(names).evaluate(GRID)
    for _ in range(4):
        again = MODEL.assemble(list(rng.permutation(names))).evaluate(GRID)
        for name in MODEL.quantities:
            assert np.array_equal(np.asarray(first[name]), np.asarray(again[name]), equal_nan=True), name


def test_power_is_balanced_with_all_effects():
    found = MODEL.assemble(MODEL.effects).evaluate(GRID)
    np.testing.assert_allclose(
        found["input_torque"] * GRID["worm_speed"],
        found["output_torque"] * found["wheel_speed"] + found["power_loss"],
        rtol=1e-12,
    )


# --- signatures that are no power law ----------------------------------------------------------------


def test_a_seal_is_a_zero_error_of_the_input_sensor():
    seal = MODEL.assemble([*BASE.uses, "seal-drag"]).evaluate(GRID, {"seal-drag.torque": 0.05})
    zero = MODEL.assemble([*BASE.uses, "torque-zero-error"]).evaluate(
        GRID, {"torque-zero-error.input": 0.05, "torque-zero-error.output": 0.0}
    )
    np.testing.assert_allclose(seal[TORQUE_IN], zero[TORQUE_IN], rtol=1e-13)


def test_output_zero_shifts_the_torque():
    shifted = MODEL.assemble([*BASE.uses, "torque-zero-error"]).evaluate(
        conditions(torque=61.5), {"torque-zero-error.input": 0.0, "torque-zero-error.output": 1.5}
    )
    assert shifted[TORQUE_IN] == pytest.approx(BASE.evaluate(conditions(torque=60.0))[TORQUE_IN], rel=1e-13)


def test_gains_multiply_what_the_sensors_see():
    use = [*BASE.uses, "torque-gain-error"]
    gains = {"torque-gain-error.input": 0.004, "torque-gain-error.output": 0.0}
    base = BASE.evaluate(conditions())[TORQUE_IN]
    assert MODEL.assemble(use).evaluate(conditions(), gains)[TORQUE_IN] == pytest.approx(1.004 * base)
    gains = {"torque-gain-error.input": 0.0, "torque-gain-error.output": 0.004}
    got = MODEL.assemble(use).evaluate(conditions(torque=60 * 1.004), gains)[TORQUE_IN]
    assert got == pytest.approx(base, rel=1e-13)


def test_a_biased_thermometer_is_another_temperature():
    biased = MODEL.assemble([*BASE.uses, "temperature-bias"]).evaluate(
        conditions(celsius=52.0), {"temperature-bias.bias": 2.0}
    )
    assert biased[TORQUE_IN] == pytest.approx(BASE.evaluate(conditions(celsius=50.0))[TORQUE_IN], rel=1e-13)


def test_viscosity_dependent_friction_changes_its_sign_with_temperature():
    assert change_of("viscosity-dependent-friction", celsius=30.0) < 0
    assert change_of("viscosity-dependent-friction", celsius=75.0) > 0


@pytest.mark.parametrize("exponent", [-0.5, 0.2, 1.0])
def test_load_dependent_friction_holds_the_power_law(exponent):
    """mu_0 x^a is mu_0 and a change of mu_0 (2^a - 1) when the load doubles; x is 1 at 45 N*m."""
    values = {
        "tooth-friction.mu": 0.04,
        "load-dependent-friction.change": 0.04 * (2**exponent - 1),
        "load-dependent-friction.exponent": exponent,
    }
    torque = np.array([11.25, 45.0, 90.0])
    found = MODEL.assemble(["tooth-friction", "load-dependent-friction"]).evaluate(
        conditions(torque=torque), values
    )
    assert found["friction_coefficient"] == pytest.approx(0.04 * (torque / 45) ** exponent, rel=5e-3)


def test_friction_falls_with_sliding_speed():
    low, high = (change_of("speed-dependent-friction", speed_rpm=n)[0] / n for n in (300.0, 3000.0))
    assert low > 2.5 * high
    assert 0 < exponent("speed-dependent-friction", "speed") < 0.8


def test_oil_heats_up_to_its_fixed_point_and_most_where_most_is_lost():
    found = MODEL.assemble([*BASE.uses, "oil-heating"]).evaluate(GRID, {"oil-heating.resistance": 0.05})
    np.testing.assert_allclose(
        found["contact_temperature"] - found["oil_temperature"], 0.05 * found["power_loss"], rtol=1e-9
    )
    at_low, at_high = change_of("oil-heating", torque=20.0), change_of("oil-heating", torque=80.0)
    assert abs(at_high) > 1.5 * abs(at_low)


def test_preload_is_a_straight_line_over_temperature():
    drag = [change_of("bearing-preload", celsius=c)[0] for c in (30.0, 40.0, 50.0)]
    assert drag[1] == pytest.approx(0.0, abs=1e-9)
    assert drag[2] == pytest.approx(-drag[0])
    assert drag[2] == pytest.approx(0.005 * 10 * 1500 * math.pi / 30)


def test_reduction_factors_are_the_catalogues():
    """SKF: 6009 at 3000 rpm in oil of 220 mm^2/s."""
    at = conditions(speed_rpm=3000.0, celsius=40.0)
    heated = MODEL.assemble(["inlet-shear-heating"]).evaluate(at)["bearing_rolling_moment"][0]
    starved = MODEL.assemble(["starvation"]).evaluate(at)["bearing_rolling_moment"][0]
    plain = MODEL.assemble().evaluate(at)["bearing_rolling_moment"][0]
    assert heated / plain == pytest.approx(1 / (1 + 1.84e-9 * (3000 * 60) ** 1.28 * 220**0.64))
    assert starved / plain == pytest.approx(
        math.exp(-3e-8 * 220 * 3000 * (45 + 75) * math.sqrt(3.1 / (2 * (75 - 45))))
    )


@pytest.mark.parametrize("name", ["inlet-shear-heating", "starvation"])
def test_a_share_of_the_viscous_loss_is_the_bearings(name):
    """The larger bearing of the fast shaft leads; with no share the no-load loss stays."""
    uses = ["churning", name]
    at = conditions(speed_rpm=3000.0, celsius=40.0)
    plain = MODEL.assemble(["churning"]).evaluate(at)
    for share in (0.0, 0.4):
        found = MODEL.assemble(uses).evaluate(at, {f"{name}.share": share})
        factor = found["bearing_rolling_moment"][0] / plain["bearing_rolling_moment"][0]
        assert found["no_load_loss"] == pytest.approx(plain["no_load_loss"] * (1 - share * (1 - factor)))


def test_starvation_is_worse_with_less_oil():
    low, standard = (
        MODEL.assemble(["starvation"]).evaluate({**conditions(), "oil_level": level})[
            "bearing_rolling_moment"
        ]
        for level in (0.5, 1.0)
    )
    assert np.all(low < standard)


def test_running_in_is_an_order_in_time():
    times = np.array([0.0, 5.0, 50.0]) * 3600
    at = {k: np.repeat(v, 3) for k, v in conditions().items()} | {"elapsed_time": times}
    extra = MODEL.assemble([*BASE.uses, "running-in"]).evaluate(at)[TORQUE_IN] - BASE.evaluate(at)[TORQUE_IN]
    assert extra[1] / extra[0] == pytest.approx(math.exp(-1), rel=2e-3)
    assert extra[2] < 1e-4 * extra[0]


def test_effects_over_time_need_the_time():
    assert MODEL.not_testable({"worm_speed", TORQUE_OUT}) == dict.fromkeys(
        ("running-in", "torque-hysteresis", "zero-drift"), "needs elapsed_time"
    )
    assert MODEL.not_testable({"worm_speed", TORQUE_OUT, "elapsed_time"}) == {}


def test_thermal_lag_without_times_tells_idle_runs_from_loaded_ones():
    at = {k: v for k, v in conditions(torque=np.array([0.0, 5.0, 60.0])).items() if k != "elapsed_time"}
    at = {k: np.broadcast_to(v, (3,)) for k, v in at.items()}
    found = MODEL.assemble([*BASE.uses, "thermal-lag"]).evaluate(at, {"thermal-lag.idle_offset": -11.0})
    offset = found["contact_temperature"] - found["oil_temperature"]
    assert offset == pytest.approx([-11.0, -0.021, 0.0], abs=1e-3)


def test_a_body_follows_a_ramp_late():
    """First-order lag behind a ramp of r K/s: r tau (1 - exp(-t/tau)); behind a plateau it decays."""
    time = np.linspace(0.0, 3000.0, 31)
    ramp = 300.0 + 0.01 * time
    np.testing.assert_allclose(lag(ramp, time, 600.0), -6.0 * (1 - np.exp(-time / 600.0)), rtol=1e-12)
    shuffled = np.random.default_rng(0).permutation(31)
    np.testing.assert_allclose(
        lag(ramp[shuffled], time[shuffled], 600.0), lag(ramp, time, 600.0)[shuffled], rtol=1e-12
    )
    assert np.all(lag(ramp, np.nan, 600.0) == 0)  # times not known


def test_shear_thinning_lowers_the_slope_over_speed():
    assert 0 > change_of("shear-thinning", speed_rpm=500.0) > change_of("shear-thinning", speed_rpm=3000.0)


def test_a_body_lags_behind_a_jump_and_follows_by_its_time_constant():
    """A step of the sump between two readings of one time: the body is colder by the step, then exp(-t / tau) of it."""
    from specan.worm_gear.model.effects.oil import lag

    time = np.array([0.0, 600.0, 600.0, 1200.0, 2400.0])
    sump = np.array([50.0, 50.0, 60.0, 60.0, 60.0])
    expected = -10.0 * np.exp(-np.array([0.0, 600.0, 1800.0]) / 900.0)
    np.testing.assert_allclose(lag(sump, time, 900.0), [0.0, 0.0, *expected], rtol=1e-12)


def test_a_body_lags_behind_a_long_ramp_by_slope_times_time_constant():
    from specan.worm_gear.model.effects.oil import lag

    time = np.linspace(0.0, 36000.0, 61)
    np.testing.assert_allclose(lag(20.0 + 0.002 * time, time, 900.0)[-1], -0.002 * 900.0, rtol=1e-6)


@pytest.mark.parametrize(
    ("thrown_off", "power"),
    [
        (0.0, 1.0),
        (0.5, 0.17 / 1.17),
        (0.67, 0.0),
    ],  # (0.67 - s) / (0.67 + s) of the viscosity, over that of the speed
)
def test_a_mesh_starves_with_speed_and_oil_as_full_film_over_supplied_film_says(thrown_off, power):
    """Oil that is twice as thick acts as a speed higher by the factor 2^power."""
    rest = {"oil_level": 1.0, "rise": 0.05, "speed": 5.0, "thrown_off": thrown_off, "sharpness": 3.0}
    equation = flanks.mesh_starvation.function
    thick = equation(4.0, 2 * flanks.REFERENCE_VISCOSITY, level_exponent=1.0, **rest)
    fast = equation(4.0 * 2**power, flanks.REFERENCE_VISCOSITY, level_exponent=1.0, **rest)
    assert thick == pytest.approx(fast)
    full = 0.8 ** (0.67 + thrown_off)
    dry = 1 - (1 + full**3) ** (-1 / 3)
    assert equation(4.0, flanks.REFERENCE_VISCOSITY, level_exponent=1.0, **rest) == pytest.approx(0.05 * dry)
