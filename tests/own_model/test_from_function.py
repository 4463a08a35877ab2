"""A model of plain functions: units as declared, shared parameters, named parts for effects."""

import functools
import subprocess
import sys

import numpy as np
import pytest

from specan.errors import RequestError
from specan.models import Model, Parameter, effect, quantity
from specan.models.catalogue import example_model, example_rig, load_model, model_names


def outlet(flow, inlet, ua, wall, cp):
    return wall + (inlet - wall) * np.exp(-ua / (flow * cp))


def ua(flow, cp, transfer):
    return transfer * cp * flow**0


HEAT = {
    "conditions": {"flow": ("kg/min", 1, 10), "inlet": ("degC", 20, 80)},
    "observables": {"outlet": ("degC", 0.1)},
    "parameters": {"transfer": (2.0, 0.1, 10), "wall": {"value": 15.0, "vary": False, "unit": "degC"}, "cp": 4.18},
}  # fmt: skip


def test_functions_receive_the_declared_units():
    model = Model.from_function(outlet, ua, **HEAT)
    found = model.assemble().evaluate({"flow": np.array([2.0]), "inlet": np.array([55.0])})
    assert found["outlet"] == pytest.approx(15 + 40 * np.exp(-2.0 / 2.0))
    assert model.assemble().parameters["outlet.wall"].fixed


def test_a_parameter_of_two_functions_is_one_parameter():
    assert set(Model.from_function(outlet, ua, **HEAT).assemble().parameters) == {
        "cp.value", "outlet.wall", "ua.transfer",
    }  # fmt: skip


def test_an_effect_acts_on_a_part_with_a_name_in_declared_units():
    @effect("fouling", scales="ua", neutral={"layer": 0.0})
    def fouling(flow, *, layer=Parameter(5.0, "mm", min=0.1, max=9, lower=0, upper=10)):
        "Dirt insulates."
        return 1 / (1 + layer * flow)

    model = Model.from_function(outlet, ua, effects=[fouling], **HEAT)
    found = model.assemble(["fouling"]).evaluate({"flow": np.array([2.0]), "inlet": np.array([55.0])})
    assert found["ua"] == pytest.approx(2 * 4.18 / (1 + 5.0 * 2.0))  # 5, not 0.005


def test_starting_values_in_the_signature_are_parameters():
    model = Model.from_function(
        lambda x, slope=2.0, offset=1.0: offset + slope * x, conditions={"x": "s"}, observables={"y": "m"}
    )
    assert model.assemble().evaluate({"x": np.array([3.0])})["y"] == pytest.approx(7.0)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"parameters": {"wall": 15.0}}, "'outlet' reads 'cp', which is not a condition and no parameter"),
        ({"parameters": {"wall": "warm"}}, "the parameter 'wall' is 'warm'"),
        ({"observables": {"outlet": "furlung"}}, "the observable 'outlet'.*furlung"),
        ({"observables": {"outlet": "K"}, "units": {"outlet": "degC"}}, "is in K, its function in degC"),
        ({"conditions": {"flow": 3}}, "the condition 'flow' is 3; expected a unit"),
    ],
)
def test_what_cannot_be_is_refused(change, said):
    with pytest.raises(RequestError, match=said):
        Model.from_function(outlet, ua, **{**HEAT, **change})


@pytest.mark.parametrize("name", model_names())
def test_a_rig_template_is_a_rig_file(tmp_path, name):
    from specan.models.catalogue import read_rig_file
    from specan.models.describe import rig_template

    (tmp_path / "rig.toml").write_text(rig_template(example_model(name), example_rig(name)), encoding="utf-8")
    found = load_model(name, read_rig_file(tmp_path / "rig.toml"))
    assert found.rig == example_model(name).rig


@pytest.mark.long
def test_a_function_that_numba_keeps_on_disk_is_found_again(tmp_path):
    pytest.importorskip("numba")
    path = tmp_path / "kept.py"
    path.write_text(
        "import numba\nfrom specan.models import Model\n@numba.njit(cache=True)\ndef inner(x, a):\n    return a * x\n"
        "def force(x, a):\n    return inner(x, a)\n"
        'model = Model.from_function(force, conditions={"x": ("mm", 0, 10)}, observables={"force": "N"}, '
        'parameters={"a": 2.0})\n',
        encoding="utf-8",
    )
    asked = (
        "import sys; from specan.models.catalogue import load_model; "
        "print(load_model(sys.argv[1], {}).assemble().evaluate({'x': 2.0})['force'])"
    )
    for _ in range(2):  # compiled, then read from the disk by another process
        done = subprocess.run(
            [sys.executable, "-c", asked, path], capture_output=True, text=True, check=False
        )
        assert done.stdout.strip() == "4.0", done.stderr


def test_an_effect_over_a_compiled_function_acts_as_the_function_that_was_compiled():
    def air(speed, *, size=Parameter(1.0, "N*m", min=0.0, max=9.0)):
        return size * speed**2

    class Compiled:
        """As numba wraps a function."""

        def __init__(self, function):
            functools.update_wrapper(self, function)

        def __call__(self, *values, **named):
            return self.__wrapped__(*values, **named)

    made = effect("air", adds_to="torque", neutral={"size": 0.0})(Compiled(air))
    model = Model.from_function(
        lambda speed, drag=2.0: drag * speed, conditions={"speed": ("1", 0, 5)}, observables={"torque": "N*m"},
        effects=[made],
    )  # fmt: skip
    assert model.assemble(["air"]).evaluate({"speed": np.array([3.0])})["torque"] == pytest.approx(2 * 3 + 9)


@pytest.mark.parametrize("thing", [np.sin, functools.partial(outlet, 3), 3])
def test_what_is_no_function_of_python_is_refused(thing):
    for declare in (
        effect("air", adds_to="torque", neutral={"size": 0.0}),
        quantity(unit="N"),
        lambda f: Model.from_function(f, conditions={"x": "1"}, observables={"sin": "N"}),
    ):
        with pytest.raises(RequestError, match=f"'{type(thing).__name__}' is not a function of Python"):
            declare(thing)


@pytest.mark.parametrize("table", ["uncertianty", "limit", "gear"])
def test_a_table_of_a_rig_that_nothing_reads_is_refused(table):
    model = Model.from_function(outlet, ua, **HEAT)
    assert model.with_rig({"uncertainty": {"outlet": 0.3}}).rig.reading == {"outlet": 0.3}
    with pytest.raises(RequestError, match=f"the rig has '{table}', which this model does not read"):
        model.with_rig({table: {"outlet": 0.3}})


def test_a_loaded_model_is_no_name():
    with pytest.raises(RequestError, match=r"not the name of a model.*load_model\(NAME, rig\)"):
        load_model(Model.from_function(outlet, ua, **HEAT), rig={})


def test_a_long_text_in_a_rig_file_names_no_file(tmp_path):
    from specan.models.catalogue import read_rig_file

    (tmp_path / "rig.toml").write_text(f'[about]\nwhat = "{"word " * 80}"\n', encoding="utf-8")
    assert read_rig_file(tmp_path / "rig.toml") == {"about": {"what": "word " * 80}}
