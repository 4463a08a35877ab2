"""The bench of planetary gears: cases are what their seed says, and one is found."""

import pytest

pytest.importorskip("numba")
from hidden_effects import gear_cases, judge_gears
from hidden_effects.gear_cases import OUTSIDE, SEEN, UNSEEN, planned
from hidden_effects.judge import table
from hidden_effects.run import run_case

pytestmark = pytest.mark.long


def test_cases_are_the_same_again_and_cover_the_catalogue() -> None:
    one, two = planned("single", 18), planned("single", 18)
    assert one == two
    assert {name for case in one for name in case.effects} == set(SEEN)
    assert {name for case in planned("unseen", 4) for name in case.effects} == set(UNSEEN)
    assert planned("null", 1)[0].simulate().machine.hidden == {}
    assert {case.effects for case in planned("unknown", 3)} == {(name,) for name in OUTSIDE}
    assert all(len(set(case.effects)) == 2 for case in planned("pair", 5))
    assert len({case.simulate().machine.z_ring for case in planned("null", 12)}) > 2
    assert set(gear_cases.FULL) == {"null", "single", "unseen", "pair", "unknown"}


def test_an_undisturbed_set_of_a_foreign_simulator_lacks_nothing() -> None:
    """Four planets of 24 teeth, counter-phased, with another mesh stiffness and other paths than the model's."""
    record = run_case(planned("null", 1)[0])
    assert "error" not in record, record.get("error")
    assert record["verdict"]["verdict"] == "nothing-missing"
    assert record["lambda"] < 100
    rows = {row["row"]: row for row in table([record], judge_gears.ROWS)}
    assert rows["null: something named"]["count"] == 0
    assert rows["null: something named"]["of"] == 1
