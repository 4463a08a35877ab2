"""A verdict comes for models and tables of every kind, and nothing beside it costs it."""

import numpy as np
import pandas as pd
import pytest
from open_tables import read_tables

from specan import Study
from specan.errors import ComputationError
from specan.models import Condition, Model, Parameter, effect
from specan.study.diagnose import diagnose
from specan.study.estimation.fit import fit
from specan.study.evidence import diagnosis as telling
from specan.study.selection.candidates import base_problem

NOISE = 0.1


def force(x, a):
    return a * x


@effect("knee", adds_to="force", neutral={"height": 0.0, "rate": 0.0})
def knee(x, *, height=Parameter(4.0, "N", min=0.5, max=20, lower=0),
         rate=Parameter(0.1, "1/mm^2", min=0.01, max=1, lower=0)):  # fmt: skip
    """Either of its sizes alone changes nothing: its slopes are zero where it vanishes."""
    return height * (1 - np.exp(-rate * x**2))


@effect("offset", adds_to="force", neutral={"size": 0.0})
def offset(x, *, size=Parameter(1.0, "N", min=-5, max=5)):
    """Forces read with an offset."""
    return size + 0 * x


def model(*effects, limits=(0, 10), unit="mm"):
    return Model.from_function(
        force, conditions={"x": (unit, *limits)}, observables={"force": ("N", NOISE)},
        parameters={"a": (2.0, 0.5, 5, f"N/{unit}")}, effects=effects,
    )  # fmt: skip


def problem(place, model, x, y, seed=1):
    rows = [f"{a:.6f},{b:.4f}" for a, b in zip(x, y + np.random.default_rng(seed).normal(0, NOISE, x.size))]
    (place / "t.csv").write_text("\n".join(["x,force", *rows]) + "\n", encoding="utf-8")
    return base_problem(model, read_tables(model, [place / "t.csv"]).fitted)


def test_an_effect_without_a_slope_where_it_vanishes_is_found(tmp_path) -> None:
    x = np.repeat(np.linspace(1, 10, 10), 3)
    found = diagnose(problem(tmp_path, model(offset, knee), x, 2 * x + 6 * (1 - np.exp(-0.05 * x**2))))
    assert found.effects == ("knee",)
    assert found.ranking[0].parameters["knee.height"]["value"] == pytest.approx(6, abs=0.5)


@effect("bend", adds_to="force", neutral={"size": 0.0})
def bend(x, *, size=Parameter(0.1, "N", min=-5, max=5)):
    """An offset that goes with the square of its size."""
    return size**2 + 0 * x


def test_the_smallest_size_seen_is_that_of_the_effect_at_that_size(tmp_path) -> None:
    x = np.repeat(np.linspace(1, 10, 10), 3)
    sizes = diagnose(problem(tmp_path, model(offset, bend), x, 2 * x)).smallest_visible
    assert sizes["bend"]["value"] ** 2 == pytest.approx(sizes["offset"]["value"], rel=0.2)


@effect("snap", adds_to="force", neutral={"size": 0.0})
def snap(x, *, size=Parameter(0.1, "N", min=-5, max=5)):
    """A ten-thousandth of the noise, however large it is."""
    return 1e-5 * np.tanh(1e3 * size) + 0 * x


def test_an_effect_that_does_not_grow_has_no_smallest_size(tmp_path) -> None:
    found = diagnose(problem(tmp_path, model(snap), np.linspace(1, 10, 30), 2 * np.linspace(1, 10, 30)))
    assert found.smallest_visible == {"snap": None}


@pytest.mark.parametrize("rows", [900, 1200])
def test_a_dense_table_of_one_condition_has_a_verdict(tmp_path, rows) -> None:
    x = np.linspace(50, 100, rows)
    y = 2 * x + np.where((x > 80) & (x < 90), 3, 0)
    found = diagnose(problem(tmp_path, model(offset, limits=(0, 100)), x, y))
    assert found.verdict == "unknown-effect"
    assert found.next_measurement


def test_a_time_that_goes_on_by_itself_is_nothing_to_set(tmp_path) -> None:
    x = np.linspace(1, 10, 60)
    found = diagnose(problem(tmp_path, model(offset, unit="s"), x, 2 * x + np.where(x > 7, x - 7, 0)))
    assert found.verdict == "unknown-effect"
    assert found.next_measurement == ()


