"""A table whose lines hold several observables: each of them counts, and is told."""

import json

import numpy as np
import pytest
from click.testing import CliRunner

from specan_cli.main import main

MODEL = """
from specan.models import Model, Parameter, effect
def force(x, a): return a * x
def heat(x, b): return b * x**2
@effect("extra", adds_to="heat", neutral={"size": 0.0})
def extra(x, *, size=Parameter(1.0, "W/mm", min=-9, max=9)):
    "Heat that grows with x."
    return size * x
@effect("stiffer", adds_to="force", neutral={"size": 0.0})
def stiffer(x, *, size=Parameter(1.0, "N/mm^2", min=-9, max=9)):
    "Force that grows faster."
    return size * x**2
model = Model.from_function(
    force, heat, conditions={"x": ("mm", 0, 10)}, observables={"force": ("N", 0.1), "heat": ("W", 0.1)},
    parameters={"a": (2.0, 0.5, 5, "N/mm"), "b": (1.0, 0.1, 5, "W/mm^2")}, effects=[extra, stiffer],
)
"""


def run(*words: object) -> str:
    found = CliRunner().invoke(main, [str(w) for w in words])
    assert found.exit_code == 0, (found.output, found.exception)
    return found.output


@pytest.fixture
def table(tmp_path):
    """Two observables over ten places, one value of the second missing; the second lacks an effect."""
    random, x = np.random.default_rng(1), np.linspace(1, 10, 10)
    force, heat = np.stack([2 * x, x**2 + 0.8 * x]) + random.normal(0, 0.1, (2, 10))
    lines = [f"{a},{f:.3f},{h:.3f}" for a, f, h in zip(x, force, heat, strict=True)]
    lines[3] = lines[3].rpartition(",")[0] + ","
    (tmp_path / "two.py").write_text(MODEL, encoding="utf-8")
    (tmp_path / "t.csv").write_text("x,force,heat\n" + "\n".join(lines) + "\n", encoding="utf-8")
    return tmp_path, x, force, np.delete(heat, 3)


def test_every_observable_of_a_line_is_fitted_and_told(table) -> None:
    place, x, force, heat = table
    said = run("study", "new", place / "s", "--model", place / "two.py", "--measurement", place / "t.csv")
    assert "19 values to fit (10 of force, 9 of heat)" in said
    assert "RMS of force" in said
    assert "RMS of heat" in said
    compared = json.loads(run("study", "compare", place / "s", "--json"))
    a = float(x @ force / (x @ x))  # least squares in closed form
    square = np.delete(x, 3) ** 2
    b = float(square @ heat / (square @ square))
    values = {name: row["value"] for name, row in compared["parameters"].items()}
    assert values == pytest.approx({"force.a": a, "heat.b": b}, rel=1e-3)


def test_what_the_second_observable_lacks_is_found_and_its_error_told(table) -> None:
    place = table[0]
    run("study", "new", place / "s", "--model", place / "two.py", "--measurement", place / "t.csv")
    found = json.loads(run("study", "diagnose", place / "s", "--json"))
    assert found["effects"] == ["extra"]
    assert found["error"]["others"][0]["after"]["observable"] == "heat"
    said = run("study", "diagnose", place / "s")
    assert "Error (RMS of force)" in said
    assert "Error (RMS of heat)" in said
    added = run("study", "add", place / "s", "extra", "--because", "asked for")
    assert "heat" in added
    assert "0.04464 W" in run("study", "history", place / "s")


def test_an_effect_is_no_better_for_readings_that_scatter_more_under_it(table) -> None:
    """No likelihood ratio is above that of the best fits: least squares of the force, with its square and without."""
    place, x, force, _ = table
    alone = MODEL.replace("effects=[extra, stiffer]", "effects=[stiffer]")
    (place / "two.py").write_text(alone, encoding="utf-8")
    run("study", "new", place / "s", "--model", place / "two.py", "--measurement", place / "t.csv")
    (row,) = json.loads(run("study", "diagnose", place / "s", "--json"))["ranking"]
    left = [np.linalg.lstsq(base.T, force)[1][0] / 0.1**2 for base in (x[None], np.stack([x, x**2]))]
    assert row["ln_evidence"] < 0.5 * (left[0] - left[1]) + 0.5
