"""Window functions for the DFT: periodic sums of cosines, with their coherent gain and noise bandwidth."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike

from specan.arrays import Real

WindowName = Literal["rectangular", "hann", "hamming", "blackman", "blackman-harris", "nuttall", "flat-top"]
WINDOWS: tuple[WindowName, ...] = get_args(WindowName)

# w(i) = sum_m (-1)^m a_m cos(2 pi m i / n). Harris, Proc. IEEE 66 (1978) 51-83 (hann to blackman-harris);
# Nuttall, IEEE Trans. ASSP 29 (1981) 84-91; flat-top: D'Antona and Ferrero, Digital Signal Processing for
# Measurement Systems (2006), p. 70, the window of ISO 18431-2. The tests hold all of them against scipy.
_COEFFICIENTS: dict[WindowName, tuple[float, ...]] = {
    "rectangular": (1.0,),
    "hann": (0.5, 0.5),
    "hamming": (0.54, 0.46),
    "blackman": (0.42, 0.5, 0.08),
    "blackman-harris": (0.35875, 0.48829, 0.14128, 0.01168),
    "nuttall": (0.3635819, 0.4891775, 0.1365995, 0.0106411),
    "flat-top": (0.21557895, 0.41663158, 0.277263158, 0.083578947, 0.006947368),
}


class WindowProperties(NamedTuple):
    """What a window does to an amplitude and to noise.

    Attributes
    ----------
    coherent_gain : float
        Mean of the window: the factor on the amplitude of a tone that falls on a line.
    enbw_lines : float
        Equivalent noise bandwidth in lines, n sum(w^2) / sum(w)^2 (Harris 1978, eq. 11).
    half_lobe_lines : int
        Half the width of the main lobe, in lines.
    """

    coherent_gain: float
    enbw_lines: float
    half_lobe_lines: int


_STEPS = 1 << 14  # of a shift, in the table of correlations
_KEPT = 1 << 17  # windows up to this length are kept; longer ones are rarely asked for twice


def window(name: WindowName, n: int) -> Real:
    """Periodic (DFT-even) window of `n` samples; not to be written to, where it is kept for all who ask.

    Examples
    --------
    >>> window("hann", 4)
    array([0. , 0.5, 1. , 0.5])
    """
    return _kept(name, n) if n <= _KEPT else _made(name, n)


@lru_cache(maxsize=16)
def _kept(name: WindowName, n: int) -> Real:
    shape = _made(name, n)
    shape.flags.writeable = False
    return shape


def _made(name: WindowName, n: int) -> Real:
    turn = 2 * np.pi * np.arange(n) / n
    return np.asarray(sum((-1) ** m * a * np.cos(m * turn) for m, a in enumerate(_COEFFICIENTS[name])))


def window_properties(name: WindowName) -> WindowProperties:
    """Coherent gain, noise bandwidth and lobe of a window, in closed form.

    With the cosine coefficients a_0, a_1, ...: gain a_0, sum(w^2)/n = a_0^2 + sum(a_m^2)/2.

    Examples
    --------
    >>> window_properties("hann").enbw_lines
    1.5
    """
    a = np.array(_COEFFICIENTS[name])
    power = a[0] ** 2 + np.sum(a[1:] ** 2) / 2
    return WindowProperties(
        coherent_gain=float(a[0]),
        enbw_lines=float(power / a[0] ** 2),
        half_lobe_lines=len(a),
    )


def window_correlation(name: WindowName, shifts: ArrayLike) -> Real:
    """Normalised correlation of a window with itself, shifted by parts of its length; 0 from one length on.

    It is the factor by which two blocks of one noise that are that far apart still look alike: the
    correlation of overlapped blocks, and the factor that a delay of the response puts on H1.

    Examples
    --------
    >>> window_correlation("hann", [0.0, 0.5, 1.0]).round(4).tolist(), float(window_correlation("rectangular", 0.25))
    ([1.0, 0.1667, 0.0], 0.75)
    """
    table = _correlation(name)
    return np.asarray(np.interp(np.abs(shifts), np.linspace(0.0, 1.0, table.size), table))


@lru_cache(maxsize=16)
def _correlation(name: WindowName) -> Real:
    """Over shifts from 0 to 1, so close that a straight line between them is right to 1e-7."""
    found = np.fft.irfft(np.abs(np.fft.rfft(window(name, _STEPS), 2 * _STEPS)) ** 2)[: _STEPS + 1]
    return np.asarray(found / found[0])


def line_correlation(name: WindowName) -> float:
    """Correlation of the random errors of neighbouring lines of a transfer function or an auto spectrum.

    |sum(w^2 exp(j 2 pi i / n))|^2 / sum(w^2)^2: both signals' lines are correlated, so it is squared.

    Examples
    --------
    >>> round(line_correlation("hann"), 4)
    0.4444
    """
    shape = window(name, 256) ** 2
    turned = np.sum(shape * np.exp(2j * np.pi * np.arange(256) / 256))
    return float(np.abs(turned) ** 2 / np.sum(shape) ** 2)


def falling_step(x: Real, last_one: float, first_zero: float) -> Real:
    """1 up to `last_one`, 0 from `first_zero`, an error function between (it reaches both to 1e-17).

    The transform of its slope is a Gauss function: a filter with this response has no side lobes.

    Examples
    --------
    >>> falling_step(np.array([0.0, 1.0, 1.5, 2.0]), 1.0, 2.0).round(12).tolist()
    [1.0, 1.0, 0.5, 0.0]
    """
    middle, half = (last_one + first_zero) / 2.0, (first_zero - last_one) / 2.0
    place = 6.0 * (x - middle) / half
    # Beyond these places the complementary error function is 2 and 0 to the last bit.
    result = np.where(place < 0.0, 2.0, 0.0)
    inside = (place > -6.5) & (place < 28.0)
    result[inside] = [math.erfc(v) for v in place[inside].tolist()]
    return np.asarray(0.5 * result)
