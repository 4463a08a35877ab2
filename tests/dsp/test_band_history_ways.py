"""Short sections, thinned outputs and envelopes give what whole blocks at the full rate give."""

import numpy as np
import pytest

from specan.dsp import bands, filter_at_work, sections
from specan.dsp.band_history import BandHistoryAccumulator, Histories
from specan.dsp.history_filters import band_filter, weighting_filter
from specan.dsp.multirate import LENGTH

RATE, N = 51200.0, 3 * LENGTH + 777
# From 0.2 s on: right behind the moment at which the averages behind A and C begin, intervals of samples show.
TIMES = np.arange(2, 19) * 0.1
RNG = np.random.default_rng(3)
NOISE = RNG.standard_normal((3, N)) * np.array([[1.0], [1e-3], [1.0]])
# A quiet beginning, 80 dB below what follows in the same block; and the end of a tone.
NOISE[1, : LENGTH // 2] *= 1e-4
NOISE[2] = np.sin(2 * np.pi * 4000 * np.arange(N) / RATE) * (np.arange(N) < 1.13 * RATE)


def histories(fraction: int, low: float, high: float, derivatives: list[int] | None = None) -> Histories:
    filters = [band_filter(int(k), fraction) for k in bands.band_range(low, high, fraction)]
    filters += [weighting_filter(w) for w in "ACZ"]
    found = BandHistoryAccumulator(3, RATE, N, filters, 0.125, None, TIMES, derivatives)
    found.add(NOISE)
    return found.result()


def in_decibels(found: Histories, expected: Histories) -> float:
    """Largest difference where a level is within 80 dB of its channel's largest."""
    worst = 0.0
    for name in ("readings", "maximum"):
        one, other = getattr(found, name), getattr(expected, name)
        with np.errstate(divide="ignore", invalid="ignore"):
            loud = other > 1e-8 * np.nanmax(other, axis=tuple(range(1, other.ndim)), keepdims=True)
            worst = max(worst, np.abs(10 * np.log10(one[loud] / other[loud])).max())
    return float(worst)


def test_sections_ring_as_blocks_do(monkeypatch: pytest.MonkeyPatch) -> None:
    found = histories(3, 1000.0, 12500.0)
    monkeypatch.setattr(sections, "SHAPES", ())
    assert in_decibels(found, histories(3, 1000.0, 12500.0)) < 1e-4


def test_what_is_not_filtered_is_not_transformed(monkeypatch: pytest.MonkeyPatch) -> None:
    found = histories(1, 4000.0, 4000.0)
    # Differentiated not at all, but on the way of channels that are.
    expected = histories(1, 4000.0, 4000.0, [0, 0, 1])
    np.testing.assert_allclose(found.readings[:2, -1], expected.readings[:2, -1], rtol=1e-9)


@pytest.mark.parametrize(("fraction", "limit"), [(3, 0.03), (24, 0.03)])
def test_thinned_outputs_have_the_level_of_full_ones(
    monkeypatch: pytest.MonkeyPatch, fraction: int, limit: float
) -> None:
    found = histories(fraction, 1500.0, 12500.0)
    monkeypatch.setattr(filter_at_work, "_INTERVALS", 1e9)
    assert in_decibels(found, histories(fraction, 1500.0, 12500.0)) < limit


def test_the_last_interval_is_read_to_the_end() -> None:
    filters = [band_filter(11, 3), weighting_filter("Z")]
    end = N / RATE
    found = BandHistoryAccumulator(3, RATE, N, filters, 0.125, None, np.array([end / 2, end]))
    found.add(NOISE)
    assert np.isfinite(found.result().readings).all()
