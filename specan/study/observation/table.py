"""A table of operating points: one row a reading, conditions and one observable each.

What may be evaluated in one pass over many rows is found out once for each effect and parameter. Most effects treat
every operating point by itself, and take a parameter that differs from row to row. Some do not: a lag looks at the
readings before, an effect may ask ``if parameter > 0``. Nothing declares this, so it is tried.
"""

from __future__ import annotations

import weakref
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import compress
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from specan.errors import ComputationError, InputError
from specan.models import Assembly, Use
from specan.models.evaluation import Evaluation
from specan.study.observation import TABLE, Array, Fixed, Strategy, Variable

KEPT = 8  # evaluations, one an assembly: a search goes back and forth between few
WORTH_A_PASS = 2000  # values for which calling a model's functions costs less than what they compute


@dataclass(frozen=True, eq=False)
class TableObservation(Fixed):
    """Rows of one or several tables as an `Observation`.

    Attributes
    ----------
    observable : array of str, shape (n,)
        Observable that each row holds; its quantity and unit are the model's.
    covariance : array, shape (n, n)
        V, in squared SI units of the rows.
    parts : mapping
        Standard uncertainty of each row by origin (``reading``, ``setting``, ``discrepancy``).
    recording : array of int, shape (n,)
        Index into `recordings`.
    known : bool
        False where the uncertainty is unknown: residuals can be shown, but nothing be concluded.
    series, position
        Conditions of the whole table that these rows were taken from, and their places in it.
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
        return np.sqrt(np.diag(self.covariance))

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
        return not np.any(self.covariance[~np.eye(self.n, dtype=bool)])

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
            covariance=self.covariance[np.ix_(keep, keep)],
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
    def _series(self) -> tuple[Mapping[str, Array], NDArray[np.intp]]:
        return (self.conditions, self._recording) if self.series is None else self.series

    @cached_property
    def _position(self) -> NDArray[np.intp]:
        return np.arange(self.n) if self.position is None else self.position

    @cached_property
    def _rows(self) -> dict[str, NDArray[np.bool_]]:
        return {name: self.observable == name for name in sorted(set(self.observable.tolist()))}

    def predict(self, assembly: Assembly, values: Mapping[str, Any]) -> Array:
        """What the model expects in every row."""
        if rows_are_coupled(assembly, self.conditions):
            return self._in_order(assembly, values)
        last = self._last(assembly)
        after, changed = (last.found, last.changed(values)) if last else (None, ())
        conditions = {name: column.copy() for name, column in self.conditions.items()}
        wanted, prepared = list(self._quantities(assembly).values()), self.by_row(assembly, values)
        with np.errstate(all="ignore"):  # what is not finite is told by the fit, with its place
            found = assembly.evaluate(conditions, prepared, wanted, after, changed)
        self._evaluated.pop(assembly.uses, None)
        self._evaluated[assembly.uses] = _Evaluated(assembly, values, found)
        if len(self._evaluated) > KEPT:
            del self._evaluated[next(iter(self._evaluated))]
        return self._picked(assembly, found, 1)

    def predict_many(self, assembly: Assembly, many: Sequence[Mapping[str, Any]]) -> Array:
        """Predictions for several sets of values, all in one pass where the model's parts allow it.

        The conditions are repeated once for each set and every parameter becomes one value a row. What
        is not available so is found out on first use, and evaluated set by set from then on.
        """
        varying = _varying(many)
        vector = knowledge(assembly).vector
        vector.update({n: False for n in varying if assembly.parameters[n].per not in ("", "recording")})
        table = None
        together = len(many) > 1 and all(vector.get(name, True) for name in varying)
        if together and not rows_are_coupled(assembly, self.conditions):
            try:
                self.predict(assembly, _middle(many))
            except ComputationError:  # a loop that settles at the sets themselves may not do so between them
                self.predict(assembly, many[0])
            try:
                table = self._together(assembly, many)
            except (TypeError, ValueError):  # "the truth value of an array is ambiguous" and its kin
                vector.update(dict.fromkeys(varying, False))
        if table is not None and all(name in vector for name in varying):
            return table
        single = np.stack([self.predict(assembly, values) for values in many], axis=1)
        if table is not None:
            same = np.allclose(table, single, rtol=1e-9, atol=0, equal_nan=True)
            vector.update(dict.fromkeys(varying, same))
        return single

    def _together(self, assembly: Assembly, many: Sequence[Mapping[str, Any]]) -> Array:
        """Predictions for several sets of values: sets that change much the same quantities in one pass.

        What none of them changes is taken from the evaluation before.
        """
        before = self._evaluated[assembly.uses]
        changed = tuple(before.changed_in(many))
        if (assembly.uses, changed) not in self._passes:
            reached = [assembly.downstream(names) for names in changed]
            self._passes[assembly.uses, changed] = _grouped(reached, self.n)
        table, wanted = np.empty((self.n, len(many))), list(self._quantities(assembly).values())
        for touched, members in self._passes[assembly.uses, changed]:
            sets, times = [many[k] for k in members], len(members)
            after = before.repeated(assembly.read_by(touched, wanted), self.n, times)
            moved = sorted({name for k in members for name in changed[k]})
            conditions = {name: np.concatenate([c] * times) for name, c in self.conditions.items()}
            values = self.by_row(assembly, self._spread(sets, moved), times)
            with np.errstate(all="ignore"):
                found = assembly.evaluate(conditions, values, wanted, after, moved)
            table[:, members] = self._picked(assembly, found, times).reshape(times, self.n).T
        return table

    @cached_property
    def _passes(self) -> dict[Any, list[tuple[frozenset[str], list[int]]]]:
        """Which of several sets of values are evaluated together, by what changes in each of them."""
        return {}

    def _picked(self, assembly: Assembly, found: Evaluation, times: int) -> Array:
        """The observable of every row."""
        quantities, predicted = self._quantities(assembly), np.empty(self.n * times)
        for name, rows in self._rows.items():
            value = np.asarray(found[quantities[name]], float)
            if len(self._rows) == 1 and value.shape == predicted.shape:
                return value.copy()
            rows = np.tile(rows, times)
            predicted[rows] = np.broadcast_to(value, rows.shape)[rows]
        return predicted

    def _last(self, assembly: Assembly) -> _Evaluated | None:
        last = self._evaluated.get(assembly.uses)
        return last if last is not None and last.assembly is assembly else None

    @cached_property
    def _evaluated(self) -> dict[tuple[Use, ...], _Evaluated]:
        """The last evaluation of some assemblies, the one that was used last at the end."""
        return {}

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

    def _spread(self, many: Sequence[Mapping[str, Any]], varying: Iterable[str]) -> dict[str, Any]:
        """One set of values whose varying members hold one value a row of the repeated table."""
        spread = dict(many[0])
        for name in varying:
            values = [one[name] for one in many]
            if isinstance(values[0], float):
                spread[name] = np.repeat(values, self.n)
            else:
                spread[name] = np.concatenate([self._per_row(value) for value in values])
        return spread

    def _per_row(self, value: Any) -> Array:
        value = np.asarray(value, dtype=float)
        return value[self._recording] if value.ndim else np.full(self.n, value)

    def by_row(self, assembly: Assembly, values: Mapping[str, Any], times: int = 1) -> dict[str, Any]:
        """Values with one element a row for parameters of each recording, rows repeated `times` times."""
        prepared = dict(values)
        for name, value in values.items():
            if (
                isinstance(value, float)
                or np.ndim(value) != 1
                or assembly.parameters[name].per != "recording"
            ):
                continue
            if np.size(value) != self.n * times:
                prepared[name] = np.tile(np.asarray(value, dtype=float)[self._recording], times)
        return prepared

    def _quantities(self, assembly: Assembly) -> dict[str, str]:
        """The model's quantity of every observable of this table."""
        return {name: assembly.model.observables[name].quantity for name in self._rows}


