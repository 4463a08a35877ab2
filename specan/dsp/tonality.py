"""What a short section of a signal looks like: a tone, noise, a sweep, a transient, silence."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from specan.dsp.sine_fit import fit_frequency, fit_sine
from specan.dsp.windows import window

Look = Literal["tone", "noise", "swept tone", "transient", "silence", "mixed"]

_LOBE = 5  # lines on either side that hold a tone under the Blackman-Harris window
_HARMONICS = 10
_FRAME_S, _MIN_FRAME, _MAX_FRAMES = 0.04, 64, 128

# Shares of the power. Between the two a tone and noise are mixed too evenly to be called either.
TONE_SHARE, NOISE_SHARE = 0.3, 0.1


class Appearance(NamedTuple):
    """How a section looks.

    Attributes
    ----------
    look : str
        One of `Look`.
    frequency_hz : float
        Of the strongest line.
    share : float
        Part of the power that this line and its harmonics hold.
    """

    look: Look
    frequency_hz: float
    share: float


def appearance(samples: NDArray[np.float64], rate: float) -> Appearance:
    """Classify one section (n,) of a second or so.

    A *tone* is a line that holds, with its harmonics, at least `TONE_SHARE` of the power and that a steady
    sine explains. A *swept tone* holds each short frame in one line that moves smoothly. *Noise* has
    no line with more than `NOISE_SHARE`. A *transient* has most of its energy in a twentieth of the time.
    """
    x = samples - samples.mean()
    # What is left of a constant by rounding is silence.
    if np.sqrt(np.mean(x**2)) <= 1e-12 * max(float(np.max(np.abs(samples))), 1e-300):
        return Appearance("silence", 0.0, 0.0)
    transient = _is_transient(x)
    if not transient:
        x = _while_on(x)
    power = np.abs(np.fft.rfft(x * window("blackman-harris", len(x)))) ** 2
    power[:_LOBE] = 0.0  # drift
    total = power.sum()
    peak = int(np.argmax(power))
    lines_per_tone = [slice(max(m * peak - _LOBE, 0), m * peak + _LOBE + 1) for m in range(1, _HARMONICS + 1)]
    share = float(sum(power[s].sum() for s in lines_per_tone if s.start < len(power)) / total)
    frequency = peak * rate / len(x)
    if transient:
        return Appearance("transient", frequency, share)
    if _is_sweep(x, rate):
        return Appearance("swept tone", frequency, share)
    if power[lines_per_tone[0]].sum() < NOISE_SHARE * total:
        return Appearance("noise", frequency, share)
    steady, frequency = _steady_line(x, rate, peak)
    if share >= TONE_SHARE and steady:
        return Appearance("tone", frequency, share)
    # Narrow bands of noise peak too, but no steady sine is in them.
    return Appearance("mixed" if steady else "noise", frequency, share)


def _steady_line(x: NDArray[np.float64], rate: float, peak: int) -> tuple[bool, float]:
    """Whether one sine removes nine tenths of the power around the peak, and its frequency."""
    n = len(x)
    fit = fit_frequency(x, rate, _interpolated(x, rate, peak))
    time = np.arange(n) / rate
    rest = x - np.real(fit.phasors[0] * np.exp(2j * np.pi * fit.frequency_hz * time)) - fit.mean
    lobe = slice(max(peak - _LOBE, 0), peak + _LOBE + 1)
    shape = window("blackman-harris", n)
    before, after = (np.sum(np.abs(np.fft.rfft(y * shape)[lobe]) ** 2) for y in (x, rest))
    return bool(after < 0.1 * before), fit.frequency_hz


def _interpolated(x: NDArray[np.float64], rate: float, peak: int) -> float:
    """Best of a few guesses around a line: the one whose sine leaves least."""
    step = rate / len(x)
    guesses = [(peak + offset) * step for offset in (-0.4, -0.2, 0.0, 0.2, 0.4)]
    guesses = [g for g in guesses if 0 < g < rate / 2]
    return min(guesses, key=lambda f: float(fit_sine(x, rate, f).residual_rms))


def _while_on(x: NDArray[np.float64]) -> NDArray[np.float64]:
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
    return kept - kept.mean()


def _is_transient(x: NDArray[np.float64]) -> bool:
    parts = np.array([np.mean(part**2) for part in np.array_split(x, 20)])
    return bool(parts.max() > 0.6 * parts.sum())


def _is_sweep(x: NDArray[np.float64], rate: float) -> bool:
    """One line in every short frame, moving in steps much smaller than its whole way."""
    frame = max(_MIN_FRAME, int(_FRAME_S * rate), len(x) // _MAX_FRAMES)
    count = len(x) // frame
    if count < 8:
        return False
    frames = x[: count * frame].reshape(count, frame) * window("hann", frame)
    power = np.abs(np.fft.rfft(frames, axis=-1)) ** 2
    peak = np.argmax(power[:, 2:], axis=-1) + 2
    held = np.array([p[max(k - 3, 0) : k + 4].sum() / max(p.sum(), 1e-300) for p, k in zip(power, peak)])
    way = np.ptp(np.percentile(peak, [5, 95]))
    step = np.median(np.abs(np.diff(peak)))
    return bool(np.percentile(held, 25) > 0.5 and way > 4 and way > 8 * step)
