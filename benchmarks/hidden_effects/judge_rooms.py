"""What counts as right for rooms: the rows of the table, with the bar."""

from __future__ import annotations

from hidden_effects.judge import (
    Record,
    Row,
    among,
    at_least,
    doubted,
    honestly_nothing,
    is_null,
    is_single,
    names_something,
    top_one,
    truth_first,
    unknown_recognised,
)

MOST_HELD_OUT_CHI2 = 1.5


def right_place(record: Record) -> bool:
    """The wall, microphone, card or edge that is named is the one in which something is hidden."""
    said = record["verdict"].get("at", {})
    return all(place in said.get(name, ()) for name, place in record["at"].items())


def _added(record: Record) -> bool:
    """Something of the catalogue is hidden, strongly enough, and an effect was added."""
    return record["kind"] == "single" and record["lambda"] >= 100 and record["added"] is not None


def held_out_meets(record: Record) -> bool:
    """Reduced chi-square of the held-out data, the prediction's covariance included."""
    return bool(record["added"]["reduced_chi2_after"] <= MOST_HELD_OUT_CHI2)


def excess_halved(record: Record) -> bool:
    """What the error on held-out data exceeds the declared uncertainty by falls to the half, or there is none left."""
    after = record["added"]["excess_after"]
    return bool(after <= 0.5 * record["added"]["excess_before"])


ROWS = (
    Row("null: something named", is_null, names_something, "<= 1 in 160", lambda n, of: n <= of / 160),
    Row("single, lambda >= 100, D >= 20: first", is_single(100, least_d=20), truth_first, ">= 95 %", at_least(0.95)),
    Row("  the place too", lambda r: is_single(100, least_d=20)(r) and truth_first(r), right_place),
    Row("single, lambda 30-100, D >= 20: first", is_single(30, 100, 20), truth_first),
    Row("single, lambda 10-30: first", is_single(10, 30), truth_first),
    Row("single, lambda >= 30, any D: first", is_single(30), truth_first),
    Row("single, lambda >= 30, any D: alone on top", is_single(30), top_one),
    Row("single, lambda >= 30: truth among the alternatives", is_single(30), among),
    Row("single, lambda >= 30: 'or one unknown' added", is_single(30), doubted),
    Row("single, lambda < 10: nothing, and said why", is_single(0, 10), honestly_nothing),
    Row(
        "unknown, lambda >= 100: recognised",
        lambda r: r["kind"] == "unknown" and r["lambda"] >= 100, unknown_recognised, ">= 90 %", at_least(0.9),
    ),
    Row(
        "  and no candidate imitates it (D >= 100)",
        lambda r: r["kind"] == "unknown" and r["lambda"] >= 100 and (r["d"] or 0.0) >= 100, unknown_recognised,
    ),
    Row(
        "left out of the catalogue, lambda >= 300, D >= 100: recognised",
        lambda r: r["kind"] == "left-out" and r["lambda"] >= 300 and (r["d"] or 0.0) >= 100, unknown_recognised,
    ),
    Row(
        "pair, each conditional lambda >= 20: exact",
        lambda r: r["kind"] == "pair" and (r["conditional_lambda"] or 0.0) >= 20, among,
    ),
    Row(
        "  'or one unknown' added",
        lambda r: r["kind"] == "pair" and (r["conditional_lambda"] or 0.0) >= 20, doubted,
    ),
    Row(
        "after add, held-out data: reduced chi2 <= 1.5",
        _added, held_out_meets, ">= 90 %", at_least(0.9),
    ),
    Row("  excess error at least halved", _added, excess_halved, ">= 90 %", at_least(0.9)),
)  # fmt: skip
