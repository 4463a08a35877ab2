"""A chaotic oscillator of Duffing, integrated by scipy: compared in pieces, and as a whole where that can be."""

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import specan
from specan.models import Model, Parameter, Signal, State, effect
from specan.models.catalogue import keep_in_memory
from specan.study.create import begin

RATE, NOISE = 10.0, 0.02


def record(path: Path, seed: int, seconds: float) -> Path:
    """Displacement of a mass between two wells, which a sine drives from one to the other (Ueda and Holmes)."""
    rng = np.random.default_rng(seed)
    time, begins = np.arange(round(seconds * RATE)) / RATE, rng.uniform(0, 6)

    def rates(t: float, s: list[float]) -> list[float]:
        return [s[1], 0.5 * np.cos(1.2 * t + begins) + s[0] - s[0] ** 3 - 0.3 * s[1]]

    done = solve_ivp(rates, (0, time[-1]), [rng.uniform(0.5, 1), 0], "DOP853", time, rtol=1e-11, atol=1e-12)
    x = done.y[0] + NOISE * rng.standard_normal(time.size)
    table = np.column_stack([time, 0.5 * np.cos(1.2 * time + begins), x])
    np.savetxt(path, table, "%.9g", ",", header="time [s],force [N],x [m]", comments="")
    return path


def dx(v):
    return v


def dv(force, spring, damper, mass):
    return (force - spring - damper) / mass


def spring(x, stiffness):
    return stiffness * x


def damper(v, damping):
    return damping * v


@effect("hardening", adds_to="spring", neutral={"size": 0.0})
def hardening(x, *, size=Parameter(1.1, "N/m^3", min=0.1, max=5, lower=0)):
    """The spring hardens."""
    return size * x**3


def model(window_s: float | None, *base: str) -> Model:
    return Model.from_rates(
        dx, dv, spring, damper, states={"x": State("m", start="measured"), "v": State("m/s")}, inputs={"force": "N"},
        observables={"x": Signal("m", NOISE)}, units={"spring": "N", "damper": "N"}, effects=[hardening],
        parameters={"stiffness": (-1.1, -3, 3, "N/m"),
            "damping": (0.25, 0.1, 1, "N*s/m"),
            "mass": (1.05, 0.5, 2, "kg")},
        base_effects=base, window_s=window_s,
    )  # fmt: skip


@pytest.mark.parametrize("held_out", ["another recording", "its end"])
def test_pieces_with_their_own_starts_reach_the_noise(tmp_path: Path, held_out: str) -> None:
    run = record(tmp_path / "run.csv", 1, 60)
    others = {"validations": [record(tmp_path / "again.csv", 2, 60)]}
    if held_out == "its end":
        others = {"hold_out": ["time=45.5..60"]}
    begin(tmp_path / "s", keep_in_memory(model(5.0, "hardening")), None, [run], **others)
    study = specan.Study(tmp_path / "s").opened
    assert "12 pieces of 5 s" in " ".join(study.data.statements)
    assert study.errors[0].rms == pytest.approx(NOISE, rel=0.1)
    assert study.held_out is not None
    assert study.held_out.errors[0].rms == pytest.approx(NOISE, rel=0.1)
    known = dict(zip(map(str, study.shown.names), study.shown.theta, strict=True))
    truth = {"spring.stiffness": -1, "damper.damping": 0.3, "dv.mass": 1, "hardening.size": 1}
    for name, value in truth.items():
        assert known[name] == pytest.approx(value, rel=0.02), name


@pytest.mark.long
def test_an_effect_is_named_in_pieces(tmp_path: Path) -> None:
    runs = [record(tmp_path / f"{k}.csv", k, 24) for k in (1, 2)]
    begin(tmp_path / "s", keep_in_memory(model(2.0)), None, runs[:1], validations=runs[1:])
    study = specan.Study(tmp_path / "s")
    assert study.diagnose().alternatives == (("hardening",),)
    rows = study.add("hardening").columns()
    assert rows["after"][list(rows["data"]).index("held-out")] == pytest.approx(NOISE, rel=0.1)


@pytest.mark.long
def test_what_no_fit_finds_in_long_pieces_is_no_noise(tmp_path: Path) -> None:
    """Pieces of a period, two wells, a base far off: what is left is ten times the noise that is stated."""
    begin(tmp_path / "s", keep_in_memory(model(5.0)), None, [record(tmp_path / "run.csv", 1, 48)])
    assert specan.Study(tmp_path / "s").diagnose().verdict in ("effect", "unknown-effect")


@pytest.mark.long
def test_a_chaotic_run_is_followed_to_its_end_or_refused_as_a_whole(tmp_path: Path) -> None:
    """A fit that grows with the recording keeps in step; over a longer one the first sample is not exact enough."""
    seen = []
    for seconds in (120, 300):
        run = record(tmp_path / f"{seconds}.csv", 7, seconds)
        begin(tmp_path / f"s{seconds}", keep_in_memory(model(None, "hardening")), None, [run])
        seen.append(specan.Study(tmp_path / f"s{seconds}").diagnose())
    shorter, longer = seen
    assert shorter.verdict == "nothing-missing"
    assert shorter.error.after.rms == pytest.approx(NOISE, rel=0.1)
    assert longer.verdict == "cannot-tell"
    assert "chaotic" in longer.reason
    assert "window_s=" in longer.reason
