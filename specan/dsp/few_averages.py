"""What few averages do to a stated uncertainty: Student's factor, and the scatter of a level in dB.

See docs/decisions/spectra.md.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

Real = NDArray[np.float64]

# Of the normal distribution, within which 95 % lie.
_NORMAL = 1.959963984540054
# Below so many degrees of freedom the tails are too heavy for a plain integral.
_FEW_DEGREES = 1.5
# Gamma functions are taken so many steps further on, where their asymptotic series is exact.
_STEPS = 12
_EVEN = np.arange(2, 15, 2)
_BERNOULLI = np.array([1 / 6, -1 / 30, 1 / 42, -1 / 30, 5 / 66, -691 / 2730, 7 / 6])


def student_factor(degrees_of_freedom: ArrayLike) -> Real:
    """By how much an uncertainty from few values is raised, so that 1.96 times it is the 95 % interval.

    t_95(nu) / 1.96, t_95 the two-sided quantile of Student's distribution (JCGM 100:2008, GUM, annex G.3). Infinite
    without a degree of freedom.

    Parameters
    ----------
    degrees_of_freedom : array
        Of the variance behind the uncertainty.

    Examples
    --------
    >>> student_factor([2, 6, 24]).round(3).tolist()
    [2.195, 1.248, 1.053]
    """
    # The quantile is slow, and the lines of a spectrum have few different degrees of freedom.
    nu, place = np.unique(np.asarray(degrees_of_freedom, dtype=float), return_inverse=True)
    with np.errstate(invalid="ignore"):
        found = np.where(nu > 0, _student_quantile(np.clip(nu, 1e-3, 1e9)) / _NORMAL, np.inf)
    found = np.where(np.isnan(nu), np.nan, np.where(np.isposinf(nu), 1.0, found))
    return np.asarray(found[place].reshape(np.shape(degrees_of_freedom)))


def log_bias(averages: ArrayLike) -> Real:
    """Mean of the natural logarithm of such a mean, over the logarithm of its expectation: psi(n) - ln n.

    Examples
    --------
    >>> log_bias([1, 10]).round(4).tolist()  # for one it is minus Euler's constant
    [-0.5772, -0.0508]
    """
    n = np.asarray(averages, dtype=float)
    x = n + _STEPS
    # Abramowitz and Stegun, 6.3.18, after steps of 6.3.5: psi(n + 1) = psi(n) + 1/n.
    powers = x[..., None] ** -_EVEN
    ahead = np.log(x) - 0.5 / x - np.add.reduce(_BERNOULLI / _EVEN * powers, axis=-1)
    return np.asarray(ahead - np.add.reduce(1.0 / (n[..., None] + np.arange(_STEPS)), axis=-1) - np.log(n))


def log_variance(averages: ArrayLike) -> Real:
    """Variance of the natural logarithm of a mean of `averages` independent squared magnitudes of noise.

    The trigamma function: the mean is a chi-square of twice as many degrees of freedom. It is 1/n + 1/(2 n^2) for
    many, and pi^2/6 for one.

    Examples
    --------
    >>> log_variance([1, 10]).round(4).tolist()
    [1.6449, 0.1052]
    """
    n = np.asarray(averages, dtype=float)
    x = n + _STEPS
    # Abramowitz and Stegun, 6.4.12, after steps of 6.4.6: psi'(n + 1) = psi'(n) - 1/n^2.
    powers = x[..., None] ** -(_EVEN + 1)
    ahead = 1.0 / x + 0.5 / x**2 + np.add.reduce(_BERNOULLI * powers, axis=-1)
    return np.asarray(ahead + np.add.reduce((n[..., None] + np.arange(_STEPS)) ** -2, axis=-1))


def _height(nu: float) -> float:
    """Density of Student's distribution at 0: Gamma((nu + 1)/2) / Gamma(nu/2) / sqrt(pi nu)."""
    if nu < 200.0:
        return math.exp(math.lgamma((nu + 1) / 2) - math.lgamma(nu / 2)) / math.sqrt(math.pi * nu)
    series = 1 - 1 / (4 * nu) + 1 / (32 * nu**2) + 5 / (128 * nu**3)
    return series / math.sqrt(2 * math.pi)


@lru_cache(maxsize=1)
def _gauss_nodes() -> tuple[Real, Real]:
    """Places and weights of an integral from 0 to 1."""
    place, weight = np.polynomial.legendre.leggauss(40)
    return (place + 1.0) / 2.0, weight / 2.0


def _student_quantile(nu: Real) -> Real:
    """t of which |T| is below with a probability of 0.95.

    Newton's method on the integral of the density from 0 to t, by 40 Gauss nodes. It comes from below, where the
    distribution function is concave: it never passes the root.
    """
    if (nu < _FEW_DEGREES).any():  # tails so heavy that the integral has no bounds to speak of
        from scipy.special import stdtrit

        return np.asarray(stdtrit(nu, 0.975))
    place, weight = _gauss_nodes()
    height = np.array([_height(v) for v in nu.tolist()])
    half = (nu + 1.0) / 2.0
    t = np.full(nu.shape, _NORMAL)
    for _ in range(60):
        density = height[:, None] * np.exp(-half[:, None] * np.log1p((t[:, None] * place) ** 2 / nu[:, None]))
        at_t = height * np.exp(-half * np.log1p(t**2 / nu))
        step = (0.475 - t * np.add.reduce(density * weight, axis=1)) / at_t
        t = t + step
        if np.all(np.abs(step) < 1e-13 * t):
            break
    return t
