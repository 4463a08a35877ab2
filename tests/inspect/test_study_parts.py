"""Parts of the page of a study that need no browser."""

import re
import shutil
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

pytest.importorskip("bokeh")

from specan.errors import InputError, RequestError
from specan.inspect.plots import outline
from specan.inspect.study_views.ranking import Ranking, uses_of
from specan.inspect.trial import KeptStudy, as_it_is, try_effects
from specan.inspect.work import Superseded, heard
from specan.report.residual_map import failing_map
from specan.study.edit import add_effect
from specan.study.estimation.fit import describe, fit
from specan.study.observation import Strategy
from specan.study.observation.frf import FrfObservation
from specan.study.selection.candidates import candidates
from specan.study.study import Study
from specan.study.verdict import Diagnosis, Ranked
from specan_cli.main import main
from specan_cli.study_new import command as study_new

GEAR = Path(__file__).parents[2] / "sample_data" / "worm_gear"


def go_on(part: float) -> bool:
    return True


@pytest.fixture(scope="module")
def begun(tmp_path_factory) -> Path:
    place = tmp_path_factory.mktemp("studies")
    for name in ("rig.toml", "table_8_loaded.csv"):
        shutil.copy(GEAR / name, place)
    arguments = ["--model", "worm-gear", "--rig", str(place / "rig.toml")]
    arguments += ["--measurement", str(place / "table_8_loaded.csv")]
    result = CliRunner().invoke(study_new, [str(place / "s"), *arguments], catch_exceptions=False)
    assert result.exit_code == 0
    return place


@pytest.fixture
def directory(begun, tmp_path) -> Path:
    shutil.copytree(begun, tmp_path / "own")
    return tmp_path / "own" / "s"


# --- trying ---------------------------------------------------------------------------------------


@pytest.mark.long
def test_trying_is_what_adding_finds_and_writes_nothing(directory):
    study = Study(directory)
    before = {p.name: p.read_bytes() for p in directory.iterdir() if p.is_file()}
    now = as_it_is(study)
    trial = try_effects(study, ["load-dependent-friction"])
    assert trial.fit.chi2 < now.fit.chi2
    assert [row[0] for row in trial.parameters.rows] == [
        n for n in trial.fit.names if n.startswith("load-dependent-friction.")
    ]
    assert {p.name: p.read_bytes() for p in directory.iterdir() if p.is_file()} == before
    added = add_effect(study, "load-dependent-friction")
    assert trial.errors[0].rms == pytest.approx(added.after.fit_error["value"], rel=1e-3)


@pytest.mark.long
def test_trying_an_effect_on_order_lines_finds_the_minimum_that_adding_finds(tmp_path):
    """An error planted in a planet's position: it leaves the noise, 1e-4 m/s^2, and not another minimum."""
    rig = str(Path(__file__).parents[2] / "sample_data" / "planetary_gear" / "rig.toml")
    runs = []
    for seed, torque in ((1, 15), (2, 60)):
        runs += ["--measurement", str(tmp_path / f"run_{torque}.tdms")]
        planted = ["--effects", "planet-position-error@P2=0.3", "--noise", "1e-4", "--seed", str(seed)]
        setting = ["--set", f"operation.carrier_torque_Nm={torque}", "--duration", "8", "-o", runs[-1]]
        main(["simulate", "planetary-gear", rig, *planted, *setting], standalone_mode=False)
    place = tmp_path / "s"
    main(
        ["study", "new", str(place), "--model", "planetary-gear", "--rig", rig, *runs], standalone_mode=False
    )
    trial = try_effects(Study(place), ["planet-position-error@P2"])
    assert trial.errors[0].rms < 1e-4
    added = add_effect(Study(place), "planet-position-error@P2")
    assert trial.errors[0].rms == pytest.approx(added.after.fit_error["value"], rel=1e-6)


def test_several_effects_are_tried_together_and_unknown_ones_refused(directory):
    study = Study(directory)
    assert try_effects(study, ["seal-drag", "windage"]).name == "seal-drag with windage"
    with pytest.raises(RequestError, match="nonsense"):
        try_effects(study, ["nonsense"])
    _, not_testable = candidates(study.problem)
    name, why = next(iter(not_testable.items()))
    with pytest.raises(RequestError, match=why):
        try_effects(study, [name])


