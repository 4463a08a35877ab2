"""The graph of quantities: order, loops, effects that commute, axes, collections."""

from dataclasses import replace

import numpy as np
import pytest

from specan.errors import ComputationError, RequestError
from specan.models import (
    Condition,
    Model,
    Observable,
    Parameter,
    Use,
    check_effect,
    constant,
    effect,
    quantity,
)
from specan.models.catalogue import effects_from_file
from specan.models.quantity import rig_statement


@quantity(unit="Pa*s")
def viscosity(temperature, cold_viscosity):
    "Viscosity of the oil."
    return cold_viscosity * np.exp(-0.03 * temperature)


@quantity(unit="K")
def temperature(sump):
    "Temperature of the oil film."
    return sump


@quantity(unit="W")
def loss(speed, viscosity, *, drag=Parameter(2.0, "W", min=0.0, max=10.0)):
    "Power loss."
    return drag * viscosity * speed**2


@quantity(unit="1", axes=("wall",))
def admittance(speed):
    "Admittance of each wall."
    return np.zeros((2, np.size(speed)))


@quantity(unit="1", collection=True)
def sources():
    "Sources of sound."
    return ()


@effect("seal", adds_to="loss", neutral={"torque": 0.0})
def seal(speed, *, torque=Parameter(0.3, "N*m", min=0.0, max=2.0, lower=-1.0)):
    "A seal."
    return torque * speed


@effect("heating", adds_to="temperature", neutral={"resistance": 0.0})
def heating(loss, *, resistance=Parameter(0.05, "K/W", min=0.0, max=0.5)):
    "The loss heats the oil."
    return resistance * loss


@effect("thick", scales="viscosity", neutral={"by": 1.0})
def thick(*, by=Parameter(1.2, min=0.5, max=2.0)):
    "Thicker oil."
    return by


@effect("soft", adds_to="admittance", at="wall", neutral={"beta": 0.0})
def soft(speed, *, beta=Parameter(0.1, min=0.0, max=1.0)):
    "A soft wall."
    return beta * np.ones_like(speed)


@effect("port", joins="sources", neutral={"size": 0.0})
def port(*, size=Parameter(0.1, min=0.0, max=1.0)):
    "A second source."
    return ("port", size)


def build(*effects):
    return Model(
        "toy",
        "a toy",
        {"speed": Condition("speed", "rad/s", "speed"), "sump": Condition("sump", "K", "sump", default=20.0)},
        {
            q.name: q
            for q in (
                loss,
                viscosity,
                temperature,
                admittance,
                sources,
                constant("cold_viscosity", 2.0, "Pa*s", ""),
            )
        },
        {e.name: e for e in effects},
        {"loss": Observable("loss", "loss", "W", "")},
        axes={"wall": ("a", "b")},
    )


ALL = (seal, heating, thick, soft, port)
SPEED = {"speed": np.array([1.0, 2.0, 5.0])}


def test_base_value_is_the_equation():
    value = build().assemble().evaluate(SPEED)["loss"]
    np.testing.assert_allclose(value, 2.0 * 2.0 * np.exp(-0.6) * SPEED["speed"] ** 2, rtol=1e-15)


def test_terms_are_scaled_after_they_are_added():
    model = build(seal, effect("half", scales="loss", neutral={"by": 1.0})(_half))
    got = model.assemble(["half", "seal"]).evaluate(SPEED)
    base = model.assemble().evaluate(SPEED)["loss"]
    np.testing.assert_allclose(got["loss"], 0.5 * (base + 0.3 * SPEED["speed"]), rtol=1e-15)
    assert set(got.contributions("loss")) == {"base", "seal", "half"}


def _half(*, by=Parameter(0.5, min=0.0, max=2.0)):
    "Half of everything."
    return by


def test_a_loop_is_solved_to_its_fixed_point():
    got = build(*ALL).assemble(["heating"]).evaluate(SPEED)
    np.testing.assert_allclose(got["temperature"], 20.0 + 0.05 * got["loss"], rtol=1e-11)
    np.testing.assert_allclose(
        got["loss"], 4.0 * np.exp(-0.03 * got["temperature"]) * SPEED["speed"] ** 2, rtol=1e-11
    )


def test_a_loop_without_fixed_point_is_an_error():
    runaway = effect("runaway", adds_to="temperature", neutral={"by": 0.0})(_runaway)
    with pytest.raises(ComputationError, match="temperature"):
        build(runaway).assemble(["runaway"]).evaluate(SPEED)


def _runaway(loss, *, by=Parameter(-50.0, "K/W", lower=-99.0)):
    "Cooling that grows with the loss without end."
    return by * loss - 1.0


def test_effects_commute_to_the_last_bit():
    names = ["seal", "heating", "thick", "soft@a", "port"]
    model = build(*ALL)
    first = model.assemble(names).evaluate(SPEED)
    second = model.assemble(names[::-1]).evaluate(SPEED)
    for name in model.quantities:
        assert np.array_equal(np.asarray(first[name], dtype=object), np.asarray(second[name], dtype=object))


def test_an_effect_acts_at_one_element_and_joins_a_collection():
    got = build(*ALL).assemble(["soft@b", "port"]).evaluate(SPEED)
    np.testing.assert_array_equal(got["admittance"], [[0, 0, 0], [0.1, 0.1, 0.1]])
    assert got["sources"] == (("port", 0.1),)


