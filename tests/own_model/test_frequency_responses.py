"""A model of a user's own compared with transfer functions: from recordings, universal files and tables.

The truth is a state-space system of three masses stepped in time (`truth.three_masses`); the model knows two, and
formulas over frequency.
"""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner

from specan.errors import InputError, RequestError, SpecanError
from specan.models import Frf, Model
from specan.models.catalogue import load_model
from specan.study.create import begin
from specan.study.data.open_transfer import open_data
from specan.study.data.transfer_file import read_transfer_file
from specan.study.diagnose import diagnose
from specan.study.observation import DataFile, MeasuredFiles, kind_of
from specan.study.selection.candidates import base_problem
from specan_cli.main import main
from truth.three_masses import ThreeMasses, as_text, simulate

TWO_MASS = Path(__file__).parents[2] / "sample_data" / "two_mass" / "two_mass.py"
RATE = 256.0


def run(*words):
    done = CliRunner().invoke(main, [str(w) for w in words], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return done.output


@pytest.fixture
def place(tmp_path, monkeypatch):
    monkeypatch.setenv("SPECAN_CONFIG_DIR", str(tmp_path / "config"))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def receptance(system: ThreeMasses, frequency: np.ndarray) -> np.ndarray:
    """x1 and x2 over the force, um/N, by solving the equations of motion line by line."""
    mass, damping, stiffness = system.matrices()
    found = []
    for f in frequency:
        s = 2j * np.pi * f
        found.append(np.linalg.solve(mass * s**2 + damping * s + stiffness, [1.0, 0, 0])[:2])
    return 1e6 * np.array(found).T


def written(
    path: Path, frequency: np.ndarray, h: np.ndarray, percent: float = 1.0, seed: int = 0
) -> np.ndarray:
    """A table with a column u, of transfer functions that scatter by so much in each part."""
    random = np.random.default_rng(seed)
    scatter = (
        percent / 100 * np.abs(h) * (random.standard_normal(h.shape) + 1j * random.standard_normal(h.shape))
    )
    noisy = h + scatter
    lines = ["frequency [Hz];x1 re [um/N];x1 im [um/N];x1 u [%];x2 re [um/N];x2 im [um/N];x2 u [%]"]
    for f, (a, b) in zip(frequency, noisy.T, strict=True):
        lines.append(";".join(f"{v:.9g}" for v in (f, a.real, a.imag, percent, b.real, b.imag, percent)))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return noisy


FREQUENCY = np.arange(8.0, 80.0, 0.25)


def test_a_recording_of_the_true_model_is_told_so(place):
    """With nothing hidden there is nothing missing, and chi-square is one: the uncertainty of the lines is right."""
    (place / "run.csv").write_text(as_text(simulate(ThreeMasses(tuned_mass=1e-9), seed=8)), encoding="utf-8")
    model = load_model(TWO_MASS, {})
    path = place / "run.csv"
    data = open_data(model, MeasuredFiles([DataFile("run.csv", path)]))
    found = diagnose(base_problem(model, data.fitted))
    assert found.verdict == "nothing-missing"
    assert found.lack_of_fit.reduced_chi2 == pytest.approx(1.0, abs=0.1)


def verdict_on(path: Path):
    model = load_model(TWO_MASS, {})
    assert kind_of(path, model) == "transfer"
    return diagnose(base_problem(model, open_data(model, MeasuredFiles([DataFile(path.name, path)])).fitted))


def test_a_table_of_transfer_functions(place):
    h = receptance(ThreeMasses(), FREQUENCY)
    noisy = written(place / "frf.csv", FREQUENCY, h)
    found = read_transfer_file(place / "frf.csv")
    assert [one.response for one in found] == ["x1", "x2"]
    np.testing.assert_allclose(found[1].values, noisy[1], rtol=1e-8)
    np.testing.assert_allclose(found[1].sigma, 0.01 * np.abs(noisy[1]), rtol=1e-8)
    said = verdict_on(place / "frf.csv")
    assert said.effects == ("sprung-mass-on-2",)


def test_every_value_of_the_residuals_says_its_line_and_part(place):
    noisy = written(place / "frf.csv", FREQUENCY, receptance(ThreeMasses(), FREQUENCY))
    run("study", "new", "s", "--model", TWO_MASS, "--measurement", "frf.csv", "--hold-out", "channel=x2")
    with pytest.raises(RequestError, match="no row has channel = x3; expected one of x1, x2"):
        run("study", "new", "t", "--model", TWO_MASS, "--measurement", "frf.csv", "--hold-out", "channel=x3")
    run("study", "compare", "s", "-o", "rows.csv")
    rows = pd.read_csv("rows.csv", comment="#").set_index(["channel", "part", "frequency"]).measured
    for channel, h in zip(("x1", "x2"), noisy, strict=True):
        np.testing.assert_allclose(rows[channel]["real"].loc[FREQUENCY], h.real, rtol=1e-5)
        np.testing.assert_allclose(rows[channel]["imaginary"].loc[FREQUENCY], h.imag, rtol=1e-5)


TABLES = {
    "magnitude and phase": (
        "f [Hz],x1 magnitude [m/N],x1 phase [deg]",
        lambda h: (1e-6 * abs(h), np.degrees(np.angle(h))),
    ),
    "radians": ("f [Hz],x1 magnitude [um/N],x1 phase [rad]", lambda h: (abs(h), np.angle(h))),
    "real and imaginary": ("frequency_hz,x1_real [um/N],x1_imag [um/N]", lambda h: (h.real, h.imag)),
    "without a name": ("Freq [Hz],re [mm/kN],im [mm/kN]", lambda h: (h.real, h.imag)),
    "kilohertz": ("f [kHz],x1 re [um/N],x1 im [um/N]", lambda h: (h.real, h.imag)),
}


@pytest.mark.parametrize("form", TABLES)
def test_every_form_of_a_table_is_the_same_measurement(place, form):
    header, parts = TABLES[form]
    frequency = FREQUENCY / (1000 if "kHz" in header else 1)
    h = receptance(ThreeMasses(), FREQUENCY)[0]
    rows = [",".join(f"{v:.12g}" for v in row) for row in zip(frequency, *parts(h), strict=True)]
    (place / "frf.csv").write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    model = Model.from_function(
        lambda frequency, size=1.0: size + 0j * frequency,
        conditions={"frequency": ("Hz", 8, 80)}, observables={"x1": Frf("um/N", uncertainty_percent=2)},
    )  # fmt: skip
    data = open_data(model, MeasuredFiles([DataFile("frf.csv", place / "frf.csv")]))
    (one,) = data.fitted
    np.testing.assert_allclose(one.response[0], h, rtol=1e-9)
    np.testing.assert_allclose(one.frequency_hz, FREQUENCY, rtol=1e-9)
    np.testing.assert_allclose(one.noise[0], 0.02 * np.abs(h), rtol=1e-9)
    assert data.known


def test_what_frf_writes_is_read(place):
    """A recording analysed by `specan frf -o`, and its table given to a study."""
    (place / "run.csv").write_text(as_text(simulate(ThreeMasses(), seed=6)), encoding="utf-8")
    run("frf", "run.csv", "--reference", "force", "--channel", "x*", "-o", "frf.txt")
    assert all(
        one.windowed for one in read_transfer_file(place / "frf.txt")
    )  # lines beside each other are alike
    assert verdict_on(place / "frf.txt").effects[0] == "sprung-mass-on-2"
    run(
        "frf",
        "run.csv",
        "--reference",
        "force",
        "--channel",
        "x*",
        "--window",
        "rectangular",
        "-o",
        "box.txt",
    )
    assert not any(one.windowed for one in read_transfer_file(place / "box.txt"))


def test_universal_files_of_others(place):
    """Written by pyuff as a modal analysis program does, ASCII and binary, with nodes and directions."""
    pyuff = pytest.importorskip("pyuff")
    h = receptance(ThreeMasses(), FREQUENCY)
    for binary, name in ((0, "ascii.uff"), (1, "binary.uff")):
        file = pyuff.UFF(str(place / name))
        for node, values in enumerate(h, 1):
            content = pyuff.prepare_58(
                binary=binary, func_type=4, rsp_node=node, rsp_dir=3, ref_node=1, ref_dir=3, data=1e-6 * values,
                x=FREQUENCY, ord_data_type=6, abscissa_spacing=1, num_pts=FREQUENCY.size, abscissa_min=8.0,
                abscissa_inc=0.25, ordinate_axis_units_lab="m", orddenom_axis_units_lab="N", id1="acceptance test",
                ordinate_spec_data_type=8, orddenom_spec_data_type=13, abscissa_spec_data_type=18,
                z_axis_spec_data_type=0,
            )  # fmt: skip
            file.write_sets(content, "add")
        found = read_transfer_file(place / name)
        assert [(one.response, one.reference) for one in found] == [("1Z", "1Z"), ("2Z", "1Z")]
        model = Model.from_function(
            lambda frequency, size=1.0: size + 0j * frequency,
            conditions={"frequency": "Hz"},
            observables={"x2": Frf("um/N", response="2+Z", reference="1Z", uncertainty_percent=1)},
        )  # fmt: skip
        data = open_data(model, MeasuredFiles([DataFile(name, place / name)]))
        np.testing.assert_allclose(data.fitted[0].response[0], h[1], rtol=1e-5)


def test_export_writes_transfer_functions_as_universal_file(place):
    pyuff = pytest.importorskip("pyuff")
    (place / "run.csv").write_text(as_text(simulate(ThreeMasses(), seed=6)), encoding="utf-8")
    run("frf", "run.csv", "--reference", "force", "--channel", "x1,x2", "-o", "frf.uff")
    table = json.loads(run("frf", "run.csv", "--reference", "force", "--channel", "x*", "--json", "-q"))
    sets = pyuff.UFF("frf.uff").read_sets()
    assert [(s["func_type"], s["rsp_node"], s["ref_node"]) for s in sets] == [
        (4, 1, 3),
        (6, 1, 3),
        (4, 2, 3),
        (6, 2, 3),
    ]
    assert [s["rsp_ent_name"].strip() for s in sets[::2]] == ["x1", "x2"]
    assert {s["ref_ent_name"].strip() for s in sets} == {"force"}
    assert (sets[0]["ordinate_axis_units_lab"].strip(), sets[0]["orddenom_axis_units_lab"].strip()) == (
        "m",
        "N",
    )
    assert sets[2]["orddenom_spec_data_type"] == 9
    channel = table["channels"][1]
    np.testing.assert_allclose(np.abs(sets[2]["data"]), channel["magnitude"], rtol=1e-9)
    np.testing.assert_allclose(sets[3]["data"], channel["coherence"], rtol=1e-9)
    # the same file given to a study: its coherence tells the uncertainty once the averages are said
    text = TWO_MASS.read_text("utf-8").replace('reference="force")', 'reference="force", averages=9)')
    (place / "m.py").write_text(text, encoding="utf-8")
    assert "from the coherence and 9 averages" in run(
        "study", "new", "s", "--model", "m.py", "--measurement", "frf.uff"
    )


def refused(path: Path, **observable) -> str:
    model = Model.from_function(
        lambda frequency, size=1.0: size + 0j * frequency,
        conditions={"frequency": ("Hz", 8, 80)}, observables={"x1": Frf(**{"unit": "um/N", **observable})},
    )  # fmt: skip
    with pytest.raises(SpecanError) as fault:
        open_data(model, MeasuredFiles([DataFile(path.name, path)]))
    return str(fault.value)


def test_what_does_not_fit_is_said(place):
    frf, run_ = place / "frf.csv", place / "run.csv"
    written(frf, FREQUENCY, receptance(ThreeMasses(), FREQUENCY))
    run_.write_text(as_text(simulate(ThreeMasses(), seconds=20)), encoding="utf-8")
    assert "holds x1 over its reference, x2 over its reference; expected x3" in refused(frf, response="x3")
    assert "is in 'um/N'; expected a unit of x1, which the model has in m/s^2/N" in refused(
        frf, unit="m/s^2/N"
    )
    assert "run.csv has no channel 'x3'" in refused(run_, response="x3")
    assert "has no channel 'hammer'" in refused(run_, reference="hammer")
    frf.write_text("frequency [Hz],x1 re\n" + "".join(f"{f},1\n" for f in range(1, 9)), encoding="utf-8")
    assert "frf.csv: the transfer function 'x1' lacks a part; expected columns re and im" in refused(frf)


def test_without_an_uncertainty_errors_are_shown_and_nothing_is_concluded(place):
    h = receptance(ThreeMasses(), FREQUENCY)[0]
    rows = "".join(f"{f},{v.real:.9g},{v.imag:.9g}\n" for f, v in zip(FREQUENCY, h, strict=True))
    (place / "frf.csv").write_text("frequency [Hz],x1 re [um/N],x1 im [um/N]\n" + rows, encoding="utf-8")
    said = run("study", "new", "s", "--model", TWO_MASS, "--measurement", "frf.csv")
    assert "the uncertainty of x1, x2 is not stated" in said
    assert "RMS" in run("study", "compare", "s")
    with pytest.raises(RequestError, match="the uncertainty of the measurement"):
        CliRunner().invoke(main, ["study", "diagnose", "s"], catch_exceptions=False)


def test_a_complex_function_that_is_declared_as_a_column_is_told(place):
    (place / "m.py").write_text(
        "from specan.models import Model\n\ndef x1(frequency, size):\n    return size * (1 + 1j * frequency)\n\n"
        "model = Model.from_function(x1, conditions={'frequency': ('Hz', 8, 80)}, observables={'x1': ('um/N', 1)},\n"
        "    parameters={'size': 1.0})\n",
        encoding="utf-8",
    )
    (place / "t.csv").write_text(
        "frequency,x1\n" + "".join(f"{f},1\n" for f in range(8, 40)), encoding="utf-8"
    )
    with pytest.raises(RequestError, match=r"m\.py, line 3: 'x1' gives complex numbers.*Frf\("):
        CliRunner().invoke(
            main, ["study", "new", "s", "--model", "m.py", "--measurement", "t.csv"], catch_exceptions=False
        )


def test_a_model_without_a_frequency(place):
    written(place / "frf.csv", FREQUENCY, receptance(ThreeMasses(), FREQUENCY))
    model = Model.from_function(
        lambda omega, size=1.0: size + 0j * omega,
        conditions={"omega": ("rad/s", 8, 80)}, observables={"x1": Frf("um/N")},
    )  # fmt: skip
    with pytest.raises(RequestError, match="no single condition in Hz"):
        open_data(model, MeasuredFiles([DataFile("frf.csv", place / "frf.csv")]))


@pytest.mark.long
def test_two_files_share_parameters_and_a_third_octave_can_be_put_aside(place):
    h = receptance(ThreeMasses(), FREQUENCY)
    written(place / "a.csv", FREQUENCY, h, seed=1)
    written(place / "b.csv", FREQUENCY, h, seed=2)
    said = json.loads(run("study", "new", "s", "--model", TWO_MASS, "--measurement", "a.csv", "--measurement", "b.csv",
                          "--hold-out", "third_octave_hz=50", "--json"))  # fmt: skip
    inside = np.sum(np.round(10 * np.log10(FREQUENCY / 1000)).astype(int) == -13)
    assert said["held_out_values"] == 2 * 2 * 2 * inside
    assert said["fitted_values"] == 2 * 2 * 2 * (FREQUENCY.size - inside)


def test_no_line_in_the_band(place):
    written(place / "frf.csv", FREQUENCY + 200, receptance(ThreeMasses(), FREQUENCY + 200))
    model = load_model(TWO_MASS, {})
    with pytest.raises(
        InputError, match=r"has no line between 8 and 80 Hz; expected a band within 208 to 279\.75 Hz"
    ):
        open_data(model, MeasuredFiles([DataFile("frf.csv", place / "frf.csv")]))


TWO_PEAKS = """from specan.models import Frf, Model


def x(frequency, f1, f2, z, a, b):
    r, s = frequency / f1, frequency / f2
    return a / (1 - r**2 + 2j * z * r) + b / (1 - s**2 + 2j * z * s)


band = 5, 100
model = Model.from_function(
    x, conditions={"frequency": ("Hz", *band)}, observables={"x": Frf("um/N")},
    parameters={"f1": (80, *band, "Hz"), "f2": (90, *band, "Hz"), "z": (0.05, 0.001, 0.2, "1"),
                "a": (1.0, 0.1, 5, "um/N"), "b": (1.0, 0.1, 5, "um/N")},
)
"""


def test_of_two_minima_the_lower_counts_in_the_first_step_too(place, monkeypatch):
    """Peaks at 30 and 62 Hz: from 80 and 90 Hz the fit loses the smaller one; another fit has found both."""
    f, true = np.arange(5, 100, 0.25), {"x.f1": 30.0, "x.f2": 62.0, "x.z": 0.02, "x.a": 1.0, "x.b": 0.6}
    h = 1 / (1 - (f / 30) ** 2 + 0.04j * f / 30) + 0.6 / (1 - (f / 62) ** 2 + 0.04j * f / 62)
    random = np.random.default_rng(0)
    h = h + random.standard_normal(f.size) + 1j * random.standard_normal(f.size)
    rows = [f"{a};{b.real:.6f};{b.imag:.6f};1.0" for a, b in zip(f, h, strict=True)]
    header = "frequency [Hz];x re [um/N];x im [um/N];x u [um/N]"
    (place / "t.csv").write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    (place / "m.py").write_text(TWO_PEAKS, encoding="utf-8")
    monkeypatch.setattr("specan.study.study.continuation_fit", lambda problem: true)
    step = begin(place / "s", "m.py", None, [place / "t.csv"]).step
    assert step.reduced_chi2 == pytest.approx(1, abs=0.15)
    assert step.parameters["x.f2"]["value"] == pytest.approx(62, rel=0.01)
