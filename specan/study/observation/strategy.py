"""How fits and searches over some data are run: every observation brings its strategy, a problem joins them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

MANY_ROWS = 2000  # from which an evaluation of the model is worth saving


@dataclass(frozen=True)
class Strategy:
    """Choices of a fit and of a search. The defaults are those of a table: few rows, quickly predicted.

    Attributes
    ----------
    continuation : bool
        The data are narrow peaks, which a fit from a poor start misses: fits begin with a down-weighted problem
        (`specan.study.estimation.continuation`), and several starts are screened.
    linearised_covariance : bool
        The covariance depends on where the model is, and is taken about a fit
        (`specan.study.estimation.linearised_covariance`).
    exact_minimum : bool
        Central differences, trust-region steps and a refinement to the minimum itself; else few Jacobians and secants.
    tolerance : float
        Times the convergence tolerances of `specan.study.estimation.levenberg_marquardt`.
    further_starts : bool
        A fit may begin at several places.
    secondary_refits : bool
        Refits beside the search: profile intervals, errors on left-out conditions, fits by the data alone.
    pruning : bool
        A refit is left out where a linear prediction rules out its success.
    reuses_signatures : bool
        Signatures of candidates are worked out at the base only, at few shapes; promising ones are scanned closer.
    explained_limit : float
        Most chi-square a value that counts as explained when rivals are compared, and is taken for what equations that
        are not exact may leave: where errors of the prediction are in the covariance, a model without a line is judged
        by the noise alone, and rivals that have it by those errors.
    refitted, pairs, rivals : int
        Most candidates, pairs and rivals of the best set that are refitted whatever they promise.
    """

    continuation: bool = False
    linearised_covariance: bool = False
    exact_minimum: bool = True
    tolerance: float = 1.0
    further_starts: bool = True
    secondary_refits: bool = True
    pruning: bool = False
    reuses_signatures: bool = False
    explained_limit: float = float("inf")
    refitted: int = 5
    pairs: int = 8
    rivals: int = 8


TABLE = Strategy()


def joined(parts: Iterable[Strategy], n_data: int) -> Strategy:
    """Strategy of a problem over several observations; a frugal one for many rows, or where one of them is.

    Parameters
    ----------
    parts : iterable of Strategy
        Of the observations.
    n_data : int
        Measured values of all of them.

    Examples
    --------
    >>> joined([TABLE, Strategy(continuation=True)], 100).continuation
    True
    >>> joined([TABLE], 48_000).exact_minimum
    False
    """
    parts = list(parts)
    whole = Strategy(
        continuation=any(p.continuation for p in parts),
        linearised_covariance=any(p.linearised_covariance for p in parts),
        explained_limit=min((p.explained_limit for p in parts), default=float("inf")),
    )
    return frugal(whole) if n_data > MANY_ROWS or any(p == frugal(p) for p in parts) else whole


def frugal(strategy: Strategy) -> Strategy:
    """The same where an evaluation of the model is worth saving; no verdict shows the tolerance of chi-square."""
    return replace(
        strategy, exact_minimum=False, tolerance=20.0, further_starts=False, secondary_refits=False,
        pruning=True, reuses_signatures=True, refitted=3, pairs=4, rivals=3,
    )  # fmt: skip
