"""Groups of rows - specimens, days - by which parameters may differ."""

import json

import numpy as np
import pytest
from click.testing import CliRunner
from open_tables import read_tables

from specan.errors import InputError, RequestError
from specan.models import Model, Parameter, effect
from specan.study.diagnose import diagnose
from specan.study.estimation.fit import fit
from specan.study.selection.candidates import base_problem
from specan_cli.main import main

SLOPES = {"No. 1": 2.0, "No. 2": 2.3, "No. 3": 1.9}  # N/mm
NOISE = 0.1


def force(stretch, slope, preload):
    return slope * stretch + preload


@effect("hardening", adds_to="force", neutral={"cubic": 0})
def hardening(stretch, *, cubic=Parameter(0.01, "N/mm^3", min=1e-4, max=0.1, lower=-1, upper=1)):
    return cubic * stretch**3


def spring(slope=(2.0, 0.5, 5.0, "N/mm"), **more):
    return Model.from_function(
        force, conditions={"stretch": ("mm", 0, 10)}, observables={"force": ("N", NOISE)},
        parameters={"slope": slope, "preload": (1.0, 0, 5, "N")}, effects=[hardening], **more,
    )  # fmt: skip


def table(path, slopes=SLOPES, preload=1.2, seed=1, header="specimen"):
    random, lines = np.random.default_rng(seed), [f"stretch,force,{header}"]
    for name, slope in slopes.items():
        for x in range(1, 10):
            lines.append(f"{x},{slope * x + preload + NOISE * random.standard_normal():.4f},{name}")
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def test_the_verdict_is_that_a_parameter_differs(tmp_path):
    model = spring(groups="specimen")
    found = diagnose(base_problem(model, read_tables(model, [table(tmp_path / "t.csv")]).fitted))
    assert (found.verdict, found.effects) == ("effect", ("slope-differs-between-specimens",))
    values = found.ranking[0].parameters
    # standard uncertainty of a slope over 9 readings of 0.1 N with the preload shared: about 0.009 N/mm
    for name, true in (("No__2", 0.3), ("No__3", -0.1)):
        assert values[f"slope-differs-between-specimens.{name}"]["value"] == pytest.approx(true, abs=0.03)


def test_a_parameter_that_a_function_only_passes_on_may_differ_as_well(tmp_path):
    def force(stretch, rate, preload):
        return rate * stretch + preload

    def rate(slope):
        return slope

    model = Model.from_function(
        force, rate, conditions={"stretch": ("mm", 0, 10)}, observables={"force": ("N", NOISE)},
        units={"rate": "N/mm"}, groups="specimen",
        parameters={"slope": (2.0, 0.5, 5.0, "N/mm"), "preload": (1.0, 0, 5, "N")},
    )  # fmt: skip
    found = diagnose(base_problem(model, read_tables(model, [table(tmp_path / "t.csv")]).fitted))
    assert found.effects == ("slope-differs-between-specimens",)


@pytest.mark.parametrize("seed", range(4))
def test_nothing_differs_where_specimens_are_alike(tmp_path, seed):
    model = spring(groups="specimen")
    path = table(tmp_path / "t.csv", dict.fromkeys(SLOPES, 2.0), seed=seed)
    found = diagnose(base_problem(model, read_tables(model, [path]).fitted))
    assert found.verdict == "nothing-missing"


def test_one_value_for_each_specimen(tmp_path):
    model = spring(Parameter(2.0, "N/mm", min=0.5, max=5, per="specimen"), groups=("specimen",))
    best = fit(base_problem(model, read_tables(model, [table(tmp_path / "t.csv")]).fitted))
    for name, true in zip(("No__1", "No__2", "No__3"), SLOPES.values(), strict=True):
        assert best.values[f"slope.{name}"] == pytest.approx(true, abs=0.03)
    # the same by least squares over all rows at once
    rows = np.loadtxt(tmp_path / "t.csv", delimiter=",", skiprows=1, usecols=(0, 1))
    design = np.zeros((27, 4))
    for k in range(3):
        design[9 * k : 9 * k + 9, k] = rows[9 * k : 9 * k + 9, 0]
    design[:, 3] = 1
    exact = np.linalg.lstsq(design, rows[:, 1], rcond=None)[0]
    found = [best.values[f"slope.{n}"] for n in ("No__1", "No__2", "No__3")] + [best.values["preload.value"]]
    np.testing.assert_allclose(found, exact, rtol=1e-5)


