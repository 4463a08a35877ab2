"""``model check`` and ``simulate`` with a recording, and what is said of mistakes in a model of rates."""

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline

import specan
from specan import shelf
from specan.errors import RequestError
from specan.models import Model, Signal, State
from specan.models.march import as_cubics
from specan_cli.main import main
from tests.rates.test_solver import damper, dv, dx, oscillator, response, spring
from tests.rates.test_three_commands import MODEL, recording


def run(*words):
    found = CliRunner().invoke(main, [str(w) for w in words])
    return found.output + str(found.exception or "")


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    found = tmp_path_factory.mktemp("rates")
    recording(found / "run.tdms", 1, lambda x, v: 0.0)
    (found / "osc.py").write_text(MODEL)
    return found


def checked(place, old="", new=""):
    (place / "changed.py").write_text(MODEL.replace(old, new))
    return run("model", "check", place / "changed.py", "--measurement", place / "run.tdms")


def test_a_model_passes_with_a_recording(place):
    said = checked(place)
    assert "finite at 1500 samples" in said
    assert "determines each parameter: dv.mass, spring.stiffness, damper.damping" in said
    assert "dry-friction passes" in said
    assert "distinguishes each of these effects from the others" in said


def test_an_effect_that_the_base_imitates_with_this_input(place):
    gain = (
        '@effect("gain", scales="force", neutral={"share": 0.0})\n'
        'def gain(*, share=Parameter(0.02, min=-0.1, max=0.1)):\n    """Sensitivity."""\n'
        "    return 1 + share\n\n\nmodel ="
    )
    (place / "changed.py").write_text(
        MODEL.replace("model =", gain).replace("[cubic, dry]", "[cubic, dry, gain]")
    )
    said = run("model", "check", place / "changed.py", "--measurement", place / "run.tdms")
    assert "the parameters of the base have the same effect as gain" in said


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("(force - spring - damper) / mass", "force - spring - damper", "declared is m/s/s"),
        ("dx, dv, spring,", "dx, spring,", "the state 'v' has no rate"),
        (
            "return stiffness * x",
            "return stiffness * y",
            "'spring' fails (NameError: name 'y' is not defined)",
        ),
        ("return size * x**3", "return size * x**2", "declared is N"),
        ("return stiffness * x", "return stiffness * x * np.sqrt(x / x)", "'spring' is not finite"),
        ('inputs={"force": "N"}', 'inputs={"force": "V"}', "a unit like V"),
        ('observables={"x": Signal("mm", 0.05)}', 'observables={"x": Signal("N", 0.05)}', "a unit like m"),
    ],
)
def test_mistakes_are_named(place, old, new, words):
    assert words in checked(place, old, new)


def test_a_channel_of_another_name(place):
    changed = 'inputs={"push": "N"}'
    said = checked(place, 'inputs={"force": "N"}', changed).replace("\n", " ")
    assert "push" in said
    renamed = MODEL.replace('inputs={"force": "N"}', changed).replace("def dv(force,", "def dv(push,")
    (place / "changed.py").write_text(renamed.replace("(force -", "(push -"))
    words = ("model", "check", place / "changed.py", "--measurement", place / "run.tdms")
    assert "--column" in run(*words)
    assert "finite at" in run(*words, "--column", "push=force")


def test_the_shelf_in_other_units_than_the_model():
    with pytest.raises(RequestError, match="was made for x in mm, which is in m"):
        Model.from_rates(
            dx, dv, spring, damper, states={"x": State("m"), "v": State("m/s")}, inputs={"force": "N"},
            observables={"x": Signal("mm")}, units={"spring": "N", "damper": "N"},
            parameters={"stiffness": 1e4, "mass": 1.0, "damping": 20.0},
            effects=shelf.mechanics(force=("spring", 60, "N"), x=("x", 6, "mm"), v=("v", 0.6, "m/s")),
        )  # fmt: skip


@pytest.mark.parametrize("ending", ["tdms", "csv"])
def test_simulate_answers_to_a_recorded_input(place, ending):
    out = place / f"out.{ending}"
    words = ("simulate", place / "osc.py", "--conditions", place / "run.tdms")
    run(*words, "-e", "cubic-spring=3e6", "-o", out)
    made, given = specan.read(out), specan.read(place / "run.tdms")
    (x,) = made.read([made.channel("x")])
    (force,) = given.read([given.channel("force")])
    rate = given.channel("force").sampling_rate
    plain = oscillator()
    expected = response(plain, np.arange(force.size) / rate, force)  # mm
    assert made.channel("x").sampling_rate == rate
    assert np.std(1e3 * x) < np.std(expected)  # it hardens
    run(*words, "-o", place / f"plain.{ending}")
    made = specan.read(place / f"plain.{ending}")
    np.testing.assert_allclose(1e3 * made.read([made.channel("x")])[0], expected, atol=2e-3)


@pytest.mark.parametrize(
    ("chosen", "term"),
    [("cubic-spring=3e6", lambda x, v: 3e6 * x**3), ("dry-friction=2", lambda x, v: 2 * np.tanh(v / 1e-3))],
)
def test_simulate_is_as_exact_as_scipy(place, tmp_path, chosen, term):
    """The same cubics between samples, by scipy at 1e-10."""
    out = tmp_path / "exact.tdms"
    run("simulate", place / "osc.py", "--conditions", place / "run.tdms", "-e", chosen, "-o", out)
    made, given = specan.read(out), specan.read(place / "run.tdms")
    (x,), (force,) = made.read([made.channel("x")]), given.read([given.channel("force")])
    time = np.arange(force.size) / 500.0
    values, slopes = as_cubics(force)
    drive = CubicHermiteSpline(time, values, 500.0 * slopes)

    def rates(t, s):
        return [s[1], float(drive(t)) - 1e4 * s[0] - 20 * s[1] - term(*s)]

    expected = solve_ivp(rates, (0, time[-1]), [0, 0], "LSODA", time, rtol=1e-10, atol=1e-13).y[0]
    assert made.channel("x").unit == "m"
    np.testing.assert_allclose(x, expected, atol=2e-7 * np.std(expected))


def test_simulate_needs_a_recording(place):
    assert "--conditions FILE" in run("simulate", place / "osc.py")
