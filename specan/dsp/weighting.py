"""Weightings: A, B, C and Z in frequency, as exact curves and as sampled filters; Fast, Slow, Impulse in time."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from specan.arrays import Complex, Real

Weighting = Literal["A", "B", "C", "Z"]
WEIGHTINGS: tuple[Weighting, ...] = ("Z", "A", "B", "C")


def _pole_frequencies() -> tuple[float, float, float, float]:
    """f_1 to f_4 in Hz, IEC 61672-1:2013, E.3 and E.4: from the design goals, not rounded."""
    f_r, f_l, f_h, f_a, d = 1000.0, 10.0**1.5, 10.0**3.9, 10.0**2.45, math.sqrt(0.5)
    b = (f_r**2 + f_l**2 * f_h**2 / f_r**2 - d * (f_l**2 + f_h**2)) / (1.0 - d)
    c = f_l**2 * f_h**2
    root = math.sqrt(b * b - 4.0 * c)
    golden = math.sqrt(5.0)
    return (
        math.sqrt((-b - root) / 2.0),
        (3.0 - golden) / 2.0 * f_a,
        (3.0 + golden) / 2.0 * f_a,
        math.sqrt((-b + root) / 2.0),
    )


F_1, F_2, F_3, F_4 = _pole_frequencies()
# The pole that makes C into B: 158.48932 Hz, ANSI S1.4-1983, appendix C (the curve of IEC 60651).
F_5 = 10.0**2.2


# Zeros at 0 Hz.
ZEROS: dict[Weighting, int] = {"Z": 0, "A": 4, "B": 3, "C": 2}
_C_POLES = (F_1, F_1, F_4, F_4)
# Frequencies in Hz, of poles on the negative real axis.
POLES: dict[Weighting, tuple[float, ...]] = {
    "Z": (),
    "A": (*_C_POLES, F_2, F_3),
    "B": (*_C_POLES, F_5),
    "C": _C_POLES,
}


def power_weighting(frequency: ArrayLike, weighting: Weighting) -> Real:
    """Factor on the mean square at each frequency, 1 at 1 kHz.

    ======  =====================================================================  =====================
    C       [f_4^2 f^2 / ((f^2 + f_1^2) (f^2 + f_4^2))]^2                          IEC 61672-1:2013 (E.1)
    A       C x f^4 / ((f^2 + f_2^2) (f^2 + f_3^2))                                IEC 61672-1:2013 (E.6)
    B       C x f^2 / (f^2 + f_5^2)                                                ANSI S1.4-1983, app. C
    Z       1                                                                      IEC 61672-1:2013, 5.5
    ======  =====================================================================  =====================

    The gain that makes each curve 0 dB at 1 kHz is computed, not rounded to 0.001 dB (E.4.2).

    Examples
    --------
    >>> (10 * np.log10(power_weighting([31.62, 1000.0], "A"))).round(2).tolist()
    [-39.44, 0.0]
    """
    found = _shape(np.square(np.asarray(frequency, dtype=np.float64)), 2, weighting)
    return np.asarray(found / _shape(np.asarray(1e6), 2, weighting))


def weighting_level(frequency: ArrayLike, weighting: Weighting) -> Real:
    """The same in dB; minus infinity at 0 Hz for A, B and C."""
    with np.errstate(divide="ignore"):
        return 10.0 * np.log10(power_weighting(frequency, weighting))


def complex_weighting(frequency: ArrayLike, weighting: Weighting) -> Complex:
    """Complex response of the analogue network, exp(+j w t); its squared magnitude is `power_weighting`.

    Poles at -f_1 (twice) and -f_4 (twice), for A also at -f_2 and -f_3, for B at -f_5; zeros at 0 Hz.
    """
    found = _shape(1j * np.asarray(frequency, dtype=np.float64), 1, weighting)
    return np.asarray(found / abs(_shape(np.asarray(1e3j), 1, weighting)), dtype=np.complex128)


def _shape(s: NDArray[Any], power: int, weighting: Weighting) -> NDArray[Any]:
    """Zeros over poles, not yet 1 at 1 kHz: of s = j f, or of their squared magnitudes, f^2."""
    found = s ** ZEROS[weighting]
    for pole in POLES[weighting]:
        found = found / (s + pole**power)
    return found


# The lowest poles of A, B and C are at 20.6 Hz: seconds to fall by 180 dB.
WEIGHTINGS_RING = 9.0 * math.log(10.0) / (2.0 * math.pi * F_1)
# ... and by 100 dB.
WEIGHTINGS_SETTLE = 5.0 * math.log(10.0) / (2.0 * math.pi * F_1)
# Lines up to half the rate on which a weighting is made causal, its poles and zeros taken out.
_LINES = 1 << 13


def sampled_weighting(weighting: Weighting, rate: float, samples: int) -> Real:
    """The first samples of the impulse response of the causal sampled filter with a weighting's magnitude.

    Each pole at -s and each zero at 0 becomes one of a recursive filter, at exp(-s / rate) and 1. What these leave of
    the magnitude is so even that its response is short, whatever the rate; it is made causal by `minimum_phase`.

    Examples
    --------
    >>> response = np.fft.rfft(sampled_weighting("A", 48000.0, 1 << 14))
    >>> float((20 * np.log10(np.abs(response[np.argmin(np.abs(np.fft.rfftfreq(1 << 14, 1 / 48e3) - 100))]))).round(1))
    -19.2
    """
    poles = np.exp(-2.0 * np.pi * np.array(POLES[weighting]) / rate)
    zeros = np.arange(poles.size) < ZEROS[weighting]

    def rest(frequency: Real) -> Real:
        later = np.exp(-2j * np.pi * frequency / rate)
        found = np.sqrt(power_weighting(frequency, weighting))
        for pole, zero in zip(poles, zeros, strict=True):
            found *= np.abs(1.0 - pole * later) / (np.abs(1.0 - later) if zero else 1.0)
        return found

    short = np.fft.irfft(minimum_phase(rest, 0, rate, _LINES + 1, 0.0))
    # Long enough for what is cut off to have rung out.
    points = 1 << math.ceil(math.log2(max(2.0 * WEIGHTINGS_RING * rate, short.size)))
    later = np.exp(-2j * np.pi * np.arange(points // 2 + 1) / points)
    lines = np.fft.rfft(short, points)
    for pole, zero in zip(poles, zeros, strict=True):
        lines *= ((1.0 - later) if zero else 1.0) / (1.0 - pole * later)
    return np.fft.irfft(lines)[:samples]


def minimum_phase(
    magnitude: Callable[[Real], Real],
    zeros: int,
    rate: float,
    lines: int,
    ringing: float,
) -> Complex:
    """Response of the sampled filter of minimum phase that has a given magnitude up to half the sampling rate.

    An analogue filter's response, cut off at half the rate, belongs to a filter that is no longer causal: it rings
    before each sample as (-1)^n / n. The filter of minimum phase with the same magnitude is causal. Its phase is
    the Hilbert transform of the logarithm of its magnitude: of the real cepstrum, twice the causal half is kept
    (Oppenheim and Schafer, Discrete-Time Signal Processing, 3rd ed., 13.5).

    Parameters
    ----------
    magnitude : callable
        |H| at frequencies in Hz; it rises as f^`zeros` from 0 Hz and is positive elsewhere.
    zeros : int
        How many zeros H has at 0 Hz. There the logarithm has no value, so they are taken out as factors
        1 - exp(-j w), which are of minimum phase.
    rate : float
        Sampling rate in Hz.
    lines : int
        The response is given at this many frequencies from 0 to half the rate.
    ringing : float
        Seconds until the filter has fallen to nothing: its cepstrum has fallen at least as much.

    Examples
    --------
    A single pole at 100 Hz, far below half the rate:

    >>> response = minimum_phase(lambda f: 1 / np.hypot(1.0, f / 100.0), 0, 48000.0, 4097, 0.1)
    >>> f = np.linspace(0, 24000.0, 4097)
    >>> bool(np.allclose(np.abs(response), 1 / np.hypot(1.0, f / 100.0)))
    True
    >>> bool(np.abs(np.fft.irfft(response)[4097:]).max() < 1e-6)  # nothing before time 0
    True
    """
    times = max(1, int(np.ceil(ringing * rate / (lines - 1))))
    fine = (lines - 1) * times
    angle = np.pi * np.arange(fine + 1) / fine
    angle[0] = 1e-3 * angle[1]  # in the place of 0 Hz, where numerator and denominator vanish
    rest = magnitude(angle * rate / (2.0 * np.pi)) / (2.0 * np.sin(angle / 2.0)) ** zeros
    cepstrum = np.fft.irfft(np.log(rest))
    cepstrum[1:fine] *= 2.0
    cepstrum[fine + 1 :] = 0.0
    angle[0] = 0.0
    response = np.exp(np.fft.rfft(cepstrum)) * (1.0 - np.exp(-1j * angle)) ** zeros
    return np.asarray(response[::times])


# Time constants in s; IEC 61672-1:2013, 5.8.
FAST, SLOW = 0.125, 1.0

# Time constants in s of the average and of the peak holder behind it; IEC 60651, 7.2 (ANSI S1.4-1983, 6.2).
IMPULSE, IMPULSE_DECAY = 0.035, 1.5


# Samples that are summed up at once: as many time constants at most, and as the cache holds.
_GROWTH, _AT_ONCE = 200.0, 1 << 12


class TimeWeighting:
    """Running exponential average of a squared signal, whatever the pieces in which it comes.

    y(t) = 1/tau  integral of x(s)^2 exp(-(t - s)/tau) ds over s < t: IEC 61672-1:2013, formula (1),
    with the squared samples held constant over a sampling interval. With `decay`, a peak detector
    follows, which rises at once and falls with exp(-t/decay): 2.9 dB/s for 1.5 s.

    Parameters
    ----------
    rows : int
        Number of signals.
    sampling_rate : float
        In Hz.
    time_constant : float
        tau in s.
    decay : float, optional
        Time constant of the peak detector in s; without it there is none.

    Examples
    --------
    >>> fast = TimeWeighting(1, 1000.0, FAST)
    >>> float(fast(np.ones((1, 125)))[0, -1].round(4)), round(1 - math.exp(-1), 4)
    (0.6321, 0.6321)
    """

    def __init__(
        self, rows: int, sampling_rate: float, time_constant: float, decay: float | None = None
    ) -> None:
        # y(i) = keep y(i - 1) + (1 - keep) x(i) = keep^i [keep y(-1) + (1 - keep) sum of x(j) keep^-j, j <= i]: a sum
        # of positive terms, which loses nothing to rounding, over so few samples that the powers do not overflow.
        self._keep = math.exp(-1.0 / (sampling_rate * time_constant))
        together = min(max(1, int(_GROWTH * sampling_rate * time_constant)), _AT_ONCE)
        self._rise = self._keep ** -np.arange(float(together)) if together > 1 else np.ones(1)
        self._state = np.zeros((rows, 1))
        self._fall = 0.0 if decay is None else 1.0 / (sampling_rate * decay)
        self._peak = np.zeros((rows, 1))

    def __call__(self, squared: Real) -> Real:
        """Weighted mean square at every sample; `squared` has the shape (rows, n)."""
        given = squared.astype(np.float64)
        for first in range(0, given.shape[1], self._rise.size):
            piece = given[:, first : first + self._rise.size]
            rise = self._rise[: piece.shape[1]]
            piece *= (1.0 - self._keep) * rise
            np.cumsum(piece, axis=1, out=piece)
            piece += self._keep * self._state
            piece /= rise
            self._state = piece[:, -1:].copy()
        return self._hold(given) if self._fall else given

    def _hold(self, average: Real) -> Real:
        """The largest of all earlier values, each with its decay: a running maximum of the logarithms."""
        fallen = self._fall * np.arange(1, average.shape[1] + 1)
        with np.errstate(divide="ignore"):
            rising = np.log(np.concatenate([self._peak, average], axis=1))
        rising[:, 1:] += fallen
        np.maximum.accumulate(rising, axis=1, out=rising)
        held = np.exp(rising[:, 1:] - fallen)
        self._peak = held[:, -1:]
        return np.asarray(held)
