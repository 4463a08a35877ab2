"""Laws for unknown effects: the law that was built in comes back, noise gives none, files can be added."""

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from specan.errors import RequestError
from specan.models import Model
from specan.study.estimation.fit import fit
from specan.study.evidence.law_search import Spread, formulas, search_laws
from specan.study.history import History
from specan.study.observation.table import TableObservation
from specan.study.propose import source_of
from specan.study.selection.candidates import base_problem
from specan.study.selection.refits import Refit
from specan.study.user_effects import write_beside_older
from specan_cli.main import main


def torque(load, speed, stiffness, drag):
    """Torque of a machine."""
    return stiffness * load + drag * speed


def machine(hidden, seed=1, noise=0.02, side=9, correlated=False):
    load, speed = (g.ravel() for g in np.meshgrid(np.linspace(1, 12, side), np.geomspace(0.5, 20, side)))
    rng = np.random.default_rng(seed)
    measured = torque(load, speed, 1.3, 0.4) + hidden(load, speed) + noise * rng.standard_normal(load.size)
    model = Model.from_function(
        torque,
        conditions={"load": ("N", 1, 12), "speed": ("rad/s", 0.5, 20)},
        observables={"torque": ("N*m", noise)},
        parameters={"stiffness": (1.0, 0.1, 5), "drag": (1.0, 0.01, 5)},
    )
    table = {"load": load, "speed": speed}
    covariance = np.diag(np.full(load.size, noise**2)) + (noise**2 / 4 if correlated else 0.0)
    names = np.full(load.size, "torque")
    observed = TableObservation("machine", names, measured, table, covariance, labels=table)
    problem = base_problem(model, [observed])
    return Refit(frozenset(), problem, fit(problem, starts=2))


LAWS = {
    "exponential of speed": (lambda f, n: 0.8 * np.exp(-n / 3), (3.0,)),
    "exponential growth of load": (lambda f, n: 0.3 * np.expm1((f - 1) / 3), (3.0,)),
    "saturation of speed": (lambda f, n: 2.0 * n / (n + 1.5), (1.5,)),
    "power of load, power of speed": (lambda f, n: 0.02 * f**2 / np.sqrt(n), None),
}


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("correlated", [pytest.param(False, marks=pytest.mark.long), True])
def test_the_law_that_was_built_in_is_proposed(law: str, correlated: bool) -> None:
    hidden, shapes = LAWS[law]
    found = search_laws(machine(hidden, correlated=correlated))
    families = [", ".join(one.formula.family) for one in found.laws]
    assert law in families
    assert len(families) <= 4
    assert found.noise < 1e-6
    if shapes is not None:
        mine = next(one for one in found.laws if ", ".join(one.formula.family) == law)
        assert mine.shapes == pytest.approx(shapes, rel=0.15)


@pytest.mark.long
def test_noise_gives_no_law() -> None:
    found = [search_laws(machine(lambda f, n: 0 * f, seed, side=6)) for seed in range(12)]
    assert not any(one.laws for one in found)
    # What is said with so much less than certainty is wrong less often than that.
    assert np.mean([one.noise for one in found]) > 0.5


def test_what_the_model_can_do_itself_is_no_law() -> None:
    found = search_laws(machine(lambda f, n: 0.7 * n))
    assert found.laws == ()


def test_too_few_rows_are_told() -> None:
    with pytest.raises(RequestError, match="9 rows are too few"):
        search_laws(machine(lambda f, n: 0 * f, side=3))


def test_every_formula_says_the_same_in_numpy_and_in_its_file() -> None:
    x = {"load": np.linspace(0, 5, 11), "speed": np.linspace(-3, 3, 11)}
    spreads = [Spread.of("load", "N", x["load"]), Spread.of("speed", "rad/s", x["speed"])]
    assert None not in spreads
    many = formulas([s for s in spreads if s is not None], relative=True)
    assert {f.factors[0].family for f in many} >= {
        "power",
        "signed power",
        "exponential growth",
        "signed saturation",
    }
    for formula in many:
        shapes = next(iter(formula.scan()))
        names = {s.name: v for s, v in zip(formula.shapes, shapes)}
        code = " * ".join(f"({f.code})" for f in formula.factors)
        with np.errstate(all="ignore"):
            theirs = eval(code, {"np": np, **x, **names})
            assert np.allclose(formula.value(x, shapes), theirs, rtol=1e-5, equal_nan=True), code


def test_files_are_written_and_added(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SPECAN_CONFIG_DIR", str(tmp_path / "config"))
    monkeypatch.chdir(tmp_path)
    start = machine(LAWS["saturation of speed"][0])
    o = start.problem.observations[0]
    rows = [f"{f},{n},{y}" for f, n, y in zip(o.conditions["load"], o.conditions["speed"], o.measured)]
    Path("t.csv").write_text("load [N],speed [rad/s],torque [N*m]\n" + "\n".join(rows))
    Path("m.py").write_text(
        "from specan.models import Model\ndef torque(load, speed, stiffness, drag):\n"
        "    return stiffness * load + drag * speed\n"
        "model = Model.from_function(torque, conditions={'load': ('N', 1, 12), 'speed': ('rad/s', 0.5, 20)},\n"
        "    observables={'torque': ('N*m', 0.02)},"
        " parameters={'stiffness': (1.0, 0.1, 5), 'drag': (1.0, 0.01, 5)})\n"
    )
    for words in (
        "study new s --model m.py --measurement t.csv",
        "study propose s",
        "study diagnose s",
        "study add s s/laws/law-saturation-speed.py",
    ):
        done = CliRunner().invoke(main, words.split(), catch_exceptions=False, standalone_mode=False)
        if "propose" in words:
            assert "law-saturation-speed: torque + size x speed / (speed + speed_width)" in done.stdout
    assert "law-saturation-speed.speed_width" in done.stdout
    assert "after" in done.stdout
    led_to = History(Path("s")).steps[-1].diagnosis  # of the model before the law was known
    assert led_to
    assert led_to["verdict"] == "unknown-effect"
    CliRunner().invoke(main, ["study", "drop", "s", "law-saturation-speed"], catch_exceptions=False)
    known = {path.name for path in Path("s/effects").iterdir()}  # the law that was tried, and its rivals
    assert known == {path.name for path in Path("s/laws").iterdir()}


def test_a_file_that_was_changed_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "law-power-x.py"
    for text in ("first\n", "first\n", "second\n"):
        write_beside_older(path, text.encode())
    assert path.read_text() == "second\n"
    kept = [p for p in tmp_path.iterdir() if p != path]
    assert [p.read_text() for p in kept] == ["first\n"]


def test_a_file_holds_units_and_the_fitted_values() -> None:
    law = search_laws(machine(LAWS["exponential of speed"][0])).laws[0]
    text = source_of(law, "mine", 102)
    assert 'neutral={"size": 0.0}' in text
    assert f'size=Parameter({law.size:.6g}, "N*m"' in text
    assert '"rad/s"' in text