# --- one study for all windows --------------------------------------------------------------------


def test_a_study_is_opened_again_only_when_somebody_changed_it(directory):
    kept = KeptStudy(Study(directory))
    first, now = kept.current(), kept.now()
    assert kept.current() is first
    assert kept.now() is now
    add_effect(Study(directory), "seal-drag", "by the command")
    assert "seal-drag" in kept.current().model_effects
    assert kept.now() is not now
    assert len(kept.current().history.steps) == 2


def test_a_study_whose_data_change_or_vanish_says_so(directory):
    kept = KeptStudy(Study(directory))
    table = directory.parent / "table_8_loaded.csv"
    table.write_text(table.read_text() + "\n")
    with pytest.raises(RequestError, match="changed"):
        kept.current()
    table.unlink()
    with pytest.raises(InputError, match="cannot be reached"):
        kept.current()


@pytest.mark.long
def test_a_diagnosis_is_made_once_and_ends_when_nobody_waits(directory):
    kept = KeptStudy(Study(directory))
    heard_of = []
    with pytest.raises(Superseded):
        kept.diagnosis(lambda part: False, heard_of.append)
    assert heard_of == []
    found = kept.diagnosis(go_on, heard_of.append)
    assert found.alternatives
    assert any("fitting with" in text for text in heard_of)
    said: list[str] = []
    assert KeptStudy(Study(directory)).diagnosis(go_on, said.append) == found
    assert said == []  # it was on the disk


# --- candidates -----------------------------------------------------------------------------------


def ranked(*names: str, plausible: bool = True) -> Ranked:
    size = {"value": 1.0, "low": 0.5, "high": 1.5, "unit": "m", "plausible": True, "at_bound": True}
    parameters = {f"{n}.size": size for n in names}
    bare = tuple(n.partition("@")[0] for n in names)
    return Ranked(
        effects=bare, at={}, probability=0.9, ln_evidence=12.0, error_after=0.1,
        parameters=parameters, plausible=plausible, at_bound=False,
    )  # fmt: skip


@dataclass
class Known:
    """A model whose effects can be looked up."""

    explanation: str = "It <b>rubs</b>."
    separate_by: str = "more speeds"
    reference: str = "a book"
    model: object = None
    effects: dict = field(default_factory=dict)


def known(*names: str) -> Known:
    study = Known()
    study.model = study
    study.effects = {n: Known() for n in names}
    return study


def test_places_and_copies_of_a_candidate_are_those_of_its_parameters():
    assert uses_of(ranked("wall-impedance@z1", "microphone-gain@Mic 2")) == (
        "wall-impedance@z1",
        "microphone-gain@Mic 2",
    )


def test_candidates_stand_in_the_order_of_the_diagnosis():
    pressed = []
    one = Ranking(pressed.append)
    study = known("a", "b", "c", "d")
    one.show(study, ["a", "b", "c", "d"], {"e": "needs a load"}, None)
    first = [row.children[0].name for row in one.list.children[:4]]
    assert first == ["try-a", "try-b", "try-c", "try-d"]
    rows = [ranked("c"), ranked("b"), ranked("a", plausible=False)]
    found = Diagnosis("group", "", alternatives=(("c",), ("b",)), ranking=tuple(rows))
    line = one.list.children[2]
    one.show(study, ["a", "b", "c", "d"], {"e": "needs a load"}, found)
    shown = [getattr(c, "children", [c])[0] for c in one.list.children]
    assert [getattr(w, "name", None) or w.text for w in shown] == [
        "<b><small>Supported by the data, not distinguished: remaining error, probability</small></b>",
        "try-c", "try-b",
        "<b><small>Not plausible: remaining error, probability</small></b>",
        "try-a",
        "<b><small>Not supported by the data</small></b>",
        "try-d",
        shown[-1].text,
    ]  # fmt: skip
    assert one.list.children[1] is line  # the same widgets: those of before would stay in the browser
    assert "opacity" in one.list.children[4].styles
    assert "opacity" not in one.list.children[1].styles
    assert "needs a load" in shown[-1].text
    one.explain(("c",))
    assert "It &lt;b&gt;rubs&lt;/b&gt;." in one.explanation.text
    assert re.findall("0.5|1.5|at its bound", one.explanation.text) == ["0.5", "1.5", "at its bound"]


