"""Whether an effect of the stated smallest visible size is named as often as is said: in four cases of five.

    python benchmarks/detectable_size.py --cases 60 --seed 3000 --out sizes.jsonl

Every case is a null: the model itself with noise, instrument errors and model discrepancy drawn as they are declared,
or with ``--gears`` a gear of the independent simulator, which differs from the model by less than is declared, so that
more than four of five are seen. The study states the smallest visible size of every effect;
one of them, in turn, is planted at exactly that size with the equation of the catalogue, its shapes at their
defaults, on the fit of the base. Counted is whether the
verdict on the planted data has the effect among its alternatives.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

from calibrated_statements import drawn, opened

from hidden_effects.judge import interval
from specan.study.diagnose import diagnose
from specan.study.estimation.fit import fit
from specan.study.estimation.problem import Problem
from specan.study.selection.candidates import Candidate, candidates
from specan.study.selection.refits import Refit
from specan.study.selection.signatures import default_value
from truth.worm_gear import simulate

DESIGNS = ("grid", "idle")
NOISE = 0.5  # percent of the reading


def planted(problem: Problem, candidate: Candidate, size: float) -> Problem:
    """The data with what the effect of a size (SI) changes of the base's prediction, added."""
    base = Refit(frozenset(), problem, fit(problem, starts=3))
    name = candidate.amplitudes[0]
    shapes = {n: default_value(candidate, n) for n in candidate.own if n != name}
    toward = 1.0 if default_value(candidate, name) > candidate.neutral(name) else -1.0
    others = {n: candidate.neutral(n) for n in candidate.amplitudes if n != name}
    point = {**shapes, **others, name: candidate.neutral(name) + toward * abs(size - candidate.neutral(name))}
    (observation,) = problem.observations
    values = problem.values_at(base.fit.theta)
    plain = observation.predict(problem.assembly, values)
    change = observation.predict(candidate.extended.assembly, {**values, **point}) - plain
    return problem.over([replace(observation, measured=observation.measured + change)])


def run_case(number: int, seed: int, only: tuple[str, ...], gears: bool) -> dict[str, Any] | None:
    """One null, its statement, the planted effect and the verdict on it."""
    case = simulate(seed, {}, DESIGNS[number % 2], NOISE)
    problem = opened(case)
    if not gears:
        readings, _ = drawn(problem, seed, NOISE, None)
        table = {name: values for name, values in case.table.items() if name != "efficiency"}
        problem = opened(replace(case, table={**table, "input_torque_Nm": readings}))
    null = diagnose(problem)
    stated = {
        n: v["value"] for n, v in null.smallest_visible.items() if v is not None and (not only or n in only)
    }
    found = {c.use.name: c for c in candidates(problem)[0] if c.use.name in stated and not c.without_prior}
    if not found:
        return None
    effect = sorted(found)[number % len(found)]
    candidate = found[effect]
    size = candidate.parameter(candidate.amplitudes[0]).to_si(stated[effect])
    start = time.process_time()
    verdict = diagnose(planted(problem, candidate, size))
    return {
        "seed": seed,
        "effect": effect,
        "size": stated[effect],
        "null": null.verdict,
        "verdict": verdict.verdict,
        "named": any(effect in names for names in verdict.alternatives),
        "something": verdict.verdict != "nothing-missing",
        "rank": [[row.effects, row.probability, row.ln_evidence] for row in verdict.ranking[:2]],
        "cpu_s": round(time.process_time() - start, 2),
    }


def main() -> int:
    """Run and count."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cases", type=int, default=60)
    parser.add_argument("--seed", type=int, default=3000, help="of the first gear")
    parser.add_argument("--effects", nargs="+", default=[], help="plant only these")
    parser.add_argument("--gears", action="store_true", help="gears of the independent simulator")
    parser.add_argument("--out", type=Path, default=Path("detectable_size.jsonl"))
    arguments = parser.parse_args()
    records = []
    with arguments.out.open("a", encoding="utf-8") as file:
        for number in range(arguments.cases):
            record = run_case(number, arguments.seed + number, tuple(arguments.effects), arguments.gears)
            if record is None:
                continue
            records.append(record)
            file.write(json.dumps(record) + "\n")
            file.flush()
    for what in ("named", "something"):
        right = sum(r[what] for r in records)
        low, high = interval(right, len(records))
        print(f"{what}: {right} of {len(records)}, 95 % interval {100 * low:.0f} to {100 * high:.0f} %")
    return 0


if __name__ == "__main__":
    sys.exit(main())
