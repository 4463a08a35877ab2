"""What can be wrong with a model file is said in a sentence with file and line, and nothing is left behind."""

import re

import pytest
from click.testing import CliRunner

from specan.errors import RequestError, SpecanError
from specan.models import Condition, Observable, trial
from specan.models.quantity import rig_statement
from specan_cli.main import main

HEAD = "import numpy as np\nfrom specan.models import Model, Parameter, effect\n"
MODEL = (
    "model = Model.from_function(f, conditions={'x': ('mm', 1, 9)}, observables={'y': ('N', 0.1)},"
    " parameters={'a': (2.0, 0, 9)})\n"
)
TABLE = "x,y\n" + "".join(f"{x},{2 * x}\n" for x in range(1, 10))
GOOD = HEAD + "def f(x, a):\n    return a * x\n" + MODEL


@pytest.fixture
def place(tmp_path, monkeypatch):
    monkeypatch.setenv("SPECAN_CONFIG_DIR", str(tmp_path / "config"))
    monkeypatch.chdir(tmp_path)
    (tmp_path / "t.csv").write_text(TABLE, encoding="utf-8")
    return tmp_path


def test_a_study_says_which_formula_contradicts_its_units(place):
    (place / "m.py").write_text(CASES["a formula in other units than declared"][0], encoding="utf-8")
    words = ["study", "new", "s", "--model", "m.py", "--measurement", "t.csv"]
    done = CliRunner().invoke(main, words, catch_exceptions=False)
    assert re.search(
        r"m\.py, line 3: the formula of 'y' gives 'y' in mm \* N, declared is N; the numbers", done.output
    )


def refused(*words: object) -> str:
    with pytest.raises(SpecanError) as fault:
        CliRunner().invoke(main, [str(w) for w in words], catch_exceptions=False)
    return str(fault.value)


def body(lines: str, model: str = MODEL) -> str:
    return HEAD + "def f(x, a):\n" + "".join(f"    {line}\n" for line in lines.split("\n")) + model


CASES = {
    "no model": (GOOD.replace("model =", "made = lambda:"), r"m\.py holds no model.*specan model new"),
    "two models": (GOOD + MODEL.replace("model", "other"), r"m\.py holds 2 models"),
    "no Python": ("def f(:\n", r"m\.py is not valid Python \(.*line 1\)"),
    "deep nesting": ("x = " + 5000 * "-" + "1\n", r"m\.py is not valid Python"),
    "fails when loaded": ("x = 1\ny = x / 0\n", r"m\.py, line 2 fails when it is loaded \(ZeroDivisionError"),
    "a circle": (
        HEAD + "def f(x, a, g):\n    return a * x + g\ndef g(y):\n    return y\n" + MODEL.replace("(f,", "(f, g,"),
        r"m\.py, line 7: the quantities .*depend on each other in a loop",
    ),
    "an argument that is nothing known": (
        body("return x").replace("def f(x, a)", "def f(x, b)"), r"m\.py, line 3: 'y' reads 'b'.*known are",
    ),
    "a unit that is none": (GOOD.replace("'mm'", "'furlung'"), r"m\.py, line 5: the condition 'x'.*'furlung'"),
    "a formula in other units than declared": (
        GOOD.replace("(2.0, 0, 9)", "(2.0, 0, 9, 'N')"), r"m\.py, line 3: the formula of 'y' gives 'y' in",
    ),
    "the wrong shape": (body("return np.array([a, a])"), r"m\.py, line 3: 'y' gives the shape \(2,\) for 9 rows"),
    "not a number at some rows": (
        body("return a * np.log(x - 5)"), r"m\.py, line 3: 'y' is not finite in 5 of 9 rows, the first at x = 1",
    ),
    "an exception": (body("b = a\nreturn c * x"), r"m\.py, line 5: 'y' fails \(NameError: name 'c' is not defined"),
    "randomness": (
        HEAD + "R = np.random.default_rng(1).normal\ndef f(x, a):\n    return a * x + R()\n" + MODEL,
        r"m\.py, line 4: 'y' gives other values when it is called again",
    ),
    "nothing returned": (body("a * x"), r"m\.py, line 3: 'y' returns nothing; return its value"),
    "a function of single numbers": (
        HEAD + "import math\ndef f(x, a):\n    return a * math.sqrt(x)\n" + MODEL,
        r"m\.py, line 5: 'y' fails \(TypeError.*functions receive arrays.*np\.sqrt",
    ),
    "an if over rows": (
        body("if x > 3:\n    return a\nreturn x"), r"m\.py, line 4: 'y' fails \(ValueError.*np\.where for if",
    ),
    "an end of the program": ("import sys\nsys.exit(0)\n", r"m\.py, line 2 fails when it is loaded \(SystemExit"),
    "changed arguments": (body("x += 1\nreturn a * x"), r"m\.py, line 4: 'y' fails .*read-only"),
}  # fmt: skip


@pytest.mark.parametrize("case", [c for c in CASES if "units than declared" not in c])
def test_a_study_of_a_faulty_model_is_not_begun(place, case):
    content, expected = CASES[case]
    (place / "m.py").write_text(content, encoding="utf-8")
    said = refused("study", "new", "s", "--model", "m.py", "--measurement", "t.csv")
    assert re.search(expected, said), said
    assert "s/model" not in said  # the study's own copy is gone with the study
    assert not (place / "s").exists()


@pytest.mark.parametrize(
    "case", ["a circle", "a formula in other units than declared", "the wrong shape", "randomness"]
)
def test_a_faulty_model_does_not_pass_the_check(place, case):
    content, expected = CASES[case]
    (place / "m.py").write_text(content, encoding="utf-8")
    said = refused("model", "check", "m.py")
    assert re.search(expected.replace("9 rows", r"\d+ rows"), said), said


