"""The DFT of one block as peak amplitudes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from specan.dsp.long_transform import real_transform
from specan.dsp.windows import Windowing, WindowName

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]


class AmplitudeTransform:
    """One-sided amplitude spectrum (..., n // 2 + 1) of blocks (..., n), peak values, exp(+j w t).

    A tone A cos(2 pi f t + phi) on a line, t = 0 at the first sample, gives A exp(j phi) there. Between two
    lines the magnitude falls by the scallop loss of the window and the phase of the nearest line is off by
    180 degrees times the distance in lines: use a sine fit for the phase of such a tone.

    Parameters
    ----------
    n : int
        Samples of a block.

    Examples
    --------
    >>> t = np.arange(64) / 64
    >>> spectrum = AmplitudeTransform(64)(3 * np.cos(2 * np.pi * 8 * t + 1))
    >>> round(float(abs(spectrum[8])), 6), round(float(np.angle(spectrum[8])), 6)
    (3.0, 1.0)
    """

    def __init__(self, n: int, window_name: WindowName = "hann", *, detrend: bool = True) -> None:
        self._shape, self._detrend = Windowing(window_name, n), detrend
        self._scale = 2 / self._shape.sum
        self._single = np.flatnonzero(~has_mirror(n // 2 + 1, n))

    def __call__(self, samples: Real) -> Complex:
        """The spectrum of blocks (..., n), whose memory is used for the work."""
        if self._detrend:
            samples -= np.add.reduce(samples, axis=-1, keepdims=True) / samples.shape[-1]
        self._shape(samples)
        spectrum: Complex = real_transform(samples) if samples.ndim == 1 else np.fft.rfft(samples, axis=-1)
        spectrum *= self._scale
        spectrum[..., self._single] /= 2
        return spectrum


def has_mirror(lines: int, block: int) -> NDArray[np.bool_]:
    """Which of the first lines of a DFT stand for two: all but 0 Hz and half the sampling rate."""
    mirrored = np.ones(lines, dtype=np.bool_)
    mirrored[:1] = False
    if block % 2 == 0:
        mirrored[block // 2 : block // 2 + 1] = False
    return mirrored
