"""Complex order lines of vibration sensors, held against a model's.

Rows are the real parts of all sensors (one after the other, each over its lines), then the imaginary parts. What lies
between machine and sensor is unknown: each sensor has a free complex gain for every harmonic, so that nothing rests on
absolute levels. Recordings of one speed share their gains, because the path to a sensor knows no load, and stand in one
observation. The gains are linear and nobody's concern; they are eliminated by generalised least squares whenever
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
from specan.study.observation.variable import Variable

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Mask = NDArray[np.bool_]

REACH = 4.0  # orders within which the model's error is common to lines


@dataclass(frozen=True, eq=False)
class OrderLinesObservation:
    """Measured order lines of one recording, or of several that share the path to the sensors.

    Lines of all recordings stand one after the other.

    Attributes
    ----------
    name : str
    recordings : tuple of str
    quantity : str
        The model's quantity that is observed, array (sensors, lines).
    channels : tuple of str
        Names of the sensors, in the model's order.
    order, harmonic, family : arrays (lines,)
        See `specan.models.order_lines.OrderLines`.
    recording : array of int (lines,)
        Which of the recordings each line belongs to.
    amplitude : complex array (sensors, lines)
    noise : array (sensors, lines)
        Standard uncertainty of the real and of the imaginary part that lines do not share.
    shared, path : complex arrays (sensors, lines, r)
        What is uncertain but common to lines, one standard deviation a column: of each recording by itself, and of the
        path that they share; see `model_errors` and `path_errors`.
    kept : bool array (sensors, lines)
        Rows in use; the real and the imaginary part of a line go together.
    order_condition : str
    point : mapping
        Values of every other condition, one a recording, SI.
    levels : mapping
        The same as printed, one a recording, with words.
    noise_dof : float
        Degrees of freedom of the noise estimate.
    reference : bool array (sensors, lines), optional
        Lines that give the gains, where those in use are held out: the fitted ones.
    added : array (n, n), optional
        Covariance beside that of noise and declared errors: of gains that come from a reference.
    """

    name: str
    recordings: tuple[str, ...]
    quantity: str
    channels: tuple[str, ...]
    order: Array
    harmonic: NDArray[np.intp]
    family: NDArray[np.str_]
    recording: NDArray[np.intp]
    amplitude: Complex
    noise: Array
    shared: Complex = field(repr=False)
    path: Complex = field(repr=False)
    kept: Mask = field(repr=False)
    order_condition: str
    point: Mapping[str, Array]
    levels: Mapping[str, tuple[Array, Variable]] = field(default_factory=dict)
    noise_dof: float = np.inf
    observable: str = "lines"
    reference: Mask | None = field(default=None, repr=False)
    added: Array | None = field(default=None, repr=False)
    pure_dof: ClassVar[float] = 0.0
    kind: ClassVar[str] = "orders"
    resonant: ClassVar[bool] = False
    about_model: ClassVar[bool] = False

    @property
    def n(self) -> int:
        """Number of real values."""
        return 2 * int(self.kept.sum())

    @property
    def n_effective(self) -> float:
        """Number of real values less two for every gain that they determine themselves."""
        return float(self.n - 2 * sum(not external for _, _, external in self.groups))

    @property
    def available(self) -> frozenset[str]:
        """Conditions that the data hold."""
        return frozenset({self.order_condition, *self.point})

    @cached_property
    def groups(self) -> list[tuple[Mask, Mask, bool]]:
        """Lines in use, (sensors, lines), of each sensor and harmonic, which share a gain; those that give it.

        The gain comes from the lines themselves where the reference has none.
        """
        found = []
        for sensor in range(len(self.channels)):
            for harmonic in np.unique(self.harmonic):
                place = np.zeros(self.kept.shape, dtype=bool)
                place[sensor] = self.harmonic == harmonic
                mine = place & self.kept
                if not mine.any():
                    continue
                given = mine if self.reference is None else place & self.reference
                found.append(
                    (mine, given, True) if given is not mine and given.any() else (mine, mine, False)
                )
        return found

    @cached_property
    def measured(self) -> Array:
        """Real parts, then imaginary parts."""
        return self.stack(self.amplitude)

    @cached_property
    def conditions(self) -> Mapping[str, Array]:
        """Order and operating point of every row."""
        return {name: self._rows(self._spread(values)) for name, values in self._of_lines.items()}

    @cached_property
    def _of_lines(self) -> dict[str, Array]:
        """Conditions of every line."""
        return {self.order_condition: self.order, **{c: v[self.recording] for c, v in self.point.items()}}

    @cached_property
    def labels(self) -> Mapping[str, NDArray[Any]]:
        """Family, harmonic and sensor of every row; level of each other condition."""
        number = np.array([f"h = {h}" for h in self.harmonic])
        return {
            "orders": self._rows(self._spread(self.family)),
            "harmonic": self._rows(self._spread(number)),
            "channel": self._rows(np.broadcast_to(np.array(self.channels)[:, None], self.kept.shape)),
            **{
                name: self._rows(self._spread(level[self.recording]))
                for name, (level, _) in self.levels.items()
            },
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
        """V: noise of each line, what lines have in common, and what the gains of a reference add."""
        own = self._covariance(self.kept)
        return own if self.added is None else own + self.added

    @property
    def _declared(self) -> Complex:
        """Columns of all that lines have in common."""
        return np.concatenate([self.shared, self.path], axis=-1)

    def _covariance(self, lines: Mask) -> Array:
        """Covariance of noise and declared errors of some lines."""
        columns = _rows_of(self._declared, lines)
        return np.diag(_rows_of(self.noise * (1 + 1j), lines) ** 2) + columns @ columns.T

    @cached_property
    def sigma(self) -> Array:
        """Standard uncertainty of every row."""
        return np.sqrt(np.diag(self.covariance))

    @cached_property
    def _root(self) -> Array:
        return _root_of(self.covariance)

    def whiten(self, array: Array) -> Array:
        """Apply V^(-1/2) along axis 0."""
        return np.asarray(self._root @ array)

    # --- prediction ---------------------------------------------------------------------------

    def predict(self, assembly: Assembly, values: Mapping[str, Any]) -> Array:
        """What the model expects in place of `measured`, with the gains that fit best."""
        return self.predict_many(assembly, [values])[:, 0]

    def predict_many(self, assembly: Assembly, many: Sequence[Mapping[str, Any]]) -> Array:
        """Predictions for several sets of values; what does not depend on what changed is kept."""
        if any(self._is_vector(assembly, n, v) for n, v in many[0].items()):
            return np.stack([self.with_gains(self._apart(assembly, values)) for values in many], axis=1)
        out, first, start = [], None, None
        for values in many:
            changed = (
                () if start is None else tuple(n for n in values if not np.array_equal(values[n], start[n]))
            )
            found = assembly.evaluate(
                self._of_lines, values, wanted=[self.quantity], after=first, changed=changed
            )
            out.append(self.with_gains(np.asarray(found[self.quantity])))
            if first is None:
                first, start = found, values
        return np.stack(out, axis=1)

    def _apart(self, assembly: Assembly, values: Mapping[str, Any]) -> Complex:
        """Lines of the model, every recording with its own element of parameters that have one each."""
        found = np.empty(self.kept.shape, dtype=complex)
        for number in range(len(self.recordings)):
            mine = self.recording == number
            own = {n: v[number] if self._is_vector(assembly, n, v) else v for n, v in values.items()}
            conditions = {name: of_line[mine] for name, of_line in self._of_lines.items()}
            found[:, mine] = assembly.evaluate(conditions, own, wanted=[self.quantity])[self.quantity]
        return found

    def with_gains(self, lines: Complex) -> Array:
        """Rows of predicted lines (sensors, lines), each sensor and harmonic with the gain that fits best."""
        whole = np.zeros(self.n)
        for give in self._givers:
            scale, normal, weighted = give.solver(lines)
            gain = np.linalg.solve(normal, weighted.T @ _rows_of(self.amplitude, give.among))
            whole += _columns(lines, give.used, self.kept) / scale @ gain
        return whole

    @cached_property
    def _givers(self) -> list[_Gains]:
        """Gains that come from the lines in use themselves, and those from a reference."""
        found = []
        for external in (False, True):
            groups = [(used, given) for used, given, where in self.groups if where is external]
            if groups:
                used, given = (list(part) for part in zip(*groups, strict=True))
                among = np.any(given, axis=0)
                covariance = self._covariance(among)
                root = _root_of(covariance)
                found.append(_Gains(used, given, among, root.T @ root, covariance, external))
        return found

    def _of_reference(self, lines: Complex) -> Array | None:
        """Covariance that gains from a reference add: measured less predicted is y - B y_ref."""
        give = next((g for g in self._givers if g.external), None)
        if give is None:
            return None
        scale, normal, weighted = give.solver(lines)
        b = _columns(lines, give.used, self.kept) / scale @ np.linalg.solve(normal, weighted.T)
        both = _rows_of(self._declared, self.kept) @ _rows_of(self._declared, give.among).T
        found = b @ give.covariance @ b.T - both @ b.T - b @ both.T
        return np.asarray(0.5 * (found + found.T))

    def _is_vector(self, assembly: Assembly, name: str, value: Any) -> bool:
        return np.ndim(value) == 1 and assembly.parameters[name].per == "recording"

    # --- the same with other rows ---------------------------------------------------------------

    def take(self, mask: Mask) -> OrderLinesObservation:
        """Some of the rows; a line stays where either of its parts does."""
        half = self.n // 2
        lines = mask[:half] | mask[half:]
        kept = self.kept.copy()
        kept[self.kept] = lines
        rows = np.flatnonzero(np.tile(lines, 2))
        added = None if self.added is None else self.added[np.ix_(rows, rows)]
        return replace(self, kept=kept, added=added)

    def sketch(self, assembly: Assembly, values: Mapping[str, Any], rows: int) -> OrderLinesObservation:
        """All of it: lines are few."""
        return self

    def coarse(self, percent: float) -> OrderLinesObservation:
        """Itself."""
        return self

    def unfolded(self, assembly: Assembly, values: Mapping[str, Any]) -> OrderLinesObservation:
        """Itself."""
        return self

    def about(
        self, assembly: Assembly, values: Mapping[str, Any], seen: bool = True
    ) -> OrderLinesObservation:
        """With the uncertainty of gains that come from a reference, about the model's lines; else itself."""
        if not any(external for _, _, external in self.groups):
            return self
        return replace(self, added=self._of_reference(self._apart(assembly, values)))

    def stack(self, lines: Complex) -> Array:
        """Rows of complex lines (sensors, lines, ...)."""
        return _rows_of(lines, self.kept)

    def _spread(self, of_line: NDArray[Any]) -> NDArray[Any]:
        return np.broadcast_to(of_line, self.kept.shape)

    def _rows(self, array: NDArray[Any]) -> NDArray[Any]:
        return np.tile(array[self.kept], 2)


