"""Oscillators of one degree of freedom that a shock drives: ramp-invariant digital filters (ISO 18431-4).

Between two samples the acceleration of the base is taken to be a straight line, for which these filters are exact
(D. O. Smallwood, An improved recursive formula for calculating shock response spectra, Shock and Vibration Bulletin 51,
1981).
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

Array = NDArray[np.float64]
Response = Literal["acceleration", "pseudo-velocity", "displacement"]


def oscillator(frequency_hz: float, quality: float, rate: float, response: Response) -> tuple[Array, Array]:
    """Numerator and denominator of the filter from the acceleration of the base to a response.

    Parameters
    ----------
    frequency_hz : float
        Undamped natural frequency.
    quality : float
        Q, 1 / (2 zeta); above 1/2.
    rate : float
        Samples a second.
    response : {"acceleration", "pseudo-velocity", "displacement"}
        Absolute acceleration of the mass; relative displacement, as it is or times the natural angular frequency.

    Examples
    --------
    >>> b, a = oscillator(100.0, 10.0, 10000.0, "acceleration")
    >>> round(float(b.sum() / a.sum()), 9)  # a constant acceleration is followed
    1.0
    """
    omega, zeta, step = 2 * np.pi * frequency_hz, 0.5 / quality, 1 / rate
    root = np.sqrt(1 - zeta**2)
    decay, turn = np.exp(-zeta * omega * step), omega * root * step
    c, s = decay * np.cos(turn), decay * np.sin(turn)
    a = np.array([1.0, -2 * c, decay**2])
    if response == "acceleration":
        return np.array([1 - s / turn, 2 * (s / turn - c), decay**2 - s / turn]), a
    part = (2 * zeta**2 - 1) * s / root
    b = np.array(
        [
            2 * zeta * (c - 1) + part + step * omega,
            -2 * c * step * omega + 2 * zeta * (1 - decay**2) - 2 * part,
            decay**2 * (step * omega + 2 * zeta) - 2 * zeta * c + part,
        ]
    )
    return -b / (step * omega**3) * (omega if response == "pseudo-velocity" else 1.0), a


class Oscillators:
    """Largest and smallest responses of oscillators at rest to samples that come in pieces.

    Attributes
    ----------
    highest, lowest : array, shape (channels, frequencies)
    """

    def __init__(
        self, channels: int, frequency_hz: Array, quality: float, rate: float, response: Response
    ) -> None:
        self._filters = [oscillator(float(f), quality, rate, response) for f in frequency_hz]
        self._states = [np.zeros((channels, 2)) for _ in self._filters]
        # Of one period, in which the residual response peaks.
        self._rest = np.ceil(rate / frequency_hz).astype(int)
        self.highest = np.zeros((channels, frequency_hz.size))
        self.lowest = np.zeros((channels, frequency_hz.size))

    def add(self, samples: Array) -> None:
        """Take the next samples (channels, m) of the acceleration of the base."""
        for k in range(len(self._filters)):
            self._drive(k, samples)

    def end(self) -> None:
        """Let every oscillator swing on for a period, the base at rest."""
        for k, count in enumerate(self._rest):
            self._drive(k, np.zeros((self.highest.shape[0], int(count))))

    def _drive(self, k: int, samples: Array) -> None:
        b, a = self._filters[k]
        found, self._states[k] = lfilter(b, a, samples, axis=1, zi=self._states[k])
        self.highest[:, k] = np.maximum(self.highest[:, k], found.max(axis=1))
        self.lowest[:, k] = np.minimum(self.lowest[:, k], found.min(axis=1))
