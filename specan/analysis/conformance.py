"""What the standards ask of an analyser, tried on signals made for it: expected, found, tolerance.

Signals go through the same settings as recordings do. Table 3 and table 4 of IEC 61672-1 have wider limits at most of
their frequencies and durations; here the tightest one of each table holds for all its rows.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from specan.analysis.levels import Levels
from specan.analysis.octave import Octave
from specan.analysis.tone import Tone
from specan.data.channel import Channel
from specan.data.recording import ArraySource, Recording
from specan.divisions import FRACTIONS
from specan.dsp import bands
from specan.dsp.bands import BREAKPOINTS, breakpoint_ratio, class_1_limits
from specan.dsp.weighting import weighting_level
from specan.errors import RequestError

Real = NDArray[np.float64]

FILTERS, METERS, RECORDERS = "IEC 61260-1:2014", "IEC 61672-1:2013", "IEEE 1057-2017"
RATES = (44100.0, 1e6)  # in Hz
_FADE = 3.0  # a tone is faded over this, times the inverse of the bandwidth: cut off, it would be wider than the limits
_CYCLES = 25
# IEC 61672-1:2013, table 4: duration in ms of a 4 kHz burst, maximum F and S levels and exposure level, re the
# steady level.
_BURSTS: tuple[tuple[float, float, float | None, float], ...] = (
    (1000, 0.0, -2.0, 0.0), (500, -0.1, -4.1, -3.0), (200, -1.0, -7.4, -7.0), (100, -2.6, -10.2, -10.0),
    (50, -4.8, -13.1, -13.0), (20, -8.3, -17.0, -17.0), (10, -11.1, -20.0, -20.0), (5, -14.1, -23.0, -23.0),
    (2, -18.0, -27.0, -27.0), (1, -21.0, None, -30.0), (0.5, -24.0, None, -33.0), (0.25, -27.0, None, -36.0),
)  # fmt: skip
_BURST_LIMIT, _WEIGHTING_LIMIT = 0.5, 0.7  # dB, class 1: table 4, and table 3 at 1 kHz
# IEC 61672-1:2013, table 5: cycles, frequency in Hz, C peak level minus steady C level, limit of class 1.
_PEAKS = ((1.0, 31.5, 2.5, 2.0), (1.0, 500.0, 3.5, 1.0), (1.0, 8000.0, 3.4, 2.0), (0.5, 500.0, 2.4, 1.0))


@dataclass(frozen=True)
class Check:
    """One requirement and what was found.

    Attributes
    ----------
    standard, clause, what : str
    expected, found : float
        In `unit`; where only limits are stated, `expected` is NaN.
    lower, upper : float
        What `found` has to lie between.
    """

    standard: str
    clause: str
    what: str
    expected: float
    found: float
    lower: float
    upper: float
    unit: str

    @property
    def passed(self) -> bool:
        """Whether the requirement is met."""
        return self.lower <= self.found <= self.upper


def checks(rate: float = 51200.0) -> Iterator[Check]:
    """All requirements that are tried, at one sampling rate in Hz.

    Raises
    ------
    RequestError
        The rate does not hold the audio range, or takes more memory than a computer has.

    Examples
    --------
    >>> one = Check("IEC 61260-1:2014", "5.12", "effective bandwidth", 0.0, 0.1, -0.4, 0.4, "dB")
    >>> one.passed
    True
    """
    low, high = RATES
    if not low <= rate <= high:
        raise RequestError(
            f"the sampling rate is {rate:g} Hz",
            expected=f"{low:g} to {high:g} Hz, which hold the audio range",
        )
    for fraction in FRACTIONS:
        yield from _attenuation(fraction, rate)
        yield _bandwidth(fraction, rate)
        yield _summation(fraction, rate)
        yield _sweep(fraction, rate)
    yield _linearity(rate)
    for weighting in ("A", "C", "Z"):
        yield _weighting(weighting, rate)
    yield from _bursts(rate)
    yield from _falls(rate)
    yield from _peaks(rate)
    yield from _sine_fit(rate)


def _about(
    standard: str,
    clause: str,
    what: str,
    expected: float,
    found: float,
    limits: tuple[float, float],
    unit: str,
) -> Check:
    """A check with limits relative to what is expected."""
    return Check(
        standard, clause, what, expected, float(found), expected + limits[0], expected + limits[1], unit
    )


def _recording(rate: float, *signals: Real) -> Recording:
    channels = tuple(
        Channel(f"signal {k}", unit="Pa", role="microphone", sampling_rate=rate, n_samples=signals[0].size)
        for k in range(len(signals))
    )
    return Recording("signals", channels, ArraySource(signals))


def _tone(frequency: float, seconds: float, rate: float) -> Real:
    """A faded tone with a mean square of 1."""
    n = round(seconds * rate)
    signal = np.sin(np.pi * np.arange(n) / n) ** 2 * np.sin(
        2 * np.pi * frequency * (np.arange(n) + 0.5) / rate
    )
    return np.asarray(signal / math.sqrt(float(np.mean(signal**2))))


_STEADY = 10.0 * math.log10(1.0 / 4e-10)  # level of 1 Pa


def _band_levels(frequencies: Real, fraction: int, rate: float) -> tuple[Real, Real]:
    """Levels of the bands about tones re the tones' own, and the mid-frequencies."""
    width = frequencies.min() * math.log(bands.OCTAVE_RATIO) / fraction
    seconds = max(2 * _FADE / width, _CYCLES / float(frequencies.min()), 0.1)
    found = Octave(fraction=fraction, fmax=0.39 * rate)(
        _recording(rate, *(_tone(f, seconds, rate) for f in frequencies))
    )
    return found.level_dB - _STEADY, found.exact_hz


