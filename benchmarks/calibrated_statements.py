"""Whether p of lack of fit is uniform and 95 % intervals hold the truth, where the truth is exactly what is assumed.

    python benchmarks/calibrated_statements.py --cases 220 --noise 0.5
    python benchmarks/calibrated_statements.py --cases 120 --noise 0.5 --effects
    python benchmarks/calibrated_statements.py --cases 220 --noise 0.5 --gears

The first two make the data with the model itself: instrument errors drawn from their certificates, the declared model
discrepancy drawn from its covariance, noise in percent of the reading that only repeats tell. With ``--effects`` one
effect of the catalogue acts, and is fitted. ``--gears`` takes the independent simulator, whose gears are not the
model: the declared discrepancy covers what they differ by.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

import numpy as np

from hidden_effects.engine import _problem
from hidden_effects.judge import interval
from specan.study.estimation.fit import fit
from specan.study.estimation.problem import Problem
from specan.study.selection.candidates import Candidate, candidates
from specan.study.selection.refits import Refit
from specan.study.selection.signatures import default_value
from specan.study.verdict import parameters_of
from truth.worm_gear import TruthCase, simulate, write

DESIGNS = ("grid", "idle")
STARTS = 6  # of the fit with an effect
SHOWN = 17.0  # fall of chi-square from which an effect is named (0.1 % over some thirty independent tests)


def opened(case: TruthCase) -> Problem:
    """The problem as a user's study would have it."""
    with tempfile.TemporaryDirectory() as name:
        write(case, Path(name))
        return _problem(Path(name))


def drawn(
    problem: Problem,
    seed: int,
    noise: float,
    candidate: Candidate | None,
    sizes: Mapping[str, float] | None = None,
) -> tuple[Any, dict[str, float]]:
    """Readings of the model with everything drawn as declared, and the true values by full name; `sizes` as given."""
    rng = np.random.default_rng([seed, 77])
    (observation,) = problem.observations
    true = dict(problem.values_at(fit(problem, starts=2).theta))
    for name, (mean, sd) in problem.priors.items():
        true[name] = mean + sd * rng.standard_normal(np.shape(true[name]))
    assembly = problem.assembly
    if candidate is not None:
        assembly = candidate.extended.assembly
        true |= {name: default_value(candidate, name) for name in candidate.own} | dict(sizes or {})
    exact = observation.predict(assembly, true)
    sizes = observation.parts["discrepancy"]
    shared = observation.covariance - np.diag(np.diag(observation.covariance) - sizes**2)
    width, vectors = np.linalg.eigh(shared)
    wrong = vectors @ (np.sqrt(np.maximum(width, 0.0)) * rng.standard_normal(exact.size))
    return exact + wrong + noise / 100 * exact * rng.standard_normal(exact.size), true


def run_case(seed: int, noise: float, effects: bool, gears: bool, discrepancy: float) -> dict[str, Any]:
    """Lack of fit and, where the truth is the model, which intervals hold it."""
    case = simulate(seed, {}, DESIGNS[seed % 2], noise)
    case.rig["uncertainty"]["model_discrepancy_percent"] = discrepancy
    problem = opened(case)
    if gears:
        return {"seed": seed, "p": fit(problem, starts=2).p_value}
    chosen = None
    if effects:
        usable = [c for c in candidates(problem)[0] if not c.without_prior and not c.use.at]
        chosen = usable[seed % len(usable)]
    readings, true = drawn(problem, seed, noise, chosen)
    table = {name: values for name, values in case.table.items() if name != "efficiency"}
    case = replace(case, table={**table, "input_torque_Nm": readings})
    problem = opened(case)
    without = fit(problem, starts=2).chi2 if chosen is not None else 0.0
    if chosen is not None:
        problem = problem.with_uses([chosen.use])
    found = Refit(
        frozenset() if chosen is None else frozenset([chosen.use]), problem, fit(problem, starts=STARTS)
    )
    record: dict[str, Any] = {
        "seed": seed,
        "p": found.fit.p_value,
        "effect": str(chosen.use) if chosen else "",
    }
    record["held"] = {
        name: bool(row["low"] <= problem.assembly.parameters[name].from_si(true[name]) <= row["high"])
        for name, row in _all_parameters(found).items()
        if name.split("[")[0] not in problem.priors
    }
    record["shown"] = chosen is None or without - found.chi2 > SHOWN
    record["own"] = [n for n in record["held"] if chosen is not None and n.startswith(f"{chosen.use}.")]
    return record


def _all_parameters(found: Refit) -> dict[str, dict[str, Any]]:
    """Intervals of all parameters, base and effects, as a verdict states those of its effects."""
    return parameters_of(replace(found, uses=frozenset(found.problem.assembly.uses)), profiled=True)


def main() -> int:
    """Run and count."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cases", type=int, default=220)
    parser.add_argument("--seed", type=int, default=5000)
    parser.add_argument("--noise", type=float, default=0.5, help="percent of the reading")
    parser.add_argument("--discrepancy", type=float, default=0.5, help="declared, percent of the losses")
    parser.add_argument("--effects", action="store_true")
    parser.add_argument("--gears", action="store_true")
    parser.add_argument("--out", type=Path)
    arguments = parser.parse_args()
    records = [
        run_case(
            arguments.seed + k, arguments.noise, arguments.effects, arguments.gears, arguments.discrepancy
        )
        for k in range(arguments.cases)
    ]
    if arguments.out:
        arguments.out.write_text("\n".join(json.dumps(r) for r in records) + "\n", encoding="utf-8")
    print(text(records, arguments))
    return 0


def text(records: list[dict[str, Any]], arguments: argparse.Namespace) -> str:
    """Kolmogorov and Smirnov's test of p, and the counts of intervals."""
    from scipy.stats import kstest

    p = np.array([r["p"] for r in records])
    lines = [
        f"noise {arguments.noise:g} %, declared discrepancy {arguments.discrepancy:g} %, {p.size} cases: "
        f"KS p {kstest(p, 'uniform').pvalue:.2g}, median {np.median(p):.2f}, "
        f"below 0.05 {np.mean(p < 0.05):.3f}, below 0.001 {np.sum(p < 0.001)}, above 0.95 {np.mean(p > 0.95):.3f}"
    ]
    for what, chosen in (
        ("the base", lambda r: set(r["held"]) - set(r["own"])),
        ("effects that the data show", lambda r: set(r["own"]) if r["shown"] else ()),
        ("other effects", lambda r: () if r["shown"] else set(r["own"])),
    ):
        counted: dict[str, list[bool]] = {}
        for r in records:
            for name in chosen(r) if "held" in r else ():
                counted.setdefault(name, []).append(r["held"][name])
        held = [h for values in counted.values() for h in values]
        if held:
            low, high = interval(sum(held), len(held))
            lines.append(
                f"95 % intervals of {what}: {sum(held)} of {len(held)} hold, {100 * low:.1f} to {100 * high:.1f} %"
            )
            lines += [f"  {name}: {sum(v)} of {len(v)}" for name, v in sorted(counted.items())]
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
