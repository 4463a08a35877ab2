"""A recording of force and displacement, four lines of a spring-mass-damper, and the missing term in three commands."""

import json

import numpy as np
import pytest
from click.testing import CliRunner
from nptdms import ChannelObject, TdmsWriter

from specan.inspect.study_views.agreement import agreement_of
from specan.study.study import Study
from specan_cli.main import main
from tests.rates.runge_kutta import displacement, halves

MODEL = '''"""A mass on a spring."""
import numpy as np
from specan.models import Model, Parameter, Signal, State, effect


def spring(x, stiffness): return stiffness * x
def damper(v, damping): return damping * v
def dx(v): return v
def dv(force, spring, damper, mass): return (force - spring - damper) / mass


@effect("cubic-spring", adds_to="spring", neutral={"size": 0.0})
def cubic(x, *, size=Parameter(1e7, "N/m^3", min=1e5, max=1e9, lower=-1e10, upper=1e10)):
    """A spring that hardens."""
    return size * x**3


@effect("dry-friction", adds_to="damper", neutral={"size": 0.0})
def dry(v, *, size=Parameter(1, "N", min=0.1, max=20, lower=0, upper=100)):
    """Friction that knows only the direction."""
    return size * np.tanh(v / 1e-3)


model = Model.from_rates(
    dx, dv, spring, damper, states={"x": State("m"), "v": State("m/s")}, inputs={"force": "N"},
    observables={"x": Signal("mm", 0.05)},
    parameters={"stiffness": (1e4, 1e3, 1e5, "N/m"), "damping": (20, 1, 200, "N*s/m"), "mass": (1, 0.1, 10, "kg")},
    units={"spring": "N", "damper": "N"}, effects=[cubic, dry],
)
'''

TERMS = {
    "cubic-spring": lambda x, v: 3e6 * x**3,
    "dry-friction": lambda x, v: 2.0 * np.tanh(v / 1e-3),
    "": lambda x, v: 0.0,
}


def recording(path, seed, term):
    """Force in N and displacement in mm of an oscillator with a term of its own; noise of 0.05 mm."""
    rng, rate, n = np.random.default_rng(seed), 500.0, 1500
    lines = 2 * np.pi * np.arange(2, 40, 0.33)
    phase = rng.uniform(0, 2 * np.pi, lines.size)
    push = np.cos(np.outer(halves(rate, n, 16), lines) + phase).sum(axis=1)
    push *= 30 / np.std(push[::32])
    x = displacement(push, rate, 16, lambda f, x, v: (f - 1.1e4 * x - 15 * v - term(x, v)) / 1.2)
    force, x = push[::32], 1e3 * x + 0.05 * rng.standard_normal(n)
    told = {"wf_increment": 1 / rate}
    with TdmsWriter(path) as writer:
        writer.write_segment(
            [ChannelObject("run", "force", force, told | {"unit_string": "N"}),
             ChannelObject("run", "x", x, told | {"unit_string": "mm"})]
        )  # fmt: skip


def run(*words):
    found = CliRunner().invoke(main, [str(w) for w in words])
    assert found.exit_code == 0, found.output
    return found.stdout


@pytest.mark.parametrize(
    "term", [one if one == "dry-friction" else pytest.param(one, marks=pytest.mark.long) for one in TERMS]
)
def test_named_and_error_falls_elsewhere(tmp_path, term):
    recording(tmp_path / "run.tdms", 1, TERMS[term])
    recording(tmp_path / "again.tdms", 2, TERMS[term])
    (tmp_path / "osc.py").write_text(MODEL)
    study = tmp_path / "study"
    run("study", "new", study, "--model", tmp_path / "osc.py", "--measurement", tmp_path / "run.tdms",
        "--validation", tmp_path / "again.tdms", "--hold-out", "time=2..2.4")  # fmt: skip
    found = json.loads(run("study", "diagnose", study, "--json"))
    if not term:
        assert found["verdict"] == "nothing-missing"
        return
    assert (found["verdict"], found["alternatives"]) == ("effect", [[term]])
    run("study", "add", study, term)
    last = json.loads((study / "history.jsonl").read_text().splitlines()[-1])
    before = json.loads((study / "history.jsonl").read_text().splitlines()[0])
    assert last["held_out_error"]["value"] < 0.06 < 0.1 < before["held_out_error"]["value"]
    size = last["parameters"][f"{term}.size"]
    truth = {"cubic-spring": 3e6, "dry-friction": 2.0}[term]
    assert size["value"] == pytest.approx(truth, rel=0.05)
    known = Study(study)
    (on_the_page,) = agreement_of(known, lambda: known)  # the samples over time
    assert on_the_page.abscissa.options == [("time", "Time / s")]
