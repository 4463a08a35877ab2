"""What counts as right, and the table of counts with their intervals against the bar."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

Record = dict[str, Any]

LEAST_OF_A_PAIR = 20.0  # conditional lambda from which both effects of a pair have to be named


def interval(right: int, of: int, level: float = 0.95) -> tuple[float, float]:
    """Clopper-Pearson interval of a proportion.

    >>> tuple(round(x, 4) for x in interval(0, 300))
    (0.0, 0.0122)
    """
    from scipy.special import betaincinv

    tail = (1 - level) / 2
    low = 0.0 if right == 0 else float(betaincinv(right, of - right + 1, tail))
    high = 1.0 if right == of else float(betaincinv(right + 1, of - right, 1 - tail))
    return low, high


# --- one verdict ---------------------------------------------------------------------------------------


def names_something(record: Record) -> bool:
    """Whether the verdict says that something is missing."""
    return record["verdict"]["verdict"] in ("effect", "group", "unknown-effect", "fits-only-if")


def names_effects(record: Record) -> bool:
    """Whether the verdict names effects of the catalogue."""
    return record["verdict"]["verdict"] in ("effect", "group")


def said(kind: str) -> Callable[[Record], bool]:
    """Whether the verdict is of a kind."""
    return lambda record: bool(record["verdict"]["verdict"] == kind)


def _sets(record: Record) -> list[frozenset[str]]:
    return [frozenset(names) for names in record["verdict"]["alternatives"]]


def truth_first(record: Record) -> bool:
    """The right effect ranks first, or stands in the group that the verdict names."""
    if record["verdict"]["verdict"] not in ("effect", "group"):
        return False
    truth, ranking = frozenset(record["truth"]), record["verdict"]["ranking"]
    return truth in _sets(record) or bool(ranking and frozenset(ranking[0]["effects"]) == truth)


def top_one(record: Record) -> bool:
    """The right effect alone leads the ranking."""
    ranking = record["verdict"]["ranking"]
    return bool(ranking and frozenset(ranking[0]["effects"]) == frozenset(record["truth"]))


def among(record: Record) -> bool:
    """The truth is one of the alternatives."""
    return frozenset(record["truth"]) in _sets(record)


def sure_and_wrong(record: Record) -> bool:
    """Effects are named without a doubt, and none of the alternatives is the truth.

    Of a pair one effect alone is right where the other adds less to chi-square than an effect has to (20).
    """
    if not names_effects(record) or doubted(record):
        return False
    truth = frozenset(record["truth"])
    partly = len(truth) > 1 and (record["conditional_lambda"] or 0.0) < LEAST_OF_A_PAIR
    return not any(named == truth or (partly and named < truth) for named in _sets(record))


def visible(record: Record) -> bool:
    """Every hidden effect is at least as large as the verdict says that is seen in four cases of five."""
    sizes, planted = record["verdict"]["smallest_visible"], record["planted"]
    return bool(planted) and all(
        size is not None and sizes.get(name) is not None and size >= sizes[name]["value"]
        for name, size in planted.items()
    )


def honestly_nothing(record: Record) -> bool:
    """Nothing-missing, and every hidden effect's smallest visible size lies above the planted one."""
    verdict = record["verdict"]
    if verdict["verdict"] != "nothing-missing":
        return False
    for name, planted in record["planted"].items():
        if planted is None:
            return False
        visible = verdict["smallest_visible"].get(name)
        if visible is not None and not visible["value"] > planted:
            return False
    return True


def unknown_recognised(record: Record) -> bool:
    """Unknown, alone or as the doubt beside named effects."""
    return record["verdict"]["verdict"] == "unknown-effect" or bool(record["verdict"]["unknown_possible"])


def doubted_nothing(record: Record) -> bool:
    """Nothing missing within what is known, beside values outside of it that fit better."""
    return record["verdict"]["verdict"] == "nothing-missing" and doubted(record)


def doubted(record: Record) -> bool:
    """Whether "or one unknown" was added."""
    return bool(record["verdict"]["unknown_possible"])


