"""What the standards ask of an analyser, tried on signals made for it: expected, found, tolerance.

Signals go through the same settings as recordings do. Table 3 and table 4 of IEC 61672-1 have wider limits at most of
their frequencies and durations; here the tightest one of each table holds for all its rows.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from specan.analysis.levels import Levels
from specan.analysis.octave import Octave
from specan.analysis.tone import Tone
from specan.arrays import Real
from specan.data.recording import Recording
from specan.divisions import FRACTIONS
from specan.dsp import bands
from specan.dsp.bands import BREAKPOINTS, breakpoint_ratio, class_1_limits
from specan.dsp.weighting import Weighting, weighting_level
from specan.errors import RequestError

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
    for standard, rows in ((FILTERS, _filters), (METERS, _meters), (RECORDERS, _sine_fit)):
        for clause, what, expected, found, below, above, unit in rows(rate):
            about = 0.0 if math.isnan(expected) else expected
            yield Check(standard, clause, what, expected, float(found), about + below, about + above, unit)


# Clause, what, expected, found, limits about what is expected (or as they are, where that is NaN), unit.
Row = tuple[str, str, float, float, float, float, str]


def _filters(rate: float) -> Iterator[Row]:
    parts = (
        ("5.12", "effective bandwidth", _bandwidth, -0.4, 0.4),
        ("5.16", "summation of bands", _summation, -1.8, 0.8),
        ("5.14", "time-invariant operation", _sweep, -0.4, 0.4),
    )
    for fraction in FRACTIONS:
        yield from _attenuation(fraction, rate)
        for clause, what, errors, below, above in parts:
            worst = _worst(errors(fraction, rate))
            yield clause, f"1/{fraction} octave, {what}", 0.0, worst, below, above, "dB"
    yield "5.13", "1/3 octave, level linearity over 120 dB", 0.0, _worst(_linearity(rate)), -0.5, 0.5, "dB"


def _meters(rate: float) -> Iterator[Row]:
    weightings: tuple[Weighting, ...] = ("A", "C", "Z")
    for weighting in weightings:
        worst = _worst(_weighting(weighting, rate))
        yield "5.5", f"weighting {weighting}", 0.0, worst, -_WEIGHTING_LIMIT, _WEIGHTING_LIMIT, "dB"
    yield from _bursts(rate)
    yield from _falls(rate)
    yield from _peaks(rate)


def _recording(rate: float, *signals: Real) -> Recording:
    named = {f"signal {k}": signal for k, signal in enumerate(signals)}
    return Recording.from_arrays(named, rate, units=dict.fromkeys(named, "Pa"))


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


def _attenuation(fraction: int, rate: float) -> Iterator[Row]:
    """5.10: the band at 1 kHz, with tones at the breakpoints on both sides."""
    mid = float(bands.mid_frequencies(bands.band_at(1000.0, fraction), fraction))
    for x in BREAKPOINTS:
        ratio = float(breakpoint_ratio(x, fraction))
        levels, exact = _band_levels(np.array([mid * ratio, mid / ratio]), fraction, rate)
        found = -levels[:, int(np.argmin(np.abs(exact - mid)))]
        low, high = (float(limit) for limit in class_1_limits(ratio, fraction))
        # The side that is nearer to a limit.
        worst = float(min(found, key=lambda value: min(value - low, high - value)))
        expected = 0.0 if x == 0 else math.nan
        yield "5.10", f"1/{fraction} octave, attenuation at G^{x:g}", expected, worst, low, high, "dB"


def _bandwidth(fraction: int, rate: float) -> Real:
    """5.12: an impulse has the same energy in every hertz; bands to a fifth of the rate, above it is cut off."""
    n = 16 * round(rate)
    impulse = np.zeros(n)
    impulse[n // 3] = 1.0
    found = Octave(fraction=fraction, settling="counted")(_recording(rate, impulse))
    expected = 10 * np.log10((found.upper_hz - found.lower_hz) / (rate / 2) / n / 4e-10)
    return (found.level_dB[0] - expected)[found.upper_hz < 0.2 * rate]


def _summation(fraction: int, rate: float) -> Real:
    """5.16: energies of the bands together, of tones in the middle, at the edge and between."""
    index = bands.band_at(1000.0, fraction)
    mid, (_, upper) = bands.mid_frequencies(index, fraction), bands.band_edges(index, fraction)
    levels, _ = _band_levels(np.geomspace(float(mid), float(upper), 5), fraction, rate)
    return np.asarray(10 * np.log10(np.sum(10 ** (0.1 * levels), axis=1)))


def _sweep(fraction: int, rate: float) -> Real:
    """5.14: an exponential sweep spends the same time in every band of a fraction of an octave."""
    seconds, low, high = 20.0, 20.0, 0.4 * rate
    t = np.arange(round(seconds * rate)) / rate
    pace = math.log(high / low) / seconds
    sweep = np.sqrt(2) * np.sin(2 * np.pi * low / pace * (np.exp(pace * t) - 1))
    found = Octave(fraction=fraction, fmin=100.0, fmax=5000.0, settling="counted")(_recording(rate, sweep))
    expected = 10 * np.log10(np.log(found.upper_hz / found.lower_hz) / pace / seconds)
    return np.asarray(found.level_dB[0] - _STEADY - expected)


def _linearity(rate: float) -> Real:
    """5.13: from 120 dB down to 0 dB."""
    levels = np.arange(0.0, 121.0, 10.0)
    tone = _tone(1000.0, 0.5, rate)
    found = Octave(band=1000.0)(_recording(rate, *(tone * 2e-5 * 10 ** (level / 20) for level in levels)))
    # The band takes the same part of the faded tone at every level.
    return np.asarray(found.level_dB[:, 0] - levels - (found.level_dB[-1, 0] - levels[-1]))


def _weighting(weighting: Weighting, rate: float) -> Real:
    """5.5: overall levels of tones at the nominal frequencies from 10 Hz to 20 kHz."""
    frequencies = 10 ** (np.arange(10, 44) / 10)
    frequencies = frequencies[frequencies < 0.45 * rate]
    found = [
        Octave(band=1000.0)(_recording(rate, _tone(f, 400 / f, rate))).overall_dB[weighting][0]
        for f in frequencies.tolist()
    ]
    return np.array(found) - _STEADY - weighting_level(frequencies, weighting)


def _burst(frequency: float, seconds: float, length: float, rate: float, sign: float = 1.0) -> Real:
    samples = np.zeros(round(length * rate))
    part = sign * np.sqrt(2) * np.sin(2 * np.pi * frequency * np.arange(round(seconds * rate)) / rate)
    start = round(0.2 * rate)
    samples[start : start + part.size] = part
    return samples


def _bursts(rate: float) -> Iterator[Row]:
    """5.9 and table 4."""
    steady = Levels()(_recording(rate, _tone(4000.0, 2.0, rate))).equivalent_dB["A"][0]
    for milliseconds, *expected in _BURSTS:
        recording = _recording(rate, _burst(4000.0, milliseconds / 1000, 0.6 + milliseconds / 1000, rate))
        fast, slow = (Levels(averaging=name)(recording) for name in ("fast", "slow"))
        found = (fast.max_dB[0], slow.max_dB[0], fast.exposure_dB["A"][0])
        for name, wanted, level in zip(("maximum fast", "maximum slow", "exposure"), expected, found):
            if wanted is not None:
                what = f"4 kHz burst of {milliseconds:g} ms, {name}"
                yield "5.9", what, wanted, level - steady, -_BURST_LIMIT, _BURST_LIMIT, "dB"


def _falls(rate: float) -> Iterator[Row]:
    """5.8: how fast F and S fall after a tone."""
    t = np.arange(round(5.0 * rate)) / rate
    samples = np.where(t < 3.0, np.sqrt(2) * np.sin(2 * np.pi * 1000 * t), 0.0)
    for averaging, expected, below, above in (("fast", 34.7, -3.7, 3.8), ("slow", 4.3, -0.7, 0.8)):
        settings = Octave(band=1000.0, averaging=averaging, interval_s=0.25)  # type: ignore[arg-type]
        history = settings(_recording(rate, samples)).history
        assert history is not None
        later = (history.time_s > 3.4) & (history.time_s < 4.8)
        found = -float(np.polyfit(history.time_s[later], history.overall_dB["Z"][0, later], 1)[0])
        yield "5.8", f"fall of the {averaging} level", expected, found, below, above, "dB/s"


def _peaks(rate: float) -> Iterator[Row]:
    """5.13 and table 5."""
    for cycles, frequency, expected, limit in _PEAKS:
        steady = _STEADY + float(weighting_level(np.array([frequency]), "C")[0])
        halves = {"positive half cycle": 1.0, "negative half cycle": -1.0}
        for kind, sign in halves.items() if cycles == 0.5 else (("one cycle", 1.0),):
            samples = _burst(frequency, cycles / frequency, 1.0, rate, sign)
            found = Levels()(_recording(rate, samples)).c_peak_dB[0] - steady
            yield "5.13", f"C peak, {kind} of {frequency:g} Hz", expected, found, -limit, limit, "dB"


def _sine_fit(rate: float) -> Iterator[Row]:
    """4.6: the four-parameter fit without noise, and its scatter with noise beside the Cramer-Rao bound."""
    n, frequency, amplitude = round(0.25 * rate), 1234.567, 0.8
    t = np.arange(n) / rate
    clean = amplitude * np.cos(2 * np.pi * frequency * t + 0.3)
    found = Tone()(_recording(rate, clean))
    errors = {
        "frequency": found.frequency_hz / frequency - 1,
        "amplitude": math.sqrt(2) * float(found.tone_rms[0]) / amplitude - 1,
    }
    for what, error in errors.items():
        yield "4.6", f"{what} of a sine", 0.0, 1e6 * error, -1.0, 1.0, "ppm"
    noise, draws = 0.01, 60
    rng = np.random.default_rng(1057)
    noisy = [clean + noise * rng.standard_normal(n) for _ in range(draws)]
    scatter = math.sqrt(2) * np.std([Tone()(_recording(rate, x)).tone_rms[0] for x in noisy], ddof=1)
    ratio = float(scatter / (noise * math.sqrt(2.0 / n)))
    # A standard deviation from 60 draws is known to 9 %; three of that.
    yield "4.6", "scatter of the amplitude over the Cramer-Rao bound", 1.0, ratio, -0.28, 0.28, "1"


def _worst(errors: Real) -> float:
    return float(errors[int(np.argmax(np.abs(errors)))])
