"""Noise that follows itself in time, r_t = a_1 r_(t-1) + ... + a_p r_(t-p) + e_t, by its reflection coefficients."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache, reduce

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

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
    out, order = columns.copy(), len(reflections)
    taps = _predictor(tuple(reflections))
    for rows in chains:
        forward = backward = columns[rows[:order]]  # the first ones have fewer before them
        power = 1.0
        for k, reflection in enumerate(reflections, 1):
            ahead, behind = forward[1:], backward[:-1]
            forward, backward = ahead - reflection * behind, behind - reflection * ahead
            power *= 1 - reflection**2
            out[rows[k:order]] = forward / np.sqrt(power)
        out[rows[order:]] = lfilter(taps, [1.0], columns[rows], axis=0)[order:] / np.sqrt(power)
    return out


def coloured(rows: Array, reflections: Sequence[float]) -> Array:
    """What has these innovations, of one chain: the inverse of `innovations`."""
    order, taps = len(reflections), _predictor(tuple(reflections))
    if not order:
        return rows
    scale = np.sqrt(np.prod(1 - np.square(reflections)))
    first = innovations(np.eye(order), [np.arange(order)], reflections)
    driven = rows.copy()
    driven[:order] = lfilter(taps, [scale], np.linalg.solve(first, rows[:order]), axis=0)
    return np.asarray(lfilter([scale], taps, driven, axis=0))


@lru_cache
def _predictor(reflections: tuple[float, ...]) -> Array:
    """The filter that makes innovations."""
    return reduce(_longer, reflections, np.ones(1))


def _longer(taps: Array, reflection: float) -> Array:
    """The filter that makes innovations, one order higher."""
    longer = np.append(taps, 0.0)
    return np.asarray(longer - reflection * longer[::-1])


def of_covariance(lags: Array) -> tuple[float, ...]:
    """Reflection coefficients of a noise by its covariance over lags, the recursion of Levinson (1947).

    Examples
    --------
    >>> [round(float(c), 3) for c in of_covariance(np.array([1.0, 0.9, 0.81]))]
    [0.9, 0.0]
    """
    taps, power, found = np.ones(1), lags[0], []
    for k in range(1, lags.size):
        found.append(float(np.clip(taps @ lags[k:0:-1] / power, -0.9999999, 0.9999999)))
        taps, power = _longer(taps, found[-1]), power * (1 - found[-1] ** 2)
    return tuple(found)


def excess(columns: Array, chains: Chains, reflections: Sequence[float]) -> Array:
    """Y'(R - 1)Y of columns Y, with the correlation R of the noise between rows."""
    found = np.zeros((columns.shape[1], columns.shape[1]))
    for rows in chains:
        length = 2 * rows.size
        density = np.abs(np.fft.rfft(_predictor(tuple(reflections)), length)) ** -2.0
        twice = np.full(density.size, 2 / length)  # both halves of the circle
        twice[[0, -1]] = 1 / length
        lines = np.fft.rfft(columns[rows], length, axis=0)
        weights = twice * (density / (twice @ density) - 1)
        found += np.real((lines.conj().T * weights) @ lines)
    return found


def ln_volume(chains: Chains, reflections: Sequence[float]) -> float:
    """-1/2 ln det of the correlation."""
    return -0.5 * sum(
        max(rows.size - k, 0) * float(np.log1p(-(reflection**2)))
        for rows in chains
        for k, reflection in enumerate(reflections, 1)
    )


def ln_likelihood(chains: Chains, residual: Array, reflections: Sequence[float]) -> float:
    """Of a residual, at its likeliest size."""
    rows = np.concatenate(chains)
    power = float(np.mean(innovations(residual, chains, reflections)[rows] ** 2))
    return ln_volume(chains, reflections) - 0.5 * rows.size * float(np.log(max(power, 1e-300)))


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


def of_process(response: Array, share: float, most: int = 100) -> tuple[float, ...]:
    """Reflection coefficients of white noise beside what a disturbance leaves that is white itself.

    Parameters
    ----------
    response : array
        To an impulse of the disturbance.
    share : float
        Of the variance that the disturbance makes.
    """
    power = np.abs(np.fft.rfft(response, 2 * response.size)) ** 2
    lags = np.fft.irfft(power)[: min(most + 1, response.size)]
    lags *= share / lags[0]
    lags[0] = 1.0
    return of_covariance(lags)
