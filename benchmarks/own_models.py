"""What a verdict on a user's own model costs.

    python benchmarks/own_models.py [python|fmu]

A pipe's pressure loss over flow and temperature, 200 rows, with the equation of Colebrook solved row by row in plain
Python: one evaluation of all rows takes 1 or 5 ms, by the number of iterations. One of eight candidate effects is
hidden. Printed are CPU seconds of the verdict, how many evaluations of all rows it took, and what they cost by
themselves. The same for an FMU made by pythonfmu, whose simulations are counted and repeated without specan.
"""

from __future__ import annotations

import math
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from open_tables import read_tables

from specan.models import Model, Parameter, effect
from specan.study.diagnose import diagnose
from specan.study.selection.candidates import base_problem

ROWS = 200
NOISE = 0.02  # kPa
HIDDEN = ("fouling", "valve", "cavitation", "leak")


class Loss:
    """The loss of a pipe; counts the rows that it works out and the CPU time that it takes."""

    def __init__(self, iterations: int) -> None:
        self.iterations, self.rows, self.seconds = iterations, 0, 0.0

    def function(self) -> Callable[..., np.ndarray]:
        def loss(flow, temperature, roughness, length, extra):
            """Pressure lost in the pipe, kPa, from litres a second."""
            began = time.process_time()
            each = np.broadcast_arrays(np.atleast_1d(flow), temperature, roughness, length, extra)
            found = np.array([self._one(*row) for row in zip(*(a.tolist() for a in each), strict=True)])
            self.rows += found.size
            self.seconds += time.process_time() - began
            return found

        return loss

    def _one(self, flow: float, temperature: float, roughness: float, length: float, extra: float) -> float:
        diameter = 0.05
        speed = 1e-3 * flow / (math.pi / 4 * diameter**2)
        viscosity = 1e-6 * math.exp(-0.022 * (temperature - 20))
        reynolds = speed * diameter / viscosity
        root = 7.0
        for _ in range(self.iterations):
            root = -2 * math.log10(roughness / 1000 / diameter / 3.71 + 2.51 * root / reynolds)
        return (length / diameter / root**2 + extra) * 0.5 * speed**2


@effect("fouling", scales="pressure", neutral={"rate": 0.0})
def fouling(flow, *, rate=Parameter(0.02, min=0.002, max=0.2, lower=0, upper=1)):
    """Deposits narrow the pipe."""
    return 1 + rate * np.sqrt(flow)


@effect("zero", adds_to="pressure", neutral={"offset": 0.0})
def zero(*, offset=Parameter(0.2, min=-2, max=2)):
    """The gauge does not read zero at rest."""
    return offset


@effect("gain", scales="pressure", neutral={"error": 0.0})
def gain(*, error=Parameter(0.02, min=-0.1, max=0.1)):
    """The gauge reads a share too much."""
    return 1 + error


@effect("valve", adds_to="pressure", neutral={"size": 0.0})
def valve(
    flow, *, size=Parameter(0.2, min=0.01, max=3, lower=0, upper=10), onset=Parameter(3.0, min=1, max=5)
):
    """Above some flow a check valve flutters."""
    return size * np.maximum(flow - onset, 0) ** 2


@effect("cavitation", adds_to="pressure", neutral={"size": 0.0})
def cavitation(flow, temperature, *, size=Parameter(0.01, min=0.001, max=0.2, lower=0, upper=1)):
    """Warm water boils where it is fast."""
    return size * flow**3 * np.maximum(temperature - 30, 0) / 30


@effect("swelling", adds_to="pressure", neutral={"rate": 0.0})
def swelling(flow, temperature, *, rate=Parameter(0.01, min=0.001, max=0.1, lower=0, upper=1)):
    """The wall takes up water when warm."""
    return rate * flow**2 * (temperature - 20) / 20


@effect("air", adds_to="pressure", neutral={"share": 0.0})
def air(
    flow, *, share=Parameter(0.2, min=0.02, max=2, lower=0, upper=5), limit=Parameter(1.0, min=0.3, max=3)
):
    """Air collects below some flow."""
    return share * np.exp(-((flow / limit) ** 2))


@effect("leak", adds_to="pressure", neutral={"rate": 0.0})
def leak(flow, *, rate=Parameter(0.05, min=0.005, max=0.5, lower=0, upper=2)):
    """Part of the flow goes elsewhere."""
    return -rate * flow


CANDIDATES = (fouling, zero, gain, valve, cavitation, swelling, air, leak)


def pipe(loss: Callable[..., np.ndarray]) -> Model:
    def pressure(loss):
        """What the gauge reads."""
        return loss

    return Model.from_function(
        pressure, loss,
        conditions={"flow": ("1", 0.3, 6), "temperature": ("1", 5, 60)}, observables={"pressure": ("1", NOISE)},
        parameters={"roughness": (0.05, 0.005, 0.5), "length": (10.0, 5, 20), "extra": (5.0, 0, 20)},
        effects=CANDIDATES,
    )  # fmt: skip


def observations(model: Model, hidden: str, conditions: dict[str, np.ndarray], noise: float):
    """A table with an effect in it, written and read as a user's would be."""
    (observable,) = model.observables
    truth = np.asarray(model.assemble([hidden]).evaluate(conditions)[observable])
    measured = truth + noise * np.random.default_rng(7).standard_normal(truth.size)
    with tempfile.TemporaryDirectory() as folder:
        table = Path(folder) / "bench.csv"
        rows = zip(*conditions.values(), measured, strict=True)
        text = "\n".join(",".join(f"{v:.9g}" for v in row) for row in rows)
        table.write_text(",".join([*conditions, observable]) + "\n" + text + "\n", encoding="utf-8")
        return read_tables(model, [table]).fitted