# --- the table -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Row:
    """A line of the table: which cases it is about, what is counted, what the bar asks."""

    text: str
    about: Callable[[Record], bool]
    counted: Callable[[Record], bool]
    bar: str = ""
    met: Callable[[int, int], bool] | None = None


def at_least(share: float) -> Callable[[int, int], bool]:
    """Bar that a share of the cases has to meet."""
    return lambda right, of: right >= share * of


def is_null(record: Record) -> bool:
    """Whether nothing was hidden."""
    return record["kind"].startswith("null")


def is_single(low: float, high: float = float("inf"), least_d: float = 0.0) -> Callable[[Record], bool]:
    """Single effects by what the data know of them."""
    return lambda r: (
        r["kind"] == "single"
        and low <= r["lambda"] < high
        and (least_d == 0.0 or (r["d"] is not None and r["d"] >= least_d))
    )


def _is_pair(record: Record) -> bool:
    return record["kind"] == "pair" and (record["conditional_lambda"] or 0.0) >= LEAST_OF_A_PAIR


def _is_unknown(low: float, high: float = float("inf")) -> Callable[[Record], bool]:
    return lambda r: r["kind"] == "unknown" and low <= r["lambda"] < high


def _single_and(visibly: bool) -> Callable[[Record], bool]:
    return lambda r: r["kind"] == "single" and bool(r["planted"]) and visible(r) == visibly


ROWS = (
    Row("null: something named", is_null, names_something, "<= 3 in 800", lambda n, of: n <= 3 / 800 * of),
    Row("  an effect or a group", is_null, names_effects, "<= 3 in 1000", lambda n, of: n <= 3 / 1000 * of),
    Row("  unknown-effect", is_null, said("unknown-effect")),
    Row("  fits-only-if", is_null, said("fits-only-if")),
    Row("null: nothing, with a doubt", is_null, doubted_nothing),
    Row(
        "named without a doubt, truth absent: nulls", is_null, sure_and_wrong, "<= 2 %", lambda n, of: n <= 0.02 * of
    ),
    Row(
        "named without a doubt, truth absent: effects", lambda r: not is_null(r), sure_and_wrong,
        "<= 2 %", lambda n, of: n <= 0.02 * of,
    ),
    Row("  set values met exactly", lambda r: r["kind"] == "null-exact", names_something),
    Row("  with set-up scatter", lambda r: r["kind"] == "null", names_something),
    Row("  with idle rows", lambda r: r["kind"] == "null-idle", names_something),
    Row("  with elapsed time", lambda r: r["kind"] == "null-time", names_something),
    Row("  with back-to-back readings", lambda r: r["kind"] == "null-readings", names_something),
    Row("  at two oil levels", lambda r: r["kind"] == "null-levels", names_something),
    Row("  24 conditions only", lambda r: r["kind"] == "null-small", names_something),
    Row("single, lambda >= 100, D >= 20: among", is_single(100, least_d=20), among, ">= 95 %", at_least(0.95)),
    Row("single, lambda >= 100, D >= 20: first", is_single(100, least_d=20), truth_first, ">= 85 %", at_least(0.85)),
    Row("  alone on top", is_single(100, least_d=20), top_one),
    Row("  'or one unknown' added", is_single(100, least_d=20), doubted),
    Row("single, lambda 30-100, D >= 20: first", is_single(30, 100, 20), truth_first, ">= 90 %", at_least(0.90)),
    Row("single, lambda 10-30: first", is_single(10, 30), truth_first),
    Row("single, lambda >= 30, any D: first", is_single(30), truth_first),
    Row("single, lambda >= 30, any D: alone on top", is_single(30), top_one),
    Row("single, lambda >= 30: truth among the alternatives", is_single(30), among, ">= 98 %", at_least(0.98)),
    Row("single, lambda >= 30: 'or one unknown' added", is_single(30), doubted),
    Row("single, lambda < 10: nothing, and said why", is_single(0, 10), honestly_nothing, ">= 95 %", at_least(0.95)),
    Row("single, at least the stated smallest size: among", _single_and(visibly=True), among, ">= 80 %", at_least(0.8)),
    Row("single, smaller than that: named nevertheless", _single_and(visibly=False), among),
    Row("unknown, lambda >= 300: recognised", _is_unknown(300), unknown_recognised, ">= 90 %", at_least(0.9)),
    Row(
        "  and no candidate imitates it (D >= 100)",
        lambda r: r["kind"] == "unknown" and r["lambda"] >= 300 and (r["d"] or 0.0) >= 100,
        unknown_recognised,
    ),
    Row(
        "  a candidate does at implausible values (D < 10)",
        lambda r: r["kind"] == "unknown" and r["lambda"] >= 300 and (r["d"] or 0.0) < 10,
        unknown_recognised,
    ),
    Row("unknown, lambda 100-300: recognised", _is_unknown(100, 300), unknown_recognised),
    Row("unknown, lambda < 100: named without a doubt", _is_unknown(0, 100), sure_and_wrong),
    Row(
        "left out of the catalogue, lambda >= 300, D >= 100: recognised",
        lambda r: r["kind"] == "left-out" and r["lambda"] >= 300 and (r["d"] or 0.0) >= 100,
        unknown_recognised,
    ),
    Row("pair, each conditional lambda >= 20: exact", _is_pair, among, ">= 75 %", at_least(0.75)),
    Row("  'or one unknown' added", _is_pair, doubted),
)  # fmt: skip


