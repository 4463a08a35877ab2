"""Faults that the bench plants in tables of its machines are found, each by its name; clean tables have none."""

import numpy as np
import pytest

from machines import faults
from machines.cases import drawn
from machines.run import MACHINES
from specan.study.diagnose import diagnose
from specan.study.selection.candidates import base_problem


def told(case):
    found = diagnose(base_problem(case.model, [case.observation]))
    named = [p for p in found.probabilities if p.kind == "fault"]
    return found, named, sum(p.probability for p in named)


@pytest.mark.parametrize("fault", ["level", "cold-spot", "not-set-anew", "range", "later-zero", "copied"])
def test_a_planted_fault_is_found_by_its_name(fault):
    cases = (faults.planted(seed, fault) for seed in range(160))
    cases = [case for case in cases if case is not None][:10]
    right = []
    for case in cases:
        if faults.chi2(case) > faults.VISIBLE and len(right) < 4:
            _, named, probability = told(case)
            said = bool(named) and any(words in named[0].explanation for words in faults.SAID[fault])
            right.append(probability > 0.5 and said)
    assert len(right) >= 3
    assert sum(right) >= len(right) - 1


def test_the_level_that_is_wrong_is_named_with_its_true_value():
    cases = (faults.planted(seed, "level") for seed in range(100, 140))
    case = next(one for one in cases if one is not None and faults.chi2(one) > 1000)
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
    for seed in range(100, 108):
        case = drawn(seed, MACHINES, "null")
        found, _, probability = told(case)
        assert found.verdict != "faulty-data"
        assert probability < 0.5
