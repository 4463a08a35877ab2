"""What a verdict is worth where the truth is known, and what the bench counts."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

Record = dict[str, Any]

VISIBLE = 20.0  # chi-square from which an effect ought to be seen, and from which one is told from another
RIGHT = ("right", "in group", "unknown right")
OUTCOMES = (*RIGHT, "missed (not visible)", "missed", "false name", "unknown called")
UNKNOWN = "something else"  # effect of the explanation that says: not in the catalogue
CLASSES = 10


def outcome(record: Record) -> str:
    """One of `OUTCOMES`.

    Of a pair one effect is enough where the other leaves no chi-square of `VISIBLE`.
    """
    said, truth = record["verdict"], frozenset(record["truth"])
    sets = [frozenset(names) for names in record["alternatives"]]
    hidden = bool(record["strengths"])
    if said in ("effect", "group"):
        accepted = [truth] if truth else []
        if len(truth) == 2 and record["weakest"] < VISIBLE:
            accepted += [frozenset([name]) for name in truth]
        if any(one in accepted for one in sets):
            return "right" if len(sets) == 1 else "in group"
        return "false name"
    if said in ("unknown-effect", "fits-only-if", "faulty-data"):
        return "unknown right" if hidden and not truth else "unknown called"
    if not hidden and said == "nothing-missing":
        return "right"
    return "missed" if not hidden or record["lambda"] >= VISIBLE else "missed (not visible)"


def wilson(right: int, of: int) -> tuple[float, float]:
    """95 % interval of a proportion, by Wilson.

    >>> tuple(round(x, 3) for x in wilson(0, 10))
    (0.0, 0.278)
    """
    z, p = 1.959964, right / of
    middle, half = p + z**2 / (2 * of), z * math.sqrt(p * (1 - p) / of + z**2 / (4 * of**2))
    return max(0.0, (middle - half) / (1 + z**2 / of)), min(1.0, (middle + half) / (1 + z**2 / of))


def read(diagnosis: Any) -> Record:
    """What a `specan.study.verdict.Diagnosis` says."""
    told = getattr(diagnosis, "probabilities", None) or ()
    return {
        "verdict": diagnosis.verdict,
        "alternatives": [list(names) for names in diagnosis.alternatives],
        "doubt": bool(diagnosis.unknown_possible),
        "reason": diagnosis.reason,
        "probabilities": [[_named(one), float(one.probability)] for one in told],
    }


def _named(told: Any) -> list[str]:
    """Effects of a stated explanation; `UNKNOWN`, or the fault before them."""
    kind = getattr(told, "kind", "effects")
    if kind == "unknown":
        return [UNKNOWN]
    return [*([told.explanation] if kind == "fault" else []), *sorted(set(told.effects))]


def explanation(record: Record) -> list[str]:
    """The true one, as probabilities have it: nothing, the effects, or `UNKNOWN`."""
    return record["truth"] or ([UNKNOWN] if record["strengths"] else [])


def reliability(records: Iterable[Record]) -> tuple[list[tuple[int, int, float]], float]:
    """In ten classes of a stated probability: how many, how many of them true, their mean; and the mean Brier score."""
    stated, scores = [], []
    for record in records:
        true = explanation(record)
        of_true = 0.0
        score = 0.0
        for effects, probability in record["probabilities"]:
            is_true = effects == true
            stated.append((probability, is_true))
            score += (probability - is_true) ** 2
            of_true += is_true
        scores.append(score + (1 - of_true))  # a truth that is not listed was given nothing
    classes = []
    for k in range(CLASSES):
        inside = [s for s in stated if min(int(s[0] * CLASSES), CLASSES - 1) == k]
        mean = float(np.mean([p for p, _ in inside])) if inside else float("nan")
        classes.append((len(inside), sum(is_true for _, is_true in inside), mean))
    return classes, float(np.mean(scores))


def table(records: Sequence[Record]) -> str:
    """Counts by kind and by machine, those of visible cases apart, what was wrong, and CPU time."""
    good = [r for r in records if "error" not in r]
    visible = [r for r in good if not r["strengths"] or r["lambda"] >= VISIBLE]
    told = [r for r in visible if min(r.get("d", math.inf), r.get("weakest", math.inf)) >= VISIBLE]
    rows: list[tuple[str, list[Record]]] = [
        (kind, [r for r in good if r["kind"] == kind]) for kind in _kinds(good)
    ]
    rows += [("all", good), ("all visible", visible), ("  d, weakest >= 20", told)]
    rows += [
        (name, [r for r in visible if r["machine"] == name]) for name in sorted({r["machine"] for r in good})
    ]
    lines = [
        f"{'':22}{'cases':>6}" + "".join(f"{name:>{len(name) + 2}}" for name in OUTCOMES) + "   right, %"
    ]
    for name, group in rows:
        if not group:
            continue
        count = Counter(r["outcome"] for r in group)
        right = sum(count[name] for name in RIGHT)
        low, high = wilson(right, len(group))
        cells = "".join(f"{count[name]:>{len(name) + 2}}" for name in OUTCOMES)
        lines.append(
            f"{name:22}{len(group):>6}{cells}   {100 * right / len(group):.1f} ({100 * low:.1f} to {100 * high:.1f})"
        )
    lines += ["", "rows of machines: visible cases alone"]
    lines += ["", "not right though visible:"]
    lines += [_wrong(r) for r in visible if r["outcome"] not in RIGHT]
    sure = sum(r["outcome"] == "false name" and not r["doubt"] for r in good)
    lines += ["", f"false names without a doubt: {sure} of {len(good)}"]
    if any(r["probabilities"] for r in good):
        lines += ["", *_calibration("all", good), "", *_calibration("visible", visible)]
    seconds = sorted(r["cpu_s"] for r in good)
    lines += ["", f"CPU seconds a verdict: median {seconds[len(seconds) // 2]:.2f}, worst {seconds[-1]:.2f}"]
    lines += [
        f"FAILED {r['machine']}/{r['seed']}: {r['error'].strip().splitlines()[-1]}"
        for r in records
        if "error" in r
    ]
    return "\n".join(lines)


def _kinds(records: Iterable[Record]) -> list[str]:
    return sorted({r["kind"] for r in records})


def _calibration(name: str, records: Sequence[Record]) -> list[str]:
    classes, brier = reliability(records)
    rows = [
        f"  {k / CLASSES:.1f} to {(k + 1) / CLASSES:.1f}: {n:>5} stated, mean {mean:.3f}, true {true / n:.3f} ({true})"
        for k, (n, true, mean) in enumerate(classes)
        if n
    ]
    return [f"reliability, {name} cases; Brier score {brier:.3f}", *rows]


def _wrong(record: Record) -> str:
    said = " | ".join("+".join(names) for names in record["alternatives"]) or record["verdict"]
    hidden = "+".join(record["strengths"]) or "nothing"
    known: Mapping[str, float] = {n: record[n] for n in ("lambda", "d", "weakest") if n in record}
    figures = ", ".join(f"{name} {value:.0f}" for name, value in known.items())
    doubt = ", or one unknown" if record["doubt"] else ""
    case = f"{record['machine']}/{record['seed']} {record['kind']}"
    return f"  {case}: {hidden} ({figures}) -> {record['outcome']}: {said}{doubt}"
