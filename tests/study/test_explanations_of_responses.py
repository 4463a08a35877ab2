"""Explanations of transfer functions: each is counted once."""

from collections import Counter
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from specan.models.catalogue import load_model
from specan.room.study.of_field import InitialFit, OfField
from specan.study.estimation.fit import describe, fit
from specan.study.evidence.diagnosis import told
from specan.study.selection.candidates import base_problem
from specan.study.selection.refits import Refit
from tests.study.few import beside
from tests.study.test_coarse import RIG, recorded


@cache  # its fit takes longer than what is made of it
def lined(wrong=0.0):
    """A lined wall that a model without one is far from, as it was fitted; `wrong` near 260 Hz at Mic 2."""
    model = load_model("room", RIG)
    lining = {"wall-impedance@y1.conductance": 0.4, "wall-impedance@y1.mass": 0.2}
    measured, without = recorded(model, ["wall-impedance@y1"], lining), recorded(model, [], {})
    change = measured.response - without.response
    change *= wrong * np.exp(-(((measured.frequency_hz - 260.0) / 20.0) ** 2))
    change[[0, 2, 3]] = 0.0
    measured = replace(measured, response=measured.response + change)
    problem = base_problem(beside(model, "wall-impedance", "microphone-position"), [measured])
    return Refit(frozenset(), problem, fit(problem))


@pytest.mark.parametrize("promising", [False, pytest.param(True, marks=pytest.mark.long)])
def test_each_explanation_is_counted_once_where_the_model_is_far_off(promising, monkeypatch):
    """A lined wall; where no effect promises anything, and where the wall and the displaced receivers do."""
    start = lined()
    assert start.poor_fit
    assert start.problem.strategy.linearised_covariance
    if not promising:
        monkeypatch.setattr(OfField, "_promises", lambda self, one: iter(()))
    seen = OfField(InitialFit(start))
    assert any(one.kind == "effects" for one in seen.found) == promising
    counts = Counter((one.kind, one.uses, one.noise) for one in seen.found)
    assert set(counts.values()) == {1}
    if promising:  # and nothing is named beside a lining that is all
        assert told(seen, start).alternatives == (("wall-impedance",),)


@pytest.mark.long
def test_what_is_said_of_the_model_is_said_of_the_fit_that_is_shown(monkeypatch):
    """A search may begin from another fit than that of the study: errors and misfit told are the study's."""
    monkeypatch.setattr(OfField, "_promises", lambda self, one: iter(()))
    start = lined()
    theta = start.fit.theta + 0.1 * start.problem.scale
    elsewhere = replace(start, fit=describe(start.problem, theta))
    verdict = told(OfField(InitialFit(elsewhere)), start)
    assert elsewhere.fit.reduced_chi2 != pytest.approx(start.fit.reduced_chi2, rel=0.01)
    assert verdict.verdict == "unknown-effect"
    assert verdict.lack_of_fit.reduced_chi2 == start.fit.reduced_chi2
    off = np.concatenate(start.problem.plain(start.fit.theta)) - start.problem.observations[0].measured
    assert verdict.error.before.rms == pytest.approx(np.sqrt(np.mean(off**2)), rel=1e-6)


@pytest.mark.long
def test_an_effect_that_only_repairs_the_form_of_another_is_not_named():
    """A line of a lining that is off by 1 % at one microphone is no error of that microphone."""
    start = lined(wrong=0.01)
    verdict = told(OfField(InitialFit(start)), start)
    assert verdict.alternatives == (("wall-impedance",),)
