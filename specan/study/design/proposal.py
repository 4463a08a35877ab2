"""A measurement that is proposed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from specan.study.selection.refits import Refit

SEPARATES = 2.0  # sigma that a measurement must promise to be worth proposing
EXPLORED = 2  # measurements that are proposed for something unknown


@dataclass(frozen=True)
class Proposal:
    """A condition to measure, or another kind of measurement where no condition would tell.

    Attributes
    ----------
    conditions : mapping
        By column, in the column's unit; of a receiver its coordinates; empty for another kind of measurement.
    predictions : mapping
        What each rival expects, in `unit`.
    unit, observable : str
        Of the predictions, and what is read.
    sigma : float
        Standard uncertainty of a reading there.
    separation_sigma : float
        Largest difference of two rivals over its standard uncertainty.
    least_sigma : float or None
        The smallest one: a reading with two or more tells all rivals apart.
    """

    text: str
    conditions: Mapping[str, float | str]
    predictions: Mapping[str, float]
    unit: str
    sigma: float | None
    separation_sigma: float | None
    least_sigma: float | None = None
    observable: str = ""


def name_of(rival: Refit) -> str:
    """What a rival adds to the model, in words."""
    return " with ".join(str(u) for u in sorted(rival.uses)) or "the model as it is"
