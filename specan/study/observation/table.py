"""A table of operating points: one row a reading, conditions and one observable each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from specan.errors import InputError
from specan.models import Assembly
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
        """Predictions for several sets of values.

        Whole recordings are evaluated one after the other: an effect may look at earlier readings, also at those that
        are left out here.
        """
        conditions, recording = self._series
        quantities = {name: assembly.model.observables[name].quantity for name in self._rows}
        predicted = np.empty((self.n, len(many)))
        for number in np.unique(self._recording):
            here = np.flatnonzero(self._recording == number)
            inside = np.flatnonzero(recording == recording[self._position[here[0]]])
            rows = {name: here[mine[here]] for name, mine in self._rows.items()}
            lines = {n: column[inside] for n, column in conditions.items()}
            own = [
                {n: v[number] if _each_recording(assembly, n, v) else v for n, v in values.items()}
                for values in many
            ]
            with np.errstate(all="ignore"):  # what is not finite is told by the fit, with its place
                for k, found in enumerate(assembly.evaluate_many(lines, own, list(quantities.values()))):
                    for name, quantity in quantities.items():
                        whole = np.broadcast_to(np.asarray(found[quantity], float), inside.shape)
                        places = np.searchsorted(inside, self._position[rows[name]])
                        predicted[rows[name], k] = whole[places]
        return predicted

    def by_row(self, assembly: Assembly, values: Mapping[str, Any]) -> dict[str, Any]:
        """Values with one element a row for parameters of each recording."""
        return {
            name: value[self._recording] if _each_recording(assembly, name, value) else value
            for name, value in values.items()
        }


def _each_recording(assembly: Assembly, name: str, value: Any) -> bool:
    return (
        not isinstance(value, float) and np.ndim(value) == 1 and assembly.parameters[name].per == "recording"
    )


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