def table(records: Sequence[Record], asked: Sequence[Row] = ROWS) -> list[dict[str, Any]]:
    """Counts, 95 % intervals and whether the bar is met; rows without a case say so."""
    rows = []
    for row in asked:
        about = [r for r in records if "error" not in r and row.about(r)]
        right, of = sum(row.counted(r) for r in about), len(about)
        low, high = interval(right, of) if of else (float("nan"), float("nan"))
        rows.append(
            {
                "row": row.text,
                "count": right,
                "of": of,
                "percent": 100 * right / of if of else None,
                "low": 100 * low if of else None,
                "high": 100 * high if of else None,
                "lambda": _middle(r["lambda"] for r in about),
                "d": _middle(r["d"] for r in about if r["d"] is not None),
                "bar": row.bar,
                "met": row.met(right, of) if row.met and of else None,
            }
        )
    return rows


def _middle(values: Iterable[float]) -> float | None:
    ordered = sorted(values)
    return ordered[len(ordered) // 2] if ordered else None


def by_effect(records: Sequence[Record], least_lambda: float = 30.0) -> list[dict[str, Any]]:
    """Per hidden effect: how many cases are strong enough, how often it is first, among, or what is named instead."""
    found: dict[str, list[Record]] = {}
    for record in records:
        if record["kind"] in ("single", "unknown", "left-out") and "error" not in record:
            found.setdefault(
                f"{record['kind']}: {next(iter(record['effects'])).partition('@')[0]}", []
            ).append(record)
    rows = []
    for name, group in sorted(found.items()):
        strong = [r for r in group if r["lambda"] >= least_lambda]
        counted = truth_first if name.startswith("single") else unknown_recognised
        misses: dict[str, int] = {}
        for r in strong:
            if not counted(r):
                said = (
                    " | ".join("+".join(a) for a in r["verdict"]["alternatives"]) or r["verdict"]["verdict"]
                )
                misses[said] = misses.get(said, 0) + 1
        rows.append(
            {
                "effect": name,
                "cases": len(group),
                "strong": len(strong),
                "right": sum(counted(r) for r in strong),
                "d": _middle(r["d"] for r in strong if r["d"] is not None),
                "instead": ", ".join(
                    f"{n}x {said}" for said, n in sorted(misses.items(), key=lambda m: -m[1])
                ),
            }
        )
    return rows


def cpu_seconds(records: Sequence[Record]) -> tuple[float, float] | None:
    """Median and largest CPU time of a verdict."""
    times = sorted(r["cpu_s"] for r in records if "cpu_s" in r)
    return (times[len(times) // 2], times[-1]) if times else None
