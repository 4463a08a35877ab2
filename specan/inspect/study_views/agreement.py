"""Measured beside model, as the page asks for it whatever was measured."""

from __future__ import annotations

from typing import Any, Protocol

from specan.inspect.study_views.rows import TableAgreement
from specan.inspect.study_views.transfer import TransferAgreement
from specan.inspect.trial import Trial
from specan.study.observation.frf import FrfObservation
from specan.study.observation.table import TableObservation
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


def agreement_of(study: Study) -> list[Agreement]:
    """One for the tables and one for the recordings of a study."""
    found: list[Agreement] = []
    observations = study.data.fitted  # not those of the problem, whose covariances may rest on a fit
    if any(isinstance(o, TableObservation) for o in observations):
        found.append(TableAgreement(study))
    if any(isinstance(o, FrfObservation) for o in observations):
        found.append(TransferAgreement(study))
    return found
