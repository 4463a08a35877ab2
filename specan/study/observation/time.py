"""A recording that a model of rates is compared with, sample by sample; and its noise.

Noise may follow itself in time, r_t = a_1 r_(t-1) + ... + a_p r_(t-p) + e_t, known by its reflection coefficients.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache, reduce
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter
from scipy.special import gammaln

from specan.models import Assembly
from specan.models.rates import TIME
from specan.study.observation import Array, Strategy
from specan.study.observation.table import TableObservation

Chains = Sequence[NDArray[np.intp]]


def innovations(columns: Array, chains: Chains, reflections: Sequence[float]) -> Array:
    """Rows as independent innovations, of unit variance where those of the columns have it.

    Parameters
    ----------
    columns : array, shape (n,) or (n, k)
    chains : sequence of int arrays
        Rows in the order of time; each chain begins anew.
    reflections : sequence of float
        Between -1 and 1.
    """
    out, order = columns.copy(), len(reflections)
    taps = _predictor(tuple(reflections))
    for rows in chains:
        forward = backward = columns[rows[:order]]  # the first ones have fewer before them
        power = 1.0
        for k, reflection in enumerate(reflections, 1):
            ahead, behind = forward[1:], backward[:-1]
            forward, backward = ahead - reflection * behind, behind - reflection * ahead
            power *= 1 - reflection**2
            out[rows[k:order]] = forward / np.sqrt(power)
        out[rows[order:]] = lfilter(taps, [1.0], columns[rows], axis=0)[order:] / np.sqrt(power)
    return out


def coloured(rows: Array, reflections: Sequence[float]) -> Array:
    """What has these innovations, of one chain: the inverse of `innovations`."""
    order, taps = len(reflections), _predictor(tuple(reflections))
    if not order:
        return rows
    scale = np.sqrt(np.prod(1 - np.square(reflections)))
    first = innovations(np.eye(order), [np.arange(order)], reflections)
    driven = rows.copy()
    driven[:order] = lfilter(taps, [scale], np.linalg.solve(first, rows[:order]), axis=0)
    return np.asarray(lfilter([scale], taps, driven, axis=0))


@lru_cache
def _predictor(reflections: tuple[float, ...]) -> Array:
    """The filter that makes innovations."""
    return reduce(_longer, reflections, np.ones(1))


def _longer(taps: Array, reflection: float) -> Array:
    """The filter that makes innovations, one order higher."""
    longer = np.append(taps, 0.0)
    return np.asarray(longer - reflection * longer[::-1])


def of_covariance(lags: Array) -> tuple[float, ...]:
    """Reflection coefficients of a noise by its covariance over lags, the recursion of Levinson (1947).

    Examples
    --------
    >>> [round(float(c), 3) for c in of_covariance(np.array([1.0, 0.9, 0.81]))]
    [0.9, 0.0]
    """
    taps, power, found = np.ones(1), lags[0], []
    for k in range(1, lags.size):
        found.append(float(np.clip(taps @ lags[k:0:-1] / power, -0.9999999, 0.9999999)))
        taps, power = _longer(taps, found[-1]), power * (1 - found[-1] ** 2)
    return tuple(found)


def excess(columns: Array, chains: Chains, reflections: Sequence[float]) -> Array:
    """Y'(R - 1)Y of columns Y, with the correlation R of the noise between rows."""
    found = np.zeros((columns.shape[1], columns.shape[1]))
    for rows in chains:
        length = 2 * rows.size
        density = np.abs(np.fft.rfft(_predictor(tuple(reflections)), length)) ** -2.0
        twice = np.full(density.size, 2 / length)  # both halves of the circle
        twice[[0, -1]] = 1 / length
        lines = np.fft.rfft(columns[rows], length, axis=0)
        weights = twice * (density / (twice @ density) - 1)
        found += np.real((lines.conj().T * weights) @ lines)
    return found


def ln_volume(chains: Chains, reflections: Sequence[float]) -> float:
    """-1/2 ln det of the correlation."""
    return -0.5 * sum(
        max(rows.size - k, 0) * float(np.log1p(-(reflection**2)))
        for rows in chains
        for k, reflection in enumerate(reflections, 1)
    )


def ln_likelihood(chains: Chains, residual: Array, reflections: Sequence[float]) -> float:
    """Of a residual, at its likeliest size."""
    rows = np.concatenate(chains)
    power = float(np.mean(innovations(residual, chains, reflections)[rows] ** 2))
    return ln_volume(chains, reflections) - 0.5 * rows.size * float(np.log(max(power, 1e-300)))


def burg(chains: Chains, residual: Array, most: int) -> tuple[list[float], list[float]]:
    """Reflection coefficients by the recursion of Burg (1975), and the power of the innovations of every order."""
    forward, backward = [residual[rows] for rows in chains], [residual[rows] for rows in chains]
    count = sum(rows.size for rows in chains)
    power = [sum(float(f @ f) for f in forward) / max(count, 1)]
    found: list[float] = []
    for _ in range(most):
        pairs = [(f[1:], b[:-1]) for f, b in zip(forward, backward, strict=True)]
        above = 2 * sum(float(f @ b) for f, b in pairs)
        below = sum(float(f @ f + b @ b) for f, b in pairs)
        found.append(float(np.clip(above / max(below, 1e-300), -0.9999, 0.9999)))
        power.append(power[-1] * (1 - found[-1] ** 2))
        forward = [f - found[-1] * b for f, b in pairs]
        backward = [b - found[-1] * f for f, b in pairs]
    return found, power


def of_likely_order(chains: Chains, residual: Array, most: int = 30) -> tuple[float, ...]:
    """Reflection coefficients of the order that Schwarz's criterion (1978) takes; none for white noise.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> e = rng.standard_normal(4000)
    >>> of_likely_order([np.arange(4000)], e)
    ()
    >>> r = np.zeros(4000)
    >>> for t in range(1, 4000):
    ...     r[t] = 0.9 * r[t - 1] + e[t]
    >>> [round(float(c), 1) for c in of_likely_order([np.arange(4000)], r)]
    [0.9]
    """
    count = sum(rows.size for rows in chains)
    shortest = min((rows.size for rows in chains), default=0)
    found, power = burg(chains, residual, max(min(most, shortest // 10), 0))
    costs = [count * np.log(max(p, 1e-300)) + k * np.log(max(count, 1)) for k, p in enumerate(power)]
    return tuple(found[: int(np.argmin(costs))])


def of_process(response: Array, share: float, most: int = 100) -> tuple[float, ...]:
    """Reflection coefficients of white noise beside what a disturbance leaves that is white itself.

    Parameters
    ----------
    response : array
        To an impulse of the disturbance.
    share : float
        Of the variance that the disturbance makes.
    """
    power = np.abs(np.fft.rfft(response, 2 * response.size)) ** 2
    lags = np.fft.irfft(power)[: min(most + 1, response.size)]
    lags *= share / lags[0]
    lags[0] = 1.0
    return of_covariance(lags)


@dataclass(frozen=True)
class Noise:
    """A form of the noise of one observable.

    Attributes
    ----------
    words : str
        What it is.
    reflections : tuple of float
        See `specan.study.observation.time`.
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
