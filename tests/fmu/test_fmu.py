"""Models that are FMUs: values against closed forms, studies, and FMUs that crash, hang or fit nowhere."""

import math
import os
import time
import zipfile

import numpy as np
import pytest
from click.testing import CliRunner
from fmus import c_fmu, python_fmu

from specan.errors import ComputationError, RequestError
from specan.fmu.process import FmuProcess
from specan.models.catalogue import load_model
from specan_cli.main import main

SPEED = np.array([5.0, 20.0, 60.0, 300.0])


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    return python_fmu(tmp_path_factory.mktemp("fmi2"))


@pytest.fixture(scope="module")
def first_order(tmp_path_factory):
    return c_fmu(tmp_path_factory.mktemp("fmi3"))


def torque(model, uses=(), **values):
    values = {name.replace("__", "."): value for name, value in values.items()}
    return model.assemble(uses).evaluate({"speed": SPEED}, values)["torque"]


def test_co_simulation_of_fmi_2_gives_the_closed_form(drive):
    model = load_model(drive, {})
    assert model.title == "A drive"
    assert torque(model, torque__mu=1.2) == pytest.approx(np.full(4, 1.2), rel=1e-12)
    expected = 1.2 + 0.4 * np.exp(-SPEED / 20)
    assert torque(model, ["stribeck"], torque__mu=1.2, stribeck__rise=0.4) == pytest.approx(
        expected, rel=1e-12
    )


def test_a_switch_is_a_share_of_what_the_fmu_does_with_it(drive):
    model = load_model(drive, {})
    for share in (0.0, 0.4, 1.0):
        found = torque(model, ["extra", "stribeck"], extra__share=share, stribeck__rise=0.4, torque__mu=1.0)
        assert found == pytest.approx(1 + 0.4 * np.exp(-SPEED / 20) + share * SPEED / 1000, rel=1e-12)


@pytest.mark.parametrize("kind", ["co-simulation", "model-exchange"])
def test_fmi_3_follows_the_closed_form_of_its_equation(first_order, kind):
    text = first_order.with_suffix(".toml").read_text(encoding="utf-8")
    first_order.with_suffix(".toml").write_text(
        text.replace("step = 0.5\n", f'step = 0.5\nkind = "{kind}"\n'), encoding="utf-8"
    )
    try:
        found = torque(load_model(first_order, {}), ["stribeck"], torque__friction=1.2, stribeck__rise=0.4)
    finally:
        first_order.with_suffix(".toml").write_text(text, encoding="utf-8")
    expected = (1.2 + 0.4 * np.exp(-SPEED / 20)) * (1 - math.exp(-1 / 0.5))
    assert found == pytest.approx(expected, rel=1e-6)


def test_averages_are_taken_over_the_end(first_order):
    text = first_order.with_suffix(".toml").read_text(encoding="utf-8")
    first_order.with_suffix(".toml").write_text(
        text.replace("step = 0.5\n", "step = 0.25\naverage = 0.5\n"), encoding="utf-8"
    )
    try:
        found = torque(load_model(first_order, {}), torque__friction=1.0)
    finally:
        first_order.with_suffix(".toml").write_text(text, encoding="utf-8")
    assert found == pytest.approx(np.mean([1 - math.exp(-t / 0.5) for t in (0.5, 0.75, 1.0)]), rel=1e-5)


def test_the_check_of_a_model_takes_it(drive, monkeypatch, tmp_path):
    monkeypatch.setenv("SPECAN_CONFIG_DIR", str(tmp_path))
    result = CliRunner().invoke(main, ["model", "check", str(drive)])
    assert result.exit_code == 0, (result.output, result.exception)
    assert "determines each parameter: torque.mu" in result.output
    assert "stribeck passes" in result.output
    assert "extra passes" in result.output


@pytest.mark.long
def test_a_study_names_the_effect_that_the_fmu_lacks(drive, tmp_path, monkeypatch):
    monkeypatch.setenv("SPECAN_CONFIG_DIR", str(tmp_path / "config"))
    monkeypatch.chdir(tmp_path)
    speed = np.geomspace(5, 300, 16)
    noise = 0.005 * np.random.default_rng(4).standard_normal(16)
    measured = 1.1 + 0.25 * np.exp(-speed / 20) + noise
    rows = "\n".join(f"{n:.6g},{t:.6g}" for n, t in zip(speed, measured, strict=True))
    (tmp_path / "bench.csv").write_text("speed,torque\n" + rows + "\n", encoding="utf-8")

    def run(*words):
        result = CliRunner().invoke(main, list(words))
        assert result.exit_code == 0, (result.output, result.exception)
        return result.output

    run("study", "new", "s", "--model", str(drive), "--measurement", "bench.csv")
    assert sorted(p.name for p in (tmp_path / "s" / "model").iterdir()) == ["drive.fmu", "drive.toml"]
    assert "Missing: stribeck" in run("study", "diagnose", "s")
    run("study", "add", "s", "stribeck")
    assert "fits" in run("study", "compare", "s")
    settings = tmp_path / "s" / "model" / "drive.toml"
    settings.write_text(settings.read_text(encoding="utf-8") + "\n", encoding="utf-8")
    result = CliRunner().invoke(main, ["study", "compare", "s"])
    assert isinstance(result.exception, RequestError)
    assert "was changed since it was added" in str(result.exception)


