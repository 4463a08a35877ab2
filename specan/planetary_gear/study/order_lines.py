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
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from specan.arrays import Complex
from specan.models import Assembly
from specan.planetary_gear.model.kinematics import OrderLines
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
    strategy: ClassVar[Strategy] = Strategy(frugal=True)

    @property
    def recordings(self) -> tuple[str, ...]:
        """Their names, each once."""
        return tuple(dict.fromkeys(self.of_row))

    @property
    def places(self) -> Mapping[str, Any]:
        """Recording of every row, and which part of a line it is."""
        return {**super().places, "file": self.rows(np.array(self.of_row)[:, None])}

    @property
    def size_error(self) -> float:  # type: ignore[override]
        """How strongly the machine answers to any error of its parts, mostly less than a stiff one.

        3.6 times what is declared of its lines: deviation of ln of true over fitted sizes, where 50 % are declared, on
        gears whose truth has other equations, floating suns among them (benchmarks/README.md).
        """
        return 3.6 * self.known.response

    @property
    def n_effective(self) -> float:
        """Number of real values less two for every gain that is eliminated."""
        return float(self.n - 2 * np.unique(self.of_row_and_harmonic[self.kept]).size)

    @property
    def available(self) -> frozenset[str]:
        """Conditions that the data hold."""
        return frozenset({"order", *self.point})

    @property
    def of_row_and_harmonic(self) -> NDArray[np.intp]:
        """Number of the gain of each line, (rows, lines)."""
        return self._numbered(np.arange(len(self.channels)))

    def _numbered(self, of_row: NDArray[np.intp]) -> NDArray[np.intp]:
        """A number for each harmonic of what rows belong to, (rows, lines)."""
        return of_row[:, None] * self.known.harmonic.max() + self.known.harmonic - 1

    @property
    def speed(self) -> NDArray[np.intp]:
        """Of each row a number of its speed: sensors that hear through one path do so at one."""
        return self.path // len(set(self.channels))

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
        """The model's lines in place of `measured`, with gains that lines of the ideal machine tell.

        What the model is declared not to know stays in the error. Lines that are held out have the gains of those that
        were fitted and heard through the same path. What effects make is as strong as lines of other recordings that
        the ideal machine does not have say: nothing is learned from the lines that are shown.
        """
        others = self.learned or self
        mixed, of_others = (o._lines_by_strength(assembly, values) for o in (self, others))
        predicted = np.zeros(self.kept.shape, complex)
        for name in self.recordings:
            mine = np.array(self.of_row) == name
            rest = others.kept & others.beyond & (np.array(others.of_row) != name)[:, None]
            strength = others._strength(others._heard(of_others(1.0)), rest)
            told = of_others(strength)
            answer = others._answers(others._heard(told), rest, self.speed[mine][0], strength)
            predicted[mine] = (self._heard(mixed(strength), told) * np.where(self.beyond, answer, 1.0))[mine]
        return self.stack(predicted)

    def _lines_by_strength(self, assembly: Assembly, values: Mapping[str, Any]) -> Callable[[float], Complex]:
        """The model's lines, (rows, lines); those of the ideal machine changed so many times as much by effects."""
        lines, base = self.model_lines(assembly, values), assembly.model.assemble(assembly.model.base_effects)
        ideal = self.model_lines(base, {name: values[name] for name in base.parameters if name in values})
        return lambda strength: np.where(self.beyond, lines, ideal + strength * (lines - ideal))

    def _heard(self, lines: Complex, fitted: Complex | None = None) -> Complex:
        """The model's lines (rows, lines) with gains that they tell themselves, or those that were fitted do."""
        lines = np.where(np.abs(lines) > ROUNDING * strongest(lines, self.known.harmonic), lines, 0.0)
        mine = self.of_row_and_harmonic
        gains = self._shown_gains(lines, mine)[mine]
        if self.learned is not None and fitted is not None:
            mine, theirs = self._numbered(self.path), self.learned._numbered(self.learned.path)
            told = self.learned._shown_gains(fitted, theirs, mine.max() + 1)
            gains = np.where(np.isin(mine, theirs), told[mine], gains)
        return gains * lines

    def _strength(self, heard: Complex, told: NDArray[np.bool_]) -> float:
        """How many times as strong as the model's the lines that tell it are, by least squares; 1 where none do."""
        size = np.sum(np.abs(heard[told]) ** 2)
        return max(float(np.vdot(heard[told], self.amplitude[told]).real / size), 0.0) if size > 0 else 1.0

    def _answers(self, heard: Complex, told: NDArray[np.bool_], speed: int, average: float) -> Complex:
        """Factor by which each line is stronger, from lines that tell it: by least squares, a complex number each line.

        A machine has one answer for each harmonic, kind of motion and order in the carrier's frame at one speed. It is
        known as well as the lines that tell it, and otherwise as those of all speeds are on average.
        """
        known, size = self.known, np.where(told, np.abs(heard) ** 2, 0.0)
        cross = np.where(told, heard.conj() * self.amplitude, 0.0)
        away = known.path * known.far
        unsure = np.where(told, 2 * self.noise**2 + (known.near**2 + away**2) * np.abs(heard) ** 2, 0.0)
        alike = same(known.harmonic, known.mode, known.frame).astype(float)
        at_speed = (np.sum(part[self.speed == speed], axis=0) @ alike for part in (size, cross, unsure))
        size, cross, unsure = at_speed
        heard_there = np.where(size > 0, size + unsure, 1.0)
        return np.where(size > 0, (cross + average * unsure) / heard_there, average)

    def path_gains(self, assembly: Assembly, values: Mapping[str, Any]) -> list[dict[str, Any]]:
        """Of each recording: the gains that `plain` learns from its lines, and the RMS error without them."""
        lines = self.model_lines(assembly, values)
        numbers = np.unique(self.of_row_and_harmonic[self.kept])
        gains = self._shown_gains(lines, self.of_row_and_harmonic)[numbers]
        row, harmonic = np.divmod(numbers, self.known.harmonic.max())
        with np.errstate(divide="ignore"):
            level = 20 * np.log10(np.abs(gains))
        found = []
        for name in self.recordings:
            own = np.array(self.of_row) == name
            mine, gap = own[row], np.abs((lines - self.amplitude)[self.kept & own[:, None]])
            found.append({
                "recording": name,
                "rms_without": float(np.sqrt(np.mean(gap**2) / 2)),
                "channel": [self.channels[k] for k in row[mine]],
                "harmonic": (harmonic[mine] + 1).tolist(),
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

    def _shown_gains(self, lines: Complex, number: NDArray[np.intp], least: int = 0) -> Complex:
        """Gain of each number, by least squares over lines of the ideal machine; 0 where there are none."""
        told = self.kept & ~self.beyond
        count = max(int(number.max()) + 1, least)
        size = np.bincount(number[told], np.abs(lines[told]) ** 2, count)
        cross = _summed(number[told], lines[told].conj() * self.amplitude[told], count)
        return cross / np.where(size > 0, size, 1.0)

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
        numbers, groups = np.unique(self.of_row_and_harmonic[self.kept], return_inverse=True)
        strongest = np.zeros(numbers.size)
        np.maximum.at(strongest, groups, np.abs(lines))
        there = strongest > 0
        lines = lines / np.where(there, strongest, 1.0)[groups]
        lines = np.where(np.abs(lines) > ROUNDING, lines, 0.0)
        # The gain is wanted to a part of the relative errors: one step from equal errors of all lines is enough.
        weight = 1.0 / (self.noise[self.kept] ** 2 + (START * np.abs(measured)) ** 2)
        size = np.where(there, np.bincount(groups, weight * np.abs(lines) ** 2), 1.0)
        cross = np.conj(lines) * measured * weight
        gain = _summed(groups, cross, numbers.size) / size
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

        One part after the other of those that share errors. In the phases of the prediction V is real. Lines that are
        not predicted have their noise alone.
        """
        from scipy.linalg.lapack import dpotrf, dtrtrs

        size, roots = _between(predicted, self.amplitude[self.kept]), []
        noise = self.noise[self.kept]
        for lines, relative in self._relative_covariance:
            there = predicted[lines] != 0
            own, covariance = lines[there], relative[np.ix_(there, there)]
            if not own.size:
                continue
            covariance *= size[own, None] * size[own]
            covariance.flat[:: own.size + 1] += noise[own] ** 2
            root, failed = dpotrf(covariance, lower=1)
            if failed:
                raise FloatingPointError("the covariance of order lines is not positive definite")
            phase = (predicted[own] / np.abs(predicted[own]))[:, None]
            roots.append((own, root, phase))

        def white(lines: Complex) -> Complex:
            found = lines.reshape(predicted.size, -1) / noise[:, None]
            for own, root, phase in roots:
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
        known, harmonic = self.known, self.known.harmonic[line]
        own = known.near**2 * _smooth(known.order)[np.ix_(line, line)] * same(row)
        away = known.path * known.far[line]
        own += np.outer(away, away) * same(known.passages[line], self.path[row], harmonic)
        response = np.where(self.beyond[self.kept], known.unlike[line], 0.0)
        answers = same(self.speed[row], harmonic, known.mode[line]) * resonance(known.order[line])
        own += np.outer(response, response) * answers
        count, part = connected_components(own > 0)
        return [(lines, own[np.ix_(lines, lines)]) for k in range(count) for lines in np.nonzero(part == k)]


def same(*labels: NDArray[Any]) -> NDArray[np.bool_]:
    """Of each two lines whether all labels are equal."""
    return np.asarray(np.all([label[:, None] == label for label in labels], axis=0))


def resonance(order: Array) -> Array:
    """Correlation of a machine's answers at these orders: those within a resonance are alike."""
    return np.exp(-0.5 * (np.subtract.outer(*2 * [np.log(order)]) / BANDWIDTH) ** 2)


def strongest(amplitude: Complex, harmonic: NDArray[np.intp]) -> Array:
    """Largest line about each line's harmonic, (rows, lines)."""
    size = np.abs(amplitude)
    return np.stack([size[:, harmonic == h].max(axis=1) for h in harmonic], axis=1)


def _summed(number: NDArray[np.intp], values: Complex, count: int) -> Complex:
    """Sums of the values of each number."""
    found = np.zeros(count, dtype=complex)
    np.add.at(found, number, values)
    return found


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
