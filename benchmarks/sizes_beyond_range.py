"""Whether an effect of a size beyond its known range is told, or at least nothing else is named without a doubt.

    python benchmarks/sizes_beyond_range.py --gears 12 --seed 8000 --out sizes.jsonl

The data are made with the model itself, everything drawn as it is declared (`calibrated_statements`); one effect of the
catalogue acts with a size that is 1.5 to 5 times the largest one known, within its domain. Of each gear every effect is
tried. Data that a study refuses (a gear that drives itself) are left out.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

import numpy as np
from calibrated_statements import drawn, opened

from hidden_effects.judge import interval
from specan.errors import SpecanError
from specan.study.diagnose import diagnose
from specan.study.selection.candidates import Candidate, candidates
from truth.worm_gear import simulate

DESIGNS = ("grid", "idle", "campaign")
NOISE = 0.5  # percent of the reading
BEYOND = (1.5, 5.0)  # times the largest size known
ANSWERS = (
    "named",
    "told beside others",
    "doubt or unknown",
    "nothing missing",
    "another one, without a doubt",
)


def cases(gears: int, first: int, only: tuple[str, ...]) -> Iterator[dict[str, Any]]:
    """Every effect that the data of a gear can test, one after the other."""
    for seed in range(first, first + gears):
        case = simulate(seed, {}, DESIGNS[seed % len(DESIGNS)], NOISE)
        problem = opened(case)
        for candidate in candidates(problem)[0]:
            if only and candidate.use.name not in only:
                continue
            rng = np.random.default_rng([seed, sum(map(ord, candidate.use.name))])
            sizes = _sizes(candidate, rng)
            readings, _ = drawn(problem, seed, NOISE, candidate, sizes)
            table = {name: values for name, values in case.table.items() if name != "efficiency"}
            try:
                found = diagnose(opened(replace(case, table={**table, "input_torque_Nm": readings})))
            except SpecanError:
                continue
            verdict = found.to_dict()
            kept = {
                key: verdict[key]
                for key in ("verdict", "alternatives", "unknown_possible", "reason", "remarks")
            }
            yield {"seed": seed, "effect": candidate.use.name, "sizes": sizes, **kept}


def _sizes(candidate: Candidate, rng: np.random.Generator) -> dict[str, float]:
    """One amplitude beyond its range, SI; others at nothing."""
    sizes = {str(name): candidate.neutral(name) for name in candidate.amplitudes}
    name = candidate.amplitudes[int(rng.integers(len(candidate.amplitudes)))]
    neutral, ends = candidate.neutral(name), np.array(candidate.plausible(name))
    both = ends[0] < neutral < ends[1]
    end = ends[int(rng.integers(2))] if both else ends[np.argmax(np.abs(ends - neutral))]
    low, high = candidate.extended.domain(name.whole)
    size = neutral + (end - neutral) * float(np.exp(rng.uniform(*np.log(BEYOND))))
    return {**sizes, str(name): float(min(max(size, low), high))}


def answer(record: dict[str, Any]) -> str:
    """What the verdict amounts to."""
    effect, sets = record["effect"], [set(names) for names in record["alternatives"]]
    if {effect} in sets:
        return ANSWERS[0]
    if effect in record["reason"] or any(effect in text for text in record["remarks"]):
        return ANSWERS[1]
    if record["unknown_possible"]:
        return ANSWERS[2]
    return ANSWERS[3] if record["verdict"] == "nothing-missing" else ANSWERS[4]


def main() -> int:
    """Run and count."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--gears", type=int, default=12)
    parser.add_argument("--seed", type=int, default=8000, help="of the first gear")
    parser.add_argument("--effects", nargs="+", default=[], help="only these")
    parser.add_argument("--out", type=Path, default=Path("sizes_beyond_range.jsonl"))
    arguments = parser.parse_args()
    counts: Counter[str] = Counter()
    wrong: Counter[str] = Counter()
    with arguments.out.open("w", encoding="utf-8") as file:
        for record in cases(arguments.gears, arguments.seed, tuple(arguments.effects)):
            file.write(json.dumps(record) + "\n")
            file.flush()
            counts[answer(record)] += 1
            wrong.update([record["effect"]] if answer(record) == ANSWERS[-1] else [])
    total = sum(counts.values())
    for text in ANSWERS:
        low, high = interval(counts[text], total)
        print(f"{text}: {counts[text]} of {total}, {100 * low:.1f} to {100 * high:.1f} %")
    print("wrong:", ", ".join(f"{name} {n}" for name, n in wrong.items()) or "none")
    return 0


if __name__ == "__main__":
    sys.exit(main())
