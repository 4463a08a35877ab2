"""Where a fitted model fails, looked for in the way that suits the kind of measurement."""

from __future__ import annotations

from specan.study.estimation.fit import Fit
from specan.study.estimation.problem import Problem
from specan.study.localisation.by_band_and_channel import by_band_and_channel
from specan.study.localisation.by_blocks import by_blocks
from specan.study.localisation.by_order_family import by_order_family
from specan.study.localisation.result import Localisation

# kind of measurement: how its residual is looked at; others by blocks
WAYS = {"frf": by_band_and_channel, "orders": by_order_family}


def localise(problem: Problem, best: Fit) -> Localisation:
    """Find where a fitted model fails.

    Parameters
    ----------
    problem : Problem
    best : Fit
        Its minimum.

    Returns
    -------
    Localisation
        Blocks and trends, the most improbable first.
    """
    kinds = {o.kind for o in problem.observations}
    return WAYS.get(kinds.pop(), by_blocks)(problem, best) if len(kinds) == 1 else by_blocks(problem, best)
