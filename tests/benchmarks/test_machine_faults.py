"""Faults that the bench plants in tables of its machines are found, each by its name; clean tables have none."""

import numpy as np
import pytest

from machines import faults
from machines.cases import drawn
from machines.run import MACHINES
from specan.study.diagnose import diagnose
from specan.study.selection.candidates import base_problem
from tests.study.few import beside

pytestmark = pytest.mark.long


def told(case):
    few = beside(case.model, *sorted(case.model.effects)[:3])
    found = diagnose(base_problem(few, [case.observation]))
    named = [p for p in found.probabilities if p.kind == "fault"]
    return found, named, sum(p.probability for p in named)


# Seeds whose tables are read in little time; how many of all are found, benchmarks/machines/faults.py counts.
SEEDS = {"cold-spot": 2, "not-set-anew": 16, "range": 1, "later-zero": 0, "copied": 4}
SEED_OF_A_LEVEL = 6


@pytest.mark.parametrize("fault", SEEDS)
def test_a_planted_fault_is_found_by_its_name(fault):
    case = faults.planted(SEEDS[fault], fault)
    assert faults.chi2(case) > faults.VISIBLE
    _, named, probability = told(case)
    assert probability > 0.5
    assert any(words in named[0].explanation for words in faults.SAID[fault])


def test_the_level_that_is_wrong_is_named_with_its_true_value():
    case = faults.planted(SEED_OF_A_LEVEL, "level")
    found, _, _ = told(case)
    assert found.verdict == "faulty-data"
    (name,) = [n for n in case.table if f"the {n} of the rows at" in found.reason]
    actual, written = case.settings(np.random.default_rng([case.seed, 2]))
    read, true = (
        float(t.split()[0]) for t in found.reason.partition("where it says ")[2].split(" it would be ")
    )
    (wrong,) = np.unique(written[name][~np.isclose(actual[name], written[name], rtol=0.02)])
    assert read == pytest.approx(wrong, rel=1e-3)
    assert true == pytest.approx(float(np.mean(actual[name][written[name] == wrong])), rel=0.01)


def test_clean_tables_have_no_fault():
    for seed in (101, 102):
        case = drawn(seed, MACHINES, "null")
        found, _, probability = told(case)
        assert found.verdict != "faulty-data"
        assert probability < 0.5
