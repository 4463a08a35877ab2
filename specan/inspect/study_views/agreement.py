"""Measured beside model, as the page asks for it whatever was measured."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

from specan.inspect.study_views.rows import TableAgreement
from specan.inspect.study_views.transfer import TransferAgreement
from specan.inspect.trial import Trial
from specan.study.study import Study


class Agreement(Protocol):
    """Figures that hold a fitted model beside its measurement.

    Attributes
    ----------
    body : object
        What is laid out.
    """

    body: Any

    def show(self, trial: Trial) -> None:
        """Show another fit."""


VIEWS: dict[str, Callable[[Study], Agreement]] = {"table": TableAgreement, "frf": TransferAgreement}


def agreement_of(study: Study) -> list[Agreement]:
    """One for every kind of measurement of a study."""
    kinds = {o.kind for o in study.data.fitted}  # not of the problem, whose covariances may rest on a fit
    return [view(study) for kind, view in VIEWS.items() if kind in kinds]