@pytest.mark.long
def test_six_conditions_with_limits_have_proposals_in_little_time_and_memory(tmp_path) -> None:
    names = "uvwxyz"

    @effect("square", adds_to="load", neutral={"size": 0.0})
    def square(u, *, size=Parameter(0.1, "N/mm^2", min=0, max=1)):
        """A square."""
        return size * u**2

    @effect("product", adds_to="load", neutral={"size": 0.0})
    def product(u, v, *, size=Parameter(0.1, "N/mm^2", min=0, max=1)):
        """A product, the same along the diagonal."""
        return size * u * v

    def load(u, v, w, x, y, z, a):
        return a * (u + v + w + x + y + z)

    made = Model.from_function(
        load, conditions={n: Condition(n, "mm", n, n, "mm") for n in names}, observables={"load": ("N", NOISE)},
        parameters={"a": (2.0, 0.5, 5, "N/mm")}, effects=[square, product],
    )  # fmt: skip
    made = made.with_rig({"limits": {n: [0, 10] for n in names}})
    random = np.random.default_rng(1)
    points = np.column_stack([np.linspace(1, 5, 40)] * 2 + list(random.uniform(1, 10, (4, 40))))
    read = 2 * points.sum(axis=1) + 0.1 * points[:, 0] ** 2 + random.normal(0, NOISE, 40)
    rows = [",".join(f"{v:.5f}" for v in (*row, y)) for row, y in zip(points, read, strict=True)]
    (tmp_path / "t.csv").write_text("\n".join(["u,v,w,x,y,z,load", *rows]) + "\n", encoding="utf-8")
    found = diagnose(base_problem(made, read_tables(made, [tmp_path / "t.csv"]).fitted))
    assert found.verdict == "group"
    best = found.next_measurement[0]["conditions"]
    assert abs(best["u"] - best["v"]) > 5  # u^2 and u v differ most where u and v do


def test_what_fails_beside_a_verdict_is_a_remark(tmp_path, monkeypatch) -> None:
    def fails(*given, **more):
        raise ValueError("need at least one array to concatenate")

    for module, name in ((telling, "pulls"), (telling, "localise"), (telling.verdict, "error_fall")):
        monkeypatch.setattr(module, name, fails)
    x = np.repeat(np.linspace(1, 10, 10), 3)
    found = diagnose(problem(tmp_path, model(offset), x, 2 * x + 1.5))
    assert found.effects == ("offset",)
    assert sum("could not be computed" in remark for remark in found.remarks) >= 4


def test_a_model_without_candidates_has_a_verdict(tmp_path) -> None:
    x = np.repeat(np.linspace(1, 10, 10), 3)
    assert diagnose(problem(tmp_path, model(), x, 2 * x)).verdict == "nothing-missing"
    assert diagnose(problem(tmp_path, model(), x, 2 * x + 0.05 * x**2)).verdict == "unknown-effect"


def test_a_fit_that_does_not_settle_is_a_remark(tmp_path, monkeypatch) -> None:
    from specan.study.estimation import fit as fitting
    from specan.study.estimation.levenberg_marquardt import NotSettledError, descend

    def given_up(problem, start):
        raise NotSettledError(descend(problem, start), 25)

    x = np.repeat(np.linspace(1, 10, 10), 3)
    asked = problem(tmp_path, model(offset), x, 2 * x + 1.5)
    monkeypatch.setattr(fitting, "descend", given_up)
    monkeypatch.setattr(fitting, "_exact", given_up)
    base = fit(asked)
    assert not base.converged
    found = diagnose(asked, base=base)
    assert found.effects == ("offset",)
    assert any("did not converge" in remark for remark in found.remarks)
    monkeypatch.setattr(fitting, "descend", lambda *given: (_ for _ in ()).throw(ComputationError("nowhere")))
    monkeypatch.setattr(fitting, "_exact", fitting.descend)
    with pytest.raises(ComputationError, match="nowhere"):
        fit(asked)