@dataclass(frozen=True)
class _Gains:
    """Groups whose gains are found together: lines that they apply to, lines that give them, and these lines' V."""

    used: list[Mask]
    given: list[Mask]
    among: Mask
    inverse: Array
    covariance: Array
    external: bool

    def solver(self, lines: Complex) -> tuple[Array, Array, Array]:
        """Scale of the columns C of all gains, C' V^(-1) C, and V^(-1) C."""
        columns = _columns(lines, self.given, self.among)
        size = np.linalg.norm(columns, axis=0)
        scale = np.where(size > 0, size, 1.0)
        columns = columns / scale
        weighted = self.inverse @ columns
        normal = columns.T @ weighted
        normal[np.diag_indices_from(normal)] += np.where(size > 0, 0.0, 1.0)
        return scale, normal, weighted


def _root_of(covariance: Array) -> Array:
    """C^(-1/2) D^(-1) of V = D C D: of all roots of V^(-1) the one whose rows stay closest to the lines."""
    sigma = np.sqrt(np.diag(covariance))
    values, vectors = np.linalg.eigh(covariance / np.outer(sigma, sigma))
    return np.asarray((vectors / np.sqrt(np.maximum(values, 1e-12 * values[-1:]))) @ vectors.T / sigma)


def _columns(lines: Complex, groups: Sequence[Mask], among: Mask) -> Array:
    """Derivatives with respect to real and imaginary part of every group's gain, rows of the lines `among`."""
    parts = []
    for group in groups:
        mine = np.where(group, lines, 0.0)
        parts += [_rows_of(mine, among), _rows_of(1j * mine, among)]
    return np.stack(parts, axis=1)


