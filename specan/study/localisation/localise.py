"""Where a fitted model fails, looked for in the way that suits the kind of measurement.

An installed kind of measurement (an entry point of the group ``specan.measurement_kinds``) may bring its own way: the
functions ``localise(problem, best) -> Localisation`` and ``curve_errors(observation, predicted)`` in its module.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from specan.errors import RequestError
from specan.study.data.sources import KINDS, kind_named
from specan.study.estimation.fit import Fit
from specan.study.estimation.problem import Problem
from specan.study.localisation.by_band_and_channel import by_band_and_channel
from specan.study.localisation.by_blocks import Localisation, by_blocks
from specan.study.localisation.by_order_family import by_order_family
from specan.study.localisation.frf_errors import FrfErrors, frf_errors

# By kind of measurement: how its residual is looked at (by blocks if there is no own way), and what is said of curves.
WAYS: Mapping[str, Callable[[Problem, Fit], Localisation]] = {
    "table": by_blocks,
    "frf": by_band_and_channel,
    "orders": by_order_family,
}
CURVES: Mapping[str, Callable[..., FrfErrors]] = {"frf": frf_errors}


def localise(problem: Problem, best: Fit) -> Localisation:
    """Find where a fitted model fails.

    Parameters
    ----------
    problem : Problem
        Over observations of one kind, or of several, which are then looked at by blocks.
    best : Fit
        Its minimum.

    Returns
    -------
    Localisation
        Blocks and trends, the most improbable first.
    """
    kinds = {o.kind for o in problem.observations}
    way = _of_kind(kinds.pop(), WAYS, "localise") if len(kinds) == 1 else None
    found: Localisation = (way or by_blocks)(problem, best)
    return found


def curve_errors(problem: Problem, best: Fit) -> list[FrfErrors]:
    """Level and phase errors of every recording whose kind of measurement holds curves; none where none does.

    Parameters
    ----------
    problem : Problem
    best : Fit
        Its minimum.
    """
    predictions = problem.predictions(best.theta)
    ways = [_of_kind(o.kind, CURVES, "curve_errors") for o in problem.observations]
    return [way(o, p) for way, o, p in zip(ways, problem.observations, predictions, strict=True) if way]


def _of_kind(kind: str, known: Mapping[str, Callable[..., Any]], name: str) -> Callable[..., Any] | None:
    """Function of a built-in kind, or the one that an installed kind brings; None where it has none."""
    if kind in known or kind in KINDS:
        return known.get(kind)
    try:
        return getattr(kind_named(kind), name, None)
    except RequestError:  # observations that somebody made without any file
        return None
