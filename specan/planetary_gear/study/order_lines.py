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

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from specan.arrays import Complex
from specan.models import Assembly
from specan.planetary_gear.model.kinematics import FAR
from specan.planetary_gear.model.lines import UNLIKE, OrderLines
from specan.study.observation import Array, Strategy, Variable
from specan.study.observation.frf import KeptLines

REACH = 4.0  # orders within which the model's error is common to lines
MOST = 2.0  # times a prediction: largest line that its relative errors are taken of
ROUNDING = 1e-9  # of the strongest line of its gain: a smaller one is none
# of a resonance over its frequency: twice the damping ratio, 0.01 to 0.1 (see `Uncertainty`)
BANDWIDTH = 0.06
START = 0.3  # relative error that all lines are given for the first gains


@dataclass(frozen=True, eq=False)
class OrderLinesObservation(KeptLines):
    """Measured order lines of recordings of one machine.

    Attributes
    ----------
    name : str
    of_row, channels : tuples of str
        Recording and sensor of each row of lines: recordings one after the other, each with all sensors in the
        model's order.
    quantity : str
        The model's quantity that is observed, array (sensors, lines).
    known : OrderLines
        What the model says of each line.
    amplitude : complex array (rows, lines)
    noise : array (rows, lines)
        Standard uncertainty of the real and of the imaginary part that lines do not share.
    beyond : bool array (rows, lines)
        Lines that the ideal machine does not have.
    path : array of int (rows,)
        Rows of one number hear the machine through one path.
    kept : bool array (rows, lines)
        Lines in use; their real and imaginary part go together.
    point : mapping
        Value of every condition but the order in each row, SI.
    levels : mapping
        The same as printed, with words.
    noise_dof : float
        Degrees of freedom of the noise estimate.
    learned : OrderLinesObservation, optional
        Where these lines are held out: those that were fitted.
    """

    name: str
    of_row: tuple[str, ...]
    quantity: str
    channels: tuple[str, ...]
    known: OrderLines
    amplitude: Complex
    noise: Array
    beyond: NDArray[np.bool_] = field(repr=False)
    path: NDArray[np.intp]
    kept: NDArray[np.bool_] = field(repr=False)
    point: Mapping[str, Array]
    levels: Mapping[str, tuple[Array, Variable]] = field(default_factory=dict)
    noise_dof: float = np.inf
    learned: OrderLinesObservation | None = field(default=None, repr=False)
    observable: str = "lines"
    kind: ClassVar[str] = "orders"
    level_of: ClassVar[str] = "levels of lines"
    cells: ClassVar[tuple[str, ...]] = ("orders", "harmonic", "channel")
    strategy: ClassVar[Strategy] = Strategy(frugal=True, exact_minimum=False)

    @property
    def recordings(self) -> tuple[str, ...]:
        """Their names, each once."""
        return tuple(dict.fromkeys(self.of_row))

    @property
    def places(self) -> Mapping[str, Any]:
        """Recording of every row, and which part of a line it is."""
        return {**super().places, "file": self.rows(np.array(self.of_row)[:, None])}

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
        """Lines in use, (rows, lines), of each row and harmonic: those that share a gain."""
        found = []
        for row, harmonic in product(range(len(self.channels)), np.unique(self.known.harmonic)):
            mine = np.zeros(self.kept.shape, dtype=bool)
            mine[row] = self.kept[row] & (self.known.harmonic == harmonic)
            if mine.any():
                found.append(mine)
        return found

    @cached_property
    def measured(self) -> Array:
        """Real parts, then imaginary parts."""
        return self.stack(self.amplitude)

    @cached_property
    def conditions(self) -> Mapping[str, Array]:
        """Order and the other conditions of every row."""
        order = self.rows(self.known.order)
        return {"order": order, **{c: self.rows(v[:, None]) for c, v in self.point.items()}}

    @cached_property
    def labels(self) -> Mapping[str, NDArray[Any]]:
        """Family, harmonic and sensor of every row; level of each other condition."""
        number = np.array([f"h = {h}" for h in self.known.harmonic])
        return {
            "orders": self.rows(self.known.family),
            "harmonic": self.rows(number),
            "channel": self.channel_of_row,
            **{name: self.rows(level[:, None]) for name, (level, _) in self.levels.items()},
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

    @property
    def along(self) -> Array:
        """In units of twice the orders within which a model's error is common to lines."""
        return self.rows(self.known.order / (2 * REACH))

    def powers(self) -> tuple[Array, Array]:
        """All rows; the power of their noise is taken with them."""
        return np.ones(self.n), self.sigma**2

    # --- prediction ---------------------------------------------------------------------------

    def plain(self, assembly: Assembly, values: Mapping[str, Any]) -> Array:
        """The model's lines in place of `measured`, with gains that lines of the ideal machine tell.

        What the model is declared not to know stays in the error. Lines that are held out have the gains of those that
        were fitted and heard through the same path. Lines that the ideal machine does not have are as strong as those
        of other recordings say: nothing is learned from the lines that are shown.
        """
        others = self.learned or self
        predicted, told = self._heard(assembly, values, self.learned), others._heard(assembly, values)
        for name in self.recordings:
            mine = np.array(self.of_row) == name
            rest = others.kept & others.beyond & (np.array(others.of_row) != name)[:, None]
            answer = others._answers(told, rest, self.path[mine][0])
            predicted[mine] *= np.where(self.beyond[mine], answer, 1.0)
        return self.stack(predicted)

    def _heard(
        self, assembly: Assembly, values: Mapping[str, Any], seen: OrderLinesObservation | None = None
    ) -> Complex:
        """The model's lines (rows, lines) with gains that they tell themselves, or those that were fitted do."""
        lines = self.model_lines(assembly, values)
        gains = self._shown_gains(lines, range(len(self.of_one_gain)))
        if seen is not None:
            gains = seen._shown_gains(seen.model_lines(assembly, values), seen._paths) | {
                k: gain for k, gain in gains.items() if self._paths[k] not in seen._paths
            }
        heard = np.zeros(self.kept.shape, dtype=complex)
        for k, (path, group) in enumerate(zip(self._paths, self.of_one_gain, strict=True)):
            heard[group] = gains.get(path, gains.get(k, 0.0)) * lines[group]
        return heard

    def _answers(self, heard: Complex, told: NDArray[np.bool_], path: int) -> Complex:
        """Factor by which each line is stronger, from lines that tell it: by least squares, a complex number each line.

        A machine has one answer for each harmonic, kind of motion and order in the carrier's frame at one speed. It is
        known as well as the lines that tell it, and otherwise as those of all speeds are on average.
        """
        known, size = self.known, np.where(told, np.abs(heard) ** 2, 0.0)
        cross = np.where(told, heard.conj() * self.amplitude, 0.0)
        if not size.sum() > 0:
            return np.ones(known.order.size, complex)
        average = max(float(cross.sum().real / size.sum()), 0.0)
        away = known.path * np.minimum(np.abs(known.passages), FAR) / FAR
        unsure = np.where(told, 2 * self.noise**2 + (known.near**2 + away**2) * np.abs(heard) ** 2, 0.0)
        speed = self.path // len(set(self.channels)) == path // len(set(self.channels))
        frame = np.round(known.order - known.passages, 6)
        alike = same(known.harmonic, known.mode, frame).astype(float)
        at_speed = [np.sum(part[speed], axis=0) @ alike for part in (size, cross, unsure)]
        return (average * at_speed[2] + at_speed[1]) / np.maximum(
            at_speed[2] + at_speed[0], 1e-300
        ) + average * (at_speed[0] == 0)

    @cached_property
    def _paths(self) -> list[tuple[int, int]]:
        """Path and harmonic of each group of `of_one_gain`."""
        first = (np.argwhere(group)[0] for group in self.of_one_gain)
        return [(int(self.path[row]), int(self.known.harmonic[line])) for row, line in first]

    def path_gains(self, assembly: Assembly, values: Mapping[str, Any]) -> list[dict[str, Any]]:
        """Of each recording: the gains that `plain` learns from its lines, and the RMS error without them."""
        lines = self.model_lines(assembly, values)
        gains = np.array(list(self._shown_gains(lines, range(len(self.of_one_gain))).values()))
        where = np.array([np.argwhere(group)[0] for group in self.of_one_gain])
        with np.errstate(divide="ignore"):
            level = 20 * np.log10(np.abs(gains))
        found = []
        for name in self.recordings:
            mine = np.array(self.of_row)[where[:, 0]] == name
            rows = (self.kept.T & (np.array(self.of_row) == name)).T
            gap = np.abs((lines - self.amplitude)[rows])
            found.append({
                "recording": name,
                "rms_without": float(np.sqrt(np.mean(gap**2) / 2)),
                "channel": [self.channels[row] for row in where[mine, 0]],
                "harmonic": self.known.harmonic[where[mine, 1]].tolist(),
                "gain_dB": level[mine].tolist(),
                "phase_deg": np.degrees(np.angle(gains[mine])).tolist(),
            })  # fmt: skip
        return found

    def model_lines(self, assembly: Assembly, values: Mapping[str, Any]) -> Complex:
        """The model's lines without gains, (rows, lines)."""
        found = assembly.evaluate(self._conditions, values, wanted=[self.quantity])
        return self._by_row(np.asarray(found[self.quantity]))

    def _by_row(self, lines: Complex) -> Complex:
        """Lines of all recordings, (sensors, recordings x lines), as (rows, lines)."""
        parts = np.split(lines, len(self.recordings), axis=1)
        return np.concatenate(parts)

    def _shown_gains(self, lines: Complex, keys: Iterable[Any]) -> dict[Any, complex]:
        """Of all groups of `of_one_gain` that have one key, by least squares over lines of the ideal machine."""
        size: defaultdict[Any, float] = defaultdict(float)
        cross: defaultdict[Any, complex] = defaultdict(complex)
        for key, group in zip(keys, self.of_one_gain, strict=True):
            told = group & ~self.beyond
            size[key] += float(np.vdot(lines[told], lines[told]).real)
            cross[key] += complex(np.vdot(lines[told], self.amplitude[told]))
        return {key: cross[key] / size[key] if size[key] > 0 else 0j for key in size}

    def predict_many(self, assembly: Assembly, many: Sequence[Mapping[str, Any]]) -> Array:
        """Predictions for several sets of values."""
        found = assembly.evaluate_many(self._conditions, list(many), [self.quantity])
        return np.stack(
            [self.as_known(self._by_row(np.asarray(one[self.quantity]))) for one in found], axis=1
        )

    @cached_property
    def _conditions(self) -> dict[str, Array]:
        count = len(self.recordings)
        each = len(self.channels) // count
        return {
            "order": np.tile(self.known.order, count),
            **{c: np.repeat(v[::each], self.known.order.size) for c, v in self.point.items()},
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
        lines = np.where(np.abs(lines) > ROUNDING, lines, 0.0)
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

    def _roots(self, predicted: Complex, size: Array) -> list[tuple[NDArray[np.intp], Array]]:
        """Lines that are predicted, and the lower Cholesky factor of their V where lines have these sizes.

        One part after the other of those that share errors. In the phases of the prediction V is real. Other lines have
        their noise alone.
        """
        from scipy.linalg.lapack import dpotrf

        roots = []
        for lines, relative in self._relative_covariance:
            there = predicted[lines] != 0
            own, covariance = lines[there], relative[np.ix_(there, there)]
            covariance *= size[own, None] * size[own]
            covariance.flat[:: own.size + 1] += self.noise[self.kept][own] ** 2
            root, failed = dpotrf(covariance, lower=1)
            if failed:
                raise FloatingPointError("the covariance of order lines is not positive definite")
            roots.append((own, np.asarray(root)))
        return roots

    def _whitening(self, predicted: Complex) -> Callable[[Complex], Complex]:
        """V^(-1/2) of the lines in use: noise, and relative errors about these predictions."""
        from scipy.linalg.lapack import dtrtrs

        roots = self._roots(predicted, _between(predicted, self.amplitude[self.kept]))
        noise = self.noise[self.kept][:, None]

        def white(lines: Complex) -> Complex:
            found = lines.reshape(predicted.size, -1) / noise
            for own, root in roots:
                phase = (predicted[own] / np.abs(predicted[own]))[:, None]
                turned = lines.reshape(predicted.size, -1)[own] * phase.conj()
                both = np.concatenate([turned.real, turned.imag], axis=1)
                real, imaginary = np.split(dtrtrs(root, both, lower=1)[0], 2, axis=1)
                found[own] = (real + 1j * imaginary) * phase
            return found.reshape(lines.shape)

        return white

    @cached_property
    def _relative_covariance(self) -> list[tuple[NDArray[np.intp], Array]]:
        """Lines in use that share errors with each other, and the covariance of these."""
        from scipy.sparse.csgraph import connected_components

        row, line = np.nonzero(self.kept)
        known, path = self.known, self.path[row]
        passes, harmonic = known.passages[line], known.harmonic[line]
        own = known.near**2 * _smooth(known.order)[np.ix_(line, line)] * (row[:, None] == row)
        away = known.path * np.minimum(np.abs(passes), FAR) / FAR
        alike = (passes[:, None] == passes) & (path[:, None] == path)
        own += away[:, None] * away * alike * (harmonic[:, None] == harmonic)
        # Sensors that hear through one path do so at one speed, where the machine answers alike.
        at_speed = np.unique(self.path, return_inverse=True)[1] // len(set(self.channels))
        answers = np.stack([at_speed[row], harmonic, known.mode[line]])
        alike = np.all(answers[:, :, None] == answers[:, None], axis=0)
        beyond, apart = self.beyond[self.kept], np.subtract.outer(*2 * [np.log(known.order[line])])
        alike = alike & beyond & beyond[:, None]
        response = known.response * np.array(UNLIKE)[harmonic - 1]
        own += response**2 * alike * np.exp(-0.5 * (apart / BANDWIDTH) ** 2)
        count, part = connected_components(own > 0)
        return [(lines, own[np.ix_(lines, lines)]) for k in range(count) for lines in np.nonzero(part == k)]

    @cached_property
    def _gain_of_line(self) -> NDArray[np.intp]:
        number = np.zeros(self.kept.shape, dtype=np.intp)
        for k, group in enumerate(self.of_one_gain):
            number[group] = k
        return number[self.kept]


def same(*labels: NDArray[Any]) -> NDArray[np.bool_]:
    """Of each two lines whether all labels are equal."""
    return np.asarray(np.all([label[:, None] == label for label in labels], axis=0))


def _between(predicted: Complex, measured: Complex) -> Array:
    """Logarithmic mean of two complex numbers, by its size: (a - b) / log(a / b); at most twice the first."""
    size = np.abs(predicted)
    both = (size > 0) & (np.abs(measured) > 0)
    ratio = np.where(both, measured, 1.0) / np.where(both, predicted, 1.0)
    apart = np.abs(ratio - 1.0)
    near = apart < 1e-6
    mean = np.where(near, 1.0, apart / np.where(near, 1.0, np.abs(np.log(ratio))))
    return size * np.where(both, np.minimum(mean, MOST), 0.0)


def _smooth(order: Array) -> Array:
    """Correlation of an error that varies smoothly with the order: pieces `REACH` orders long that overlap."""
    centres = np.arange(np.floor(order.min() / REACH), np.ceil(order.max() / REACH) + 1) * REACH
    root = np.sqrt(np.clip(1 - np.abs(order[:, None] - centres) / REACH, 0, None))  # the pieces add up to one
    return np.asarray(root @ root.T)


def joined(parts: Sequence[OrderLinesObservation]) -> OrderLinesObservation:
    """Recordings of one machine as one observation: what they hear of it through one path is common to them."""
    first = parts[0]

    def rows(name: str) -> Any:
        return np.concatenate([getattr(part, name) for part in parts])

    return replace(
        first,
        name=", ".join(part.name for part in parts),
        of_row=tuple(name for part in parts for name in part.of_row),
        channels=tuple(name for part in parts for name in part.channels),
        **{name: rows(name) for name in ("amplitude", "noise", "beyond", "path", "kept")},
        point={c: np.concatenate([part.point[c] for part in parts]) for c in first.point},
        levels={
            n: (np.concatenate([part.levels[n][0] for part in parts]), words)
            for n, (_, words) in first.levels.items()
        },
    )