def test_an_effect_with_a_size_for_each_specimen(tmp_path):
    @effect("offset", adds_to="force", neutral={"size": 0})
    def offset(*, size=Parameter(0.5, "N", min=-3, max=3, per="specimen")):
        return size

    random, lines = np.random.default_rng(3), ["stretch,force,specimen"]
    for name, shift in (("A", 0.0), ("B", 1.5)):
        lines += [
            f"{x},{2 * x + 1 + shift + NOISE * random.standard_normal():.4f},{name}" for x in range(1, 10)
        ]
    (tmp_path / "t.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    model = Model.from_function(
        lambda stretch, slope=2.0: slope * stretch + 1, conditions={"stretch": ("mm", 0, 10)},
        observables={"force": ("N", NOISE)}, parameters={"slope": Parameter(2.0, fixed=True)}, effects=[offset],
        groups="specimen",
    )  # fmt: skip
    problem = base_problem(model, read_tables(model, [tmp_path / "t.csv"]).fitted).with_uses(["offset"])
    best = fit(problem)
    assert best.values["offset.size_A"] == pytest.approx(0, abs=0.1)
    assert best.values["offset.size_B"] == pytest.approx(1.5, abs=0.1)


@pytest.fixture
def place(tmp_path, monkeypatch):
    monkeypatch.setenv("SPECAN_CONFIG_DIR", str(tmp_path / "config"))
    monkeypatch.chdir(tmp_path)
    (tmp_path / "spring.py").write_text(
        "from specan.models import Model\n\n"
        "def force(stretch, slope, preload):\n    return slope * stretch + preload\n\n"
        "model = Model.from_function(force, conditions={'stretch': ('mm', 0, 10)}, observables={'force': ('N', 0.1)},\n"
        "    parameters={'slope': (2.0, 0.5, 5, 'N/mm'), 'preload': (1.0, 0, 5, 'N')})\n",
        encoding="utf-8",
    )
    table(tmp_path / "t.csv")
    return tmp_path


def run(*words):
    done = CliRunner().invoke(main, [str(w) for w in words], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return done.output


NEW = ["study", "new", "s", "--model", "spring.py", "--measurement", "t.csv"]


@pytest.mark.long
def test_declared_in_the_study(place):
    said = run(*NEW, "--group", "specimen")
    assert "specimen: 3 groups of rows, No. 1, No. 2, No. 3" in said
    assert 'groups = ["specimen"]' in (place / "s" / "study.toml").read_text("utf-8")
    assert "fails at No. 2 (specimen)" in run("study", "compare", "s", "--plot", "c.png")
    assert "Missing: slope-differs-between-specimens" in run("study", "diagnose", "s")
    assert json.loads(run("study", "next", "s", "--json"))["next_measurement"] == []  # nothing is open
    added = run("study", "add", "s", "slope-differs-between-specimens")
    assert "slope-differs-between-specimens.No__2" in added
    run("study", "report", "s", "-o", "r.html")
    assert "fits" in run("study", "compare", "s")


def test_a_specimen_can_be_put_aside(place):
    said = json.loads(run(*NEW, "--group", "specimen", "--hold-out", "specimen=No. 3", "--json"))
    assert (said["fitted_values"], said["held_out_values"]) == (18, 9)
    with pytest.raises(RequestError, match=r"no row has specimen = No\. 7.*one of No\. 1"):
        CliRunner().invoke(main, [*NEW[:2], "u", *NEW[3:], "--group", "specimen", "--hold-out", "specimen=No. 7"],
                           catch_exceptions=False)  # fmt: skip


def test_a_file_for_each_specimen(place):
    model = spring(groups="specimen")
    from specan.study.data.open_tables import open_data
    from specan.study.observation import DataFile, MeasuredFiles

    files = []
    for name, slope in SLOPES.items():
        path = place / f"{name[-1]}.csv"
        path.write_text("stretch,force\n" + "".join(f"{x},{slope * x + 1.2:.3f}\n" for x in range(1, 10)))
        files.append(DataFile(path.name, path, conditions={"specimen": name}))
    (found,) = open_data(model, MeasuredFiles(files)).fitted
    assert found.groups == {"specimen": tuple(SLOPES)}
    assert found.labels["specimen"][[0, 9, 18]].tolist() == list(SLOPES)


def test_without_the_column_it_is_said(place):
    (place / "t.csv").write_text("stretch,force\n1,2\n2,4\n3,6\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"the column 'specimen' is missing.*--column \"specimen=HEADER\""):
        CliRunner().invoke(main, [*NEW, "--group", "specimen"], catch_exceptions=False)
    assert not (place / "s").exists()
    table(place / "t.csv", header="sample [-]")
    assert "3 groups" in run(*NEW, "--group", "specimen", "--column", "specimen=sample [-]")


def test_what_is_no_group(place):
    with pytest.raises(
        RequestError, match=r"declared per 'batch', which is not a group.*groups=\(\"batch\",\)"
    ):
        spring(Parameter(2.0, per="batch"))
    with pytest.raises(RequestError, match="'stretch' is a group and something else"):
        spring(groups="stretch")
