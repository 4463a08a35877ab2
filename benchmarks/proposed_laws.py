"""Laws proposed for unknown effects, on sealed cases: a known model, a hidden law, a table with noise.

``python benchmarks/proposed_laws.py [--seeds 100] [--first 1000] [--nulls 100]``. For every seed a model with two
operating variables, a plan and a hidden law are drawn; the law's family, its numbers, its size and the noise as well.
Counted: the true family among the proposed ones, the number proposed, the error on rows that were never fitted beside
that of the true law, and laws proposed where nothing is hidden.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from specan.models import Model
from specan.study.estimation.fit import fit
from specan.study.evidence.law_search import LawSearch, search_laws
from specan.study.observation.table import TableObservation
from specan.study.selection.candidates import base_problem
from specan.study.selection.refits import Refit

ROWS = (40, 120)
LEAST_VISIBLE = 0.03  # share of a hidden law that the base cannot take
SIZE = (5.0, 40.0)  # sigma of the hidden law's RMS that no base parameter can take


def load_line(load, speed, stiffness, drag):
    """A machine's torque: proportional to load, with viscous drag."""
    return stiffness * load + drag * speed


def pump(load, speed, stiffness, drag):
    """A head that rises with speed squared and falls with flow squared."""
    return stiffness * speed**2 - drag * load**2


def cooler(load, speed, stiffness, drag):
    """A temperature rise: heat over flow, and an offset."""
    return stiffness * load / (1 + speed) + drag


BASES = (load_line, pump, cooler)


@dataclass(frozen=True)
class Hidden:
    """A law: its families with variables, as the grammar calls them, its shapes and its values."""

    family: tuple[str, ...]
    shapes: tuple[float, ...]
    of: Callable[..., np.ndarray]

    def value(self, v: dict[str, np.ndarray]) -> np.ndarray:
        return self.of(v, *self.shapes)


def draw_law(rng: np.random.Generator, spans: dict[str, tuple[float, float]]) -> Hidden:
    """One factor, or in four of ten cases a product with a power."""
    first = str(rng.choice(list(spans)))
    family, shapes, factor = draw_factor(rng, *spans[first])
    if rng.random() < 0.4:
        second = str(rng.choice([name for name in spans if name != first]))
        power = rng.choice([-1.0, 1.0, 2.0])
        names = tuple(sorted([f"{family} of {first}", f"power of {second}"]))
        return Hidden(names, (*shapes, power), lambda v, *p: factor(v[first], *p[:-1]) * v[second] ** p[-1])
    return Hidden((f"{family} of {first}",), shapes, lambda v, *p: factor(v[first], *p))


def draw_factor(
    rng: np.random.Generator, low: float, high: float
) -> tuple[str, tuple[float, ...], Callable[..., np.ndarray]]:
    width = float(low * (high / low) ** rng.uniform(0.15, 0.7))
    power = float(rng.choice([-1.5, -1.0, 0.5, 1.5, 2.0, 3.0]))
    kinds: dict[str, tuple[tuple[float, ...], Callable[..., np.ndarray]]] = {
        "power": ((power,), lambda x, p: x**p),
        "exponential": ((width,), lambda x, w: np.exp(-x / w)),
        "saturation": ((width,), lambda x, w: x / (x + w)),
    }
    name = str(rng.choice(list(kinds)))
    return name, *kinds[name]


@dataclass(frozen=True)
class Sealed:
    """A data set, the model that is known, and the law that is hidden in it (size 0: none)."""

    base: Callable[..., np.ndarray]
    truth: dict[str, float]
    hidden: Hidden
    table: dict[str, np.ndarray]
    measured: np.ndarray
    noise: float
    fresh: dict[str, np.ndarray]
    target: np.ndarray  # on fresh rows, without noise


def draw(seed: int, null: bool) -> Sealed:
    """The case of a seed."""
    rng = np.random.default_rng(seed)
    base = BASES[rng.integers(len(BASES))]
    spans = {"load": (1.0, float(rng.uniform(4, 40))), "speed": (0.5, float(rng.uniform(5, 50)))}
    n = int(rng.integers(*ROWS))
    side = max(4, round(math.sqrt(n)))
    levels = [
        np.geomspace(*spans[v], side) if rng.random() < 0.5 else np.linspace(*spans[v], side) for v in spans
    ]
    grid = np.stack([g.ravel() for g in np.meshgrid(*levels)])
    table = dict(zip(spans, grid))
    fresh = {v: rng.uniform(*spans[v], 60) for v in spans}
    truth = {"stiffness": float(rng.uniform(0.5, 3)), "drag": float(rng.uniform(0.2, 2))}
    clean, clean_fresh = base(**table, **truth), base(**fresh, **truth)
    # Sized by what the base's own parameters cannot take; a law that they take altogether is not hidden in the data.
    basis, _ = np.linalg.qr(base_columns(base, truth, table))
    while True:
        hidden = draw_law(rng, spans)
        law, law_fresh = hidden.value(table), hidden.value(fresh)
        visible = law - basis @ (basis.T @ law)
        if np.linalg.norm(visible) > LEAST_VISIBLE * np.linalg.norm(law):
            break
    noise = 0.01 * float(np.std(clean))
    strength = float(np.exp(rng.uniform(*np.log(SIZE))))
    size = 0.0 if null else strength * noise / float(np.sqrt(np.mean(visible**2)))
    measured = clean + size * law + noise * rng.standard_normal(clean.size)
    return Sealed(base, truth, hidden, table, measured, noise, fresh, clean_fresh + size * law_fresh)