@dataclass(frozen=True)
class _Evaluated:
    """Quantities at some values of the parameters, from which others at the same conditions are worked out."""

    assembly: Assembly
    values: Mapping[str, Any]
    found: Evaluation

    def changed(self, values: Mapping[str, Any]) -> tuple[str, ...]:
        """Parameters that have other values."""
        own = self.values
        return tuple(n for n, v in values.items() if n not in own or (v is not own[n] and _differ(v, own[n])))

    def changed_in(self, many: Sequence[Mapping[str, Any]]) -> list[tuple[str, ...]]:
        """The same for several sets of values of the same parameters."""
        own, names, moved = self.values, [], []
        for name in many[0]:
            values, value = [one[name] for one in many], own.get(name)
            if _all_equal(values, value):
                continue
            names.append(name)
            moved.append(
                [v != value for v in values]
                if isinstance(value, float)
                else [_differ(v, value) for v in values]
            )
        return [tuple(compress(names, of_one)) for of_one in zip(*moved, strict=True)] or [()] * len(many)

    def repeated(self, names: Iterable[str], rows: int, times: int) -> Evaluation | None:
        """Some of the quantities for the rows repeated; None where it is not clear which axis is that of the rows."""
        repeated, known = {}, self.found.values
        for name in names:
            if name not in known:
                continue
            value, axes = known[name], len(self.assembly.model.quantities[name].axes)
            if np.ndim(value) > axes:
                if np.ndim(value) != axes + 1 or value.shape[-1] != rows:
                    return None
                value = np.concatenate([value] * times, axis=-1)  # a fifth of the time of tile
            repeated[name] = value
        return Evaluation(repeated, {})


