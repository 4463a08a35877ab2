"""Eight machines with truths in other formulas than their models: what verdicts on their tables are worth.

    python benchmarks/machines/run.py [--seeds 0:91] [--machine NAME] [--kind NAME] [--jobs 2] [--out FILE.json]
    python benchmarks/machines/run.py --in-catalogue [...]
    python benchmarks/machines/run.py --report FILE.json

With ``--in-catalogue`` the truth is the user's own model with effects of its catalogue: every equation is exact.

Seeds 0 to 999 are for development: look at them, learn from them. Seeds 1000 to 1999 are for counts that are frozen
before a change and made again after it. Seeds from 2000 on are reserved for fresh counts: each is run once, and
nothing is changed because of what it shows.

Counted are cases by kind. `lambda` is the chi-square that the model as it is leaves of readings without noise, `d` what
the best wrong effect leaves more than the right one, `weakest` what a pair's better effect leaves more than both.
A case is visible where lambda is at least 20. Whether another pair does as well as the right one is not looked at.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
import traceback
from multiprocessing import get_context
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):  # the cores belong to the jobs
    os.environ.setdefault(_name, "1")

from machines import (  # noqa: E402
    compressor,
    fan,
    fuel_cell,
    generator,
    in_catalogue,
    judge,
    loudspeaker,
    ship,
    shock_absorber,
    solar_collector,
)
from machines.cases import SHARES, Machine, drawn  # noqa: E402
from specan.study.diagnose import diagnose  # noqa: E402
from specan.study.selection.candidates import base_problem  # noqa: E402

MACHINES: dict[str, Machine] = {
    "generator": generator.MACHINE, "fuel-cell": fuel_cell.MACHINE, "ship": ship.MACHINE, "fan": fan.MACHINE,
    "shock-absorber": shock_absorber.MACHINE, "loudspeaker": loudspeaker.MACHINE,
    "compressor": compressor.MACHINE,
    "solar-collector": solar_collector.MACHINE,
}  # fmt: skip


def run(seed: int, only: str = "", exact: bool = False) -> judge.Record:
    """Ask for a verdict on the case of a seed. A failure is a record, not an end."""
    case = (in_catalogue.drawn if exact else drawn)(seed, MACHINES, only)
    record = {
        "machine": case.name, "seed": seed, "kind": case.kind, "strengths": dict(case.strengths),
        "truth": list(case.truth), "noise": case.noise, "repeated": case.repeated,
    }  # fmt: skip
    try:
        record["rows"] = case.observation.n
        problem = base_problem(case.model, [case.observation])
        start = time.process_time()
        found = diagnose(problem)
        record["cpu_s"] = time.process_time() - start
        record |= judge.read(found) | case.visibility()
        record["outcome"] = judge.outcome(record)
    except Exception:  # whatever breaks in one case is counted and shown, the others go on
        record["error"] = traceback.format_exc(limit=-4)
    return record


def main() -> int:
    """Run and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", default="0:91", metavar="FIRST:END")
    parser.add_argument("--machine", choices=MACHINES, help="only the seeds that fall on this one")
    parser.add_argument("--kind", choices=SHARES, default="", help="all cases of this kind; drawn by default")
    parser.add_argument(
        "--in-catalogue", action="store_true", help="every equation of the truth is the model's"
    )
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--out", type=Path, metavar="FILE.json", help="where every record is kept")
    parser.add_argument(
        "--report", type=Path, metavar="FILE.json", help="print the counts of a file, run nothing"
    )
    arguments = parser.parse_args()
    if arguments.in_catalogue and arguments.kind not in ("", *in_catalogue.SHARES):
        parser.error(f"--in-catalogue has the kinds {', '.join(in_catalogue.SHARES)}")
    if arguments.report:
        records = json.loads(arguments.report.read_text(encoding="utf-8"))
    else:
        names = list(MACHINES)
        seeds = [s for s in range(*map(int, arguments.seeds.split(":")))
                 if arguments.machine in (None, names[s % len(names)])]  # fmt: skip
        if arguments.jobs > 1:
            with get_context("spawn").Pool(arguments.jobs) as pool:
                asked = [(seed, arguments.kind, arguments.in_catalogue) for seed in seeds]
                records = pool.starmap(run, asked, chunksize=1)
        else:
            records = [run(seed, arguments.kind, arguments.in_catalogue) for seed in seeds]
    if arguments.out:
        arguments.out.write_text(json.dumps(records, indent=1) + "\n", encoding="utf-8")
    print(judge.table(records))
    return 1 if any("error" in record for record in records) else 0


if __name__ == "__main__":
    sys.exit(main())
