"""What a section of a signal looks like, tone, noise, transient, and how the frequency of a tone moves."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np

from specan.arrays import Complex, Flags, Real
from specan.dsp.sine_fit import fit_frequency, fit_sine, harmonics_below_nyquist, peak_frequency, tone_basis
from specan.dsp.windows import window

Look = Literal[
    "tone", "broad", "narrow", "several tones", "square wave", "transient", "silence", "mixed", "slow"
]

_LOBE = 5  # lines on either side that hold a tone under the Blackman-Harris window
_HARMONICS = 10

# Shares of the power. Between the two a tone and noise are mixed too evenly to be called either.
TONE_SHARE, NOISE_SHARE = 0.3, 0.1
# A tone of which the amplitude varies by m has a mean square that is larger by m^2 / 2. One part in a hundred is
# 0.04 dB, as much as levels of tones may be wrong.
_MODULATED = 0.01
# A second line this far below (10 dB): hum beside a tone.
_SECOND = 0.1
# The fundamental of what is a distorted sine, and not a train of pulses, holds this part of its harmonics and itself
# (a square wave's 0.81, a rectangular one's with a duty of 0.4 0.73).
_FUNDAMENTAL = 0.75
# Mean fourth power over the squared mean square: 1 of a square wave, 1.5 of a sine, 3 of noise.
_SQUARE = 1.25
# The power of a line of noise is exponentially distributed: over the mean of its neighbours it exceeds this
# with a probability of exp(-20), one in 10^4 among the 50 000 lines of a section.
_SIGNIFICANT = 20.0
_NEIGHBOURS = 25


class Appearance(NamedTuple):
    """How a section looks.

    Attributes
    ----------
    look : str
        One of `Look`. "broad" and "narrow" may be noise or not, see `specan.dsp.tonality`.
    frequency_hz : float
        Of the strongest line.
    share : float
        Part of the power that this line and its harmonics hold.
    amplitude : float
        Of the tone, else 0.
    band_hz : tuple of float
        Where what surrounds the strongest line lies.
    """

    look: Look
    frequency_hz: float
    share: float
    amplitude: float = 0.0
    band_hz: tuple[float, float] = (0.0, 0.0)


def appearance(samples: Real, rate: float) -> Appearance:
    """Classify one section (n,) of a second or so.

    A *tone* is a line that holds, with its harmonics, at least `TONE_SHARE` of the power; one steady sine
    explains it, and there is no other line that is more than a hum beside it. *Broad* is what has no line
    with `NOISE_SHARE`, *narrow* what has one that no steady sine explains. A tone and noise evenly are *mixed*.
    A *transient* has most of its energy in a twentieth of the time. *Slow* is what has hardly five periods.

    Examples
    --------
    >>> t = np.arange(8000) / 8000
    >>> found = appearance(np.sin(2 * np.pi * 123.4 * t), 8000.0)
    >>> found.look, round(found.frequency_hz, 3), round(found.share, 3)
    ('tone', 123.4, 1.0)
    """
    x = samples - samples.mean()
    # What is left of a constant by rounding is silence.
    if np.sqrt(np.mean(x**2)) <= 1e-12 * max(float(np.max(np.abs(samples))), 1e-300):
        return Appearance("silence", 0.0, 0.0)
    parts = np.array([np.mean(part**2) for part in np.array_split(x, 20)])
    transient = bool(parts.max() > 0.6 * parts.sum())
    if not transient:
        x = _while_on(x)
    power = _lines(x)
    slow = power[:_LOBE].sum()
    power[:_LOBE] = 0.0  # drift
    total = power.sum()
    if slow > 100 * total:
        return Appearance("slow", 0.0, 0.0)
    peak = int(np.argmax(power))
    share = float(power[_family(power)].sum() / total)
    frequency = peak * rate / len(x)
    if transient:
        return Appearance("transient", frequency, share)
    band = _around(power, peak, rate / len(x))
    if power[_lobe(peak)].sum() < NOISE_SHARE * total:
        return Appearance("broad", frequency, share, 0.0, band)
    return _with_a_line(x, rate, power, share, band)


def tonal_share(samples: Real) -> float:
    """Part of the power of a section (n,) in its strongest line and the harmonics of that; 1 where it is silent.

    Examples
    --------
    >>> round(tonal_share(np.sin(2 * np.pi * 50.3 * np.arange(1000) / 1000)), 3)
    1.0
    """
    if not np.isfinite(samples).all():
        return 1.0
    power = _lines(samples - samples.mean())
    power[:_LOBE] = 0.0
    total = power.sum()
    return float(power[_family(power)].sum() / total) if total > 0 else 1.0


def _family(power: Real) -> Flags:
    """Lines of the strongest one and its harmonics."""
    peak, lines = int(np.argmax(power)), np.zeros(len(power), dtype=bool)
    for m in range(1, _HARMONICS + 1):
        lines[_lobe(m * peak)] = True
    return lines


def _lobe(peak: int) -> slice:
    """Lines that hold a tone."""
    return slice(max(peak - _LOBE, 0), peak + _LOBE + 1)


def _with_a_line(x: Real, rate: float, power: Real, share: float, band: tuple[float, float]) -> Appearance:
    """What holds a tenth of its power in one line: a steady sine, something else besides it, or a narrow band."""
    n, peak = len(x), int(np.argmax(power))
    line = rate / n
    fit = fit_frequency(x, rate, peak_frequency(x, rate, (peak - 2) * line, (peak + 2) * line))
    frequency, amplitude = fit.frequency_hz, float(abs(fit.phasors[0]))
    if not _is_steady(x, rate, frequency, power, peak):
        return Appearance("narrow", frequency, share, 0.0, band)
    look: Look = "mixed"
    if share >= TONE_SHARE:
        order = harmonics_below_nyquist(rate, frequency, _HARMONICS, n)
        phasors = fit_sine(x, rate, frequency, order).phasors
        squares, square_wave = np.abs(phasors) ** 2, np.mean(x**4) < _SQUARE * np.mean(x**2) ** 2
        others = squares[0] < _FUNDAMENTAL * squares.sum() or _has_other_lines(x, rate, phasors, frequency)
        look = "several tones" if others else "square wave" if square_wave else "tone"
    return Appearance(look, frequency, share, amplitude, band)


def _lines(x: Real) -> Real:
    return np.asarray(np.abs(np.fft.rfft(x * window("blackman-harris", len(x)))) ** 2)


def _around(power: Real, peak: int, line_hz: float) -> tuple[float, float]:
    """The band around the strongest line in which lines are within 20 dB of it, gaps of a lobe allowed."""
    strong = np.flatnonzero(power > 0.01 * power[peak])
    place = int(np.searchsorted(strong, peak))
    gaps = np.diff(strong) > 2 * _LOBE
    before, after = np.flatnonzero(gaps[:place]), np.flatnonzero(gaps[place:])
    low = strong[before[-1] + 1] if before.size else strong[0]
    high = strong[place + after[0]] if after.size else strong[-1]
    return (float(low) - 1) * line_hz, (float(high) + 1) * line_hz


def _background(power: Real, peak: int) -> float:
    """Mean power of a line of the noise around a line, from the median, which other lines do not move."""
    own = _lobe(peak)
    before = power[max(peak - _NEIGHBOURS, _LOBE) : own.start]
    sides = np.concatenate([before, power[own.stop : peak + _NEIGHBOURS + 1]])
    return float(np.median(sides) / np.log(2)) if sides.size else 0.0


def _is_steady(x: Real, rate: float, frequency: float, power: Real, peak: int) -> bool:
    """Whether one sine explains the power around the peak, but for noise and one part in a hundred."""
    basis = tone_basis(len(x), rate, frequency)
    fit = fit_sine(x, rate, frequency)
    phasor = fit.phasors[0]
    rest = _lines(x - fit.mean - phasor.real * basis[0] + phasor.imag * basis[1])
    lobe = _lobe(peak)
    noise = (2 * _LOBE + 1) * _background(rest, peak)
    significant = power[peak] > _SIGNIFICANT * _background(power, peak)
    return bool(significant and rest[lobe].sum() < _MODULATED * power[lobe].sum() + 3 * noise)


def _has_other_lines(x: Real, rate: float, phasors: Complex, frequency: float) -> bool:
    """Whether a line besides the tone and its harmonics is more than hum, or there is a pair around the tone."""
    n = len(x)
    basis = tone_basis(n, rate, frequency, len(phasors))
    tone = np.sum(phasors.real[:, None] * basis[0:-1:2] - phasors.imag[:, None] * basis[1:-1:2], axis=0)
    rest, whole = _lines(x - tone), _lines(tone)
    rest[:_LOBE] = 0.0
    peak = int(np.argmax(whole[: len(rest)]))
    power, strongest = whole[_lobe(peak)].sum(), int(np.argmax(rest))
    background = _background(rest, strongest)
    if rest[strongest] < _SIGNIFICANT * background:
        return False
    found = rest[_lobe(strongest)].sum() - (2 * _LOBE + 1) * background
    if found > _SECOND * power:
        return True
    mirrored = 2 * peak - strongest
    if found < _MODULATED / 2 * power or not _LOBE < mirrored < len(rest) - _LOBE:
        return False
    pair = rest[mirrored - 2 : mirrored + 3].max()
    return bool(pair > 0.25 * rest[strongest] and pair > _SIGNIFICANT * _background(rest, mirrored))


def _while_on(x: Real) -> Real:
    """The longest stretch that is within 20 dB of the loudest fiftieth: a start or an end inside it is cut off."""
    parts = np.array_split(x, 50)
    power = np.array([np.mean(part**2) for part in parts])
    on = np.concatenate([[False], power > 0.01 * power.max(), [False]])
    edges = np.flatnonzero(on[1:] != on[:-1]).reshape(-1, 2)
    first, last = edges[np.argmax(edges[:, 1] - edges[:, 0])]
    if (first, last) == (0, len(parts)):
        return x
    # The parts at a cut hold the step itself.
    first, last = (first + 1 if first else 0), (last - 1 if last < len(parts) else last)
    kept = np.concatenate(parts[first:last]) if last - first >= 5 else x
    return np.asarray(kept - kept.mean())


# Lengths of the frames in which the scatter is looked at, from what a fast sweep needs to what a slow one does.
_FRAMES = tuple(1 << power for power in range(6, 16))
_LEAST_FRAMES, _LEAST_LINES = 16, 16
# Lines that hold these parts of the energy are looked at, in frames that hold this part of the loudest one's.
# The strongest half alone shows what a floor of noise over many more lines would hide.
_ENERGY, _ON = (0.9, 0.5), 0.1
# Sum over lags of the squared correlation of lines under the Hann window: 1 + 2 (2/3)^2 + 2 (1/6)^2.
_CORRELATED_LINES = 1.944
# Allowance for what is nearly stationary and nearly Gaussian, besides the scatter of the estimate.
# Mean fourth power of samples over the squared mean square: 3 of a Gaussian process,
# 3/d of one that is on for a part d.
_PEAKED = 10.0
# Mean fourth power of an envelope over the squared mean square: 1 where it is constant, 2 of noise; 99 of 100
# bands of noise with 20 independent samples lie above this.
_CONSTANT_ENVELOPE, _LEAST_RESOLVED = 1.3, 2.5
_NEARLY, _DEVIATIONS = 0.1, 3.0


def scatters_as_noise(sections: Sequence[Real]) -> bool | None:
    """Whether the lines of short frames scatter within each frame as those of Gaussian noise do.

    Each line of a stationary Gaussian process has an exponentially distributed power, so that the mean
    square of the power over lines of equal expectation is twice the squared mean: the spectral kurtosis
    is 0 (Antoni, Mech. Syst. Signal Process. 20 (2006) 282-307; variance 4/n for n independent lines). The lines
    are brought to equal expectation by their mean over all frames, and compared within a frame, so that a gate
    does not matter. A sweep or a step holds one line of a frame (far more than 2), a pulse all of them evenly (1).

    Parameters
    ----------
    sections : sequence of array (n,)
        Of one signal.

    Returns
    -------
    bool or None
        The ratio exceeds 2 at no length of the frames, and falls short of it at one length at most where
        a signal repeats itself within the frame (a maximum length sequence). None where no length
        of the frames can tell.

    Examples
    --------
    >>> noise = np.random.default_rng(1).standard_normal(8000)
    >>> t = np.arange(8000) / 8000
    >>> sweep = np.sin(2 * np.pi * (50 * t + 1000 * t**2))
    >>> scatters_as_noise([noise]), scatters_as_noise([sweep])
    (True, False)
    """
    x = np.concatenate(sections)
    square = np.square(x - x.mean())
    if np.mean(square**2) > _PEAKED * np.mean(square) ** 2:
        return False  # rarer and higher than those of a Gaussian process that is on part of the time
    answers = []
    for energy in _ENERGY:
        seen = [found for length in _FRAMES if (found := _scatter(sections, length, energy)) is not None]
        if seen:
            excess = [(ratio - expected) / margin for ratio, expected, margin in seen]
            # Only a frame that is shorter than the period of a sequence sees it as noise.
            answers.append(bool(max(excess) <= 1.0 and (energy < max(_ENERGY) or excess[0] >= -1.0)))
    return all(answers) if answers else None


def _scatter(sections: Sequence[Real], length: int, energy: float) -> tuple[float, float, float] | None:
    """Mean square over squared mean of the lines in a frame; what noise has; how far it may be from that."""
    shape = window("hann", length)
    parts = [s[: len(s) // length * length].reshape(-1, length) for s in sections if len(s) >= length]
    if not parts:
        return None
    frames = np.concatenate(parts)
    power = np.abs(np.fft.rfft((frames - frames.mean(axis=1, keepdims=True)) * shape)[:, 2:-1]) ** 2
    whole = power.sum(axis=1)
    power = power[whole > _ON * whole.max()]
    expected = power.mean(axis=0)
    order = np.argsort(expected)[::-1]
    held = np.cumsum(expected[order])
    kept = order[: int(np.searchsorted(held, energy * held[-1])) + 1]
    n, m = len(power), len(kept)
    if n < _LEAST_FRAMES or m < _LEAST_LINES:
        return None
    even = power[:, kept] / expected[kept]
    ratio = float(np.mean(m * np.sum(even**2, axis=1) / np.sum(even, axis=1) ** 2))
    noise = 2 * n / (n + 1) / (1 + _CORRELATED_LINES / m)
    return ratio, noise, _NEARLY + _DEVIATIONS * 2 / np.sqrt(n * m)


def narrow_band_is_noise(sections: Sequence[Real], low: float, high: float) -> bool:
    """Whether what lies between two frequencies (in cycles a sample) is a narrow band of Gaussian noise.

    Steady lines have one power in every section, noise has not; and the envelope of noise is that of a complex
    Gaussian process, whose mean fourth power is twice the squared mean square. Of a sine, a
    sweep and frequency modulation it is that square itself, of two tones 1.5 times at most.

    Parameters
    ----------
    sections : sequence of array (n,)
        All of one length.
    """
    n = len(sections[0])
    first, last = max(int(low * n), 1), min(int(np.ceil(high * n)), n // 2 - 1)
    if len(sections) < 2 or last - first < 2:
        return False
    shape = window("hann", n)
    power = np.stack([np.abs(np.fft.rfft(s * shape)[first : last + 1]) ** 2 for s in sections])
    # Sections in which the signal is off say nothing.
    power = power[power.sum(axis=1) > 0.01 * power.sum(axis=1).max()]
    k = len(power)
    mean = power.mean(axis=0)
    lines = float(mean.sum() ** 2 / np.sum(mean**2)) / _CORRELATED_LINES
    if k < 2 or lines < _LEAST_RESOLVED:
        return False  # all of it lies in one line, or in two: that is not resolved
    repeated = float(np.mean(power**2, axis=0) @ (1 / mean) / mean.sum())
    envelopes = np.concatenate([_envelope_square(s, first, last) for s in sections])
    envelopes = envelopes[envelopes > 0]
    fourth = float(np.mean(envelopes**2) / np.mean(envelopes) ** 2)
    scatter = 1 / np.sqrt(lines * k)
    expected = 2 * k / (k + 1)
    # Halfway to what steady lines have (1); far above is what stands elsewhere in every section.
    if not 0.5 * (1 + expected) < repeated < expected + 5 * scatter:
        return False
    return bool(_CONSTANT_ENVELOPE < fourth < 2 + 5 * scatter)


def _envelope_square(x: Real, first: int, last: int) -> Real:
    """Squared envelope of what lies between two lines, without the ends, which the cut has bent."""
    spectrum = np.fft.rfft(x)[first : last + 1]
    count = 2 * len(spectrum)
    envelope = np.abs(np.fft.ifft(spectrum, count)) ** 2
    return np.asarray(envelope[count // 10 : count - count // 10])


Path = Literal["sweep", "steps", "moves", "none"]

_SHORTEST, _LEAST_FRAMES = 64, 8
_SIDE = 2  # lines on either side that hold a tone under the Hann window
_NEARLY_MOST = 0.8
_HELD = 0.3  # part of the power of a frame in one line: a tone down to some 3 dB below noise
# Median over mean of the steps from frame to frame: 1 for a linear sweep, above 0.5 for a logarithmic one of a
# section, 0 for a tone that stands still between a few steps.
_SMOOTH, _STEPWISE = 0.5, 0.3
_MONOTONE, _ALIKE = 0.97, 0.75
# Ways shorter than this part of the frequency are a drift; nobody measures a transfer function with them.
_DRIFT = 0.02


class Track(NamedTuple):
    """Frequency against time of one section.

    Attributes
    ----------
    frequency_hz : ndarray
        Of each frame.
    line_hz : float
        Distance of the lines in which it was looked for.
    held : float
        Part of the power in the strongest line, median over the frames.
    evenness : float
        Median over mean of the steps from frame to frame, in the frames that show the least: a sweep moves in frames of
        any length, steps stand still in short ones.
    """

    frequency_hz: Real
    line_hz: float
    held: float
    evenness: float

    @property
    def direction(self) -> int:
        """+1 or -1 where its thirds rise or fall, else 0."""
        steps = np.sign(np.diff([np.median(third) for third in np.array_split(self.frequency_hz, 3)]))
        return int(steps[0]) if steps[0] == steps[1] else 0


def track(section: Real, rate: float) -> Track | None:
    """The strongest line of every frame; in the longest frames in which that line holds about most.

    None where in no length one line holds most frames.
    """
    found = []
    length = _SHORTEST
    while length * _LEAST_FRAMES <= len(section):
        found.append(_track(section, rate, length))
        length *= 2
    most = max((one.held for one in found), default=0.0)
    if most < _HELD:
        return None
    # Short frames hold much in one line because their lines are wide.
    good = [one for one in found if one.held > _NEARLY_MOST * most]
    # A frame of hardly a period has no frequency that could move.
    resolved = [one for one in good if np.median(one.frequency_hz) > 2 * _SIDE * one.line_hz]
    return good[-1]._replace(evenness=min(one.evenness for one in resolved or good[-1:]))


def _track(section: Real, rate: float, length: int) -> Track:
    frames = section[: len(section) // length * length].reshape(-1, length)
    power = np.abs(np.fft.rfft((frames - frames.mean(axis=1, keepdims=True)) * window("hann", length))) ** 2
    whole = power.sum(axis=1)
    power = power[whole > 0.01 * whole.max()]
    peak = np.clip(np.argmax(power, axis=1), _SIDE, power.shape[1] - 1 - _SIDE)
    around = peak[:, None] + np.arange(-_SIDE, _SIDE + 1)
    lobe = np.take_along_axis(power, around, axis=1)
    held = lobe.sum(axis=1) / np.maximum(power.sum(axis=1), 1e-300)
    centre = (lobe * around).sum(axis=1) / np.maximum(lobe.sum(axis=1), 1e-300)
    steps = np.abs(np.diff(centre))
    even = float(np.median(steps) / max(np.mean(steps), 1e-300)) if steps.size else 0.0
    return Track(centre * rate / length, rate / length, float(np.median(held)), even)


def path(tracks: Sequence[Track], steady: Sequence[bool], section_s: float, apart_s: float) -> Path:
    """What the frequency does over the sections of a record.

    Parameters
    ----------
    tracks : sequence of Track
        Of the sections in which there is a signal, in their order.
    steady : sequence of bool
        Whether one steady sine explains the section.
    section_s, apart_s : float
        Length of a section, and time between the beginnings of the first and the last one, in seconds.

    Returns
    -------
    {"sweep", "steps", "moves", "none"}
        A sweep moves in one direction all the time; steps stand still in between. What moves otherwise
        (frequency modulation, a drift) only "moves".
    """
    if not tracks:
        return "none"
    every = np.concatenate([t.frequency_hz for t in tracks])
    middles = np.array([np.median(t.frequency_hz) for t in tracks])
    way = float(np.ptp(middles)) if all(steady) else float(np.ptp(np.percentile(every, [2, 98])))
    if way < _DRIFT * np.median(every):
        return "moves" if np.ptp(middles) > 0.1 / section_s else "none"
    moving = [t for t, still in zip(tracks, steady) if not still]
    rank = np.argsort(np.argsort(every, kind="stable"), kind="stable")
    in_time = np.corrcoef(rank, np.arange(rank.size))[0, 1]  # Spearman's rank correlation
    if 2 * len(moving) > len(tracks) and abs(in_time) > _MONOTONE:  # a slow beginning may look steady
        sign = 1 if middles[-1] + every[-1] > middles[0] + every[0] else -1
        smooth = np.median([t.evenness for t in moving]) > _SMOOTH
        if smooth and np.mean([t.direction == sign for t in moving]) > _ALIKE:
            return "sweep"
    if not all(t.evenness < _STEPWISE for t in moving):
        return "moves"
    # Steady sines of several frequencies are steps, unless a sweep that slow would look steady as well.
    if not moving and way * section_s / max(apart_s, section_s) * section_s < 0.5:
        return "moves"
    return "steps"
