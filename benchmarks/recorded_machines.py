"""Recordings of force and displacement of machines that lack one effect, or nothing: what does a diagnosis say?

    python benchmarks/recorded_machines.py [--cases hardening process ...] [--seeds 1:3]

A mass on a spring, 4 096 samples at 1 kHz, integrated by scipy from formulas of this file. The force is a multisine,
noise in a band or a sweep; the displacement has noise of 1 % that the model is not told. The model is a spring, a
damper and a mass with 34 effects of the shelf. The error is that on another recording with another force.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np
from nptdms import ChannelObject, TdmsWriter
from scipy.integrate import solve_ivp
from scipy.signal import butter, chirp, lfilter, sosfiltfilt

import specan
from specan import shelf
from specan.models import Model, Signal, State
from specan.models.catalogue import keep_in_memory
from specan.study.create import begin

RATE, COUNT = 1000.0, 4096
TIME = np.arange(COUNT) / RATE
TRUTH = {
    "hardening": {"cubic-spring"}, "coulomb": {"dry-friction"}, "backlash": {"backlash"}, "stop": {"stop"},
    "delay": {"x-delay"}, "hysteresis": {"bouc-wen", "dahl-friction", "lugre-friction"},
    "white": set(), "coloured": set(), "process": set(), "slow-process": set(),
}  # fmt: skip


def push(rng: np.random.Generator, form: int) -> np.ndarray:
    """A force of 40 N RMS from 2 to 45 Hz."""
    if form == 0:
        noise = rng.standard_normal(COUNT + 2000)
        found = sosfiltfilt(butter(4, [2, 45], "band", fs=RATE, output="sos"), noise)[1000:-1000]
    elif form == 1:
        found = sum(np.cos(2 * np.pi * f * TIME + rng.uniform(0, 6.3)) for f in np.arange(2, 40, 0.5))
    else:
        found = chirp(TIME, 2, TIME[-1], 35)
    found = found * np.minimum(TIME / 0.05, 1)
    return 40 * found / np.std(found)


def record(path: Path, case: str, seed: int, again: bool) -> None:
    """Write a recording of a machine that the seed draws; `again` with another force and noise."""
    rng = np.random.default_rng([seed, 77])
    mass, damping, stiffness = rng.uniform(1.1, 1.9), rng.uniform(12, 25), rng.uniform(0.9e4, 1.5e4)
    size = rng.uniform(0.7, 1.4)
    if again:
        rng = np.random.default_rng([seed, 79])
    force = push(rng, (seed + again) % 3)
    kicks = {
        "process": 3 * size * rng.standard_normal(COUNT),
        "slow-process": 3
        * size
        * sosfiltfilt(butter(2, 80, fs=RATE, output="sos"), rng.standard_normal(COUNT)),
    }.get(case, np.zeros(COUNT))

    def pull(x: float, v: float, z: float) -> float:
        if case == "backlash":
            gap = 0.4e-3 * size
            return stiffness * (abs(x) - gap) * np.sign(x) if abs(x) > gap else 0.0
        more = {
            "hardening": 0.25 * size * stiffness * x * (x / 4e-3) ** 2,
            "coulomb": 4 * size * np.tanh(v / 2e-4),
            "stop": 2e5 * size * max(x - 5e-3, 0.0),
            "hysteresis": 2.5e3 * size * z,
        }.get(case, 0.0)
        return stiffness * x + more

    def rates(t: float, state: np.ndarray) -> list[float]:
        x, v, z = state
        given = np.interp(t, TIME, force + kicks)
        return [
            v,
            (given - pull(x, v, z) - damping * v) / mass,
            v - (0.6 * abs(v) * z + 0.4 * v * abs(z)) / 0.8e-3,
        ]

    method = "LSODA" if case == "coulomb" else "RK45"
    x = (
        1e3
        * solve_ivp(
            rates, (0, TIME[-1]), [0, 0, 0], method, TIME, rtol=1e-7, atol=1e-10, max_step=1 / RATE
        ).y[0]
    )
    if case == "delay":
        x = np.interp(TIME - 3e-3 * size, TIME, x)
    noise = rng.standard_normal(COUNT)
    if case == "coloured":
        noise = 2 * lfilter([np.sqrt(1 - 0.95**2)], [1, -0.95], noise)
    told = {"wf_increment": 1 / RATE}
    with TdmsWriter(path) as writer:
        writer.write_segment(
            [ChannelObject("run", "Load cell", force / 1e3, told | {"unit_string": "kN"}),
             ChannelObject("run", "x", x + 0.01 * np.std(x) * noise, told | {"unit_string": "mm"})]
        )  # fmt: skip


def dx(v):
    return v


def dv(force, spring, damper, mass):
    return (force - spring - damper) / mass


def spring(x, stiffness):
    return stiffness * x


def damper(v, damping):
    return damping * v


def model() -> Model:
    """What a user writes."""
    return Model.from_rates(
        dx, dv, spring, damper, states={"x": State("m"), "v": State("m/s")}, inputs={"force": "N"},
        observables={"x": Signal("mm")}, units={"spring": "N", "damper": "N"},
        parameters={"stiffness": (1e4, 1e3, 1e5, "N/m"), "damping": (20, 1, 200, "N*s/m"),
            "mass": (1.5, 0.1, 10, "kg")},
        effects=[
            *shelf.mechanics(force=("spring", 60, "N"), x=("x", 5e-3, "m"), v=("v", 0.5, "m/s")),
            *shelf.sensor(of=("x", 5, "mm")),
        ],
    )  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", nargs="+", default=list(TRUTH), choices=TRUTH)
    parser.add_argument("--seeds", default="1:3", metavar="FIRST:END")
    asked = parser.parse_args()
    right = count = 0
    for case in asked.cases:
        for seed in range(*map(int, asked.seeds.split(":"))):
            with tempfile.TemporaryDirectory() as folder:
                place = Path(folder)
                record(place / "run.tdms", case, seed, False)
                record(place / "again.tdms", case, seed, True)
                begin(
                    place / "study", keep_in_memory(model()), None, [place / "run.tdms"],
                    validations=[place / "again.tdms"], columns={"force": "Load cell"},
                )  # fmt: skip
                study, began = specan.Study(place / "study"), time.process_time()
                found = study.diagnose()
                spent, said = time.process_time() - began, {n for names in found.alternatives for n in names}
                good = (
                    bool(said) and said <= TRUTH[case] if TRUTH[case] else found.verdict == "nothing-missing"
                )
                fall = ""
                for name in found.alternatives[0] if found.alternatives else ():
                    rows = study.add(name).columns()
                    held = list(rows["data"]).index("held-out")
                    fall = f"{fall}{rows['before'][held]:.3g} -> {rows['after'][held]:.3g} mm "
                right, count = right + good, count + 1
                mark = "right" if good else "WRONG"
                print(
                    f"{mark} {case} {seed}: {found.verdict}, {sorted(said)} {fall}{spent:.0f} s", flush=True
                )
    print(f"{right} of {count} right")


if __name__ == "__main__":
    main()
