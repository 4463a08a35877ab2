"""Probability that a fall in chi-square is chance, whatever the noise is known from."""

from __future__ import annotations

import math

LACK_OF_FIT = 1e-3  # probability below which a model is said not to fit
LIKE_INFINITE = 1e5  # degrees of freedom


def improvement_probability(
    fall: float,
    amplitudes: float,
    *,
    dispersion: float = 1.0,
    noise_dof: float = math.inf,
    sided: int = 2,
    tolerated: float = 0.0,
) -> float:
    """Probability under the null that q further amplitudes lower chi-square by `fall` or more.

    F = (fall / q) / max(s^2, 1) with q and `noise_dof` degrees of freedom. `sided` = 1 for one
    amplitude that cannot change sign: it sits on the boundary of its domain under the null, and the
    law is the even mixture of chi-square with 0 and 1 degrees (Self & Liang 1987, JASA 82:605).

    Parameters
    ----------
    fall : float
        Chi-square without less chi-square with the amplitudes.
    amplitudes : int
        Number q of amplitudes.
    dispersion : float
        max(s^2, 1), where s^2 is the reduced chi-square that is left.
    noise_dof : float
        Degrees of freedom from which the noise is known: replicates plus residual. The larger of s^2
        and 1 is never below their pooled variance, so that pooling the degrees keeps the level.
    sided : int
        1 or 2.
    tolerated : float
        Chi-square, in units of `dispersion`, that may be there without meaning anything: the law is then
        the noncentral one.

    Examples
    --------
    >>> round(improvement_probability(3.841, 1), 4)
    0.05
    """
    from scipy.special import chdtrc, chndtr, fdtrc, ncfdtr

    if fall <= 0:
        return 1.0
    value = fall / dispersion
    if tolerated > 0:
        if math.isinf(noise_dof) or noise_dof > LIKE_INFINITE:
            return float(max(1 - chndtr(value, amplitudes, tolerated), 0.0))
        return float(max(1 - ncfdtr(amplitudes, noise_dof, tolerated, value / amplitudes), 0.0))
    if math.isinf(noise_dof):
        probability = chdtrc(amplitudes, value)
    else:
        probability = fdtrc(amplitudes, noise_dof, value / amplitudes)
    return float(probability) * (0.5 if sided == 1 and amplitudes == 1 else 1.0)


def lack_of_fit_probability(
    chi2: float, dof: float, noise_dof: float = math.inf, tolerated: float = 0.0
) -> float:
    """Probability that a right model leaves a reduced chi-square as large as this.

    `tolerated` as in `improvement_probability`.

    Examples
    --------
    >>> round(lack_of_fit_probability(124.342, 100), 3)
    0.05
    """
    return improvement_probability(chi2, dof, noise_dof=noise_dof, tolerated=tolerated)


def needed_reduction(level: float, amplitudes: int = 1, noise_dof: float = math.inf, sided: int = 2) -> float:
    """Fall in chi-square, in units of max(s^2, 1), at which `improvement_probability` is `level`.

    Examples
    --------
    >>> round(needed_reduction(0.05), 3), round(needed_reduction(0.05, noise_dof=10), 3)
    (3.841, 4.965)
    """
    from scipy.special import chdtri, fdtri

    level = 2 * level if sided == 1 and amplitudes == 1 else level
    if math.isinf(noise_dof) or noise_dof > LIKE_INFINITE:
        return float(chdtri(amplitudes, level))
    return float(amplitudes * fdtri(amplitudes, noise_dof, 1 - level))


def detectable_noncentrality(
    gain: float, amplitudes: int = 1, noise_dof: float = math.inf, power: float = 0.8
) -> float:
    """Chi-square without noise, of which the fall in chi-square exceeds `gain` with probability `power`.

    The fall over max(s^2, 1) has the noncentral law of F; with known noise, that of chi-square, and for one amplitude
    lambda = (sqrt(gain) + z_power)^2 (Saris, Satorra & van der Veld 2009).

    Examples
    --------
    >>> round(detectable_noncentrality(needed_reduction(0.05)), 2)
    7.85
    """
    from scipy.special import chndtrinc, ncfdtr

    if math.isinf(noise_dof) or noise_dof > LIKE_INFINITE:
        return float(chndtrinc(gain, amplitudes, 1 - power))
    from scipy.optimize import brentq

    def seen(noncentrality: float) -> float:
        return float(ncfdtr(amplitudes, noise_dof, noncentrality, gain / amplitudes)) - (1 - power)

    return float(brentq(seen, 0.0, 4 * gain + 20.0))
