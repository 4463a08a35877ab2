"""Complete models under noise that follows itself: what is named, though nothing is missing.

    python benchmarks/machines/complete.py [--seeds 0:100] [--memory 0.9] [--jobs 2]

The truth of each table is the user's own model at values drawn from what is known of its parameters. The noise is
declared with its right standard deviation; each error remembers the one before by `memory`.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections import Counter
from dataclasses import dataclass, replace
from multiprocessing import get_context
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import numpy as np  # noqa: E402

from machines.cases import Case, drawn, floor_of  # noqa: E402
from machines.judge import wilson  # noqa: E402
from machines.run import MACHINES  # noqa: E402
from specan.models import Model  # noqa: E402
from specan.study.diagnose import diagnose  # noqa: E402
from specan.study.selection.candidates import base_problem  # noqa: E402


@dataclass(frozen=True, eq=False)
class Complete(Case):
    """A case whose noise is declared as it is, and no error of form."""

    @property
    def model(self) -> Model:
        """As the user has it."""
        said = {f"{name}_percent": self.noise for name in self.clean}
        said |= {name: 0.01 * self.noise * floor_of(y) for name, y in self.clean.items()}
        return self.machine.model({"model_discrepancy_percent": 0.0, **said})


def complete(seed: int, memory: float) -> Complete:
    """A case whose readings are those of the user's model, its parameters drawn from what is known of them."""
    plain = drawn(seed, MACHINES, f"ar-{memory}")
    problem = base_problem(plain.model, [plain.observation])
    rng = np.random.default_rng([seed, 7])
    theta = np.array([rng.uniform(*problem.plausible(name)) for name in problem.names])
    (predicted,) = problem.predictions(theta)
    readings = {name: predicted[plain.observation.observable == name] for name in plain.clean}
    machine = replace(plain.machine, readings=lambda *_: readings)
    return Complete(
        machine, plain.name, seed, plain.kind, plain.table, plain.forms, plain.strengths, plain.noise, False
    )


def verdict(asked: tuple[int, float]) -> str:
    """What is named of a case; empty where nothing is missing."""
    case = complete(*asked)
    found = diagnose(base_problem(case.model, [case.observation]))
    if found.verdict == "nothing-missing":
        return ""
    return f"{case.name}/{case.seed} {found.verdict}: {found.alternatives} {found.reason}"


def main() -> int:
    """Run and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", default="0:100", metavar="FIRST:END")
    parser.add_argument("--memory", type=float, default=0.9)
    parser.add_argument("--jobs", type=int, default=2)
    arguments = parser.parse_args()
    asked = [(seed, arguments.memory) for seed in range(*map(int, arguments.seeds.split(":")))]
    with get_context("spawn").Pool(arguments.jobs) as pool:
        said = [text for text in pool.map(verdict, asked, chunksize=1) if text]
    print(*said, sep="\n")
    kinds = Counter(text.split(":")[0].split()[-1] for text in said)
    low, high = wilson(len(said), len(asked))
    print(
        f"memory {arguments.memory}: {len(said)} of {len(asked)} ({100 * low:.1f} to {100 * high:.1f} %); {dict(kinds)}"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