def test_a_crash_names_the_place_and_the_next_simulation_runs(drive):
    model = load_model(drive, {})
    with pytest.raises(
        ComputationError, match=r"drive.fmu crashed \(exit code 7: the FMU talks.*speed = 950"
    ):
        model.assemble().evaluate({"speed": np.array([50.0, 950.0])})
    assert torque(model) == pytest.approx(np.full(4, 0.8))


def test_a_hang_ends_at_the_limit(drive, tmp_path):
    text = drive.with_suffix(".toml").read_text(encoding="utf-8")
    copy = tmp_path / "drive.fmu"
    copy.write_bytes(drive.read_bytes())
    copy.with_suffix(".toml").write_text(
        text.replace("[simulation]", "[simulation]\ntime_limit = 0.5"), encoding="utf-8"
    )
    model = load_model(copy, {})
    began = time.monotonic()
    with pytest.raises(ComputationError, match=r"takes longer than 0.5 s for one simulation.*speed = 850"):
        model.assemble().evaluate({"speed": np.array([850.0])})
    assert time.monotonic() - began < 30
    assert torque(model) == pytest.approx(np.full(4, 0.8))


def test_a_crash_leaves_the_study_as_it_was(drive, tmp_path, monkeypatch):
    monkeypatch.setenv("SPECAN_CONFIG_DIR", str(tmp_path / "config"))
    monkeypatch.chdir(tmp_path)
    copy = tmp_path / "drive.fmu"
    copy.write_bytes(drive.read_bytes())
    text = drive.with_suffix(".toml").read_text(encoding="utf-8")
    copy.with_suffix(".toml").write_text(text.replace("high = 300", "high = 1000"), encoding="utf-8")
    (tmp_path / "bench.csv").write_text("speed,torque\n10,1\n50,1\n100,1\n150,1\n", encoding="utf-8")
    (tmp_path / "fast.csv").write_text("speed,torque\n10,1\n950,1\n", encoding="utf-8")
    words = ["study", "new", "s", "--model", "drive.fmu", "--measurement"]
    result = CliRunner().invoke(main, [*words, "fast.csv"])
    assert isinstance(result.exception, ComputationError)
    assert "crashed (exit code 7: the FMU talks), at speed = 950" in str(result.exception)
    assert not (tmp_path / "s").exists()
    assert CliRunner().invoke(main, [*words, "bench.csv"]).exit_code == 0


def test_an_fmu_for_another_platform_is_told(drive, tmp_path):
    other = tmp_path / "drive.fmu"
    with zipfile.ZipFile(drive) as whole, zipfile.ZipFile(other, "w") as part:
        for name in whole.namelist():
            if name == "modelDescription.xml":
                part.writestr(name, whole.read(name))
        part.writestr("binaries/c-code/drive.so", b"")
    (tmp_path / "drive.toml").write_bytes(drive.with_suffix(".toml").read_bytes())
    with pytest.raises(RequestError, match=r"is made for .*, and this machine is .*export the FMU"):
        load_model(other, {})


def test_what_is_wrong_in_the_files_is_told(drive, tmp_path):
    text = drive.with_suffix(".toml").read_text(encoding="utf-8")
    copy = tmp_path / "drive.fmu"
    copy.write_bytes(drive.read_bytes())
    with pytest.raises(RequestError, match=r"has no file drive.toml beside it"):
        load_model(copy, {})
    faults = {
        "[parameters.mu]": ("[parameters.mo]", r"has no variable 'mo'; known are speed, mu, rise, on"),
        "low = 5": ("lowest = 5", r"drive.toml: .*conditions.speed"),
        'unit = "1/min"': ('unit = "bananas"', "bananas"),
        'switch = "on"': ('switch = "off"', "has no variable 'off'"),
        "neutral = 0\n": ("", "an effect needs a switch, or a parameter with a neutral value"),
    }
    for old, (new, message) in faults.items():
        copy.with_suffix(".toml").write_text(text.replace(old, new), encoding="utf-8")
        with pytest.raises(RequestError, match=message):
            load_model(copy, {})
    copy.with_suffix(".toml").write_text(text, encoding="utf-8")
    copy.write_bytes(b"no archive")
    with pytest.raises(RequestError, match="cannot be read as an FMU"):
        load_model(copy, {})


def test_what_was_simulated_is_not_simulated_again(drive, monkeypatch):
    asked = []
    simulate = FmuProcess.simulate
    monkeypatch.setattr(
        FmuProcess, "simulate", lambda self, rows: (asked.append(len(rows)), simulate(self, rows))[1]
    )
    model = load_model(drive, {})
    first = torque(model, ["extra"], extra__share=0.5)
    assert asked == [4, 4]  # with the switch off and on
    assert torque(model, ["extra"], extra__share=0.7) != pytest.approx(first)
    assert torque(model, ["extra"], extra__share=0.5) == pytest.approx(first)
    assert asked == [4, 4]


@pytest.mark.long
def test_the_process_ends_with_the_model(drive):
    import gc

    model = load_model(drive, {})
    torque(model)
    if not os.path.isdir("/proc"):
        pytest.skip("processes are looked up in /proc")
    children = _children()
    assert children
    del model
    gc.collect()
    assert not children & _children()


def _children():
    me, found = str(os.getpid()), set()
    for pid in filter(str.isdigit, os.listdir("/proc")):
        try:
            with open(f"/proc/{pid}/stat", encoding="utf-8") as file:
                stat = file.read()
            with open(f"/proc/{pid}/cmdline", "rb") as file:
                command = file.read()
        except OSError:
            continue
        if stat.rsplit(")", 1)[1].split()[1] == me and b"specan.fmu.worker" in command:
            found.add(pid)
    return found
