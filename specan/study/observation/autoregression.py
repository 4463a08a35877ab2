"""Noise that follows itself in time, r_t = a_1 r_(t-1) + ... + a_p r_(t-p) + e_t, by its reflection coefficients."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from specan.study.observation import Array

Chains = Sequence[NDArray[np.intp]]


def innovations(columns: Array, chains: Chains, reflections: Sequence[float]) -> Array:
    """Rows as independent innovations, of unit variance where those of the columns have it.

    Parameters
    ----------
    columns : array, shape (n,) or (n, k)
    chains : sequence of int arrays
        Rows in the order of time; each chain begins anew.
    reflections : sequence of float
        Between -1 and 1.
    """
    out = columns.copy()
    for rows in chains:
        forward = backward = columns[rows]
        power = 1.0
        for k, reflection in enumerate(reflections, 1):
            ahead, behind = forward[1:], backward[:-1]
            forward, backward = ahead - reflection * behind, behind - reflection * ahead
            power *= 1 - reflection**2
            out[rows[k:]] = forward / np.sqrt(power)
    return out


def spectrum(reflections: Sequence[float], size: int) -> Array:
    """Power over the frequencies of `numpy.fft.rfft` of so many samples, with a mean of one.

    Examples
    --------
    >>> spectrum([0.9], 100)[[0, -1]].round(2)
    array([19.  ,  0.05])
    """
    taps = np.ones(1)
    for reflection in reflections:
        longer = np.append(taps, 0.0)
        taps = longer - reflection * longer[::-1]
    power = 1 / np.abs(np.fft.rfft(taps, size)) ** 2
    return np.asarray(power * np.prod(1 - np.square(reflections)))


def burg(chains: Chains, residual: Array, most: int) -> tuple[list[float], list[float]]:
    """Reflection coefficients by the recursion of Burg (1975), and the power of the innovations of every order."""
    forward, backward = [residual[rows] for rows in chains], [residual[rows] for rows in chains]
    count = sum(rows.size for rows in chains)
    power = [sum(float(f @ f) for f in forward) / max(count, 1)]
    found: list[float] = []
    for _ in range(most):
        pairs = [(f[1:], b[:-1]) for f, b in zip(forward, backward, strict=True)]
        above = 2 * sum(float(f @ b) for f, b in pairs)
        below = sum(float(f @ f + b @ b) for f, b in pairs)
        found.append(float(np.clip(above / max(below, 1e-300), -0.9999, 0.9999)))
        power.append(power[-1] * (1 - found[-1] ** 2))
        forward = [f - found[-1] * b for f, b in pairs]
        backward = [b - found[-1] * f for f, b in pairs]
    return found, power


def of_likely_order(chains: Chains, residual: Array, most: int = 30) -> tuple[float, ...]:
    """Reflection coefficients of the order that Schwarz's criterion (1978) takes; none for white noise.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> e = rng.standard_normal(4000)
    >>> of_likely_order([np.arange(4000)], e)
    ()
    >>> r = np.zeros(4000)
    >>> for t in range(1, 4000):
    ...     r[t] = 0.9 * r[t - 1] + e[t]
    >>> [round(float(c), 1) for c in of_likely_order([np.arange(4000)], r)]
    [0.9]
    """
    count = sum(rows.size for rows in chains)
    shortest = min((rows.size for rows in chains), default=0)
    found, power = burg(chains, residual, max(min(most, shortest // 10), 0))
    costs = [count * np.log(max(p, 1e-300)) + k * np.log(max(count, 1)) for k, p in enumerate(power)]
    return tuple(found[: int(np.argmin(costs))])