def test_each_of_many_candidates_has_its_line():
    names = [f"effect-{k}" for k in range(60)]
    one = Ranking(lambda uses: None)
    one.show(known(*names), names, {}, None)
    assert [line.children[0].name for line in one.list.children] == [f"try-{name}" for name in names]


# --- small parts ----------------------------------------------------------------------------------


def test_a_band_has_a_gap_where_an_end_is_missing():
    low = np.array([0.0, 0.0, np.nan, 0.0, -np.inf])
    x, y = outline(np.arange(5.0), low, np.ones(5))
    assert np.array_equal(x, [0, 1, 1, 0, np.nan, 3, 3], equal_nan=True)
    assert np.array_equal(y, [0, 0, 1, 1, np.nan, 0, 1], equal_nan=True)
    assert outline(np.arange(2.0), np.full(2, np.nan), np.ones(2))[0].size == 0


def test_reading_is_told_and_can_be_ended():
    from specan.data.recording import ArraySource, Channel, Recording

    channel = Channel("Mic", "G", unit="Pa", sampling_rate=1000.0, n_samples=1000)
    one = Recording("a.tdms", (channel,), ArraySource([np.arange(1000.0)]))
    parts = []
    telling = heard(one, lambda part: parts.append(part) or True)
    for _ in telling.blocks((channel,), 250):
        pass
    assert parts == [0.25, 0.5, 0.75, 1.0]
    with pytest.raises(Superseded):
        list(heard(one, lambda part: False).blocks((channel,), 250))


# --- recordings -----------------------------------------------------------------------------------


def measured_room():
    """Two microphones over a few lines; only what the page looks at."""
    from specan.study.observation.frf import FrfObservation

    f = np.arange(100.0, 140.0)
    response = np.stack([3 * np.exp(-0.1j * f), 5 * np.exp(-0.2j * f)])
    parts = {
        "name": "a.tdms", "channels": ("Mic 1", "Mic <b>2</b>"), "frequency_hz": f, "response": response,
        "kept": np.ones((2, f.size), dtype=bool), "noise": np.full((2, f.size), 0.05),
        "shared": np.zeros((2, f.size, 1), dtype=complex),
    }  # fmt: skip
    one = object.__new__(FrfObservation)
    for name, value in parts.items():
        object.__setattr__(one, name, value)
    return one


@dataclass
class Tried:
    """A fit that was made."""

    problem: object
    predictions: list
    uses: tuple = ()
    reduced_chi2: float = 2.0

    @property
    def fit(self):
        return self

    @property
    def name(self) -> str:
        return " with ".join(self.uses)


def test_a_tried_effect_stands_beside_the_model_as_it_is_and_the_measurement():
    from types import SimpleNamespace

    from specan.inspect.study_views.agreement import TransferAgreement

    one = measured_room()
    problem = SimpleNamespace(observations=[one])
    model = SimpleNamespace(observables={"frf": SimpleNamespace(unit="Pa*s/m")})
    view = TransferAgreement(SimpleNamespace(data=SimpleNamespace(fitted=[one]), model=model))

    def stacked(factors):
        scaled = np.array(factors)[:, None] * one.response
        return [np.concatenate([scaled.real.ravel(), scaled.imag.ravel()])]

    view.show(Tried(problem, stacked([1.0, 2.0])))
    magnitude, _, error = (view.plots.plots[key] for key in sorted(view.plots.plots))

    def names():
        return list(magnitude.source.data["name"])

    # The microphone that the model misses most is shown first; its name is text.
    assert view.microphones.value == ["0/Mic <b>2</b>"]
    assert names() == ["Mic <b>2</b> measured", "Mic <b>2</b> model"]
    level = magnitude.source.data["y"]
    assert level[1] - level[0] == pytest.approx(20 * np.log10(2) * np.ones(40))
    low, high = (f(magnitude._shades.data["y"][0]) for f in (np.nanmin, np.nanmax))
    assert low == pytest.approx(20 * np.log10(5 * 0.98))
    assert high == pytest.approx(20 * np.log10(5 * 1.02))
    view.show(Tried(problem, stacked([1.0, 1.0]), ("leak@x0",)))
    assert names()[1:] == ["Mic <b>2</b> model", "Mic <b>2</b> model before"]
    assert error.source.data["y"][1] == pytest.approx(np.zeros(40), abs=1e-12)
    assert error.source.data["y"][2] == pytest.approx(-20 * np.log10(2) * np.ones(40))
    view.show(Tried(problem, stacked([1.0, 3.0]), ("scatterer",)))  # before is still the model as it is
    assert error.source.data["y"][2] == pytest.approx(-20 * np.log10(2) * np.ones(40))
    view.microphones.value = ["0/Mic 1", "0/Mic <b>2</b>"]
    assert len(names()) == 6
    view.show(Tried(problem, stacked([1.0, 1.0])))
    assert not any("before" in name for name in names())


