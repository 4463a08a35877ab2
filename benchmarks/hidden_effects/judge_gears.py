"""What counts as right for planetary gears: the rows of the table."""

from __future__ import annotations

from hidden_effects.judge import (
    Record,
    Row,
    among,
    at_least,
    doubted,
    is_null,
    is_single,
    names_something,
    sure_and_wrong,
    truth_first,
    unknown_recognised,
)

_SAME_LINES = frozenset({"planet-position-error", "unequal-load-sharing"})  # told apart over torque only


def same_lines(record: Record) -> bool:
    """The first place of the ranking has the lines of the truth: the effect itself, or the one that shares them."""
    ranking = record["verdict"]["ranking"]
    if record["verdict"]["verdict"] not in ("effect", "group", "fits-only-if") or not ranking:
        return False
    first, truth = set(ranking[0]["effects"]), set(record["truth"])
    return bool(first == truth or (first <= _SAME_LINES and truth <= _SAME_LINES))


def wrongly_named(record: Record) -> bool:
    """Something is named, and the truth is not among the alternatives."""
    return names_something(record) and record["verdict"]["verdict"] != "unknown-effect" and not among(record)


ROWS = (
    Row("null: something named", is_null, names_something),
    Row("null: 'or one unknown' or a doubt", is_null, doubted),
    Row("something hidden: named without a doubt, truth absent", lambda r: not is_null(r), sure_and_wrong),
    Row(
        "single, lambda >= 100, D >= 20: among", is_single(100, least_d=20), among, ">= 95 %", at_least(0.95)
    ),
    Row("single, lambda >= 100, D >= 20: first", is_single(100, least_d=20), truth_first),
    Row(
        "size of a pin's error or a share within its interval",
        lambda r: r.get("covered") is not None,
        lambda r: bool(r["covered"]),
    ),
    Row(
        "pin added: RMS falls on the torque held out",
        lambda r: bool(r.get("held_out")),
        lambda r: bool(r["held_out"][1][0] < r["held_out"][0][0]),
        "all",
        at_least(1.0),
    ),
    Row("single, lambda >= 100: first", is_single(100), truth_first),
    Row("  or the one with the same lines", is_single(100), same_lines),
    Row("  truth among the alternatives", is_single(100), among),
    Row("  another named, and not the truth", is_single(100), wrongly_named),
    Row("  'or one unknown' added", is_single(100), doubted),
    Row("single, lambda < 100: first", is_single(0, 100), truth_first),
    Row("absorbed by the gains: another named", lambda r: r["kind"] == "unseen", wrongly_named),
    Row("pair: exact", lambda r: r["kind"] == "pair", among),
    Row("bearing defect: something named or unknown", lambda r: r["kind"] == "unknown", names_something),
    Row("bearing defect: recognised as unknown", lambda r: r["kind"] == "unknown", unknown_recognised),
)
