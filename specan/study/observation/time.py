"""A recording that a model of rates is compared with, sample by sample."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from specan.models import Assembly
from specan.study.observation import Array
from specan.study.observation.autoregression import innovations, of_likely_order
from specan.study.observation.table import TableObservation


@dataclass(frozen=True, eq=False)
class TimeObservation(TableObservation):
    """Samples of one or several recordings; the prediction integrates the model over each as a whole.

    Attributes
    ----------
    reflections : mapping
        Of the noise of each observable, see `specan.study.observation.autoregression`; none for white noise.
    """

    reflections: Mapping[str, tuple[float, ...]] = ()  # type: ignore[assignment]
    kind: ClassVar[str] = "time"

    @cached_property
    def chains(self) -> dict[str, list[NDArray[np.intp]]]:
        """Rows of each observable that follow each other without a gap."""
        found: dict[str, list[NDArray[np.intp]]] = {}
        for name in dict.fromkeys(self.observable.tolist()):
            rows = np.flatnonzero(self.observable == name)
            gaps = (np.diff(self._position[rows]) != 1) | (np.diff(self._recording[rows]) != 0)
            found[name] = np.split(rows, np.flatnonzero(gaps) + 1)
        return found

    def whiten(self, array: Array) -> Array:
        """Apply V^(-1/2) along axis 0."""
        scaled = array / (self.sigma if array.ndim == 1 else self.sigma[:, None])
        for name, reflections in dict(self.reflections).items():
            scaled = innovations(scaled, self.chains[name], reflections) if name in self.chains else scaled
        return np.asarray(scaled)

    def with_noise_of(self, residual: Array) -> TimeObservation:
        """The same with noise that follows itself as a residual (in units of sigma) does."""
        found = {name: of_likely_order(chains, residual) for name, chains in self.chains.items()}
        return replace(self, reflections={name: r for name, r in found.items() if r})

    def residual(self, assembly: Assembly, values: Mapping[str, Any]) -> Array:
        """Predicted less measured, in units of sigma."""
        return np.asarray((self.predict(assembly, values) - self.measured) / self.sigma)
