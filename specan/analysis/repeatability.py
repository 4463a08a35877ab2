"""How well an insertion into a calibrator repeats: estimated where microphones were inserted again, else declared."""

from __future__ import annotations

import math

ENOUGH = 3  # degrees of freedom from which an estimate replaces what was declared


def repeatability(squares: float, dof: int, windows: float, declared: float) -> tuple[float, int | None]:
    r"""Standard uncertainty of one observation by its insertion, and its degrees of freedom.

    The residuals of observations that were made more than once have the variance
    :math:`s^2 = \sum r^2 / \nu`, of which the noise within the insertions is a part. With three degrees of
    freedom or more the rest is the estimate (GUM type A), times :math:`t_{0.975}(\nu) / 1.96`: then
    +-1.96 u holds 95 % although s is itself uncertain (GUM, annex G). With fewer, the declared value counts
    (type B), or the estimate where that is larger.

    Parameters
    ----------
    squares : float
        Sum of squared residuals.
    dof : int
        Observations minus unknowns.
    windows : float
        Mean variance of an observation by the noise of its windows.
    declared : float
        Standard uncertainty that is stated for one observation.

    Returns
    -------
    tuple
        The uncertainty in the unit of the residuals; degrees of freedom, None for type B.

    Examples
    --------
    >>> found, freedom = repeatability(0.04, 4, 0.0, 0.5)
    >>> round(found, 4), freedom
    (0.1417, 4)
    >>> repeatability(0.0, 0, 0.0, 0.5)
    (0.5, None)
    """
    from scipy.special import stdtrit

    found = math.sqrt(max(squares / dof - windows, 0.0)) if dof > 0 else 0.0
    if dof < ENOUGH:
        return max(found, declared), None
    return found * float(stdtrit(dof, 0.975) / stdtrit(math.inf, 0.975)), dof
