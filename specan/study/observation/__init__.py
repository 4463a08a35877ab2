"""What was measured, in the form in which a model can be compared with it.

Decisions: docs/decisions/covariance.md, docs/decisions/leakage.md.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from specan.models import Assembly
from specan.study.observation.strategy import Strategy
from specan.study.observation.variable import Variable

Array = NDArray[np.float64]


@runtime_checkable
class Observation(Protocol):
    """A measured vector, the model's prediction of it, and the covariance of their difference.

    The covariance V holds what is random: reading noise, the scatter of setting a condition again, and
    the declared, smooth discrepancy of the model. It belongs to the observation and never changes with
    the model under test, so that chi-squares of different models may be compared. Errors that all rows
    share (a gain, a zero) are nuisance parameters with a prior in the `Problem`.
    """

    @property
    def name(self) -> str:
        """File or channel, for messages."""

    @property
    def measured(self) -> Array:
        """What was measured, SI; complex data as the real parts followed by the imaginary ones."""

    @property
    def sigma(self) -> Array:
        """Standard uncertainty of each value: the root of V's diagonal."""

    @property
    def conditions(self) -> Mapping[str, Array]:
        """Operating conditions in SI, arrays."""

    @property
    def labels(self) -> Mapping[str, NDArray[Any]]:
        """Operating variable (``load_kN``) to one level a row: values that were meant to be equal are equal."""

    @property
    def kind(self) -> str:
        """Kind of measurement; see `specan.study.measurement_kinds`."""

    @property
    def variables(self) -> Mapping[str, Variable]:
        """Words and unit of each label."""

    @property
    def available(self) -> frozenset[str]:
        """Conditions that the data hold."""

    @property
    def recordings(self) -> tuple[str, ...]:
        """Recordings of the rows; a parameter with ``per="recording"`` has one element each."""

    @property
    def n(self) -> int:
        """Length of `measured`."""

    @property
    def n_effective(self) -> float:
        """Number of independent values that the data are worth."""

    @property
    def noise_dof(self) -> float:
        """Degrees of freedom of the noise estimate; inf where the noise is known."""

    @property
    def pure_error_dof(self) -> float:
        """Degrees of freedom of the residual that only compare repeats, and that the noise was estimated from.

        They are spent: whatever the model, their share of chi-square equals their number.
        """

    def predict(self, assembly: Assembly, values: Mapping[str, Any]) -> Array:
        """What the model expects in place of `measured`.

        A parameter with ``per="recording"`` comes as a vector over `recordings`.
        """

    def predict_many(self, assembly: Assembly, many: Sequence[Mapping[str, Any]]) -> Array:
        """Predictions for several sets of values, shape (n, len(many))."""

    def whiten(self, array: Array) -> Array:
        """Apply V^(-1/2) along axis 0 of a vector, or of the columns of a matrix."""

    def take(self, mask: NDArray[np.bool_]) -> Observation:
        """The same observation with some of its rows only."""

    def subsample(self, assembly: Assembly, values: Mapping[str, Any], rows: int) -> Observation:
        """About so many rows, cheaper to predict, with the residual that the whole has at these values."""

    @property
    def strategy(self) -> Strategy:
        """How fits and searches over these data are run."""

    def down_weighted(self, percent: float) -> Observation:
        """The same with every row uncertain by so much of the level around it; itself without `continuation`."""

    def without_leakage(self, assembly: Assembly, values: Mapping[str, Any]) -> Observation:
        """The same without windows, as far as the model at these values knows what they do; itself where none are."""

    def about(self, assembly: Assembly, values: Mapping[str, Any], seen: bool = True) -> Observation:
        """The same with a covariance that is linearised about the model at these values; itself where it is not.

        What is held out may not be `seen`: then the measured values themselves must not enter.
        """
