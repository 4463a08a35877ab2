"""A recording that a model of rates is compared with, sample by sample."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from specan.models.rates import TIME
from specan.study.observation import Array, Strategy
from specan.study.observation.autoregression import of_likely_order, spectrum
from specan.study.observation.table import TableObservation


@dataclass(frozen=True, eq=False)
class TimeObservation(TableObservation):
    """Samples of one or several recordings; the prediction integrates the model over each as a whole.

    Attributes
    ----------
    inflation : float
        Variance of noise along what the model can do, over that of white noise of the same size: so many samples are
        worth one.
    """

    inflation: float = 1.0
    kind: ClassVar[str] = "time"
    strategy: ClassVar[Strategy] = Strategy(frugal=True, exact_minimum=False)

    @cached_property
    def chains(self) -> dict[str, list[NDArray[np.intp]]]:
        """Rows of each observable that follow each other without a gap."""
        found: dict[str, list[NDArray[np.intp]]] = {}
        for name in dict.fromkeys(self.observable.tolist()):
            rows = np.flatnonzero(self.observable == name)
            gaps = (np.diff(self._position[rows]) != 1) | (np.diff(self._recording[rows]) != 0)
            found[name] = np.split(rows, np.flatnonzero(gaps) + 1)
        return found

    def place_of(self, row: int) -> str:
        """``3.2 s of run.tdms``."""
        return f"{self.conditions[TIME][row]:.4g} s of {self.recordings[int(self._recording[row])]}"

    @property
    def n_effective(self) -> float:
        """Number of independent samples that they are worth."""
        return self.n / self.inflation

    def with_noise_of(self, residual: Array, directions: Array) -> TimeObservation:
        """The same with noise that follows itself as a residual does, as it shows along some directions.

        Parameters
        ----------
        residual : array (n,)
            What the largest explanation leaves, in units of sigma.
        directions : array (n, k)
            Orthonormal: what parameters and effects do to the prediction.
        """
        along = np.zeros(directions.shape[1])
        for chains in self.chains.values():
            reflections = of_likely_order(chains, residual)
            for rows in chains:
                power = np.abs(np.fft.rfft(directions[rows], 2 * rows.size, axis=0)) ** 2
                power[1:-1] *= 2
                along += spectrum(reflections, 2 * rows.size) @ power / (2 * rows.size)
        # any recording is worth twenty independent samples
        inflation = float(np.clip(np.max(along, initial=1.0), 1.0, max(self.n / 20.0, 1.0)))
        return replace(self, covariance=self.covariance * inflation / self.inflation, inflation=inflation)