def case(seed: int, null: bool) -> tuple[LawSearch, Hidden, dict[str, float]]:
    """What the search finds in the case of a seed, and its errors beside those of the true law."""
    s = draw(seed, null)
    model = Model.from_function(
        s.base,
        conditions={v: ("1", float(x.min()), float(x.max())) for v, x in s.table.items()},
        observables={"y": ("1", 0.1)},
        parameters=dict.fromkeys(s.truth, (1.0, 0.01, 10.0)),
    )
    n = s.measured.size
    covariance = np.diag(np.full(n, s.noise**2))
    observed = TableObservation("sealed", np.full(n, "y"), s.measured, s.table, covariance, labels=s.table)
    problem = base_problem(model, [observed])
    start = Refit(frozenset(), problem, fit(problem, starts=3))
    began = time.process_time()
    found = search_laws(start)
    errors = {"cpu_s": time.process_time() - began}
    if found.laws:
        errors["held_out"] = held_out(s.base, s.truth, found, s.table, s.measured, s.fresh, s.target)
        errors["of_truth"] = of_truth(s)
    return found, s.hidden, errors


def fitted_error(columns: np.ndarray, fresh: np.ndarray, measured: np.ndarray, target: np.ndarray) -> float:
    solution, *_ = np.linalg.lstsq(columns, measured, rcond=None)
    return float(np.sqrt(np.mean((fresh @ solution - target) ** 2)))


def base_columns(base, truth: dict[str, float], v: dict[str, np.ndarray]) -> np.ndarray:
    """The bases are linear in their two parameters."""
    zero = dict.fromkeys(truth, 0.0)
    return np.stack([base(**v, **{**zero, name: 1.0}) for name in truth], axis=1)


def of_truth(s: Sealed) -> float:
    """With its numbers fitted, as those of a proposed law are."""
    own, there = base_columns(s.base, s.truth, s.table), base_columns(s.base, s.truth, s.fresh)

    def left(shapes: np.ndarray) -> np.ndarray:
        columns = np.column_stack([own, s.hidden.of(s.table, *shapes)])
        solution, *_ = np.linalg.lstsq(columns, s.measured, rcond=None)
        return columns @ solution - s.measured

    shapes = least_squares(left, s.hidden.shapes, x_scale=np.abs(s.hidden.shapes)).x
    here, new = s.hidden.of(s.table, *shapes), s.hidden.of(s.fresh, *shapes)
    return fitted_error(np.column_stack([own, here]), np.column_stack([there, new]), s.measured, s.target)


def held_out(base, truth, found: LawSearch, table, measured, fresh, target) -> float:
    law = found.laws[0]
    own, there = base_columns(base, truth, table), base_columns(base, truth, fresh)
    here, new = law.formula.value(table, law.shapes), law.formula.value(fresh, law.shapes)
    if law.formula.scales:
        solution, *_ = np.linalg.lstsq(own, measured, rcond=None)
        here, new = here * (own @ solution), new * (there @ solution)
    return fitted_error(np.column_stack([own, here]), np.column_stack([there, new]), measured, target)


def names(found: LawSearch) -> list[tuple[str, ...]]:
    return [law.formula.family for law in found.laws]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("--nulls", type=int, default=100)
    parser.add_argument("--first", type=int, default=1000)
    asked = parser.parse_args()
    named, ratios, members, spent = 0, [], [], []
    for seed in range(asked.first, asked.first + asked.seeds):
        found, hidden, errors = case(seed, null=False)
        right = hidden.family in names(found)
        named += right
        members.append(len(found.laws))
        spent.append(errors["cpu_s"])
        if "held_out" in errors:
            ratios.append(errors["held_out"] / errors["of_truth"])
        print(seed, "right" if right else "WRONG", hidden.family, names(found), found.more,
              f"{ratios[-1]:.2f}" if found.laws else "-", f"{errors['cpu_s']:.1f} s", flush=True)  # fmt: skip
    false = 0
    for seed in range(asked.first, asked.first + asked.nulls):
        found, _, errors = case(seed, null=True)
        false += bool(found.laws)
    print(
        f"true family proposed: {named}/{asked.seeds}; members: median {np.median(members):g}, most {max(members)}"
    )
    print(
        f"held-out RMS over that of the true law: median {np.median(ratios):.2f}, 90 % {np.quantile(ratios, 0.9):.2f}"
    )
    print(f"laws on nulls: {false}/{asked.nulls}; CPU s a search: median {np.median(spent):.2f}")


if __name__ == "__main__":
    main()
