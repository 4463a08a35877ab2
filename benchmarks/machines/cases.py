"""What is asked of a machine: a table drawn by a seed, what is hidden in it, and how visible that is.

The truth of a machine is written in other formulas than its model. How visible an effect is, is worked out on readings
without noise by plain refits of scipy, which know nothing of how specan selects.
"""

from __future__ import annotations

import itertools
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from open_tables import read_tables
from scipy.optimize import brentq, least_squares

from specan.models import Model, varying
from specan.study.observation.table import TableObservation
from specan.study.selection.candidates import grouped_by

Array = NDArray[np.float64]
Table = dict[str, Any]  # columns of conditions and of names of a group, or readings of each observable

SHARES = {"null": 0.25, "single": 0.40, "pair": 0.18, "outside": 0.12, "ar-0.9": 0.025, "ar-0.99": 0.025}
NOISE = (0.2, 2.0)  # percent of a reading
SIZE = (0.6, 20.0)  # change of the readings by an effect over the noise, both root mean square
REPEATED = 3  # rows of each point of a plan with repeats
DISCREPANCY = 0.5  # percent that a user declares by habit
FLOOR = 0.2  # of the middle reading: what the same percentage adds to errors of small ones


class Strengths(dict[str, float]):
    """Of what is hidden; what is not has none."""

    def __missing__(self, name: str) -> float:
        return 0.0


@dataclass(frozen=True)
class Machine:
    """A model, and a machine that differs from it.

    Attributes
    ----------
    model : callable
        The model as a user writes it, from what ``[uncertainty]`` says.
    plan : callable
        Operating points of a table, drawn.
    forms : callable
        The numbers that the truth's formulas are made of, drawn.
    readings : callable
        ``(table, forms, strengths)``: what the machine does, one array for each observable.
    inside, outside : mapping
        What can be hidden, by the name of the candidate that describes it or by a name of its own, and the lowest and
        highest strength; below zero for one that goes either way.
    setting : mapping
        Percent by which a condition is off its set value.
    """

    model: Callable[[Mapping[str, float]], Model]
    plan: Callable[[np.random.Generator], Table]
    forms: Callable[[np.random.Generator], Mapping[str, float]]
    readings: Callable[[Table, Mapping[str, float], Mapping[str, float]], Mapping[str, Array]]
    inside: Mapping[str, tuple[float, float]]
    outside: Mapping[str, tuple[float, float]]
    setting: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Case:
    """One table of one machine.

    Attributes
    ----------
    kind : str
        One of `SHARES`.
    strengths : mapping
        What is hidden.
    noise : float
        Percent of a reading.
    repeated : bool
        The points are gone through `REPEATED` times and nothing is declared; else the noise is declared.
    """

    machine: Machine
    name: str
    seed: int
    kind: str
    table: Table
    forms: Mapping[str, float]
    strengths: Strengths
    noise: float
    repeated: bool

    @property
    def truth(self) -> tuple[str, ...]:
        """Names in the catalogue of what is hidden."""
        return tuple(sorted(n for n in self.strengths if n in self.machine.inside))

    @cached_property
    def model(self) -> Model:
        """As the user has it."""
        said = {"model_discrepancy_percent": DISCREPANCY}
        if not self.repeated:
            said |= {f"{name}_percent": self.noise for name in self.clean}
            said |= {name: 0.01 * self.noise * floor_of(y) for name, y in self.clean.items()}
        return self.machine.model(said)

    @cached_property
    def clean(self) -> Mapping[str, Array]:
        """Readings without noise."""
        return self.machine.readings(self.table, self.forms, self.strengths)

    @cached_property
    def observation(self) -> TableObservation:
        """The table, written and read as a user's would be."""
        rng = np.random.default_rng([self.seed, 2])
        actual, written = self.settings(rng)
        readings = self.machine.readings(actual, self.forms, self.strengths)
        noisy = {
            n: y + 0.01 * self.noise * scale_of(self.clean[n]) * self._white(rng, y.size)
            for n, y in readings.items()
        }
        columns = {**written, **self.written(noisy, rng)}
        rows = "\n".join(
            ",".join(v if isinstance(v, str) else f"{v:.8g}" for v in row)
            for row in zip(*columns.values(), strict=True)
        )
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "table.csv"
            path.write_text(",".join(columns) + "\n" + rows + "\n", encoding="utf-8")
            (found,) = read_tables(self.model, [path]).fitted
        assert isinstance(found, TableObservation)
        return found

    def settings(self, rng: np.random.Generator) -> tuple[Table, Table]:
        """What was really set, and what the table says."""
        actual = {
            n: _reset(x, self.machine.setting.get(n, 0.0), rng) if self.repeated else x
            for n, x in self.table.items()
        }
        return actual, self.table

    def written(self, readings: dict[str, Array], rng: np.random.Generator) -> dict[str, Array]:
        """What the table says of the readings."""
        return readings

    def _white(self, rng: np.random.Generator, n: int) -> Array:
        """Errors of unit variance; in a case of that kind each remembers the one before."""
        noise = rng.standard_normal(n)
        if self.kind.startswith("ar-"):
            memory = float(self.kind.removeprefix("ar-"))
            for k in range(1, n):
                noise[k] = memory * noise[k - 1] + np.sqrt(1 - memory**2) * noise[k]
        return noise

    @cached_property
    def without_noise(self) -> TableObservation:
        """The table without noise, with the covariance that specan takes for the noisy one."""
        lines = self.observation.lines
        assert lines is not None
        rows = lines - lines.min()
        measured = [
            self.clean[name][row]
            for name, row in zip(self.observation.observable.tolist(), rows, strict=True)
        ]
        return replace(self.observation, measured=np.array(measured))

    def left(self, *effects: str) -> float:
        """Chi-square that the readings without noise leave with some effects in the model, all refitted."""
        return refitted(self.model, self.without_noise, effects)

    def visibility(self) -> dict[str, Any]:
        """How well the truth can be seen and told from others.

        lambda is what the model as it is leaves, d what the best wrong effect leaves more than the truth, or what the
        best effect leaves where none is true, and weakest what the better one of a pair leaves more than both.
        """
        found: dict[str, Any] = {"lambda": self.left()}
        truth = self.left(*self.truth) if self.truth else 0.0
        if self.truth:
            found["left_by_truth"] = truth
        if len(self.truth) == 2:
            found["weakest"] = min(map(self.left, self.truth)) - truth
        elif self.strengths:
            others = {name: self.left(name) for name in candidates(self) if name not in self.truth}
            rival = min(others, key=others.__getitem__)
            found |= {"rival": rival, "d": others[rival] - truth}
        return found


