"""Complex order lines of vibration sensors, compared with a model's.

Rows are the real parts of all sensors (one after the other, each over its lines), then the imaginary parts. What lies
between machine and sensor is unknown: each sensor has a free complex gain for every harmonic, so that nothing rests on
absolute levels. The gains are linear and nobody's concern; they are eliminated by generalised least squares whenever
the model is evaluated (variable projection: Golub and Pereyra, SIAM J. Numer. Anal. 10 (1973) 413), and cost two
degrees of freedom each.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from specan.models import Assembly
from specan.study.observation import TABLE, Strategy, Variable

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

REACH = 4.0  # orders within which the model's error is common to lines


@dataclass(frozen=True, eq=False)
class OrderLinesObservation:
    """Measured order lines, one recording.

    Attributes
    ----------
    name, recording : str
    quantity : str
        The model's quantity that is observed, array (sensors, lines).
    channels : tuple of str
        Names of the sensors, in the model's order.
    order, harmonic, family : arrays (lines,)
        See `specan.models.measurement_kinds.OrderLines`.
    amplitude : complex array (sensors, lines)
    noise : array (sensors, lines)
        Standard uncertainty of the real and of the imaginary part that lines do not share.
    shared : complex array (sensors, lines, r)
        What is uncertain but common to lines, one standard deviation a column; see `declared_errors`.
    kept : bool array (sensors, lines)
        Rows in use; the real and the imaginary part of a line go together.
    order_condition : str
    point : mapping
        Value of every other condition, SI.
    levels : mapping
        The same as printed, with words.
    noise_dof : float
        Degrees of freedom of the noise estimate.
    """

    name: str
    recording: str
    quantity: str
    channels: tuple[str, ...]
    order: Array
    harmonic: NDArray[np.intp]
    family: NDArray[np.str_]
    amplitude: Complex
    noise: Array
    shared: Complex = field(repr=False)
    kept: NDArray[np.bool_] = field(repr=False)
    order_condition: str
    point: Mapping[str, float]
    levels: Mapping[str, tuple[float, Variable]] = field(default_factory=dict)
    noise_dof: float = np.inf
    observable: str = "lines"
    pure_error_dof: ClassVar[float] = 0.0
    kind: ClassVar[str] = "orders"
    strategy: ClassVar[Strategy] = TABLE

    @property
    def n(self) -> int:
        """Number of real values."""
        return 2 * int(self.kept.sum())

    @property
    def n_effective(self) -> float:
        """Number of real values less two for every gain that is eliminated."""
        return float(self.n - 2 * len(self.of_one_gain))

    @property
    def recordings(self) -> tuple[str, ...]:
        """The one recording."""
        return (self.recording,)

    @property
    def available(self) -> frozenset[str]:
        """Conditions that the data hold."""
        return frozenset({self.order_condition, *self.point})

    @cached_property
    def of_one_gain(self) -> list[NDArray[np.bool_]]:
        """Lines in use, (sensors, lines), of each sensor and harmonic: those that share a gain."""
        found = []
        for sensor in range(len(self.channels)):
            for harmonic in np.unique(self.harmonic):
                mine = np.zeros(self.kept.shape, dtype=bool)
                mine[sensor] = self.kept[sensor] & (self.harmonic == harmonic)
                if mine.any():
                    found.append(mine)
        return found

    @cached_property
    def measured(self) -> Array:
        """Real parts, then imaginary parts."""
        return self.stack(self.amplitude)

    @cached_property
    def conditions(self) -> Mapping[str, Array]:
        """Order of every row; the other conditions are the same in all."""
        order = self._rows(np.broadcast_to(self.order, self.kept.shape))
        return {self.order_condition: order, **{c: np.full(self.n, v) for c, v in self.point.items()}}

    @cached_property
    def labels(self) -> Mapping[str, NDArray[Any]]:
        """MultipleTestingFamily, harmonic and sensor of every row; level of each other condition."""
        names = np.array(self.channels)[:, None]
        number = np.array([f"h = {h}" for h in self.harmonic])
        return {
            "orders": self._rows(np.broadcast_to(self.family, self.kept.shape)),
            "harmonic": self._rows(np.broadcast_to(number, self.kept.shape)),
            "channel": self._rows(np.broadcast_to(names, self.kept.shape)),
            **{name: np.full(self.n, level) for name, (level, _) in self.levels.items()},
        }

    @property
    def variables(self) -> Mapping[str, Variable]:
        """Words of the labels."""
        return {
            "orders": Variable("orders", before=True),
            "harmonic": Variable("harmonic"),
            "channel": Variable("channel"),
            **{name: words for name, (_, words) in self.levels.items()},
        }

    # --- covariance ---------------------------------------------------------------------------

    @cached_property
    def covariance(self) -> Array:
        """V: noise of each line, and what lines have in common."""
        columns = self.stack(self.shared)
        return np.diag(self.stack(self.noise + 1j * self.noise) ** 2) + columns @ columns.T

    @cached_property
    def sigma(self) -> Array:
        """Standard uncertainty of every row."""
        return np.sqrt(np.diag(self.covariance))

    @cached_property
    def _roots(self) -> list[tuple[NDArray[np.intp], Array]]:
        """Rows of each sensor, and C^(-1/2) D^(-1) for their V = D C D: sensors have no error in common.

        Of all roots of V^(-1) the one whose rows stay closest to the lines.
        """
        found = []
        number = self._rows(np.broadcast_to(np.arange(len(self.channels))[:, None], self.kept.shape))
        for sensor in range(len(self.channels)):
            rows = np.flatnonzero(number == sensor)
            sigma = self.sigma[rows]
            values, vectors = np.linalg.eigh(self.covariance[np.ix_(rows, rows)] / np.outer(sigma, sigma))
            root = (vectors / np.sqrt(np.maximum(values, 1e-12 * values[-1:]))) @ vectors.T / sigma
            found.append((rows, root))
        return found

    def whiten(self, array: Array) -> Array:
        """Apply V^(-1/2) along axis 0."""
        white = np.empty(array.shape)
        for rows, root in self._roots:
            white[rows] = root @ array[rows]
        return white

    # --- prediction ---------------------------------------------------------------------------

    def predict(self, assembly: Assembly, values: Mapping[str, Any]) -> Array:
        """What the model expects in place of `measured`, with the gains that fit best."""
        return self.predict_many(assembly, [values])[:, 0]

    def predict_many(self, assembly: Assembly, many: Sequence[Mapping[str, Any]]) -> Array:
        """Predictions for several sets of values; what does not depend on what changed is kept."""
        conditions = {
            self.order_condition: self.order,
            **{c: np.full(self.order.size, v) for c, v in self.point.items()},
        }
        out, first, start = [], None, None
        for values in many:
            own = {n: v[0] if self._is_vector(assembly, n, v) else v for n, v in values.items()}
            changed = () if start is None else tuple(n for n in own if not np.array_equal(own[n], start[n]))
            found = assembly.evaluate(conditions, own, wanted=[self.quantity], after=first, changed=changed)
            out.append(self.with_gains(np.asarray(found[self.quantity])))
            if first is None:
                first, start = found, own
        return np.stack(out, axis=1)

    def with_gains(self, lines: Complex) -> Array:
        """Rows of predicted lines (sensors, lines), each sensor and harmonic with the gain that fits best."""
        columns = []
        for group in self.of_one_gain:
            alone = self.stack(np.where(group, lines, 0.0))
            columns += [alone, self.stack(np.where(group, 1j * lines, 0.0))]
        whole = np.stack(columns, axis=1)
        size = np.linalg.norm(whole, axis=0)
        whole = whole / np.where(size > 0, size, 1.0)
        weighted = np.empty_like(whole)
        for rows, root in self._roots:
            weighted[rows] = root.T @ (root @ whole[rows])
        normal = whole.T @ weighted
        normal[np.diag_indices_from(normal)] += np.where(size > 0, 0.0, 1.0)
        return whole @ np.linalg.solve(normal, weighted.T @ self.measured)

    def _is_vector(self, assembly: Assembly, name: str, value: Any) -> bool:
        return np.ndim(value) == 1 and assembly.parameters[name].per == "recording"

    # --- the same with other rows ---------------------------------------------------------------

    def take(self, mask: NDArray[np.bool_]) -> OrderLinesObservation:
        """Some of the rows; a line stays where either of its parts does."""
        half = self.n // 2
        kept = self.kept.copy()
        kept[self.kept] = mask[:half] | mask[half:]
        return replace(self, kept=kept)

    def subsample(self, assembly: Assembly, values: Mapping[str, Any], rows: int) -> OrderLinesObservation:
        """All of it: lines are few."""
        return self

    def down_weighted(self, percent: float) -> OrderLinesObservation:
        """Itself."""
        return self

    def without_leakage(self, assembly: Assembly, values: Mapping[str, Any]) -> OrderLinesObservation:
        """Itself."""
        return self

    def about(
        self, assembly: Assembly, values: Mapping[str, Any], seen: bool = True
    ) -> OrderLinesObservation:
        """Itself: the covariance was found without the model."""
        return self

    def stack(self, lines: Complex) -> Array:
        """Rows of complex lines (sensors, lines, ...)."""
        return np.concatenate([lines.real[self.kept], lines.imag[self.kept]])

    def _rows(self, array: NDArray[Any]) -> NDArray[Any]:
        return np.tile(array[self.kept], 2)


def declared_errors(amplitude: Complex, order: Array, offset: Array, near: float, path: float) -> Complex:
    """Columns of one standard deviation each, (sensors, lines, r), of what the model is declared not to know.

    Two relative errors of either component, proportional to the given lines (measured ones that the ideal machine has):
    one varies smoothly with the order
    and is common to lines within a few orders (pieces `REACH` orders long that overlap); one is common to the lines at
    the same offset from every harmonic, the path's, and leaves the harmonics themselves alone. Each sensor has its own.

    Parameters
    ----------
    amplitude : complex array (sensors, lines)
    order, offset : array (lines,)
        Order, and its distance from the harmonic that the line belongs to.
    near, path : float
        Relative standard uncertainty of the one and of the other.

    Examples
    --------
    >>> lines = np.array([[2.0 + 0j, 1.0, 0.0]])
    >>> found = declared_errors(lines, np.array([66.0, 67.0, 68.0]), np.array([0.0, 1.0, 2.0]), 0.1, 0.3)
    >>> np.sqrt(np.sum(found.real**2, axis=-1)).round(3).tolist()
    [[0.2, 0.316, 0.0]]
    """
    centres = np.arange(np.floor(order.min() / REACH), np.ceil(order.max() / REACH) + 1) * REACH
    basis = np.clip(1 - np.abs(order - centres[:, None]) / REACH, 0, None)
    parts = [near * np.sqrt(part) for part in basis if part.any()]  # the basis add up to one
    places = np.round(offset, 6)
    parts += [path * (places == place) for place in np.unique(places) if place]
    found = []
    for sensor in range(amplitude.shape[0]):
        own = np.zeros_like(amplitude)
        own[sensor] = amplitude[sensor]
        found += [own * part * turn for part in parts for turn in (1, 1j)]
    return np.stack(found, axis=-1)
