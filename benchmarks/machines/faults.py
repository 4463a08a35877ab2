"""Faults of the data, planted in tables of the eight machines: is each found, and is none found where there is none?

    python benchmarks/machines/faults.py [--seeds 0:16] [--fault NAME]

A fault is planted in what was set or written, never in what specan says of it. Counted is where the fault has more
than one half of the probability, and where it has less than a twentieth in clean tables. A fault of which the refitted
model leaves a chi-square below 50 is not counted.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import numpy as np  # noqa: E402

from machines.cases import Array, Case, Table, drawn, refitted  # noqa: E402
from machines.run import MACHINES  # noqa: E402
from specan.models import Model  # noqa: E402
from specan.study.diagnose import diagnose  # noqa: E402
from specan.study.selection.candidates import base_problem  # noqa: E402

VISIBLE = 50.0
ROOM = 22.0  # degC
NO_ZERO = ("temperature", "position", "excess", "angle", "evaporating", "condensing")
BADLY_SET = 2.0  # percent, where a fault needs a setting that scatters


@dataclass(frozen=True, eq=False)
class Faulty(Case):
    """A case with a fault: what was really set, and what was written down."""

    fault: str = ""
    setting: dict[str, float] = field(default_factory=dict)

    @property
    def model(self) -> Model:  # type: ignore[override]
        """As the user has it, with what the rig says of setting."""
        if not self.setting:
            return super().model
        said = {f"{name}_setting_percent": size for name, size in self.setting.items()}
        inner = replace(self.machine, model=lambda given: self.machine.model({**given, **said}))
        return replace(Case(inner, self.name, self.seed, self.kind, self.table, self.forms, self.strengths,
                            self.noise, self.repeated)).model  # fmt: skip

    def settings(self, rng: np.random.Generator) -> tuple[Table, Table]:
        actual, written = super().settings(rng)
        return CONDITIONS.get(self.fault, lambda case, a, w, r: (a, w))(self, actual, written, rng)

    def written(self, readings: dict[str, Array], rng: np.random.Generator) -> dict[str, Array]:
        return READINGS.get(self.fault, lambda case, y, r: y)(self, readings, rng)


def in_levels(case: Case) -> list[str]:
    """Conditions of a few levels, on a scale that has a zero."""
    table = {n: x for n, x in case.table.items() if x.dtype.kind == "f" and n not in NO_ZERO}
    return [n for n, x in table.items() if 3 <= np.unique(x).size <= 20]


def level(case: Case, actual: Table, written: Table, rng: np.random.Generator) -> tuple[Table, Table]:
    """One level of a condition is 3 to 6 % off what is written."""
    name = str(rng.choice(in_levels(case)))
    rows = case.table[name] == rng.choice(np.unique(case.table[name])[1:])
    factor = 1 + rng.choice([-1, 1]) * rng.uniform(0.03, 0.06)
    return {**actual, name: np.where(rows, actual[name] * factor, actual[name])}, written


def thermometer(case: Case, actual: Table, written: Table, rng: np.random.Generator) -> tuple[Table, Table]:
    """The thermometer hangs in the room while the machine warms up, the more the harder it works."""
    cold = {**actual, "temperature": np.full_like(case.table["temperature"], ROOM)}
    work = np.abs(next(iter(case.machine.readings(cold, case.forms, case.strengths).values())))
    order = np.arange(work.size) / work.size
    warm = (
        rng.uniform(10, 35) * (0.3 + 0.7 * work / work.max()) * (1 - np.exp(-order / rng.uniform(0.05, 0.3)))
    )
    room = np.round(ROOM + 0.3 * rng.standard_normal(work.size), 1)
    return {**actual, "temperature": ROOM + warm}, {**written, "temperature": room}


def cold_spot(case: Case, actual: Table, written: Table, rng: np.random.Generator) -> tuple[Table, Table]:
    """The thermometer sits where it is half as far from the room as what it is to measure."""
    seen = ROOM + 0.5 * (actual["temperature"] - ROOM)
    return actual, {**written, "temperature": np.round(seen, 2)}


def not_set_anew(case: Case, actual: Table, written: Table, rng: np.random.Generator) -> tuple[Table, Table]:
    """Each point is set once, badly, and read several times."""
    (name,) = case.setting
    _, index = np.unique(np.column_stack([*case.table.values()]), axis=0, return_inverse=True)
    off = BADLY_SET / 100 * rng.standard_normal(int(index.max()) + 1)
    return {**case.table, name: case.table[name] * (1 + off[np.ravel(index)])}, written


def switched(case: Case, readings: dict[str, Array], rng: np.random.Generator) -> dict[str, Array]:
    """Above some size a reading has another zero."""
    name = str(rng.choice(list(readings)))
    size = np.abs(case.clean[name])
    above = size > np.quantile(size, rng.uniform(0.3, 0.7))
    shift = rng.choice([-1, 1]) * rng.uniform(0.02, 0.06) * np.median(size)
    return {**readings, name: readings[name] + shift * above}


def later_zero(case: Case, readings: dict[str, Array], rng: np.random.Generator) -> dict[str, Array]:
    """From some row on a reading has another zero."""
    name = str(rng.choice(list(readings)))
    size = np.median(np.abs(case.clean[name]))
    after = np.arange(readings[name].size) > rng.uniform(0.3, 0.7) * readings[name].size
    return {**readings, name: readings[name] + rng.choice([-1, 1]) * rng.uniform(0.02, 0.06) * size * after}


def lagging(case: Case, readings: dict[str, Array], rng: np.random.Generator) -> dict[str, Array]:
    """The pointer of a reading has play: it follows what it shows only after a gap is closed."""
    name = str(rng.choice(list(readings)))
    gap = rng.uniform(0.01, 0.03) * np.median(np.abs(case.clean[name]))
    out, at = readings[name].copy(), case.clean[name][0]
    for row, true in enumerate(case.clean[name]):
        at = min(max(at, true - gap), true + gap)
        out[row] += at - true
    return {**readings, name: out}


def copied(case: Case, readings: dict[str, Array], rng: np.random.Generator) -> dict[str, Array]:
    """A tenth to a third of the last pass was not measured but copied from the first."""
    rows = next(iter(readings.values())).size // 3
    chosen = rng.choice(rows, size=max(int(rows * rng.uniform(0.1, 0.35)), 2), replace=False)
    out = {n: y.copy() for n, y in readings.items()}
    for y in out.values():
        y[2 * rows + chosen] = y[chosen]
    return out


Condition = Callable[[Case, Table, Table, np.random.Generator], tuple[Table, Table]]
CONDITIONS: dict[str, Condition] = {
    "level": level, "thermometer": thermometer, "cold-spot": cold_spot, "not-set-anew": not_set_anew,
}  # fmt: skip
READINGS: dict[str, Callable[[Case, dict[str, Array], np.random.Generator], dict[str, Array]]] = {
    "range": switched, "later-zero": later_zero, "copied": copied, "hysteresis": lagging,
}  # fmt: skip
SAID = {  # what the name of the explanation has to hold
    "level": ("of a level",), "thermometer": ("temperature",), "cold-spot": ("temperature",),
    "not-set-anew": ("not set anew",), "range": ("of a range",), "later-zero": ("from a row on",),
    "copied": ("copied",), "hysteresis": ("hysteresis",),
}  # fmt: skip


def planted(seed: int, fault: str) -> Faulty | None:
    """The case of a seed with a fault; None where it cannot have that one."""
    case = drawn(seed, MACHINES, "null")
    warm = fault in ("thermometer", "cold-spot")
    if (warm and "temperature" not in case.table) or (fault == "level" and not in_levels(case)):
        return None
    if fault in ("copied", "not-set-anew") and not case.repeated:
        return None
    setting = {}
    if fault == "not-set-anew":
        if not case.machine.setting:
            return None
        setting = dict.fromkeys(case.machine.setting, BADLY_SET)
    return Faulty(case.machine, case.name, seed, "null", case.table, case.forms, case.strengths, case.noise,
                  case.repeated, fault, setting)  # fmt: skip


def chi2(case: Faulty) -> float:
    """What the refitted model leaves beside the noise."""
    if case.fault == "copied":
        return np.inf
    return refitted(case.model, case.observation, ()) - case.observation.n


def main() -> int:
    """Run and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", default="0:16", metavar="FIRST:END")
    parser.add_argument("--fault", choices=[*CONDITIONS, *READINGS])
    asked = parser.parse_args()
    seeds = range(*map(int, asked.seeds.split(":")))
    for fault in [asked.fault] if asked.fault else [*CONDITIONS, *READINGS]:
        found = right = count = 0
        for seed in seeds:
            case = planted(seed, fault)
            if case is None or chi2(case) < VISIBLE:
                continue
            told = diagnose(base_problem(case.model, [case.observation]))
            share = sum(p.probability for p in told.probabilities if p.kind == "fault")
            names = [p for p in told.probabilities if p.kind == "fault"]
            named = bool(names) and share > 0.5 and any(word in names[0].explanation for word in SAID[fault])
            count, found, right = count + 1, found + (share > 0.5), right + named
            if not named:
                rest = ", ".join(f"{p.explanation} {p.probability:.2f}" for p in told.probabilities[:3])
                print(
                    f"  {case.name}/{seed} {fault}, chi-square {chi2(case):.0f}: {told.verdict}: {rest}",
                    flush=True,
                )
        print(f"{fault}: a fault in {found} of {count}, this one in {right}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