def candidates(case: Case) -> list[str]:
    """All effects that the user's model knows."""
    return sorted(grouped_by(case.model, [case.observation]).effects)


def refitted(model: Model, observation: TableObservation, effects: Sequence[str]) -> float:
    """Least chi-square over all parameters inside their plausible ranges, from the corners of the effects' shapes."""
    assembly = grouped_by(model, [observation]).assemble(effects)
    free = assembly.free(varying([observation.conditions]))
    sizes: dict[str, float] = {}
    shapes = []
    for name in effects:
        effect = assembly.model.effects[name]
        sizes |= {f"{name}.{n}": v for n, v in effect.neutral.items()}
        shapes += [f"{name}.{n}" for n in effect.parameters if n not in effect.neutral]
    given = [assembly.parameters[name] for name in free]
    neutral = [sizes.get(name, p.default) for name, p in zip(free, given, strict=True)]
    low = np.array([min(p.min, at) for p, at in zip(given, neutral, strict=True)])
    high = np.array([max(p.max, at) for p, at in zip(given, neutral, strict=True)])
    width = high - low

    def residuals(unit: Array) -> Array:
        values = {**assembly.defaults, **dict(zip(free, (low + width * unit).tolist(), strict=True))}
        rest = observation.measured - observation.predict(assembly, values)
        return observation.whiten(np.where(np.isfinite(rest), rest, 1e6))

    begin = (np.array([p.default for p in given]) - low) / width
    shaped = [k for k, name in enumerate(free) if name in shapes]
    found = []
    for places in itertools.product((0.5, 0.15, 0.85), repeat=min(len(shaped), 2)):
        start = begin.copy()
        for k, place in zip(shaped, places, strict=False):
            start[k] = place
        fit = least_squares(
            residuals, np.clip(start, 1e-6, 1 - 1e-6), bounds=(0, 1), x_scale="jac", max_nfev=60
        )
        found.append(2 * fit.cost)
    return float(min(found))


def scale_of(reading: Array) -> Array:
    return np.hypot(reading, floor_of(reading))


def floor_of(reading: Array) -> float:
    return FLOOR * float(np.median(np.abs(reading)))


def _reset(x: Any, percent: float, rng: np.random.Generator) -> Any:
    return x * (1 + 0.01 * percent * rng.standard_normal(len(x))) if percent else x


def drawn(seed: int, machines: Mapping[str, Machine], only: str = "") -> Case:
    """The case of a seed, of one kind `only` where that is told; its machine is the next in turn."""
    name = list(machines)[seed % len(machines)]
    machine, rng = machines[name], np.random.default_rng([seed, 1])
    kind = str(rng.choice(list(SHARES), p=list(SHARES.values())))
    kind = only or kind
    repeated = bool(rng.random() < 0.5) and not kind.startswith("ar-")
    noise = float(np.exp(rng.uniform(*np.log(NOISE))))
    table, forms = machine.plan(rng), machine.forms(rng)
    if repeated:
        rows = next(iter(table.values())).size
        chosen = np.sort(rng.choice(rows, size=rows // REPEATED, replace=False))
        table = {n: np.tile(x[chosen], REPEATED) for n, x in table.items()}
    pool = list(machine.outside if kind == "outside" else machine.inside)
    count = {"single": 1, "outside": 1, "pair": 2}.get(kind, 0)
    strengths = Strengths()
    for one in rng.choice(pool, size=count, replace=False).tolist():
        size = noise * np.exp(rng.uniform(*np.log(SIZE)))
        limits = (machine.outside if kind == "outside" else machine.inside)[one]
        strengths[one] = _strength(machine, table, forms, one, limits, size, rng)
    return Case(machine, name, seed, kind, table, forms, strengths, noise, repeated)


def _strength(
    machine: Machine, table: Table, forms: Mapping[str, float], name: str, limits: tuple[float, float], size: float,
    rng: np.random.Generator,
) -> float:  # fmt: skip
    """The strength that changes readings by so many percent, as far as its limits let it."""
    low, high = limits
    sign = -1.0 if low < 0 and rng.random() < 0.5 else 1.0
    high = abs(low) if sign < 0 else high
    low = 1e-4 * high
    plain = machine.readings(table, forms, Strengths())

    def change(logarithm: float) -> float:
        found = machine.readings(table, forms, Strengths({name: sign * float(np.exp(logarithm))}))
        parts = [((found[o] - y) / scale_of(y)) ** 2 for o, y in plain.items()]
        return float(100 * np.sqrt(np.mean(parts)) - size)

    ends = np.log([low, high])
    if change(ends[1]) <= 0 or change(ends[0]) >= 0:
        return sign * float(np.exp(ends[1 if change(ends[1]) <= 0 else 0]))
    return sign * float(np.exp(brentq(change, *ends, xtol=1e-3)))
