"""Laws of chi-square and of F, central and not, and a root between two ends: what a verdict on a table needs of scipy.

Loading scipy for them takes a quarter of a second, as long as many verdicts. The incomplete gamma and beta functions
are taken from their series and continued fractions (NIST Digital Library of Mathematical Functions, 8.11, 8.9, 8.17).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache

import numpy as np

SMALLEST = 1e-300  # in place of a zero denominator of a continued fraction
RELATIVE = 4 * np.finfo(float).eps  # accuracy of a root
MOST_STEPS = 200  # of a root: bisection alone takes 60
MOST_TERMS = 100_000  # of a continued fraction: about the root of the degrees of freedom are needed
# Standard deviations about Poisson's mean, and terms beyond them: what lies further is below rounding.
REACH, BEYOND = 9.0, 40


def tail(value: float, dof: float, noise_dof: float = math.inf) -> float:
    """Probability that chi-square per degree of freedom, over a noise known from `noise_dof` degrees, is larger.

    F with `dof` and `noise_dof` degrees of freedom; chi-square over `dof` where the noise is known.

    Examples
    --------
    >>> round(tail(3.841, 1), 4), round(tail(4.965, 1, 10), 4)
    (0.05, 0.05)
    """
    if math.isnan(value) or not value > 0:
        return math.nan if math.isnan(value) else 1.0
    if math.isinf(noise_dof):
        return math.erfc(math.sqrt(value / 2)) if dof == 1 else _upper_gamma(dof / 2, dof * value / 2)
    return _lower_beta(noise_dof / 2, dof / 2, noise_dof / (noise_dof + dof * value))


@cache
def quantile(chance: float, dof: float, noise_dof: float = math.inf) -> float:
    """The value of which `tail` is `chance`.

    Examples
    --------
    >>> round(quantile(0.05, 1), 3), round(quantile(0.05, 1, 10), 3)
    (3.841, 4.965)
    """
    if not 0 < chance < 1:
        return math.inf if chance <= 0 else 0.0
    high = 1.0
    while tail(high, dof, noise_dof) > chance:
        high *= 2
    low = high / 2
    while tail(low, dof, noise_dof) <= chance:
        low /= 2

    def above(x: float) -> float:
        return math.log(max(tail(math.exp(x), dof, noise_dof), SMALLEST) / chance)

    return math.exp(root(above, math.log(low), math.log(high)))


def noncentral(
    value: float, dof: float, noise_dof: float, least: float, most: float
) -> Callable[[float], float]:
    """Probability of no more than a value, as a function of the noncentrality between `least` and `most`.

    Poisson's mean of central laws (Johnson, Kotz & Balakrishnan 1995, chapters 29 and 30). `value` as in `tail`.

    Examples
    --------
    >>> round(noncentral(3.841, 1, math.inf, 0.0, 10.0)(7.849), 3)  # seen in four cases of five
    0.2
    """
    low, high = (end / 2 + side * REACH * math.sqrt(end / 2) for end, side in ((least, -1), (most, 1)))
    begin = max(int(low) - BEYOND, 0)
    k = np.arange(begin, int(high) + BEYOND)
    half = dof / 2 + k  # of the degrees of freedom, term by term
    if math.isinf(noise_dof):
        x = dof * value / 2
        last, ratio = 1 - _upper_gamma(half[-1] + 1, x), x / (half + 1)
        first = half[0] * math.log(x) - x - math.lgamma(half[0] + 1)
    else:
        x, b = dof * value / (noise_dof + dof * value), noise_dof / 2
        last, ratio = _lower_beta(half[-1] + 1, b, x), x * (half + b) / (half + 1)
        first = _log_beta_term(half[0], b, x) - math.log(half[0])
    # I(a) = I(a + 1) + x^a (1 - x)^b / (a B(a, b)), likewise the incomplete gamma function: from the last one down.
    terms = np.exp(first + np.concatenate([[0.0], np.cumsum(np.log(ratio[:-1]))]))
    central = last + np.cumsum(terms[::-1])[::-1]
    log_factorial = math.lgamma(begin + 1) + np.concatenate([[0.0], np.cumsum(np.log(k[1:]))])

    def at(noncentrality: float) -> float:
        if noncentrality <= 0:
            return float(central[0])
        rate = noncentrality / 2
        return float(np.exp(k * math.log(rate) - rate - log_factorial) @ central)

    return at


def root(function: Callable[[float], float], low: float, high: float, close: float = 0.0) -> float:
    """Where a function that has other signs at the two ends is zero (Brent 1973, chapter 4).

    Parameters
    ----------
    close : float
        Distance to it that is near enough; rounding's by default.

    Examples
    --------
    >>> abs(root(math.cos, 1.0, 2.0) - math.pi / 2) < 1e-15
    True
    """
    before, here = low, high
    f_before, f_here = function(before), function(here)
    if f_before == 0:
        return before
    other, f_other = before, f_before  # the end on the other side
    for _ in range(MOST_STEPS):
        if f_here == 0:
            return here
        if f_before * f_here < 0:
            other, f_other = before, f_before
            step = last = here - before
        if abs(f_other) < abs(f_here):
            before, here, other = here, other, here
            f_before, f_here, f_other = f_here, f_other, f_here
        least, half = (close + RELATIVE * abs(here)) / 2, (other - here) / 2
        if abs(half) < least:
            return here
        if abs(last) > least and abs(f_here) < abs(f_before):
            if before == other:
                found = -f_here * (here - before) / (f_here - f_before)
            else:  # inverse quadratic interpolation
                slope, beyond = (f_before - f_here) / (before - here), (f_other - f_here) / (other - here)
                found = (
                    -f_here * (f_other * beyond - f_before * slope) / (beyond * slope * (f_other - f_before))
                )
            step, last = (
                (found, step) if 2 * abs(found) < min(abs(last), 3 * abs(half) - least) else (half, half)
            )
        else:
            step = last = half
        before, f_before = here, f_here
        here += step if abs(step) > least else math.copysign(least, half)
        f_here = function(here)
    return here


def _upper_gamma(a: float, x: float) -> float:
    """Regularised incomplete gamma function Q(a, x)."""
    front = math.exp(a * math.log(x) - x - math.lgamma(a))
    if x < a + 1:
        total = term = 1 / a
        k = a
        while term > total * 1e-17:
            k += 1
            term *= x / k
            total += term
        return 1 - front * total
    b = x + 1 - a
    return front / _continued_fraction(b, lambda k: (k * (a - k), b + 2 * k))


def _lower_beta(a: float, b: float, x: float) -> float:
    """Regularised incomplete beta function I_x(a, b)."""
    if x <= 0 or x >= 1:
        return float(x >= 1)
    front = math.exp(_log_beta_term(a, b, x))
    if x < (a + 1) / (a + b + 2):
        return front / (a * _beta_fraction(a, b, x))
    return 1 - front / (b * _beta_fraction(b, a, 1 - x))


def _log_beta_term(a: float, b: float, x: float) -> float:
    """Logarithm of ``x^a (1 - x)^b / B(a, b)``."""
    return a * math.log(x) + b * math.log1p(-x) + math.lgamma(a + b) - math.lgamma(a) - math.lgamma(b)


def _beta_fraction(a: float, b: float, x: float) -> float:
    def term(k: int) -> tuple[float, float]:
        m = k // 2
        if k % 2:
            return -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1)), 1.0
        return m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m)), 1.0

    return _continued_fraction(1.0, term)


def _continued_fraction(first: float, term: Callable[[int], tuple[float, float]]) -> float:
    """``first + a_1 / (b_1 + a_2 / (b_2 + ...))`` with terms a_k, b_k, by Lentz's method (Thompson & Barnett 1986)."""
    found = above = first or SMALLEST
    below = 0.0
    for k in range(1, MOST_TERMS):
        a, b = term(k)
        below = 1 / (b + a * below or SMALLEST)
        above = b + a / above or SMALLEST
        found *= above * below
        if abs(above * below - 1) < np.finfo(float).eps:
            break
    return found