def plan() -> dict[str, np.ndarray]:
    """Twenty flows at each of ten temperatures."""
    flow, temperature = np.meshgrid(np.linspace(0.3, 6, 20), np.linspace(5, 60, 10))
    return {"flow": flow.ravel(), "temperature": temperature.ravel()}


def iterations_for(milliseconds: float, conditions: dict[str, np.ndarray]) -> int:
    """Iterations of the equation of Colebrook that make an evaluation of all rows take so long here."""
    times = {}
    for iterations in (10, 60):
        loss = Loss(iterations)
        for _ in range(20):
            loss.function()(*conditions.values(), 0.05, 10.0, 5.0)
        times[iterations] = 1000 * loss.seconds / 20
    return round(10 + (milliseconds - times[10]) * 50 / (times[60] - times[10]))


def python_models() -> None:
    conditions = plan()
    print(
        f"{'ms an evaluation':>18}{'hidden':>12}{'named':>14}{'CPU s':>8}{'evaluations':>13}{'theirs, CPU s':>15}"
    )
    for milliseconds in (1.0, 5.0):
        iterations = iterations_for(milliseconds, conditions)
        for hidden in HIDDEN:
            loss = Loss(iterations)
            model = pipe(loss.function())
            rows = observations(model, hidden, conditions, NOISE)
            loss.rows, loss.seconds = 0, 0.0
            began = time.process_time()
            found = diagnose(base_problem(model, rows))
            spent = time.process_time() - began
            one = 1000 * loss.seconds / (loss.rows / ROWS)
            print(
                f"{one:18.2f}{hidden:>12}{','.join(found.effects) or found.verdict:>14}{spent:8.2f}"
                f"{loss.rows / ROWS:13.0f}{loss.seconds:15.2f}",
                flush=True,
            )


SOURCE = """
import math
from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real

class drive(Fmi2Slave):
    def __init__(self, **kw):
        super().__init__(**kw)
        self.speed, self.mu, self.rise, self.size, self.torque = 100.0, 1.0, 0.0, 0.0, 0.0
        self.register_variable(Real("speed", causality=Fmi2Causality.input))
        for name in ("mu", "rise", "size"):
            self.register_variable(Real(name, causality=Fmi2Causality.parameter, variability=Fmi2Variability.tunable))
        self.register_variable(Real("torque", causality=Fmi2Causality.output))

    def do_step(self, t, h):
        self.torque = self.mu + self.rise * math.exp(-self.speed / 20) + self.size * (self.speed / 100) ** 2
        return True
"""
SETTINGS = """
[simulation]
duration = 1.0
step = 0.05
[conditions.speed]
unit = "1/min"
low = 5
high = 300
[observables.torque]
unit = "N*m"
uncertainty = 0.01
[parameters.mu]
value = 0.8
min = 0.1
max = 3
unit = "N*m"
"""
EFFECT = """
[effects.{0}.parameters.{1}]
value = 0.3
min = 0.05
max = 2
lower = 0
neutral = 0
"""


def fmu_model() -> None:
    """A verdict on an FMU beside its simulations alone, repeated one after the other by FMPy in one process."""
    import subprocess

    import fmpy

    from specan.fmu.process import FmuProcess
    from specan.models.catalogue import load_model

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "source.py").write_text(SOURCE, encoding="utf-8")
        build = [
            sys.executable,
            "-m",
            "pythonfmu",
            "build",
            "-f",
            str(folder / "source.py"),
            "-d",
            str(folder),
        ]
        subprocess.run(build, check=True, capture_output=True)
        effects = EFFECT.format("stribeck", "rise") + EFFECT.format("windage", "size")
        (folder / "drive.toml").write_text(SETTINGS + effects, encoding="utf-8")
        model = load_model(folder / "drive.fmu", {})
        rows = observations(model, "stribeck", {"speed": np.geomspace(5, 300, ROWS)}, 0.01)
        counted: list[list[float]] = []
        simulate = FmuProcess.simulate

        def counting(self, rows):
            counted.extend(rows)
            return simulate(self, rows)

        FmuProcess.simulate = counting
        began = _with_children()
        found = diagnose(base_problem(model, rows))
        spent = _with_children() - began
        began, bare = _with_children(), 0.0
        unpacked = fmpy.extract(str(folder / "drive.fmu"))
        description = fmpy.read_model_description(unpacked)
        instance = fmpy.instantiate_fmu(unpacked, description, "CoSimulation")
        for row in counted:
            instance.reset()
            fmpy.simulate_fmu(
                unpacked, stop_time=1.0, output_interval=0.05, fmu_instance=instance, model_description=description,
                start_values=dict(zip(("speed", "mu", "rise", "size"), map(float, row), strict=True)),
                output=["torque"], validate=False,
            )  # fmt: skip
        bare = _with_children() - began
        print(
            f"FMU: {','.join(found.effects) or found.verdict} named, {len(counted)} simulations, {spent:.2f} CPU s; "
            f"the simulations alone {bare:.2f} CPU s; ratio {spent / bare:.2f}"
        )


def _with_children() -> float:
    """CPU time of this process and of those that it started, the running ones included."""
    import psutil

    me = psutil.Process()
    parts = [me.cpu_times(), *(child.cpu_times() for child in me.children(recursive=True))]
    return sum(part.user + part.system for part in parts)


if __name__ == "__main__":
    if "fmu" not in sys.argv[1:]:
        python_models()
    if "python" not in sys.argv[1:]:
        fmu_model()
