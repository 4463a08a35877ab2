"""The hidden-effect bench: gears and rooms with a known fault, verdicts of the study engine, counts against the bar.

    python benchmarks/hidden_effects.py --quick 40 --kinds null single
    python benchmarks/hidden_effects.py --model room --quick 20 --effects leak
    python benchmarks/hidden_effects.py --full --out results.jsonl
    python benchmarks/hidden_effects.py --drawn --reserved --kinds null=400 single=400 pair=60 unknown=60
    python benchmarks/hidden_effects.py --report results.jsonl --markdown

Results are appended to a file as they come; a run that was broken off goes on where it stopped. Results of other
code (models, study or simulator have changed) are kept in the file and left out of the table.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from hidden_effects.benches import BENCHES, Bench, Case
from hidden_effects.judge import Record, by_effect, cpu_seconds, table
from hidden_effects.run import fingerprint, read, run


def chosen(bench: Bench, arguments: argparse.Namespace) -> list[Case]:
    """Cases that the command line asks for."""
    asked = dict(_kind_and_count(word) for word in arguments.kinds or bench.full)
    total = sum(bench.full[kind] for kind in asked)
    counts = {
        kind: count
        or (bench.full[kind] if arguments.full else max(1, round(arguments.quick * bench.full[kind] / total)))
        for kind, count in asked.items()
    }
    only = tuple(arguments.effects or ())
    rig = {key: float(value) for key, _, value in (word.partition("=") for word in arguments.rig)}
    noise: dict[str, object] = {} if arguments.noise is None else {"noise_percent": arguments.noise}
    noise |= {"drawn": True} if arguments.drawn else {}
    noise |= {"rig": rig} if rig else {}
    return [
        replace(case, **noise)
        for kind in asked
        for case in bench.planned(
            kind, arguments.first + counts[kind], reserved=arguments.reserved, only=only
        )[arguments.first :]
    ]


def _kind_and_count(word: str) -> tuple[str, int]:
    """``null=400``: a kind of cases, and how many where that is told (0 where not)."""
    kind, _, count = word.partition("=")
    return kind, int(count or 0)


def main() -> int:
    """Run and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--model", choices=BENCHES, default="worm-gear")
    parser.add_argument(
        "--quick", type=int, default=60, metavar="N", help="about N cases, kinds as in the full bench"
    )
    parser.add_argument("--full", action="store_true", help="all cases")
    parser.add_argument(
        "--kinds",
        nargs="+",
        metavar="KIND[=N]",
        help="kinds of cases, and how many of one: " + ", ".join(_kinds()),
    )
    parser.add_argument("--effects", nargs="+", help="hide only these")
    parser.add_argument("--reserved", action="store_true", help="the reserved seeds: once, at the end")
    parser.add_argument(
        "--rig", nargs="+", default=[], metavar="TABLE.KEY=VALUE", help="values for the rig file"
    )
    parser.add_argument(
        "--noise",
        type=float,
        metavar="PERCENT",
        help="worm gear: noise of the input torque, percent of the reading",
    )
    parser.add_argument(
        "--drawn",
        action="store_true",
        help="worm gear: every part of the truth has a published form, drawn by the seed",
    )
    parser.add_argument("--first", type=int, default=0, help="cases of every kind to leave out")
    parser.add_argument("--out", type=Path, help="result file; hidden_effects_MODEL.jsonl here by default")
    parser.add_argument(
        "--cache",
        type=Path,
        metavar="DIR",
        help="keep impulse responses of rooms there (16 kB to 50 kB a microphone)",
    )
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument(
        "--report", type=Path, metavar="FILE", help="print the table of a result file, run nothing"
    )
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--markdown", action="store_true", help="the table alone, for a page")
    arguments = parser.parse_args()
    bench = BENCHES[arguments.model]
    if unknown := {_kind_and_count(word)[0] for word in arguments.kinds or ()} - set(bench.full):
        parser.error(f"{arguments.model} has no cases of kind {', '.join(sorted(unknown))}")
    if arguments.report:
        records = read(arguments.report, fingerprint())
    else:
        out = arguments.out or Path(f"hidden_effects_{arguments.model}.jsonl")
        records = list(run(chosen(bench, arguments), out, arguments.workers, cache=arguments.cache))
    if arguments.markdown:
        print(markdown(records, bench))
    else:
        print(json.dumps(summary(records, bench), indent=1) if arguments.json else text(records, bench))
    return 1 if any("error" in record for record in records) else 0


def _kinds() -> list[str]:
    return list(dict.fromkeys(kind for bench in BENCHES.values() for kind in bench.full))


def summary(records: list[Record], bench: Bench) -> dict[str, object]:
    """Everything that the bench knows, for a program."""
    return {
        "cases": len(records),
        "errors": [{"key": r["key"], "error": r["error"]} for r in records if "error" in r],
        "table": table(records, bench.rows),
        "effects": by_effect(records),
        "cpu_seconds": cpu_seconds(records),
    }


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}"


def markdown(records: list[Record], bench: Bench) -> str:
    """The table of counts for a page; rows without a case are left out."""
    lines = ["| hidden effects | count | % (95 % interval) | bar |", "|---|---|---|---|"]
    for row in table(records, bench.rows):
        if row["of"]:
            met = {True: ", met", False: ", missed", None: ""}[row["met"]]
            lines.append(
                f"| {row['row'].strip()} | {row['count']} of {row['of']} | "
                f"{row['percent']:.1f} ({row['low']:.1f} to {row['high']:.1f}) | {row['bar']}{met} |"
            )
    return "\n".join(lines)


def text(records: list[Record], bench: Bench) -> str:
    """Everything that the bench knows, for a person."""
    lines = [f"{len(records)} cases, code {fingerprint()}", ""]
    lines.append(f"{'':64}{'count':>11}{'%':>7}  {'95 % interval':>14}  {'lambda':>7}{'D':>7}  bar")
    for row in table(records, bench.rows):
        if not row["of"]:
            continue
        met = {True: "met", False: "MISSED", None: ""}[row["met"]]
        lines.append(
            f"{row['row']:64}{row['count']:>5} / {row['of']:<3}{row['percent']:7.1f}  "
            f"{row['low']:5.1f} to {row['high']:5.1f}  {_number(row['lambda']):>7}{_number(row['d']):>7}  "
            f"{row['bar']} {met}".rstrip()
        )
    lines += ["", "lambda and D: middle values of the cases of the row", ""]
    lines.append(f"{'hidden (lambda >= 30)':44}{'right':>9}{'D':>8}   otherwise said")
    for row in by_effect(records):
        right = f"{row['right']} / {row['strong']}"
        lines.append(f"{row['effect']:44}{right:>9}{_number(row['d']):>8}   {row['instead']}".rstrip())
    times = cpu_seconds(records)
    if times:
        lines += ["", f"CPU per verdict: {times[0]:.2f} s (middle), {times[1]:.2f} s (longest)"]
    errors = [r for r in records if "error" in r]
    lines += [f"FAILED {r['key']}: {r['error'].strip().splitlines()[-1]}" for r in errors]
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