@pytest.mark.parametrize("formula", ["float(a) * x", "a * np.asarray(x, float)"])
def test_a_formula_that_takes_units_off_is_not_judged(place, formula):
    content = body(f"return {formula}").replace("(2.0, 0, 9)", "(2.0, 0, 9, 'N/mm')")
    (place / "m.py").write_text(content, encoding="utf-8")
    said = CliRunner().invoke(main, ["model", "check", "m.py"], catch_exceptions=False)
    assert said.exit_code == 0
    assert "units could not be checked in y" in said.output


def test_an_evaluation_has_a_limit_of_time_that_is_said(place, monkeypatch):
    monkeypatch.setattr(trial, "LIMIT_S", 0.2)
    (place / "m.py").write_text("import time\n" + body("time.sleep(1.5)\nreturn a * x"), encoding="utf-8")
    said = refused("study", "new", "s", "--model", "m.py", "--measurement", "t.csv")
    assert re.search(r"m\.py, line 5: one evaluation of the model takes longer than 0.2 s", said), said
    assert not (place / "s").exists()


def test_parameters_that_only_count_together_are_named(place):
    (place / "m.py").write_text(
        GOOD.replace("a * x", "a * b * x").replace("(x, a)", "(x, a, b=3.0)"), encoding="utf-8"
    )
    said = refused("model", "check", "m.py")
    assert re.search(
        r"m\.py, line 3: no measurement .* determines the parameter y\.a; only together with y\.b", said
    )


def test_a_parameter_that_changes_nothing_is_named(place):
    (place / "m.py").write_text(GOOD.replace("(x, a)", "(x, a, b=3.0)"), encoding="utf-8")
    assert "determines the parameter y.b, which changes nothing" in refused("model", "check", "m.py")


EFFECT = """
@effect("{name}", adds_to="y", neutral={{"size": 0.0}})
def {name}(x, *, size=Parameter(1.0, min=0.1, max=9, lower=-99, upper=99)):
    "Does something."
    return {body}
"""


def checked(place, *effects: tuple[str, str]) -> str:
    made = "".join(EFFECT.format(name=name, body=text) for name, text in effects)
    names = ", ".join(name for name, _ in effects)
    (place / "m.py").write_text(
        HEAD + "def f(x, a):\n    return a * x\n" + made + MODEL.replace(")\n", f", effects=[{names}])\n"),
        encoding="utf-8",
    )
    found = CliRunner().invoke(main, ["model", "check", "m.py"])
    return found.output if found.exit_code == 0 else str(found.exception)


def test_effects_that_no_measurement_tells_apart_are_named(place):
    # size (x^2 + x) and size x^2 differ by a multiple of x, which the base has as a * x
    said = checked(
        place, ("bend", "size * x**2"), ("twist", "size * (x**2 + x)"), ("wave", "size * np.sin(x)")
    )
    assert "no measurement within the limits distinguishes bend from twist" in said
    assert "from wave" not in said


def test_an_effect_that_the_base_does_itself_is_named(place):
    assert "have the same effect as drag; no measurement within the limits can detect it" in checked(
        place, ("drag", "size * x")
    )


def test_a_faulty_effect_is_told_with_its_line(place):
    said = checked(place, ("bend", "size * x**2 + 1"))
    assert re.search(r"m\.py, line 6: the effect 'bend' changes y though it is neutral", said), said


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("size * x[:3]", r"m\.py, line 6: bend gives the shape \(3,\) for 'y', which has the shape"),
        ("None", r"m\.py, line 6: bend gives None; expected one number per row"),
        ("size * np.log(x - 4)", r"m\.py, line 6: with the effect 'bend', .*'y' is not finite"),
        (
            "size * x**2 * np.random.rand()",
            r"m\.py, line 6: with the effect 'bend', .*gives other values when",
        ),
        ("size * x**2 * (1 / 0)", r"m\.py, line 9: 'bend' fails \(ZeroDivisionError"),
    ],
)
def test_what_an_effect_does_is_told_with_its_own_line(place, body, said):
    found = checked(place, ("bend", body))
    assert re.search(said, found), found


def test_parameters_of_an_effect_that_only_count_together_are_named(place):
    (place / "m.py").write_text(
        HEAD + "def f(x, a):\n    return a * x\n"
        '@effect("bend", adds_to="y", neutral={"size": 0.0})\n'
        "def bend(x, *, size=Parameter(1.0, min=0.1, max=9, lower=0, upper=99), p=Parameter(1.0, min=0.1, max=3),\n"
        "         q=Parameter(1.0, min=0.1, max=3)):\n"
        '    "Does something."\n'
        "    return size * np.exp(-p * q * x)\n" + MODEL.replace(")\n", ", effects=[bend])\n"),
        encoding="utf-8",
    )
    found = CliRunner().invoke(main, ["model", "check", "m.py"])
    assert re.search(
        r"m\.py, line 5: no measurement within the limits determines the parameter bend\.p; only together with bend\.q",
        str(found.exception),
    )


@pytest.mark.parametrize("key", ["travel_m_setting", "force_N", "model_discrepancy_percent"])
@pytest.mark.parametrize("value", [-0.01, 1e200, float("nan"), "x"])
def test_an_uncertainty_that_is_none_is_refused(key, value):
    known = (
        [Condition("travel", "m", "Travel.", "travel_m", "m")],
        [Observable("force", "force", "N", "Force.", column="force_N")],
    )
    with pytest.raises(RequestError, match=f"{key} = {value}".replace("+", r"\+")):
        rig_statement({"uncertainty": {key: value}}, *known)