def _rows_of(lines: Complex, among: Mask) -> Array:
    """Real parts of chosen complex lines (sensors, lines, ...), then imaginary parts."""
    return np.concatenate([lines.real[among], lines.imag[among]])


def joined(parts: Sequence[OrderLinesObservation]) -> OrderLinesObservation:
    """Recordings of one path as one observation, whose gains and errors of the path they share.

    Errors of the model are each recording's own: it may err otherwise at another load.
    """
    first = parts[0]
    if len(parts) == 1:
        return first
    begin = np.cumsum([0, *(len(p.recordings) for p in parts)])
    line = np.cumsum([0, *(p.order.size for p in parts)])
    width = np.cumsum([0, *(p.shared.shape[-1] for p in parts)])
    shared = np.zeros((len(first.channels), line[-1], width[-1]), dtype=complex)
    for k, part in enumerate(parts):
        shared[:, line[k] : line[k + 1], width[k] : width[k + 1]] = part.shared

    def lined(name: str, axis: int = -1) -> Any:
        return np.concatenate([getattr(p, name) for p in parts], axis=axis)

    return replace(
        first,
        name=", ".join(p.name for p in parts),
        recordings=tuple(r for p in parts for r in p.recordings),
        order=lined("order"),
        harmonic=lined("harmonic"),
        family=lined("family"),
        recording=np.concatenate([p.recording + b for p, b in zip(parts, begin, strict=False)]),
        amplitude=lined("amplitude"),
        noise=lined("noise"),
        shared=shared,
        path=lined("path", 1),
        kept=lined("kept"),
        point={c: np.concatenate([p.point[c] for p in parts]) for c in first.point},
        levels={
            c: (np.concatenate([p.levels[c][0] for p in parts]), words)
            for c, (_, words) in first.levels.items()
        },
    )