def _attenuation(fraction: int, rate: float) -> Iterator[Check]:
    """5.10: the band at 1 kHz, with tones at the breakpoints on both sides."""
    mid = float(bands.mid_frequencies(bands.band_at(1000.0, fraction), fraction))
    for x in BREAKPOINTS:
        ratio = float(breakpoint_ratio(x, fraction))
        tones = np.array([mid * ratio, mid / ratio])
        levels, exact = _band_levels(tones, fraction, rate)
        found = -levels[:, int(np.argmin(np.abs(exact - mid)))]
        low, high = (float(limit) for limit in class_1_limits(ratio, fraction))
        # The side that is nearer to a limit.
        worst = float(min(found, key=lambda value: min(value - low, high - value)))
        what = f"1/{fraction} octave, attenuation at G^{x:g}"
        yield Check(FILTERS, "5.10", what, 0.0 if x == 0 else math.nan, worst, low, high, "dB")


def _bandwidth(fraction: int, rate: float) -> Check:
    """5.12: an impulse has the same energy in every hertz; bands to a fifth of the rate, above it is cut off."""
    n = 16 * round(rate)
    impulse = np.zeros(n)
    impulse[n // 3] = 1.0
    found = Octave(fraction=fraction, settling="counted")(_recording(rate, impulse))
    expected = 10 * np.log10((found.upper_hz - found.lower_hz) / (rate / 2) / n / 4e-10)
    error = (found.level_dB[0] - expected)[found.upper_hz < 0.2 * rate]
    return _about(
        FILTERS, "5.12", f"1/{fraction} octave, effective bandwidth", 0.0, _worst(error), (-0.4, 0.4), "dB"
    )


def _summation(fraction: int, rate: float) -> Check:
    """5.16: energies of the bands together, of tones in the middle, at the edge and between."""
    index = bands.band_at(1000.0, fraction)
    mid, (_, upper) = bands.mid_frequencies(index, fraction), bands.band_edges(index, fraction)
    tones = np.geomspace(float(mid), float(upper), 5)
    levels, _ = _band_levels(tones, fraction, rate)
    error = 10 * np.log10(np.sum(10 ** (0.1 * levels), axis=1))
    return _about(
        FILTERS, "5.16", f"1/{fraction} octave, summation of bands", 0.0, _worst(error), (-1.8, 0.8), "dB"
    )


def _sweep(fraction: int, rate: float) -> Check:
    """5.14: an exponential sweep spends the same time in every band of a fraction of an octave."""
    seconds, low, high = 20.0, 20.0, 0.4 * rate
    t = np.arange(round(seconds * rate)) / rate
    pace = math.log(high / low) / seconds
    sweep = np.sqrt(2) * np.sin(2 * np.pi * low / pace * (np.exp(pace * t) - 1))
    found = Octave(fraction=fraction, fmin=100.0, fmax=5000.0, settling="counted")(_recording(rate, sweep))
    expected = 10 * np.log10(np.log(found.upper_hz / found.lower_hz) / pace / seconds)
    error = found.level_dB[0] - _STEADY - expected
    return _about(
        FILTERS,
        "5.14",
        f"1/{fraction} octave, time-invariant operation",
        0.0,
        _worst(error),
        (-0.4, 0.4),
        "dB",
    )


def _linearity(rate: float) -> Check:
    """5.13: from 120 dB down to 0 dB."""
    levels = np.arange(0.0, 121.0, 10.0)
    tone = _tone(1000.0, 0.5, rate)
    found = Octave(band=1000.0)(_recording(rate, *(tone * 2e-5 * 10 ** (level / 20) for level in levels)))
    # The band takes the same part of the faded tone at every level.
    error = found.level_dB[:, 0] - levels - (found.level_dB[-1, 0] - levels[-1])
    return _about(
        FILTERS, "5.13", "1/3 octave, level linearity over 120 dB", 0.0, _worst(error), (-0.5, 0.5), "dB"
    )


def _weighting(weighting: str, rate: float) -> Check:
    """5.5: overall levels of tones at the nominal frequencies from 10 Hz to 20 kHz."""
    errors = []
    for frequency in 10 ** (np.arange(10, 44) / 10):
        if frequency < 0.45 * rate:
            tone = _tone(float(frequency), 400 / frequency, rate)
            found = Octave(band=1000.0)(_recording(rate, tone)).overall_dB[weighting][0] - _STEADY
            errors.append(found - float(weighting_level(np.array([frequency]), weighting)[0]))  # type: ignore[arg-type]
    limit = _WEIGHTING_LIMIT
    return _about(
        METERS, "5.5", f"weighting {weighting}", 0.0, _worst(np.array(errors)), (-limit, limit), "dB"
    )


def _burst(frequency: float, seconds: float, length: float, rate: float, sign: float = 1.0) -> Real:
    samples = np.zeros(round(length * rate))
    part = sign * np.sqrt(2) * np.sin(2 * np.pi * frequency * np.arange(round(seconds * rate)) / rate)
    start = round(0.2 * rate)
    samples[start : start + part.size] = part
    return samples


def _bursts(rate: float) -> Iterator[Check]:
    """5.9 and table 4."""
    steady = Levels()(_recording(rate, _tone(4000.0, 2.0, rate))).equivalent_dB["A"][0]
    for milliseconds, fast, slow, exposure in _BURSTS:
        recording = _recording(rate, _burst(4000.0, milliseconds / 1000, 0.6 + milliseconds / 1000, rate))
        what = f"4 kHz burst of {milliseconds:g} ms"
        for name, expected in (("fast", fast), ("slow", slow)):
            if expected is not None:
                found = Levels(averaging=name)(recording).max_dB[0] - steady  # type: ignore[arg-type]
                yield _burst_check(f"{what}, maximum {name}", expected, found)
        found = Levels()(recording).exposure_dB["A"][0] - steady
        yield _burst_check(f"{what}, exposure", exposure, found)


def _burst_check(what: str, expected: float, found: float) -> Check:
    return _about(METERS, "5.9", what, expected, found, (-_BURST_LIMIT, _BURST_LIMIT), "dB")


def _falls(rate: float) -> Iterator[Check]:
    """5.8: how fast F and S fall after a tone."""
    t = np.arange(round(5.0 * rate)) / rate
    samples = np.where(t < 3.0, np.sqrt(2) * np.sin(2 * np.pi * 1000 * t), 0.0)
    for averaging, expected, below, above in (("fast", 34.7, -3.7, 3.8), ("slow", 4.3, -0.7, 0.8)):
        settings = Octave(band=1000.0, averaging=averaging, interval_s=0.25)  # type: ignore[arg-type]
        history = settings(_recording(rate, samples)).history
        assert history is not None
        later = (history.time_s > 3.4) & (history.time_s < 4.8)
        found = -float(np.polyfit(history.time_s[later], history.overall_dB["Z"][0, later], 1)[0])
        yield _about(METERS, "5.8", f"fall of the {averaging} level", expected, found, (below, above), "dB/s")


def _peaks(rate: float) -> Iterator[Check]:
    """5.13 and table 5."""
    for cycles, frequency, expected, limit in _PEAKS:
        steady = _STEADY + float(weighting_level(np.array([frequency]), "C")[0])
        for sign, side in ((1.0, "positive"), (-1.0, "negative")):
            if cycles == 1.0 and sign < 0:
                continue
            samples = _burst(frequency, cycles / frequency, 1.0, rate, sign)
            found = Levels()(_recording(rate, samples)).c_peak_dB[0] - steady
            kind = "one cycle" if cycles == 1.0 else f"{side} half cycle"
            yield _about(
                METERS, "5.13", f"C peak, {kind} of {frequency:g} Hz", expected, found, (-limit, limit), "dB"
            )


def _sine_fit(rate: float) -> Iterator[Check]:
    """4.6: the four-parameter fit without noise, and its scatter with noise beside the Cramer-Rao bound."""
    n, frequency, amplitude = round(0.25 * rate), 1234.567, 0.8
    t = np.arange(n) / rate
    clean = amplitude * np.cos(2 * np.pi * frequency * t + 0.3)
    found = Tone()(_recording(rate, clean))
    for what, error in (
        ("frequency", found.frequency_hz / frequency - 1),
        ("amplitude", math.sqrt(2) * float(found.tone_rms[0]) / amplitude - 1),
    ):
        yield _about(RECORDERS, "4.6", f"{what} of a sine", 0.0, 1e6 * error, (-1.0, 1.0), "ppm")
    noise, draws = 0.01, 60
    rng = np.random.default_rng(1057)
    noisy = [clean + noise * rng.standard_normal(n) for _ in range(draws)]
    scatter = math.sqrt(2) * np.std([Tone()(_recording(rate, x)).tone_rms[0] for x in noisy], ddof=1)
    found_ratio = float(scatter / (noise * math.sqrt(2.0 / n)))
    what = "scatter of the amplitude over the Cramer-Rao bound"
    # A standard deviation from 60 draws is known to 9 %; three of that.
    yield _about(RECORDERS, "4.6", what, 1.0, found_ratio, (-0.28, 0.28), "1")


def _worst(errors: Real) -> float:
    return float(errors[int(np.argmax(np.abs(errors)))])
