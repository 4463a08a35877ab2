"""A table of operating points: one row a reading, conditions and one observable each."""

from __future__ import annotations

import weakref
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.errors import InputError
from specan.models import Assembly
from specan.study.observation import Array


@dataclass(frozen=True, eq=False)
class TableObservation:
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
    """

    name: str
    observable: NDArray[np.str_]
    measured: Array
    conditions: Mapping[str, Array]
    covariance: Array
    labels: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    recordings: tuple[str, ...] = ("",)
    recording: NDArray[np.intp] | None = None
    noise_dof: float = np.inf
    parts: Mapping[str, Array] = field(default_factory=dict)
    available: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        if not np.all(np.isfinite(self.measured)):
            raise InputError(f"{self.name} holds values that are not finite", remedy="remove those rows")

    @property
    def n(self) -> int:
        """Number of rows."""
        return int(self.measured.size)

    @property
    def n_effective(self) -> float:
        """Number of rows: what correlates them stands in the covariance."""
        return float(self.n)

    @cached_property
    def sigma(self) -> Array:
        """Standard uncertainty of each row, all origins together."""
        return np.sqrt(np.diag(self.covariance))

    @cached_property
    def _root(self) -> Array:
        try:
            return np.linalg.cholesky(self.covariance)
        except np.linalg.LinAlgError:
            raise InputError(
                f"{self.name}: the uncertainty of some rows is zero or not a number",
                remedy="give a standard uncertainty above zero for what is measured",
            ) from None

    @cached_property
    def _diagonal(self) -> bool:
        return not np.any(self.covariance[~np.eye(self.n, dtype=bool)])

    def whiten(self, array: Array) -> Array:
        """Apply V^(-1/2) (the inverse Cholesky factor) along axis 0."""
        if self._diagonal:
            return array / (self.sigma if array.ndim == 1 else self.sigma[:, None])
        from scipy.linalg import solve_triangular

        return solve_triangular(self._root, array, lower=True, check_finite=False)

    def take(self, mask: NDArray[np.bool_]) -> TableObservation:
        """Keep some of the rows."""
        return replace(
            self,
            observable=self.observable[mask],
            measured=self.measured[mask],
            conditions={name: values[mask] for name, values in self.conditions.items()},
            covariance=self.covariance[np.ix_(mask, mask)],
            labels={name: values[mask] for name, values in self.labels.items()},
            recording=self._recording[mask],
            parts={name: values[mask] for name, values in self.parts.items()},
        )

    @cached_property
    def _recording(self) -> NDArray[np.intp]:
        return np.zeros(self.n, dtype=np.intp) if self.recording is None else self.recording

    @cached_property
    def _rows(self) -> dict[str, NDArray[np.bool_]]:
        return {name: self.observable == name for name in sorted(set(self.observable.tolist()))}

    def predict(self, assembly: Assembly, values: Mapping[str, Any]) -> Array:
        """What the model expects in every row."""
        return self.predict_many(assembly, [values])[:, 0]

    def predict_many(self, assembly: Assembly, many: Sequence[Mapping[str, Any]]) -> Array:
        """Predictions for several sets of values, all in one pass where the model's parts allow it.

        The conditions are repeated once for each set and every parameter becomes one value a row. An
        effect that cannot take a parameter as an array (it asks ``if parameter > 0``) is found out on
        first use, and evaluated set by set from then on.
        """
        if len(many) == 1:
            return self._evaluate(assembly, many[0], 1)[:, None]
        varying = _varying(many)
        trust = _trust(assembly)
        trust.update({n: False for n in varying if assembly.parameters[n].per not in ("", "recording")})
        if all(trust.get(name, True) for name in varying):
            try:
                together = self._evaluate(assembly, self._spread(many, varying), len(many))
            except (TypeError, ValueError):
                trust.update(dict.fromkeys(varying, False))
            else:
                table = together.reshape(len(many), self.n).T
                if all(name in trust for name in varying):
                    return table
                single = self._one_by_one(assembly, many)
                same = np.allclose(table, single, rtol=1e-9, atol=0, equal_nan=True)
                trust.update(dict.fromkeys(varying, same))
                return single
        return self._one_by_one(assembly, many)

    def _one_by_one(self, assembly: Assembly, many: Sequence[Mapping[str, Any]]) -> Array:
        return np.stack([self._evaluate(assembly, values, 1) for values in many], axis=1)

    def _spread(self, many: Sequence[Mapping[str, Any]], varying: frozenset[str]) -> dict[str, Any]:
        """One set of values whose varying members hold one value a row of the repeated table."""
        spread = dict(many[0])
        for name in varying:
            spread[name] = np.concatenate([self._per_row(values[name]) for values in many])
        return spread

    def _per_row(self, value: Any) -> Array:
        value = np.asarray(value, dtype=float)
        return value[self._recording] if value.ndim else np.full(self.n, value)

    def _evaluate(self, assembly: Assembly, values: Mapping[str, Any], times: int) -> Array:
        """Predictions for the conditions repeated `times` times."""
        conditions = {
            name: np.tile(column, times) if times > 1 else column for name, column in self.conditions.items()
        }
        prepared = {}
        for name, value in values.items():
            vector = np.ndim(value) == 1 and assembly.parameters[name].per == "recording"
            prepared[name] = self._per_row(value) if vector and np.size(value) != self.n * times else value
        observables = assembly.model.observables
        wanted = [observables[name].quantity for name in self._rows]
        with np.errstate(all="ignore"):  # what is not finite is told by the fit, with its place
            found = assembly.evaluate(conditions, prepared, wanted)
        predicted = np.empty(self.n * times)
        for name, rows in self._rows.items():
            rows = np.tile(rows, times)
            value = np.asarray(found[observables[name].quantity], dtype=float)
            predicted[rows] = np.broadcast_to(value, rows.shape)[rows]
        return predicted


# model id -> (the model, {parameter: whether it may be an array over the rows}); forgotten with the model.
_TRUST: dict[int, tuple[weakref.ref[Any], dict[str, bool]]] = {}


def _trust(assembly: Assembly) -> dict[str, bool]:
    key = id(assembly.model)
    if key not in _TRUST:
        _TRUST[key] = (weakref.ref(assembly.model, lambda _: _TRUST.pop(key, None)), {})
    return _TRUST[key][1]


def _varying(many: Sequence[Mapping[str, Any]]) -> frozenset[str]:
    first = many[0]
    return frozenset(
        name
        for values in many[1:]
        for name, value in values.items()
        if value is not first[name] and not np.array_equal(value, first[name])
    )
