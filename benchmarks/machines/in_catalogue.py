"""Cases whose truth is the user's own model, with effects of its own catalogue, and noise: every equation is exact."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from machines.cases import SIZE, Array, Case, Machine, Strengths, candidates, scale_of
from machines.cases import drawn as drawn_of_machine
from specan.study.estimation.problem import Problem
from specan.study.selection.candidates import base_problem

SHARES = {"null": 0.3, "single": 0.45, "pair": 0.25}


def drawn(seed: int, machines: Mapping[str, Machine], only: str = "") -> Case:
    """The case of a seed: values of all parameters are drawn from what is known of them, sizes of effects by `SIZE`."""
    plain, rng = drawn_of_machine(seed, machines), np.random.default_rng([seed, 77])
    kind = str(rng.choice(list(SHARES), p=list(SHARES.values())))
    kind = only or kind
    inside = [name for name in candidates(plain) if name in plain.machine.inside]
    count = {"null": 0, "single": 1, "pair": 2}[kind]
    names = rng.choice(inside, size=count, replace=False).tolist()
    base = base_problem(plain.model, [plain.observation])
    values = {name: float(rng.uniform(*base.plausible(name))) for name in base.names}
    for name in names:
        values |= _of_effect(name, base, values, plain, rng)
    readings = _readings(base.with_uses(names), values, plain)
    machine = replace(plain.machine, readings=lambda *_: readings, setting={})
    strengths = Strengths(dict.fromkeys(names, 1.0))
    return replace(plain, machine=machine, kind=kind, strengths=strengths)


def _of_effect(
    name: str, base: Problem, values: Mapping[str, float], plain: Case, rng: np.random.Generator
) -> dict[str, float]:
    """Values of an effect's own parameters; its size is made smaller until readings change by what was drawn."""
    problem = base.with_uses([name])
    own = [n for n in problem.names if n not in values]
    there = {n: float(rng.uniform(*problem.plausible(n))) for n in own}
    neutral = problem.assembly.model.effects[name].neutral_si
    sizes = {n: neutral[n.own] for n in own if n.own in neutral}
    wanted = plain.noise * np.exp(rng.uniform(*np.log(SIZE)))
    before = _readings(base, values, plain)
    for share in 0.9 ** np.arange(100):
        found = there | {n: zero + share * (there[n] - zero) for n, zero in sizes.items()}
        after = _readings(problem, {**values, **found}, plain)
        change = [((after[o] - y) / scale_of(y)) ** 2 for o, y in before.items()]
        if 100 * np.sqrt(np.mean(change)) < wanted:
            break
    return found


def _readings(problem: Problem, values: Mapping[str, float], plain: Case) -> dict[str, Array]:
    (predicted,) = problem.predictions(np.array([values[name] for name in problem.names]))
    return {name: predicted[plain.observation.observable == name] for name in plain.clean}
