"""A table of operating points: one row a reading, conditions and one observable each.

Most effects treat every operating point by itself, and take a parameter that differs from row to row. Some do not: a
lag looks at the readings before, an effect may ask ``if parameter > 0``. Nothing declares this, so it is tried once.
"""

from __future__ import annotations

import weakref
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from specan.errors import ComputationError, InputError, RequestError
from specan.models import Assembly, Use
from specan.models.evaluation import Evaluation
from specan.study.observation import TABLE, Array, Fixed, Strategy, Variable


@dataclass(frozen=True, eq=False)
class TableObservation(Fixed):
    """Rows of one or several tables as an `Observation`.

    Attributes
    ----------
    observable : array of str, shape (n,)
        Observable that each row holds; its quantity and unit are the model's.
    covariance : array, shape (n, n) or (n,)
        V, in squared SI units of the rows; its diagonal where rows are independent.
    parts : mapping
        Standard uncertainty of each row by origin (``reading``, ``setting``, ``discrepancy``).
    recording : array of int, shape (n,)
        Index into `recordings`.
    known : bool
        False where the uncertainty is unknown: residuals can be shown, but nothing be concluded.
    series, position
        Conditions of the lines of the whole table that these rows were taken from, and their places among them.
    lines, replicate_group : array of int
        Line of each row in its file; rows that were meant to be alike share a replicate group.
    groups : mapping
        Names of the groups whose numbers are in `conditions`.
    """

    name: str
    observable: NDArray[np.str_]
    measured: Array
    conditions: Mapping[str, Array]
    covariance: Array
    labels: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    variables: Mapping[str, Variable] = field(default_factory=dict)
    recordings: tuple[str, ...] = ("",)
    recording: NDArray[np.intp] | None = None
    noise_dof: float = np.inf
    pure_error_dof: float = 0.0
    parts: Mapping[str, Array] = field(default_factory=dict)
    available: frozenset[str] = frozenset()
    known: bool = True
    series: tuple[Mapping[str, Array], NDArray[np.intp]] | None = None
    position: NDArray[np.intp] | None = None
    lines: NDArray[np.int_] | None = None
    groups: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    replicate_group: NDArray[np.intp] | None = None
    kind: ClassVar[str] = "table"
    strategy: ClassVar[Strategy] = TABLE

    def __post_init__(self) -> None:
        if not np.all(np.isfinite(self.measured)):
            raise InputError(f"{self.name} holds values that are not finite", remedy="remove those rows")

    @property
    def n(self) -> int:
        """Number of rows."""
        return int(self.measured.size)

    @property
    def n_effective(self) -> float:
        """Number of rows: what correlates them is in the covariance."""
        return float(self.n)

    @cached_property
    def sigma(self) -> Array:
        """Standard uncertainty of each row, all origins together."""
        return np.sqrt(self.covariance if self.covariance.ndim == 1 else np.diag(self.covariance))

    @cached_property
    def _root(self) -> InverseRoot:
        """C^(-1/2) for V = D C D with the correlations C: of all roots of V^(-1), C^(-1/2) D^(-1) is the one whose
        rows stay closest to the rows of the table."""
        correlation = self.covariance / np.outer(self.sigma, self.sigma)
        if not np.all(self.sigma > 0) or not np.all(np.isfinite(correlation)):
            raise InputError(
                f"{self.name}: the uncertainty of some rows is zero or not a number",
                remedy="give a standard uncertainty above zero for what is measured",
            )
        root = InverseRoot(
            correlation, np.arange(self.n) if self.replicate_group is None else self.replicate_group
        )
        if root.least < 1e-10:
            raise InputError(
                f"{self.name}: {self._alike(correlation)} so strongly correlated that they cannot be distinguished",
                remedy="remove rows that are copies; or declare a smaller model discrepancy or a larger reading "
                "uncertainty",
            )
        return root

    def _alike(self, correlation: Array) -> str:
        """The two rows that are correlated most, by their lines."""
        if self.lines is None:
            return "the rows are"
        upper = np.triu(correlation, 1)
        first, second = np.unravel_index(int(np.argmax(upper)), upper.shape)
        return f"lines {self.lines[first]} and {self.lines[second]}, among others, are"

    @cached_property
    def _diagonal(self) -> bool:
        return self.covariance.ndim == 1 or np.array_equal(self.covariance, np.diag(np.diag(self.covariance)))

    def whiten(self, array: Array) -> Array:
        """Apply V^(-1/2) along axis 0."""
        scaled = array / (self.sigma if array.ndim == 1 else self.sigma[:, None])
        return scaled if self._diagonal else self._root(scaled)

    def take(self, mask: NDArray[np.bool_]) -> TableObservation:
        """Keep some of the rows; effects that look at earlier readings still see those left out.

        How many degrees of freedom the kept repeats hold is not followed: `pure_error_dof` becomes 0.
        """
        keep = np.flatnonzero(mask) if np.asarray(mask).dtype == bool else np.asarray(mask)
        return replace(
            self,
            observable=self.observable[keep],
            measured=self.measured[keep],
            conditions={name: values[keep] for name, values in self.conditions.items()},
            covariance=self.covariance[np.ix_(*[keep] * self.covariance.ndim)],
            labels={name: values[keep] for name, values in self.labels.items()},
            recording=self._recording[keep],
            parts={name: values[keep] for name, values in self.parts.items()},
            series=self._series,
            position=self._position[keep],
            pure_error_dof=0.0,
            lines=None if self.lines is None else self.lines[keep],
            replicate_group=None if self.replicate_group is None else self.replicate_group[keep],
        )

    def without(self, rows: NDArray[np.intp]) -> TableObservation:
        """The other rows, kept: several models are fitted to them, and the root of their covariance takes longest."""
        key = rows.tobytes()
        if key not in self._left:
            self._left[key] = self.take(~np.isin(np.arange(self.n), rows))
        return self._left[key]

    @cached_property
    def _left(self) -> dict[bytes, TableObservation]:
        return {}

    @cached_property
    def _recording(self) -> NDArray[np.intp]:
        return np.zeros(self.n, dtype=np.intp) if self.recording is None else self.recording

    @cached_property
    def _lines(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """First row of each line of the tables, and the line of each row."""
        if self.lines is None:
            return np.arange(self.n), np.arange(self.n)
        places = np.stack([self._recording, self.lines])
        _, first, line = np.unique(places, axis=1, return_index=True, return_inverse=True)
        return first, line.ravel()

    @cached_property
    def _series(self) -> tuple[Mapping[str, Array], NDArray[np.intp]]:
        if self.series is not None:
            return self.series
        first, _ = self._lines
        return {n: values[first] for n, values in self.conditions.items()}, self._recording[first]

    @cached_property
    def _position(self) -> NDArray[np.intp]:
        return self._lines[1] if self.position is None else self.position

    @cached_property
    def _rows(self) -> dict[str, NDArray[np.bool_]]:
        return {name: self.observable == name for name in sorted(set(self.observable.tolist()))}

    def predict(self, assembly: Assembly, values: Mapping[str, Any]) -> Array:
        """What the model expects in every row."""
        return self.predict_many(assembly, [values])[:, 0]

    def predict_many(self, assembly: Assembly, many: Sequence[Mapping[str, Any]]) -> Array:
        """Predictions for several sets of values; what does not depend on what changed is kept."""
        if rows_are_coupled(assembly, self._series[0]):
            return np.stack([self._in_order(assembly, values) for values in many], axis=1)
        found = self._evaluated(assembly, many[:1])
        table = np.repeat(self._picked(assembly, found, 1), len(many), axis=1)
        alike: dict[
            frozenset[str], dict[int, list[str]]
        ] = {}  # what is worked out anew, and by what, set by set
        for k, values in enumerate(many):
            moved = [n for n, v in values.items() if v is not many[0][n] and _differ(v, many[0][n])]
            if moved:
                alike.setdefault(assembly.downstream(tuple(moved)), {})[k] = moved
        for touched, sets in alike.items():
            moved = sorted({name for names in sets.values() for name in names})
            chosen = [many[k] for k in sets]
            table[:, list(sets)] = self._together(assembly, chosen, found, touched, moved)
        return table

    def _together(
        self,
        assembly: Assembly,
        many: Sequence[Mapping[str, Any]],
        before: Evaluation,
        touched: frozenset[str],
        moved: Sequence[str],
    ) -> Array:
        """Predictions that differ from an evaluation by some parameters: in one pass, with a value of them each row.

        Whether the functions take that is tried once for each parameter.
        """
        vector = _facts(assembly).vector
        vector.update({n: False for n in moved if assembly.parameters[n].per not in ("", "recording")})
        table = None
        if len(many) > 1 and all(vector.get(name, True) for name in moved):
            after = self._repeated(assembly, before, assembly.read_by(touched), len(many))
            try:
                found = None if after is None else self._evaluated(assembly, many, after, moved)
                table = None if found is None else self._picked(assembly, found, len(many))
            except (
                TypeError,
                ValueError,
                RequestError,
            ):  # "the truth value of an array is ambiguous" and its kin
                vector.update(dict.fromkeys(moved, False))
        if table is not None and all(name in vector for name in moved):
            return table
        one_by_one = [self._evaluated(assembly, [values], before, moved) for values in many]
        single = np.hstack([self._picked(assembly, found, 1) for found in one_by_one])
        if table is not None:
            vector.update(dict.fromkeys(moved, np.allclose(table, single, rtol=1e-9, atol=0, equal_nan=True)))
        return single

    def _evaluated(
        self,
        assembly: Assembly,
        many: Sequence[Mapping[str, Any]],
        after: Evaluation | None = None,
        moved: Sequence[str] = (),
    ) -> Evaluation:
        """The model at some sets of values, the rows once for each; `after` as in `Evaluator.evaluate`."""
        times, wanted = len(many), list(self._quantities(assembly).values())
        conditions = {name: np.tile(column, times) for name, column in self.conditions.items()}
        values = self.by_row(assembly, many[0], times)
        if times > 1:
            values |= {n: np.concatenate([self._per_row(one[n]) for one in many]) for n in moved}
        with np.errstate(all="ignore"):  # what is not finite is told by the fit, with its place
            return assembly.evaluate(conditions, values, wanted, after, moved)

    def _repeated(
        self, assembly: Assembly, before: Evaluation, names: frozenset[str], times: int
    ) -> Evaluation | None:
        """Some quantities for the rows repeated; None where it is not clear which axis is that of the rows."""
        repeated = {}
        for name in before.values.keys() & names:
            quantity, value = assembly.model.quantities[name], before.values[name]
            axes = len(quantity.axes)
            if quantity.collection:
                return None
            if np.ndim(value) > axes:
                if np.ndim(value) != axes + 1 or value.shape[-1] != self.n:
                    return None
                value = np.concatenate([value] * times, axis=-1)  # a fifth of the time of tile
            repeated[name] = value
        return Evaluation(repeated, {})

    def _per_row(self, value: Any) -> Array:
        value = np.asarray(value, dtype=float)
        return value[self._recording] if value.ndim else np.full(self.n, value)

    def _picked(self, assembly: Assembly, found: Evaluation, times: int) -> Array:
        """The observable of every row, one column for each set of values."""
        picked = np.empty((self.n, times))
        for name, quantity in self._quantities(assembly).items():
            value = np.broadcast_to(np.asarray(found[quantity], float), self.n * times).reshape(times, self.n)
            picked[self._rows[name]] = value.T[self._rows[name]]
        return picked

    def _quantities(self, assembly: Assembly) -> dict[str, str]:
        """The model's quantity of every observable of this table."""
        return {name: assembly.model.observables[name].quantity for name in self._rows}

    def _in_order(self, assembly: Assembly, values: Mapping[str, Any]) -> Array:
        """Predictions of an effect that looks at earlier rows: whole recordings, one after the other."""
        conditions, recording = self._series
        quantities = self._quantities(assembly)
        predicted = np.empty(self.n)
        for number in np.unique(self._recording):
            inside = np.flatnonzero(recording == number)
            mine = self._recording == number
            rows = np.searchsorted(inside, self._position[mine])
            own = {
                n: v[number] if np.ndim(v) == 1 and assembly.parameters[n].per == "recording" else v
                for n, v in values.items()
            }
            here = {n: c[inside] for n, c in conditions.items()}
            with np.errstate(all="ignore"):
                found = assembly.evaluate(here, own, list(quantities.values()))
            whole = {n: np.broadcast_to(np.asarray(found[q]), inside.shape) for n, q in quantities.items()}
            predicted[mine] = [whole[name][k] for name, k in zip(self.observable[mine], rows, strict=True)]
        return predicted

    def by_row(self, assembly: Assembly, values: Mapping[str, Any], times: int = 1) -> dict[str, Any]:
        """Values with one element a row for parameters of each recording, rows repeated `times` times."""
        return {
            name: np.tile(value[self._recording], times)
            if not isinstance(value, float)
            and np.ndim(value) == 1
            and assembly.parameters[name].per == "recording"
            else value
            for name, value in values.items()
        }


def _differ(one: Any, other: Any) -> bool:
    if isinstance(one, float) and isinstance(other, float):
        return one != other  # a twentieth of the time of what follows, and there are many
    return not np.array_equal(one, other)


@dataclass
class _Facts:
    """What was found out about the effects and parameters of one model."""

    coupled: dict[Use, bool] = field(default_factory=dict)
    vector: dict[str, bool] = field(default_factory=dict)


# model id -> (the model, what is known); forgotten together with the model
_KNOWN: dict[int, tuple[weakref.ref[Any], _Facts]] = {}


def _facts(assembly: Assembly) -> _Facts:
    key = id(assembly.model)
    if key not in _KNOWN:
        _KNOWN[key] = (weakref.ref(assembly.model, lambda _: _KNOWN.pop(key, None)), _Facts())
    return _KNOWN[key][1]


def rows_are_coupled(assembly: Assembly, conditions: Mapping[str, Array]) -> bool:
    """Whether an effect of the assembly looks from one row at another.

    Tried at the default values: every second row alone must give what it gives among the others.
    """
    known, model = _facts(assembly).coupled, assembly.model
    for use in assembly.uses:
        if use in known:
            continue
        half = {name: column[::2] for name, column in conditions.items()}
        alone, changed = model.assemble([*model.base_effects, use]), model.effects[use.name].changes
        try:
            with np.errstate(all="ignore"):
                whole, part = alone.evaluate(conditions, None, changed), alone.evaluate(half, None, changed)
        except ComputationError:  # nothing is known where the defaults have no solution
            known[use] = True
            continue
        pairs = [(np.asarray(whole[name]), np.asarray(part[name])) for name in changed
                 if not model.quantities[name].collection]  # fmt: skip
        known[use] = len(pairs) < len(changed) or not all(
            np.allclose(one[..., ::2], two, rtol=1e-9, atol=0, equal_nan=True)
            for one, two in pairs
            if one.ndim
        )
    return any(known[use] for use in assembly.uses)


class InverseRoot:
    """C^(-1/2) for a correlation matrix C, the symmetric one.

    Rows i, j are alike where C_ik = C_jk for every other row k, and C_ij is the same for all pairs of a set. With S,
    whose columns are the indicators of the sets over the root of their sizes m, C is S A S' on their span, A = S' C S,
    and 1 - C_ij on the contrasts of each set. So its root is S A^(-1/2) S' and a number for each contrast: of m
    repeats of each row an eighth of the work for m = 2, a quarter of the numbers to multiply with.

    Parameters
    ----------
    correlation : array, shape (n, n)
    sets : array of int, shape (n,)
        Rows that may be alike share a number; those that are not alike after all are taken one by one.

    Attributes
    ----------
    least : float
        Least eigenvalue of C.
    """

    def __init__(self, correlation: Array, sets: NDArray[np.intp]) -> None:
        _, self._set, counts = np.unique(_alike(correlation, sets), return_inverse=True, return_counts=True)
        self._order = np.argsort(self._set, kind="stable")
        self._starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
        self._share = (1 / np.sqrt(counts))[self._set]
        self._single = bool(np.all(counts == 1))
        values, vectors = np.linalg.eigh(self._together(self._together(correlation).T))
        first, second = self._order[self._starts], self._order[self._starts + (counts > 1)]
        contrasts = np.where(counts > 1, 1 - correlation[first, second], 1.0)
        self.least = float(min(values[0], contrasts.min()))
        if self.least > 0:
            self._root = (vectors / np.sqrt(values)) @ vectors.T
            self._of_contrast = (1 / np.sqrt(contrasts))[self._set]

    def __call__(self, array: Array) -> Array:
        """The root on an array, shape (n,) or (n, k)."""
        if self._single:
            return np.asarray(self._root @ array)
        shape = (-1,) + (1,) * (array.ndim - 1)
        share = self._share.reshape(shape)
        common = self._together(array)
        apart = (array - share * common[self._set]) * self._of_contrast.reshape(shape)
        return np.asarray(share * (self._root @ common)[self._set] + apart)

    def _together(self, array: Array) -> Array:
        """S' on an array."""
        if self._single:
            return array
        share = self._share.reshape((-1,) + (1,) * (array.ndim - 1))
        return np.asarray(np.add.reduceat((share * array)[self._order], self._starts, axis=0))


def _alike(correlation: Array, sets: NDArray[np.intp]) -> NDArray[np.intp]:
    """Number of the set of each row; a row in a set that is not of alike ones gets its own."""
    own = np.arange(sets.size)
    _, first, index = np.unique(sets, return_index=True, return_inverse=True)
    if first.size == sets.size:
        return own
    same = sets[:, None] == sets
    inside = np.where(same & (own[:, None] != own), correlation, np.nan)
    unlike = np.any(~same & (correlation != correlation[first[index]]), axis=1)
    with np.errstate(invalid="ignore"):
        low, high = np.fmin.reduce(inside, axis=1), np.fmax.reduce(inside, axis=1)
    unlike |= (low != high) & ~np.isnan(low)
    unlike |= low != low[first[index]]
    spoiled = np.bincount(index, unlike) > 0
    return np.where(spoiled[index], first.size + own, index)