def test_a_second_copy_has_its_own_parameters():
    assembly = build(*ALL).assemble(["seal", "seal@2"])
    assert {"seal.torque", "seal@2.torque"} <= set(assembly.parameters)
    got = assembly.evaluate(SPEED, {"seal.torque": 0.0, "seal@2.torque": 1.0})
    base = build(*ALL).assemble().evaluate(SPEED)
    np.testing.assert_allclose(got["loss"] - base["loss"], SPEED["speed"])
    assert str(Use.parse("wall@z1@3")) == "wall@z1@3"


@pytest.mark.parametrize("one", [seal, heating, thick])
def test_check_effect_passes_sound_effects(one):
    check_effect(one, replace(build(seal), base_effects=("seal",)), SPEED)


def test_check_effect_names_an_effect_that_nothing_measured_sees():
    with pytest.raises(RequestError, match=r"parameter soft@a\.beta, which changes nothing"):
        check_effect(soft, build(), SPEED)


def test_check_effect_sees_a_false_neutral_value():
    bad = effect("bad", adds_to="loss", neutral={"by": 1.0})(_bad)
    with pytest.raises(RequestError, match="neutral"):
        check_effect(bad, build(), SPEED)


def _bad(speed, *, by=Parameter(2.0, lower=0.0, upper=9.0)):
    "Not neutral at one."
    return by * speed


def test_unknown_names_offer_the_nearest():
    with pytest.raises(RequestError, match="did you mean 'seal'"):
        build(*ALL).assemble(["seel"])
    with pytest.raises(RequestError, match="did you mean 'viscosity'"):
        build(effect("x", adds_to="viscsity", neutral={"by": 1.0})(_half))
    with pytest.raises(RequestError, match="one of a, b"):
        build(*ALL).assemble(["soft@c"])


def test_effects_say_what_data_they_need():
    model = build(effect("drift", adds_to="loss", neutral={"by": 0.0}, needs=("elapsed_time",))(_bad))
    assert model.not_testable({"speed"}) == {"drift": "needs elapsed_time"}


def test_a_users_file_is_loaded_and_its_faults_are_named(tmp_path):
    good = tmp_path / "mine.py"
    good.write_text(
        "from specan.models import Parameter, effect\n"
        "@effect('mine', adds_to='loss', neutral={'c': 0.0})\n"
        "def mine(speed, *, c=Parameter(0.1, 'N*m', min=0, max=1)):\n"
        "    'My own effect.'\n"
        "    return c * speed\n"
    )
    [mine] = effects_from_file(good)
    check_effect(mine, build(), SPEED)
    (tmp_path / "bad.py").write_text("def broken(:\n")
    with pytest.raises(RequestError, match="line 1"):
        effects_from_file(tmp_path / "bad.py")
    (tmp_path / "none.py").write_text("x = 1\n")
    with pytest.raises(RequestError, match="no effect"):
        effects_from_file(tmp_path / "none.py")


def test_validity_ranges_intersect():
    one = effect("one", adds_to="loss", neutral={"by": 0.0}, valid={"speed": (0, 60, "rpm")})(_bad)
    two = effect("two", adds_to="loss", neutral={"by": 0.0}, valid={"speed": (1, 99, "rad/s")})(_bad)
    low, high = build(one, two).assemble(["one", "two"]).validity["speed"]
    assert (low, high) == (1.0, pytest.approx(2 * np.pi))


def test_an_evaluation_goes_on_from_another_one():
    calls = []

    @quantity(unit="W")
    def dear(speed):
        "Costs much."
        calls.append(1)
        return 3.0 * speed

    @quantity(unit="W")
    def shown(dear, loss):
        "What is read off."
        return dear + loss

    plain = build(*ALL)
    quantities = {**plain.quantities, "dear": dear, "shown": shown}
    model = Model("toy", "", plain.conditions, quantities, plain.effects, plain.observables, axes=plain.axes)
    assembly = model.assemble(["seal", "heating"])
    step = {"seal.torque": 0.9}
    first, again = assembly.evaluate_many(SPEED, [{}, step])
    kept = np.array([0.1, 0.2, 0.3])  # a value of an array that stays what it is
    one, same = assembly.evaluate_many(SPEED, [{"seal.torque": kept}, {"seal.torque": kept}])
    np.testing.assert_array_equal(one["shown"], same["shown"])
    assert len(calls) == 2  # of two beginnings
    whole = assembly.evaluate(SPEED, step)
    for name in ("shown", "temperature", "loss"):
        np.testing.assert_array_equal(again[name], whole[name])
    assert not np.array_equal(again["shown"], first["shown"])


def test_an_effect_vanishes_where_its_first_parameter_is_zero():
    def drag(speed, *, size=Parameter(0.3, lower=0.0), power=Parameter(2.0, min=1.0, max=3.0)):
        """Drag."""
        return size * speed**power

    assert effect("drag", adds_to="loss")(drag).neutral == {"size": 0.0}
    with pytest.raises(RequestError, match="neutral at power = 0"):
        effect("drag", adds_to="loss", neutral={"power": 0.0})(drag)


@pytest.mark.parametrize("ends", [[10], [1, 2, 3], 5, ["low", 3], [[1, 2], 3]])
def test_limits_that_are_not_two_numbers_are_refused(ends):
    with pytest.raises(RequestError, match=r"\[limits\] gives load.*expected two numbers"):
        rig_statement({"limits": {"load": ends}}, [Condition("load", "N", "Load.", "load", "N")], [])