def model_errors(amplitude: Complex, order: Array, size: float) -> Complex:
    """Columns of one standard deviation each, (sensors, lines, r), of a relative error that varies with the order.

    Proportional to the given lines (measured ones that the ideal machine has), and common to lines within a few orders:
    pieces `REACH` orders long that overlap. Each sensor has its own.

    Parameters
    ----------
    amplitude : complex array (sensors, lines)
    order : array (lines,)
    size : float
        Relative standard uncertainty of either component.

    Examples
    --------
    >>> lines = np.array([[2.0 + 0j, 1.0, 0.0]])
    >>> found = model_errors(lines, np.array([66.0, 67.0, 68.0]), 0.1)
    >>> np.sqrt(np.sum(found.real**2, axis=-1)).round(3).tolist()
    [[0.2, 0.1, 0.0]]
    """
    centres = np.arange(np.floor(order.min() / REACH), np.ceil(order.max() / REACH) + 1) * REACH
    hats = np.clip(1 - np.abs(order - centres[:, None]) / REACH, 0, None)
    return _in_turn(amplitude, [size * np.sqrt(hat) for hat in hats if hat.any()])  # the hats add up to one


def path_errors(amplitude: Complex, offset: Array, size: float) -> Complex:
    """The same of a relative error that is common to lines at the same offset from every harmonic.

    How strongly planets are heard before and behind a sensor is the path's, for every harmonic and every load alike;
    it leaves the harmonics themselves alone.
    """
    places = np.round(offset, 6)
    return _in_turn(amplitude, [size * (places == place) for place in np.unique(places) if place])


def level_errors(amplitude: Complex, harmonic: NDArray[np.intp], size: float) -> Complex:
    """The same of a relative error that all given lines of a harmonic and all sensors have in common.

    How strong the ideal machine's own lines are at a load depends on flanks, inertia and damping that nobody knows;
    lines beside them, which only parts make that are not alike, need not be strong or weak with them.
    """
    numbers = [harmonic == h for h in np.unique(harmonic)]
    return np.stack([size * amplitude * one * turn for one in numbers for turn in (1, 1j)], axis=-1)


def _in_turn(amplitude: Complex, parts: Sequence[Array]) -> Complex:
    """Each part of each sensor's lines, along them and across."""
    found = []
    for sensor in range(amplitude.shape[0]):
        own = np.zeros_like(amplitude)
        own[sensor] = amplitude[sensor]
        found += [own * part * turn for part in parts for turn in (1, 1j)]
    return np.stack(found, axis=-1) if found else np.zeros((*amplitude.shape, 0), dtype=complex)
