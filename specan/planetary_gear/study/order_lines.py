"""Complex order lines of vibration sensors, compared with a model's.

Rows are the real parts of all sensors (one after the other, each over its lines), then the imaginary parts. What lies
between machine and sensor is unknown: each sensor has a free complex gain for every harmonic, so that nothing rests on
absolute levels. The gains are linear and nobody's concern; they are eliminated by generalised least squares whenever
the model is evaluated (variable projection: Golub and Pereyra, SIAM J. Numer. Anal. 10 (1973) 413), and cost two
degrees of freedom each.

What the model is declared not to know is relative, and goes with the prediction p: in proportion to the measured lines
y, fits would prefer small ones (D'Agostini, Nucl. Instrum. Methods A 346 (1994) 306), in proportion to p alone large
ones. The errors are those of log(y / p), which is y - p over the logarithmic mean of y and p; the covariance V goes
with that mean. A line that the model does not have is given nothing. A fit here has one covariance, that of the noise
N. So `predict` moves a prediction towards the measurement until N sees the residual that V would: measured -
N^(1/2) V^(-1/2) (measured - predicted). `plain` is the prediction itself.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from specan.models import Assembly
from specan.study.observation import Strategy, Variable
from specan.study.observation.kept_lines import KeptLines

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

REACH = 4.0  # orders within which the model's error is common to lines
MOST = 2.0  # times a prediction: largest line that its relative errors are taken of
START = 0.3  # relative error that all lines are given for the first gains


@dataclass(frozen=True, eq=False)
class OrderLinesObservation(KeptLines):
    """Measured order lines, one recording.

    Attributes
    ----------
    name, recording : str
    quantity : str
        The model's quantity that is observed, array (sensors, lines).
    channels : tuple of str
        Names of the sensors, in the model's order.
    order, harmonic, family : arrays (lines,)
        See `specan.planetary_gear.model.lines.OrderLines`.
    amplitude : complex array (sensors, lines)
    noise : array (sensors, lines)
        Standard uncertainty of the real and of the imaginary part that lines do not share.
    relative : array (lines, r)
        Relative errors of the prediction, one standard deviation a column, each sensor's own; see `declared_errors`.
    common : array (sensors, lines, q)
        The same, common to the sensors.
    kept : bool array (sensors, lines)
        Rows in use; the real and the imaginary part of a line go together.
    point : mapping
        Value of every condition but the order, SI.
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
    relative: Array = field(repr=False)
    common: Array = field(repr=False)
    kept: NDArray[np.bool_] = field(repr=False)
    point: Mapping[str, float]
    levels: Mapping[str, tuple[float, Variable]] = field(default_factory=dict)
    noise_dof: float = np.inf
    observable: str = "lines"
    kind: ClassVar[str] = "orders"
    level_of: ClassVar[str] = "levels of lines"
    cells: ClassVar[tuple[str, ...]] = ("orders", "harmonic", "channel")
    # The errors of log(measured / predicted) bend the valley to the minimum, so that it is followed to its end.
    strategy: ClassVar[Strategy] = Strategy(frugal=True, either_sign=True)

    @property
    def n_effective(self) -> float:
        """Number of real values less two for every gain that is eliminated."""
        return float(self.n - 2 * len(self.of_one_gain))

    @property
    def available(self) -> frozenset[str]:
        """Conditions that the data hold."""
        return frozenset({"order", *self.point})

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
        order = self.rows(self.order)
        return {"order": order, **{c: np.full(self.n, v) for c, v in self.point.items()}}

    @cached_property
    def labels(self) -> Mapping[str, NDArray[Any]]:
        """Family, harmonic and sensor of every row; level of each other condition."""
        number = np.array([f"h = {h}" for h in self.harmonic])
        return {
            "orders": self.rows(self.family),
            "harmonic": self.rows(number),
            "channel": self.channel_of_row,
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
        """N: noise of each line."""
        return np.diag(self.sigma**2)

    @cached_property
    def sigma(self) -> Array:
        """Standard uncertainty of every row."""
        return self.stack(self.noise + 1j * self.noise)

    def whiten(self, array: Array) -> Array:
        """Apply N^(-1/2) along axis 0."""
        return array / (self.sigma if array.ndim == 1 else self.sigma[:, None])

    def powers(self) -> tuple[Array, Array]:
        """All rows; the power of their noise is taken with them."""
        return np.ones(self.n), self.sigma**2

    # --- prediction ---------------------------------------------------------------------------

    def plain(self, assembly: Assembly, values: Mapping[str, Any]) -> Array:
        """The model's lines in place of `measured`, with the gain of each sensor and harmonic that leaves least error.

        Nothing else is learned from the lines: what the model is declared not to know stays in the error. The gains are
        not those of the fit: where errors are correlated and the model is far off, these lie beside all lines.
        """
        lines = self._model_lines(assembly, values)
        predicted = np.zeros(self.kept.shape, dtype=complex)
        for group, gain in zip(self.of_one_gain, self._shown_gains(lines), strict=True):
            predicted[group] = gain * lines[group]
        return self.stack(predicted)

    def path_gains(self, assembly: Assembly, values: Mapping[str, Any]) -> dict[str, Any]:
        """The gains that `plain` learns from the lines, and the RMS error of the model without them."""
        lines = self._model_lines(assembly, values)
        gains = np.array(self._shown_gains(lines))
        where = [np.argwhere(group)[0] for group in self.of_one_gain]
        with np.errstate(divide="ignore"):
            level = 20 * np.log10(np.abs(gains))
        return {
            "recording": self.recording,
            "rms_without": float(np.sqrt(np.mean((self.stack(lines) - self.measured) ** 2))),
            "channel": [self.channels[sensor] for sensor, _ in where],
            "harmonic": [int(self.harmonic[line]) for _, line in where],
            "gain_dB": level.tolist(),
            "phase_deg": np.degrees(np.angle(gains)).tolist(),
        }

    def _model_lines(self, assembly: Assembly, values: Mapping[str, Any]) -> Complex:
        own = self._own(assembly, values)
        return np.asarray(assembly.evaluate(self._conditions, own, wanted=[self.quantity])[self.quantity])

    def _shown_gains(self, lines: Complex) -> list[Any]:
        """Of each group of `of_one_gain`, by least squares; none where the model has no lines."""
        sizes = [np.vdot(lines[group], lines[group]).real for group in self.of_one_gain]
        crossed = [np.vdot(lines[group], self.amplitude[group]) for group in self.of_one_gain]
        return [cross / size if size > 0 else 0j for cross, size in zip(crossed, sizes, strict=True)]

    def predict_many(self, assembly: Assembly, many: Sequence[Mapping[str, Any]]) -> Array:
        """Predictions for several sets of values."""
        own = [self._own(assembly, values) for values in many]
        found = assembly.evaluate_many(self._conditions, own, [self.quantity])
        return np.stack([self.as_known(np.asarray(one[self.quantity])) for one in found], axis=1)

    @cached_property
    def _conditions(self) -> dict[str, Array]:
        return {
            "order": self.order,
            **{c: np.full(self.order.size, v) for c, v in self.point.items()},
        }

    def as_known(self, lines: Complex) -> Array:
        """Rows of predicted lines (sensors, lines), with gains, and moved by what they are declared not to know."""
        predicted, white = self._with_gains(lines[self.kept])
        measured = self.amplitude[self.kept]
        moved = np.zeros(self.kept.shape, dtype=complex)
        moved[self.kept] = measured - self.noise[self.kept] * white(measured - predicted)
        return self.stack(moved)

    def _with_gains(self, lines: Complex) -> tuple[Complex, Callable[[Complex], Complex]]:
        """Lines in use with the gain that fits best for each sensor and harmonic; and V^(-1/2) there."""
        measured = self.amplitude[self.kept]
        groups = self._gain_of_line
        strongest = np.zeros(len(self.of_one_gain))
        np.maximum.at(strongest, groups, np.abs(lines))
        there = strongest > 0
        lines = lines / np.where(there, strongest, 1.0)[groups]
        # The gain is wanted to a part of the relative errors: one step from equal errors of all lines is enough.
        weight = 1.0 / (self.noise[self.kept] ** 2 + (START * np.abs(measured)) ** 2)
        size = np.where(there, np.bincount(groups, weight * np.abs(lines) ** 2), 1.0)
        cross = np.conj(lines) * measured * weight
        gain = (np.bincount(groups, cross.real) + 1j * np.bincount(groups, cross.imag)) / size
        columns = np.zeros((lines.size, size.size + 1), dtype=complex)
        columns[np.arange(lines.size), groups] = lines / np.sqrt(size)[groups]
        columns[:, -1] = measured
        white = self._whitening(gain[groups] * lines)(columns)
        normal = white[:, :-1].conj().T @ white[:, :-1]
        normal.flat[:: normal.shape[0] + 1] += ~there
        fitted = np.linalg.solve(normal, white[:, :-1].conj().T @ white[:, -1]) / np.sqrt(size)
        predicted = fitted[groups] * lines
        return predicted, self._whitening(predicted)

    def _whitening(self, predicted: Complex) -> Callable[[Complex], Complex]:
        """V^(-1/2) of the lines in use: noise, and relative errors about these predictions.

        In the phases of the prediction V is real.
        """
        from scipy.linalg.lapack import dpotrf, dtrtrs

        size = np.abs(predicted)
        phase = np.where(size > 0, predicted / np.where(size > 0, size, 1.0), 1.0)
        size = _between(predicted, self.amplitude[self.kept])
        covariance = self._relative_covariance * (size[:, None] * size)
        covariance.flat[:: size.size + 1] += self.noise[self.kept] ** 2
        root, failed = dpotrf(covariance, lower=1)
        if failed:
            raise FloatingPointError("the covariance of order lines is not positive definite")

        def white(lines: Complex) -> Complex:
            turn = phase if lines.ndim == 1 else phase[:, None]
            turned = (lines * turn.conj()).reshape(size.size, -1)
            both = np.concatenate([turned.real, turned.imag], axis=1)
            found = np.split(dtrtrs(root, both, lower=1)[0], 2, axis=1)
            return np.asarray((found[0] + 1j * found[1]).reshape(lines.shape) * turn)

        return white

    @cached_property
    def _relative_covariance(self) -> Array:
        sensor, line = np.nonzero(self.kept)
        own = (self.relative @ self.relative.T)[np.ix_(line, line)] * (sensor[:, None] == sensor)
        common = self.common[self.kept]
        return own + common @ common.T

    @cached_property
    def _gain_of_line(self) -> NDArray[np.intp]:
        number = np.zeros(self.kept.shape, dtype=np.intp)
        for k, group in enumerate(self.of_one_gain):
            number[group] = k
        return number[self.kept]

    def _own(self, assembly: Assembly, values: Mapping[str, Any]) -> dict[str, Any]:
        """Values with the number of this recording where each has its own."""
        parameters = assembly.parameters
        return {
            n: v[0] if np.ndim(v) == 1 and parameters[n].per == "recording" else v for n, v in values.items()
        }


def _between(predicted: Complex, measured: Complex) -> Array:
    """Logarithmic mean of two complex numbers, by its size: (a - b) / log(a / b); at most twice the first."""
    size = np.abs(predicted)
    both = (size > 0) & (np.abs(measured) > 0)
    ratio = np.where(both, measured, 1.0) / np.where(both, predicted, 1.0)
    apart = np.abs(ratio - 1.0)
    near = apart < 1e-6
    mean = np.where(near, 1.0, apart / np.where(near, 1.0, np.abs(np.log(ratio))))
    return size * np.where(both, np.minimum(mean, MOST), 0.0)


def declared_errors(order: Array, offset: Array, near: float, path: float) -> Array:
    """Columns of one standard deviation each, (lines, r), of what the model is declared not to know of its lines.

    Two relative errors of either component: one varies smoothly with the order and is common to lines within a few
    orders (pieces `REACH` orders long that overlap); one is common to the lines at the same offset from every harmonic,
    the path's, and leaves the harmonics themselves alone.

    Parameters
    ----------
    order, offset : array (lines,)
        Order, and its distance from the harmonic that the line belongs to.
    near, path : float
        Relative standard uncertainty of the one and of the other.

    Examples
    --------
    >>> found = declared_errors(np.array([66.0, 67.0, 68.0]), np.array([0.0, 1.0, 2.0]), 0.1, 0.3)
    >>> np.sqrt(np.sum(found**2, axis=-1)).round(3).tolist()
    [0.1, 0.316, 0.316]
    """
    centres = np.arange(np.floor(order.min() / REACH), np.ceil(order.max() / REACH) + 1) * REACH
    basis = np.clip(1 - np.abs(order - centres[:, None]) / REACH, 0, None)
    parts = [near * np.sqrt(part) for part in basis if part.any()]  # the basis add up to one
    places = np.round(offset, 6)
    parts += [path * (places == place) for place in np.unique(places) if place]
    return np.stack(parts, axis=-1)


def response_errors(beyond: NDArray[np.bool_], harmonic: NDArray[np.intp], response: float) -> Array:
    """Columns of one standard deviation each, (sensors, lines, q), of lines that the ideal machine does not have.

    How strongly the machine answers to what its equal parts do not do alike is known less well than how it answers to
    what they share: one relative error for each harmonic, common to all lines and sensors.

    Parameters
    ----------
    beyond : bool array (sensors, lines)
        Lines that the ideal machine does not have.
    harmonic : array of int (lines,)
    response : float
        Relative standard uncertainty.
    """
    return np.stack([response * (beyond & (harmonic == h)) for h in np.unique(harmonic)], axis=-1)