def _varying(many: Sequence[Mapping[str, Any]]) -> frozenset[str]:
    return frozenset(n for n, value in many[0].items() if not _all_equal([one[n] for one in many], value))


def _middle(many: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """The point that most of the sets share most values with: of a stencil its centre."""
    middle = dict(many[0])
    for name, value in many[0].items():
        if isinstance(value, float) and 2 * [one[name] for one in many].count(value) < len(many):
            middle[name] = many[-1][name]
    return middle


def _grouped(touched: Sequence[frozenset[str]], rows: int) -> list[tuple[frozenset[str], list[int]]]:
    """Sets of values that are worth one pass together, by the quantities that each changes."""

    def cost(names: frozenset[str], count: int) -> int:
        return len(names) * (WORTH_A_PASS + count * rows)

    groups: dict[frozenset[str], list[int]] = {}
    for k, names in enumerate(touched):
        groups.setdefault(names, []).append(k)
    while True:
        sized = [(names, len(members)) for names, members in groups.items()]
        saved, one, other = max(
            (
                (cost(a, m) + cost(b, n) - cost(a | b, m + n), a, b)
                for k, (a, m) in enumerate(sized)
                for b, n in sized[:k]
            ),
            key=lambda merged: merged[0],
            default=(0, frozenset[str](), frozenset[str]()),
        )
        if saved <= 0:
            return list(groups.items())
        members = sorted([*groups.pop(one), *groups.pop(other)])
        groups[one | other] = sorted([*groups.get(one | other, []), *members])


def _all_equal(values: list[Any], value: Any) -> bool:
    """Whether all are the same; most parameters are, and lists count them quickly."""
    if isinstance(value, float):
        return values.count(value) == len(values)
    return not any(other is not value and _differ(other, value) for other in values)


def _differ(one: Any, other: Any) -> bool:
    if isinstance(one, float) and isinstance(other, float):
        return one != other  # a twentieth of the time of what follows, and there are many
    return not np.array_equal(one, other)


@dataclass
class Knowledge:
    """What was found out about the effects and parameters of one model."""

    coupled: dict[Use, bool] = field(default_factory=dict)
    vector: dict[str, bool] = field(default_factory=dict)


# model id -> (the model, what is known); forgotten together with the model
_KNOWN: dict[int, tuple[weakref.ref[Any], Knowledge]] = {}


def knowledge(assembly: Assembly) -> Knowledge:
    """What is known about the model of an assembly."""
    key = id(assembly.model)
    if key not in _KNOWN:
        _KNOWN[key] = (weakref.ref(assembly.model, lambda _: _KNOWN.pop(key, None)), Knowledge())
    return _KNOWN[key][1]


def rows_are_coupled(assembly: Assembly, conditions: Mapping[str, Array]) -> bool:
    """Whether an effect of the assembly looks from one row at another.

    Tried at the default values: every second row alone must give what it gives among the others.
    """
    known, model = knowledge(assembly).coupled, assembly.model
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
