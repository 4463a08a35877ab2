"""The table of requirements: all met, and a filter, a weighting or a detector that is wrong is told."""

import itertools

import numpy as np
import pytest

from specan.analysis import conformance
from specan.dsp import band_energy, bands, weighting


@pytest.mark.long
def test_every_requirement_is_met_and_every_standard_is_there() -> None:
    found = list(conformance.checks(48000.0))
    assert [f"{c.clause} {c.what}: {c.found}" for c in found if not c.passed] == []
    assert {c.standard for c in found} == {conformance.FILTERS, conformance.METERS, conformance.RECORDERS}
    assert {c.clause for c in found} >= {"5.10", "5.12", "5.13", "5.14", "5.16", "5.5", "5.8", "5.9", "4.6"}


def test_a_filter_of_too_low_an_order_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    true = bands.power_response

    def wide(log_ratio, fraction):  # what a filter of order 2 lets through
        return true(log_ratio, fraction) ** 0.5

    monkeypatch.setattr("specan.dsp.bands.power_response", wide)
    band_energy._tabulated_response.cache_clear()
    try:
        failed = {c.clause for c in itertools.islice(conformance.checks(), 12) if not c.passed}
    finally:
        band_energy._tabulated_response.cache_clear()
    assert "5.10" in failed


@pytest.mark.long
def test_a_weighting_that_is_off_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    true = weighting.power_weighting
    monkeypatch.setattr(
        "specan.dsp.band_energy.power_weighting", lambda f, name: true(np.asarray(f) * 1.3, name)
    )
    band_energy.node_weights.cache_clear()
    try:
        assert np.abs(conformance._weighting("A", 51200.0)).max() > 0.7
    finally:
        band_energy.node_weights.cache_clear()
