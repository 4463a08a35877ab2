"""Whether fitted values are ones that the machine could have."""

from __future__ import annotations

import numpy as np

from specan.study.selection.refits import FORM, Refit

WIDTHS = 2.0  # standard errors by which a range may be missed
PRIOR_WIDTHS = 3.0  # standard deviations by which a certificate may be missed


def plausible(refit: Refit, base: Refit) -> bool:
    """Own parameters in their plausible range, base parameters not pushed out of what was known of them.

    A base parameter that lies outside already in the base fit is no fault of the added effects, unless
    they push it further out. Nor is one that the form of their equations may have pushed: what an equation
    trusted to `FORM` of its trace leaves out has at most the length FORM sqrt(explained chi-square), and
    moves no parameter of a least-squares fit by more standard errors than that.
    """
    before = {name: _excess(base, name) for name in base.fit.names}
    by_form = FORM * float(np.sqrt(max(base.chi2 - refit.chi2, 0.0) / refit.scale))
    for name in refit.fit.names:
        known = name in before and name.split("[")[0] not in refit.problem.priors
        excess = _excess(refit, name) - (by_form if known else 0.0)
        if excess > 0 and excess > before.get(name, 0.0) + 0.5:
            return False
    return True


def _excess(refit: Refit, name: str) -> float:
    """Standard errors by which an element misses its range or prior beyond what is allowed."""
    problem, fit = refit.problem, refit.fit
    plain = name.split("[")[0]
    value = float(fit.theta[fit.names.index(name)])
    if plain in problem.priors:
        mean, width = problem.priors[plain]
        return abs(value - mean) / width - PRIOR_WIDTHS
    low, high = problem.plausible(plain)
    error = fit.standard_error(name) * float(np.sqrt(refit.scale))
    miss = max(low - value, value - high)
    if miss <= 0:
        return -WIDTHS
    if error <= 0:
        return np.inf
    return miss / error - WIDTHS
