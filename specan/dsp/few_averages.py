"""What few averages do to a stated uncertainty: Student's factor, and the scatter of a level in dB.

See docs/decisions/0039-uncertainties-from-few-averages.md.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Real = NDArray[np.float64]

# Of the normal distribution, within which 95 % lie.
_NORMAL = 1.959963984540054


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
    from scipy.special import stdtrit

    # The quantile is slow, and the lines of a spectrum have few different degrees of freedom.
    nu, place = np.unique(np.asarray(degrees_of_freedom, dtype=float), return_inverse=True)
    with np.errstate(invalid="ignore"):
        found = np.where(nu > 0, stdtrit(np.maximum(nu, 1e-3), 0.975) / _NORMAL, np.inf)
    found = np.where(np.isnan(nu), np.nan, np.where(np.isposinf(nu), 1.0, found))
    return np.asarray(found[place].reshape(np.shape(degrees_of_freedom)))


def log_bias(averages: ArrayLike) -> Real:
    """Mean of the natural logarithm of such a mean, over the logarithm of its expectation: psi(n) - ln n.

    Examples
    --------
    >>> log_bias([1, 10]).round(4).tolist()  # for one it is minus Euler's constant
    [-0.5772, -0.0508]
    """
    from scipy.special import psi

    n = np.asarray(averages, dtype=float)
    return np.asarray(psi(n) - np.log(n))


def log_variance(averages: ArrayLike) -> Real:
    """Variance of the natural logarithm of a mean of `averages` independent squared magnitudes of noise.

    The trigamma function: the mean is a chi-square of twice as many degrees of freedom. It is 1/n + 1/(2 n^2) for
    many, and pi^2/6 for one.

    Examples
    --------
    >>> log_variance([1, 10]).round(4).tolist()
    [1.6449, 0.1052]
    """
    from scipy.special import polygamma

    return np.asarray(polygamma(1, np.asarray(averages, dtype=float)))
