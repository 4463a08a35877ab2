"""A recording that a model of rates is compared with, sample by sample."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln

from specan.models import Assembly
from specan.models.rates import TIME
from specan.study.observation import Array, Strategy
from specan.study.observation.autoregression import (
    excess,
    innovations,
    ln_likelihood,
    of_likely_order,
    of_process,
)
from specan.study.observation.table import TableObservation


@dataclass(frozen=True)
class Noise:
    """A form of the noise of one observable.

    Attributes
    ----------
    words : str
        What it is.
    reflections : tuple of float
        See `specan.study.observation.autoregression`.
    estimated : int
        How many numbers were estimated for it.
    times : float
        Its standard deviation over the declared one.
    """

    words: str
    reflections: tuple[float, ...] = ()
    estimated: int = 0
    times: float = 1.0


@dataclass(frozen=True, eq=False)
class TimeObservation(TableObservation):
    """Samples of one or several recordings; the prediction integrates the model over each as a whole.

    Attributes
    ----------
    noise : mapping
        Of each observable, where it is not white.
    stated : tuple of str
        Observables whose noise somebody has stated; that of others comes from their fastest changes.
    """

    noise: Mapping[str, Noise] = field(default_factory=dict)
    stated: tuple[str, ...] = ()
    kind: ClassVar[str] = "time"
    strategy: ClassVar[Strategy] = Strategy(frugal=True)

    @cached_property
    def chains(self) -> dict[str, list[NDArray[np.intp]]]:
        """Rows of each observable that follow each other without a gap."""
        found: dict[str, list[NDArray[np.intp]]] = {}
        for name in dict.fromkeys(self.observable.tolist()):
            rows = np.flatnonzero(self.observable == name)
            gaps = (np.diff(self._position[rows]) != 1) | (np.diff(self._recording[rows]) != 0)
            found[name] = np.split(rows, np.flatnonzero(gaps) + 1)
        return found

    def take(self, mask: NDArray[np.bool_]) -> Self:
        """Some of the rows, and the recordings that these are of."""
        found = super().take(mask)
        kept, recording = np.unique(found._recording, return_inverse=True)
        conditions, of = found._series
        number = np.full(len(found.recordings), -1)
        number[kept] = np.arange(kept.size)
        names = tuple(found.recordings[k] for k in kept)
        return replace(found, recordings=names, recording=recording, series=(conditions, number[of]))

    def beginning(self, share: float) -> Self:
        """A share of each recording, as if it had ended there."""
        conditions, recording = self._series
        time = conditions[TIME]
        kept = np.zeros(time.size, bool)
        for number in np.unique(recording):
            lines = recording == number
            kept[lines] = time[lines] <= time[lines][0] + share * np.ptp(time[lines])
        rows = kept[self._position]
        series = {n: v[kept] for n, v in conditions.items()}, recording[kept]
        place = (np.cumsum(kept) - 1)[self._position[rows]]
        return replace(super().take(rows), series=series, position=place)

    def place_of(self, row: int) -> str:
        """``3.2 s of run.tdms``."""
        return f"{self.conditions[TIME][row]:.4g} s of {self.recordings[int(self._recording[row])]}"

    def spread(self, assembly: Assembly, values: Mapping[str, Any], state: str) -> float:
        """Standard deviation of a state over the first recording."""
        number, conditions, _ = self._recorded[0]
        own = {n: v[number] if np.ndim(v) else v for n, v in values.items()}
        with np.errstate(all="ignore"):
            return float(np.std(assembly.evaluate(conditions, own)[state]))

    def ln_not_noise(self, predicted: Array, doubtful: Array) -> float:
        """ln of the evidence that what is taken for noise is none: that of any size over one that is nearly known.

        The variance is known with some degrees of freedom: 1 over it follows a gamma distribution. What is none has
        any variance up to a million times that, and is more than what is doubtful of a prediction.
        """
        half, found = self.noise_dof / 2, 0.0
        for name, form in self.noise.items():
            rows = np.concatenate(self.chains[name])
            if form.times > 1 and np.sum((self.measured - predicted)[rows] ** 2) > np.sum(
                doubtful[rows] ** 2
            ):
                ratio = form.times**2
                known = half * np.log(half) - gammaln(half) - half * (np.log(ratio) + 1 / ratio)
                found -= known + np.log(np.log(1e6))
        return float(found)

    def settled(self, assembly: Assembly, values: Mapping[str, Any]) -> bool:
        """Whether the solver takes steps enough at some values; if not, it does from then on."""
        solver = assembly.model.solver
        solver.doubted = assembly
        self.predict(assembly, values)
        settled, solver.doubted = solver.doubted is assembly, None
        return settled

    def whiten(self, array: Array) -> Array:
        """Apply V^(-1/2) along axis 0: what is left after all that the samples before tell."""
        rows = super().whiten(array)
        for name, form in self.noise.items():
            rows = innovations(rows, self.chains.get(name, []), form.reflections)
        return rows

    def excess(self, residual: Array, jacobian: Array) -> Array | float:
        """J'(R - 1)J with the correlation R that the residual shows over time."""
        return sum(excess(jacobian, own, of_likely_order(own, residual)) for own in self.chains.values())

    def with_noise_of(self, residual: Array, responses: Mapping[str, Array]) -> TimeObservation:
        """The same with the likeliest noise that a residual may be of.

        Parameters
        ----------
        residual : array (n,)
            Of the largest explanation, in units of sigma.
        responses : mapping
            Of each state of the model, the change of all rows after an impulse in its rate at the start.
        """
        found, size = {}, np.ones(self.n)
        for name, chains in self.chains.items():
            order = of_likely_order(chains, residual)
            forms = [Noise("white"), Noise("autoregressive", order, len(order))]
            for state, response in responses.items():
                own = response[chains[0]]
                if np.any(own) and np.all(np.isfinite(own)):
                    words = f"an unmeasured random change of d{state}"
                    # shares of white noise beside that of a disturbance
                    forms += [
                        Noise(words, of_process(own, 1 - white), 1)
                        for white in (0.9, 0.5, 0.2, 0.05, 0.01, 2e-3, 5e-4, 1e-4, 1e-5)
                    ]
            worth = [ln_likelihood(chains, residual, f.reflections) for f in forms]
            price = 0.5 * np.log(max(sum(rows.size for rows in chains), 1))
            best = forms[int(np.argmax([w - price * f.estimated for w, f in zip(worth, forms, strict=True)]))]
            if best.reflections:
                rows = np.concatenate(chains)
                found[name] = replace(best, times=float(np.sqrt(np.mean(residual[rows] ** 2))))
                size[rows] = np.mean(innovations(residual, chains, best.reflections)[rows] ** 2)
        return replace(self, noise=found, covariance=self.covariance * size)