# --- figures --------------------------------------------------------------------------------------


def test_the_map_says_that_nothing_is_significant(directory):
    study = Study(directory)
    found = as_it_is(study).where
    assert found is not None
    first = next((i, j) for i, row in enumerate(found.blocks) for j, cell in enumerate(row) if cell)

    def marked(*places):
        rows = [
            tuple(tuple(replace(b, significant=(i, j) in places) for b in cell) for j, cell in enumerate(row))
            for i, row in enumerate(found.blocks)
        ]
        return failing_map(replace(found, blocks=tuple(rows)), True)

    assert "no significant deviation" in marked()
    shown = marked(first)
    assert "framed: significant" in shown
    assert shown.count("outline:2px") == 1
    assert shown.count("outline:1px") == np.isfinite(found.z).sum() - 1


RESONATOR = """
import numpy as np
from specan.models import Frf, Model

def x(frequency, f0, loss):
    return 1 / (1 - (frequency / f0) ** 2 + 1j * loss)

model = Model.from_function(
    x, conditions={"frequency": ("Hz", 5, 60)}, observables={"x": Frf("um/N", response="x", reference="force")},
    parameters={"f0": (30, 10, 50, "Hz"), "loss": (0.05, 0.001, 0.2, "1")},
)
"""


def test_the_page_shows_the_fit_that_compare_shows(tmp_path, monkeypatch):
    """Where another than the best one is shown: as where instruments would be bent far beyond their certificates."""
    (tmp_path / "m.py").write_text(RESONATOR, encoding="utf-8")
    f = np.arange(10.0, 50.0)
    rows = [f"{a};{b.real};{b.imag};0.1" for a, b in zip(f, 1 / (1 - (f / 31) ** 2 + 0.04j), strict=True)]
    header = "frequency [Hz];x re [um/N];x im [um/N];x u [um/N]"
    (tmp_path / "t.csv").write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    arguments = ["--model", str(tmp_path / "m.py"), "--measurement", str(tmp_path / "t.csv")]
    result = CliRunner().invoke(study_new, [str(tmp_path / "s"), *arguments], catch_exceptions=False)
    assert result.exit_code == 0
    monkeypatch.setattr(FrfObservation, "strategy", Strategy(frugal=True))
    study = Study(tmp_path / "s")
    vars(study)["shown"] = describe(study.problem, study.problem.start({}))
    assert as_it_is(study).fit.reduced_chi2 == study.shown.reduced_chi2
    assert fit(study.problem).reduced_chi2 < study.shown.reduced_chi2 / 2


def test_a_figure_that_a_model_brings_is_drawn_of_the_model_as_it_is():
    from types import SimpleNamespace

    from matplotlib.figure import Figure

    from specan.inspect.study_views.agreement import DrawnAgreement

    drawn = []
    view = DrawnAgreement(lambda study: drawn.append(study) or Figure(), lambda: "now")
    view.show(SimpleNamespace(uses=()))
    view.show(SimpleNamespace(uses=("backlash",)))
    assert drawn == ["now"]
    assert 'src="data:image/png' in view.body.child.text
