"""A heat exchanger whose outlet is read in degrees Celsius: a percentage of it depends on where zero is."""

import numpy as np
import pandas as pd
import pytest

import specan
from specan.errors import InputError, RequestError
from specan.models import Model, Reading

FLOW, INLET = (v.ravel() for v in np.meshgrid([0.2, 0.5, 1.0, 2.0], [30.0, 50.0, 80.0]))
COOLING = (INLET - 18) * (1 - np.exp(-0.6 / FLOW))
READ = pd.DataFrame({"flow": FLOW, "inlet": INLET, "outlet": INLET - COOLING})


def outlet(inlet, cooling):
    return inlet - cooling


def cooling(flow, inlet, ambient, strength):
    return (inlet - ambient) * (1 - np.exp(-strength / flow))


def exchanger(reading=("degC", 0.05)) -> Model:
    return Model.from_function(
        outlet, cooling, conditions={"flow": ("l/s", 0.1, 3), "inlet": ("degC", 20, 90)},
        observables={"outlet": reading}, units={"cooling": "K"},
        parameters={"ambient": (15.0, 0, 30, "degC"), "strength": (0.5, 0.1, 3, "l/s")},
    )  # fmt: skip


def test_the_model_may_be_wrong_by_a_share_of_the_temperature_drop(tmp_path) -> None:
    study = specan.Study(exchanger(Reading("degC", 0.05, discrepancy=("cooling", 2))), READ)
    (table,) = study.opened.data.fitted
    assert table.parts["discrepancy"] == pytest.approx(0.02 * COOLING, rel=1e-3)


def test_a_share_of_the_outlet_says_from_which_zero(tmp_path) -> None:
    model = exchanger().with_rig({"uncertainty": {"model_discrepancy_percent": 2}})
    study = specan.Study(model, READ)
    (table,) = study.opened.data.fitted
    assert table.parts["discrepancy"] == pytest.approx(0.02 * READ["outlet"], rel=1e-3)  # in degrees Celsius
    assert any("2 % of the outlet from 0 °C" in said for said in study.assumptions)
    with pytest.raises(RequestError, match=r"expected \[limits\] and \[uncertainty\]; put it below one"):
        exchanger().with_rig({"model_discrepancy_percent": 2})


def test_a_frame_that_is_refused_is_not_in_the_way_of_the_next(tmp_path) -> None:
    place = tmp_path / "study"
    place.mkdir()
    (place / "notes.txt").write_text("mine", encoding="utf-8")
    for where in (place, tmp_path / "other"):
        with pytest.raises(InputError, match=r"unknown column 'out'"):
            specan.Study.new(where, exchanger(), READ.rename(columns={"outlet": "out"}))
        assert specan.Study.new(where, exchanger(), READ).diagnose().verdict == "nothing-missing"
    assert (place / "notes.txt").read_text(encoding="utf-8") == "mine"
    with pytest.raises(RequestError, match="holds a study already"):
        specan.Study.new(place, exchanger(), READ)
