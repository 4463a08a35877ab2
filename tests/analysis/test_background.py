"""A background of known energy is taken off again; one that is too loud is said to be."""

from __future__ import annotations

import numpy as np
import pytest

from specan.analysis.background import background_correction, without_background
from specan.analysis.octave import Octave
from specan.data.recording import ArraySource, Channel, Recording
from specan.errors import RequestError

RATE, N = 8000.0, 160000
RNG = np.random.default_rng(6)
TIME = np.arange(N) / RATE
SIGNAL = np.sin(2 * np.pi * 500 * TIME)
HUM = 0.3 * np.sin(2 * np.pi * 492 * TIME)  # 10.5 dB below, in the same band


def recording(label: str, *channels: tuple[str, str, np.ndarray]) -> Recording:
    return Recording(
        label,
        tuple(Channel(name, unit=unit, sampling_rate=RATE, n_samples=N) for name, unit, _ in channels),
        ArraySource([x for _, _, x in channels]),
    )


def test_what_was_added_is_taken_off() -> None:
    loud = recording("a", ("Mic 1", "Pa", SIGNAL + HUM), ("Mic 2", "Pa", SIGNAL + 3 * HUM))
    quiet = recording("b", ("Mic 2", "Pa", 3 * HUM), ("Mic 1", "Pa", HUM))
    settings = Octave(band=500)
    found = without_background(settings(loud), settings(quiet))
    own = settings(recording("c", ("Mic 1", "Pa", SIGNAL)))
    assert found.level_dB[0, 0] == pytest.approx(own.level_dB[0, 0], abs=0.01)
    assert found.overall_dB["Z"][0] == pytest.approx(own.overall_dB["Z"][0], abs=0.01)
    assert found.band_flags(0, 0) == ()
    # 1 dB above its background: 1.26 dB are taken off, and it is said to be too little.
    assert settings(loud).level_dB[1, 0] - found.level_dB[1, 0] == pytest.approx(1.256, abs=0.001)
    assert "low-snr" in found.band_flags(1, 0)
    assert found.flags[1] == ("low-snr",)
    assert "corrected for the background b" in found.notes[-1]


def test_the_rule_of_iso_3744() -> None:
    level = np.array([70.0, 70.0, 70.0, 70.0, 70.0, np.nan, -np.inf])
    background = np.array([64.0, 64.001, 80.0, -np.inf, 55.0, 10.0, -np.inf])
    corrected, low = background_correction(level, background)
    assert low.tolist() == [False, True, True, False, False, False, False]
    assert level[:5] - corrected[:5] == pytest.approx([1.256, 1.256, 1.256, 0.0, 0.14], abs=0.001)
    assert np.isnan(corrected[5])
    assert np.isneginf(corrected[6])


def test_what_was_not_analysed_alike_is_refused() -> None:
    mic = recording("a", ("Mic 1", "Pa", SIGNAL))
    for levels, other, message in [
        (Octave(), Octave(fraction=1), "b has the fraction 1; expected 3"),
        (Octave(), Octave(fmin=100), "other bands"),
        (Octave(averaging="fast"), Octave(averaging="fast"), "expected linear"),
    ]:
        quiet = recording("b", ("Mic 1", "Pa", HUM))
        with pytest.raises(RequestError, match=message):
            without_background(levels(mic), other(quiet))
    with pytest.raises(RequestError, match=r"b has no channel 'Mic 1' in Pa; expected Mic 7"):
        without_background(Octave()(mic), Octave()(recording("b", ("Mic 7", "Pa", HUM))))
