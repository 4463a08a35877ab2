"""A table of operating points: one row a measured value, at its conditions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from specan.errors import InputError
from specan.models import Assembly
from specan.study.observation import Array, Observation, Strategy, Variable


@dataclass(frozen=True, eq=False)
class TableObservation(Observation):
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
    series, position
        Conditions of the lines of the whole table that these rows were taken from with the recording of each, and the
        places of the rows among them: effects may look at readings before.
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
    series: tuple[Mapping[str, Array], NDArray[np.intp]] | None = None
    position: NDArray[np.intp] | None = None
    lines: NDArray[np.int_] | None = None
    groups: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    replicate_group: NDArray[np.intp] | None = None
    kind: ClassVar[str] = "table"
    strategy: ClassVar[Strategy] = Strategy()

    def __post_init__(self) -> None:
        if not np.all(np.isfinite(self.measured)):
            raise InputError(f"{self.name} holds values that are not finite", remedy="remove those rows")

    # --- covariance ---------------------------------------------------------------------------

    @cached_property
    def sigma(self) -> Array:
        """Standard uncertainty of each row, all origins together."""
        return np.sqrt(self.covariance if self.covariance.ndim == 1 else np.diag(self.covariance))

    @cached_property
    def _root(self) -> Array:
        """C^(-1/2) for V = D C D with the correlations C: of all roots of V^(-1), C^(-1/2) D^(-1) is the one whose
        rows stay closest to the rows of the table."""
        correlation = self.covariance / np.outer(self.sigma, self.sigma)
        if not np.all(self.sigma > 0) or not np.all(np.isfinite(correlation)):
            raise InputError(
                f"{self.name}: the uncertainty of some rows is zero or not a number",
                remedy="give a standard uncertainty above zero for what is measured",
            )
        values, vectors = np.linalg.eigh(correlation)
        if values[0] < 1e-10:
            raise InputError(
                f"{self.name}: {self._alike(correlation)} so strongly correlated that they cannot be distinguished",
                remedy="remove rows that are copies; or declare a smaller model discrepancy or a larger reading "
                "uncertainty",
            )
        return np.asarray((vectors / np.sqrt(values)) @ vectors.T)

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
        return scaled if self._diagonal else np.asarray(self._root @ scaled)

    # --- rows ---------------------------------------------------------------------------------

    def place_of(self, row: int) -> str:
        """``line 61 of b.csv``."""
        if self.lines is None:
            return f"row {row + 1}"
        file = self.recordings[int(self._recording[row])]
        return f"line {int(self.lines[row])}" + (f" of {file}" if file else "")

    def take(self, mask: NDArray[np.bool_]) -> Self:
        """Keep some of the rows; effects that look at earlier readings still see those left out.

        How many degrees of freedom the kept repeats hold is not followed: `pure_error_dof` becomes 0.
        """
        keep = np.flatnonzero(mask) if np.asarray(mask).dtype == bool else np.asarray(mask)

        def some(values: Any) -> Any:
            return {n: v[keep] for n, v in values.items()} if isinstance(values, Mapping) else values[keep]

        per_row = ["observable", "measured", "conditions", "labels", "parts"]
        per_row += [name for name in ("lines", "replicate_group") if getattr(self, name) is not None]
        return replace(
            self,
            **{name: some(getattr(self, name)) for name in per_row},
            covariance=self.covariance[np.ix_(*[keep] * self.covariance.ndim)],
            recording=self._recording[keep],
            series=self._series,
            position=self._position[keep],
            pure_error_dof=0.0,
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
    def _table_lines(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """First row of each line of the tables, and the line of each row: a line may hold several observables."""
        if self.lines is None:
            return np.arange(self.n), np.arange(self.n)
        places = np.stack([self._recording, self.lines])
        _, first, line = np.unique(places, axis=1, return_index=True, return_inverse=True)
        return first, line.ravel()

    @cached_property
    def _series(self) -> tuple[Mapping[str, Array], NDArray[np.intp]]:
        first = self._table_lines[0]
        return self.series or ({n: v[first] for n, v in self.conditions.items()}, self._recording[first])

    @cached_property
    def _position(self) -> NDArray[np.intp]:
        return self._table_lines[1] if self.position is None else self.position

    # --- prediction ---------------------------------------------------------------------------

    @cached_property
    def _recorded(self) -> list[tuple[int, dict[str, Array], list[tuple[str, Any, Any]]]]:
        """Of each recording: conditions of its lines; of each observable the rows, and their places among the lines."""
        conditions, recording = self._series
        found = []
        for number in np.unique(self._recording):
            inside = np.flatnonzero(recording == number)
            picks = []
            for name in sorted(set(self.observable.tolist())):
                rows = np.flatnonzero((self._recording == number) & (self.observable == name))
                picks.append((name, rows, np.searchsorted(inside, self._position[rows])))
            found.append((int(number), {n: c[inside] for n, c in conditions.items()}, picks))
        return found

    def predict_many(self, assembly: Assembly, many: Sequence[Mapping[str, Any]]) -> Array:
        """Predictions for several sets of values, shape (n, len(many)). Each recording is evaluated as a whole."""
        table = np.empty((self.n, len(many)))
        of_recordings = {name for name, p in assembly.parameters.items() if p.per == "recording"}
        for number, conditions, picks in self._recorded:
            quantities = {name: assembly.model.observables[name].quantity for name, _, _ in picks}
            size = next(iter(conditions.values())).size
            own = [
                {n: v[number] if n in of_recordings and np.ndim(v) == 1 else v for n, v in values.items()}
                for values in many
            ]
            keys: list[Any] = list(range(len(own)))
            if of_recordings:  # values that differ by those of other recordings alone are alike here
                keys = [tuple(np.asarray(v).tobytes() for v in values.values()) for values in own]
            first = {key: k for k, key in reversed([*enumerate(keys)])}
            wanted = list(quantities.values())
            with np.errstate(all="ignore"):  # what is not finite is told by the fit, with its place
                each = assembly.evaluate_many(conditions, [own[k] for k in sorted(first.values())], wanted)
                for k, found in zip(sorted(first.values()), each, strict=True):
                    for name, rows, places in picks:
                        whole = np.broadcast_to(np.asarray(found[quantities[name]], float), (size,))
                        table[rows, k] = whole[places]
            for _, rows, _ in picks:
                table[rows] = table[rows][:, [first[key] for key in keys]]
        return table

    def by_row(self, assembly: Assembly, values: Mapping[str, Any]) -> dict[str, Any]:
        """Values with one element a row for parameters of each recording."""
        return {
            name: value[self._recording]
            if np.ndim(value) == 1 and assembly.parameters[name].per == "recording"
            else value
            for name, value in values.items()
        }
