"""Frequency weightings against their formulas, their tables, and other libraries - through the public function."""

from __future__ import annotations

import numpy as np
import pytest

from specan.analysis.octave import Octave
from specan.data.recording import ArraySource, Channel, Recording
from specan.dsp.weighting import F_1, F_2, F_3, F_4, F_5, weighting_level

NOMINAL = 10 ** (np.arange(10, 44) / 10)
# ANSI S1.4-1983, table IV, column B (the curve of IEC 60651), at 10 Hz to 20 kHz; rounded to 0.1 dB.
TABLE_B = [
    -38.2, -33.2, -28.5, -24.2, -20.4, -17.1, -14.2, -11.6, -9.3, -7.4, -5.6, -4.2, -3.0, -2.0, -1.3, -0.8,
    -0.5, -0.3, -0.1, 0.0, 0.0, 0.0, 0.0, -0.1, -0.2, -0.4, -0.7, -1.2, -1.9, -2.9, -4.3, -6.1, -8.4, -11.1,
]  # fmt: skip


def by_poles(f: np.ndarray, name: str) -> np.ndarray:
    """The curves as analogue networks: zeros at 0 Hz and poles on the real axis, 0 dB at 1 kHz."""
    poles = {
        "A": [F_1, F_1, F_2, F_3, F_4, F_4],
        "B": [F_1, F_1, F_5, F_4, F_4],
        "C": [F_1, F_1, F_4, F_4],
        "Z": [],
    }[name]
    zeros = {"A": 4, "B": 3, "C": 2, "Z": 0}[name]

    def gain(f: np.ndarray) -> np.ndarray:
        s = 1j * np.asarray(f)
        return np.abs(s**zeros / np.prod([s + p for p in poles], axis=0))

    return 20 * np.log10(gain(f) / gain(np.array(1000.0)))


def test_the_poles_are_those_that_the_standards_print() -> None:
    poles = [F_1, F_2, F_3, F_4, F_5]
    np.testing.assert_allclose(poles[:4], [20.60, 107.7, 737.9, 12194.0], rtol=5e-4)
    # ANSI S1.4-1983, appendix C
    np.testing.assert_allclose(poles, [20.598997, 107.65265, 737.86223, 12194.217, 158.48932], rtol=1e-7)


@pytest.mark.parametrize("name", ["A", "B", "C", "Z"])
def test_the_curves_are_those_of_the_networks(name: str) -> None:
    np.testing.assert_allclose(weighting_level(NOMINAL, name), by_poles(NOMINAL, name), atol=1e-9)


def test_a_and_c_are_those_of_two_other_libraries() -> None:
    from acoustics.standards import iec_61672_1_2013 as acoustics
    from pyfar.constants import frequency_weighting_curve

    for name, theirs in (
        ("A", acoustics.weighting_function_a(NOMINAL)),
        ("C", acoustics.weighting_function_c(NOMINAL)),
    ):
        # Their poles are rounded as in E.4.1, and their gain to 0.001 dB.
        np.testing.assert_allclose(weighting_level(NOMINAL, name), theirs, atol=0.006)
        np.testing.assert_allclose(
            weighting_level(NOMINAL, name), frequency_weighting_curve(name, NOMINAL), atol=0.0005
        )


def test_b_is_that_of_the_table() -> None:
    np.testing.assert_allclose(weighting_level(NOMINAL, "B"), TABLE_B, atol=0.0501)


@pytest.mark.parametrize(
    "rate", [48000.0, *(pytest.param(rate, marks=pytest.mark.long) for rate in (51200.0, 102400.0))]
)
def test_overall_levels_of_tones_are_within_a_thousandth_of_a_decibel(rate: float) -> None:
    """Faded over 400 cycles, so that the curves' slopes do not show."""
    for f in NOMINAL:
        n = round(400 / f * rate)
        t = np.arange(n) / rate
        samples = np.sin(2 * np.pi * f * t) * np.sin(np.pi * np.arange(n) / n) ** 2
        channel = Channel("Mic 1", unit="Pa", sampling_rate=rate, n_samples=n)
        found = Octave()(Recording("tone", (channel,), ArraySource([samples])))
        own = 10 * np.log10(np.var(samples) / 4e-10)
        assert found.overall_dB["Z"][0] == pytest.approx(own, abs=1e-9)
        for name in "ABC":
            expected = own + float(by_poles(np.array(f), name))
            assert found.overall_dB[name][0] == pytest.approx(expected, abs=0.001), (f, name)
