"""Displacement, velocity and acceleration from each other in blocks of samples: integrals and differences in time."""

from __future__ import annotations

import numpy as np

from specan.arrays import Complex, Real
from specan.dsp.windows import WindowName, window_properties

# Beside the lobe of what integration leaves at 0 Hz, which the window makes as wide as that of a constant.
_BESIDE = 2


def convert(block: Real, times: int) -> None:
    """Replace samples (n,) by their `times`-th differences, or by sums if it is negative.

    A line divided by (j w)^2 afterwards would multiply what a window leaks from a tone to low lines. Sums have the
    tone's own factor at all lines. What they do not tell, a polynomial (the constants of integration), is taken off.
    """
    if times > 0:
        for _ in range(times):
            block[1:] = np.diff(block)
            block[0] = block[1]
        return
    block -= np.mean(block)
    for _ in range(-times):
        np.cumsum(block, out=block)
    t = np.linspace(-1.0, 1.0, block.size)
    degree = -times
    powers = [np.add.reduce(t**k) for k in range(2 * degree + 1)]
    known = np.array([[powers[i + k] for k in range(degree + 1)] for i in range(degree + 1)])
    seen = np.array([np.add.reduce(t**k * block) for k in range(degree + 1)])
    block -= np.polynomial.polynomial.polyval(t, np.linalg.solve(known, seen))


def rest(frequency_hz: Real, rate: float, times: int) -> Complex:
    """Factor on the lines of what `convert` gives: (j w)^times over its response.

    Examples
    --------
    >>> samples = np.cos(2 * np.pi * 100.0 * np.arange(1000) / 1000)
    >>> convert(samples, -2)
    >>> line = np.fft.rfft(samples)[100] / 500 * rest(np.array([100.0]), 1000.0, -2)
    >>> complex((line * (2 * np.pi * 100.0) ** 2).round(3)[0])
    (-1+0j)
    """
    # (1 - exp(-j a)) / (j a) / rate with a = w / rate.
    half = np.pi * np.asarray(frequency_hz) / rate
    step = np.sinc(half / np.pi) * np.exp(-1j * half) / rate
    return np.asarray(step ** (-times), dtype=np.complex128)


def lowest_line(name: WindowName, times: int) -> int:
    """Number of the first line that integration leaves right."""
    return window_properties(name).half_lobe_lines + _BESIDE if times < 0 else 0
