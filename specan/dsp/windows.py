"""Window functions for the DFT: periodic sums of cosines, with their coherent gain and noise bandwidth."""

from __future__ import annotations

from functools import lru_cache
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

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
    scallop_loss_db : float
        Loss of a tone halfway between two lines.
    half_lobe_lines : int
        Half the width of the main lobe, in lines.
    """

    coherent_gain: float
    enbw_lines: float
    scallop_loss_db: float
    half_lobe_lines: int


_KEPT = 1 << 17  # windows up to this length are kept; longer ones are rarely asked for twice


def window(name: WindowName, n: int) -> NDArray[np.float64]:
    """Periodic (DFT-even) window of `n` samples; not to be written to, where it is kept for all who ask.

    Examples
    --------
    >>> window("hann", 4)
    array([0. , 0.5, 1. , 0.5])
    """
    return _kept(name, n) if n <= _KEPT else _made(name, n)


@lru_cache(maxsize=16)
def _kept(name: WindowName, n: int) -> NDArray[np.float64]:
    shape = _made(name, n)
    shape.flags.writeable = False
    return shape


def _made(name: WindowName, n: int) -> NDArray[np.float64]:
    turn = 2 * np.pi * np.arange(n) / n
    terms = (a * (-1) ** m * np.cos(m * turn) for m, a in enumerate(_COEFFICIENTS[name]))
    return np.asarray(sum(terms, np.zeros(n)))


def window_properties(name: WindowName) -> WindowProperties:
    """Coherent gain, noise bandwidth, scallop loss and lobe of a window, in closed form.

    With the cosine coefficients a_0, a_1, ...: gain a_0, sum(w^2)/n = a_0^2 + sum(a_m^2)/2; a tone d lines
    away is seen through sin(pi d)/pi * sum of (-1)^m a_m d/(d^2 - m^2) (large n).

    Examples
    --------
    >>> window_properties("hann").enbw_lines
    1.5
    """
    a = np.array(_COEFFICIENTS[name])
    power = a[0] ** 2 + np.sum(a[1:] ** 2) / 2
    m = np.arange(len(a))
    half = 0.5
    response = np.sum((-1.0) ** m * a * half / (half**2 - m**2)) / np.pi  # sin(pi/2) = 1
    return WindowProperties(
        coherent_gain=float(a[0]),
        enbw_lines=float(power / a[0] ** 2),
        scallop_loss_db=float(-20 * np.log10(response / a[0])),
        half_lobe_lines=len(a),
    )


def window_correlation(name: WindowName, shift: float) -> float:
    """Normalised correlation of a window with itself, shifted by `shift` (in window lengths, 0 to 1).

    It is the factor by which two blocks of one noise that are that far apart still look alike: the
    correlation of overlapped blocks, and the factor that a delay of the response puts on H1.

    Examples
    --------
    >>> round(window_correlation("hann", 0.5), 4), window_correlation("rectangular", 0.25)
    (0.1667, 0.75)
    """
    if abs(shift) >= 1:
        return 0.0
    n = 4096
    position = np.arange(n) / n
    a = _COEFFICIENTS[name]

    def at(t: NDArray[np.float64]) -> NDArray[np.float64]:
        return sum((c * (-1) ** m * np.cos(2 * np.pi * m * t) for m, c in enumerate(a)), np.zeros(n))

    # Midpoint rule over the common part: exact enough (1e-7) for every window here.
    overlap = (1 - abs(shift)) * (position + 0.5 / n)
    common = (1 - abs(shift)) * np.mean(at(overlap) * at(overlap + abs(shift)))
    power = a[0] ** 2 + sum(c**2 for c in a[1:]) / 2
    return float(common / power)


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