@pytest.mark.parametrize(
    ("y", "verdict", "words"),
    [
        # an effect that is a hundred times what the model predicts, and no candidate's
        (lambda x: 300 * x**2, "unknown-effect", "the model does not fit, and no"),
        (
            lambda x: 2 * x + np.random.default_rng(3).normal(0, 5, x.size),
            "nothing-missing",
            "with the declared uncertainty the model does not fit",
        ),
    ],
)
def test_a_model_that_is_far_off_is_not_said_to_fit(tmp_path, y, verdict, words) -> None:
    x = np.linspace(0.2, 10, 40)
    found = diagnose(problem(tmp_path, model(offset), x, y(x)))
    assert found.verdict == verdict
    assert words in found.reason


def test_readings_in_the_steps_of_a_converter_are_no_copies(tmp_path) -> None:
    rng = np.random.default_rng(2)
    x = np.repeat(np.linspace(1, 1.5, 10), 12)  # readings at different conditions overlap
    steps = 0.03 * np.round((2 * x + rng.normal(0, NOISE, x.size)) / 0.03)  # 3.3 steps to a deviation
    lines = [f"{a:.4f},{b:.4f}" for a, b in zip(x, steps + rng.choice([0.0, 1e-4], x.size))]
    (tmp_path / "t.csv").write_text("\n".join(["x,force", *lines]) + "\n", encoding="utf-8")
    found = diagnose(base_problem(model(offset), read_tables(model(offset), [tmp_path / "t.csv"]).fitted))
    assert found.verdict == "nothing-missing", found.reason


@pytest.mark.parametrize(
    ("rows", "words"), [(2, "2 measured values for 2 parameters"), (3, "3 measured values")]
)
def test_rows_that_a_straight_line_goes_through_tell_nothing(tmp_path, rows, words) -> None:
    """Two points make a line: no chi-square is shown, and none that is no number."""

    def force(x, a, b):
        return a * x + b

    line = Model.from_function(
        force,
        conditions={"x": ("mm", 0, 10)},
        observables={"force": ("N", 0.02)},
        parameters={"a": (2, 1, 5), "b": (0, -1, 1)},
    )
    x = np.arange(1.0, rows + 1)
    study = Study.new(tmp_path / "s", line, pd.DataFrame({"x": x, "force": 2 * x + 0.3}))
    assert study.diagnose().reason.startswith(words)
    assert "nan" not in study.compare().summary()


@effect("square", adds_to="force", neutral={"size": 0.0})
def square(u, *, size=Parameter(0.1, "N/V^2", min=0, max=1)):
    "A square."
    return size * u**2


def test_a_condition_may_have_the_name_of_a_column(tmp_path) -> None:
    """A voltage u beside the uncertainty u: neither is lost in the rows or the figures."""

    def force(u, a):
        return a * u

    drive = Model.from_function(
        force,
        conditions={"u": ("V", 0, 10)},
        observables={"force": ("N", 0.1)},
        parameters={"a": (2, 1, 5)},
        effects=[square],
    )
    u = np.linspace(1, 9, 8)
    study = Study.new(tmp_path / "s", drive, pd.DataFrame({"u": u, "force": 2 * u}))
    rows = study.compare().residuals
    np.testing.assert_allclose(rows["u (condition)"], u)
    np.testing.assert_allclose(rows["u"], 0.1)
    study.add("square").plot()


def test_a_value_at_the_end_of_its_domain_is_said(tmp_path) -> None:
    """A slope of 2.1 N/mm where 1.9 to 2.0 is allowed; an offset of up to 1 N is no relative error."""

    def force(x, a, b):
        return a * x + b

    line = Model.from_function(
        force,
        conditions={"x": ("mm", 0, 10)},
        observables={"force": ("N", 0.02)},
        parameters={"a": (2, 1.9, 2.0), "b": (0, -0.05, 0.05)},
    )
    x = np.linspace(0.5, 9, 12)
    study = Study.new(tmp_path / "s", line, pd.DataFrame({"x": x, "force": 2.1 * x + 0.1}))
    assert [pull.text for pull in study.diagnose().pulls] == [
        "force.a = 2, known 1.9 to 2, at the end of its domain",
        "force.b = 0.05, known -0.05 to 0.05, at the end of its domain",
    ]
