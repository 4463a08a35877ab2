"""An effect whose shape lies far from its default is fitted where it is, in `study add` as in a diagnosis."""

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import specan
from specan import shelf
from specan.models import Model, Signal, State
from specan.models.catalogue import keep_in_memory

NOISE, MASS, STIFFNESS, DAMPING = 1e-5, 2.0, 5e3, 12.0


def dx(v):
    return v


def dv(force, spring, damper, mass):
    return (force - spring - damper) / mass


def spring(x, stiffness):
    return stiffness * x


def damper(v, damping):
    return damping * v


def record(path: Path, seed: int) -> Path:
    """A force that repeats every 2.3 mm beside the spring, by scipy."""
    rng = np.random.default_rng(seed)
    tones, phases, time = rng.uniform(1, 15, 40), rng.uniform(0, 6, 40), np.arange(800) / 400

    def force(t: float) -> float:
        return float(1.6 * min(t / 0.1, 1) ** 2 * np.sum(np.cos(2 * np.pi * tones * t + phases)))

    def rates(t: float, s: list[float]) -> list[float]:
        pull = STIFFNESS * s[0] + 0.8 * np.sin(2 * np.pi * s[0] / 2.3e-3) + DAMPING * s[1]
        return [s[1], (force(t) - pull) / MASS]

    x = solve_ivp(rates, (0, time[-1]), [0, 0], "DOP853", time, rtol=1e-9, atol=1e-12, max_step=2e-3).y[0]
    table = np.column_stack([time, [force(t) for t in time], x + NOISE * rng.standard_normal(time.size)])
    np.savetxt(path, table, "%.9g", ",", header="time [s],force [N],x [m]", comments="")
    return path


@pytest.mark.long
def test_adding_an_effect_finds_its_shape(tmp_path: Path) -> None:
    found = shelf.mechanics(force=("spring", 20, "N"), x=("x", 4e-3, "m"), v=("v", 0.2, "m/s"))
    model = Model.from_rates(
        dx, dv, spring, damper, states={"x": State("m"), "v": State("m/s")}, inputs={"force": "N"},
        observables={"x": Signal("m")}, units={"spring": "N", "damper": "N"},
        parameters={"stiffness": (4e3, 1e3, 1e5, "N/m"), "damping": (10, 1, 100, "N*s/m"), "mass": (2, 0.2, 20, "kg")},
        effects=[one for one in found if one.name == "cogging"],
    )  # fmt: skip
    run, again = record(tmp_path / "run.csv", 1), record(tmp_path / "again.csv", 2)
    study = specan.Study.new(tmp_path / "s", keep_in_memory(model), run, validation=again)
    rows = study.add("cogging").columns()
    held = list(rows["data"]).index("held-out")
    assert rows["before"][held] > 5 * NOISE
    assert rows["after"][held] == pytest.approx(NOISE, rel=0.2)
