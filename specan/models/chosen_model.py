"""Effects and parameter values as a user writes them on a command line, and what such a model predicts."""

from __future__ import annotations

import copy
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.arrays import Real
from specan.errors import RequestError, require_known
from specan.models.effect import Use
from specan.models.model import Assembly, Model
from specan.units import convert


@dataclass(frozen=True)
class SimulatedChannel:
    """Samples of one channel in the unit of the quantity, and what an acquisition program would say of it."""

    name: str
    unit: str
    samples: Real
    sensitivity: float = 1.0
    sensitivity_unit: str = "V/V"
    properties: dict[str, object] = field(default_factory=dict)

    @property
    def volts(self) -> Real:
        """What the converter saw."""
        if self.unit == "V":
            return self.samples
        per_volt = self.sensitivity_unit.endswith("/V")
        scale = 1e-3 if self.sensitivity_unit.startswith("mm") else 1.0
        if per_volt:
            return self.samples / (self.sensitivity * scale)
        return self.samples * 1e-3 * self.sensitivity


@dataclass(frozen=True)
class ChosenModel:
    """A model with effects switched on and some parameter values, in SI."""

    assembly: Assembly
    values: dict[str, float]


def choose_model(model: Model, effects: Iterable[str] = (), without: Iterable[str] = ()) -> ChosenModel:
    """Switch on what a user asks for, beside the base effects.

    Parameters
    ----------
    effects : iterable of str
        ``seal-drag``; ``seal-drag=0.2`` (its first parameter, in that one's unit); ``seal-drag=200 mN*m``;
        ``windage.exponent=2.8``; ``wall-impedance@z1.beta=0.1``.
    without : iterable of str
        Base effects to switch off.

    Raises
    ------
    RequestError
        An effect or parameter that does not exist, a value that is not a number or outside the domain.

    Examples
    --------
    >>> from specan.models.catalogue import example_model
    >>> request = choose_model(example_model("worm-gear"), ["seal-drag=200 mN*m"], without=["churning"])
    >>> [str(use) for use in request.assembly.uses], request.values
    (['bearing-friction', 'seal-drag', 'tooth-friction'], {'seal-drag.torque': 0.2})
    """
    asked = [_split(model, text) for text in effects]
    dropped = set(without)
    for name in dropped:
        require_known(name, model.base_effects, f"{name!r} is not an effect of the base model")
    uses = {Use(name) for name in model.base_effects if name not in dropped} | {use for use, _, _ in asked}
    assembly = model.assemble(uses)
    values = {}
    for use, parameter, text in asked:
        if text is not None:
            full = f"{use}.{parameter or next(iter(model.effects[use.name].parameters))}"
            values[full] = _value(assembly, full, text)
    return ChosenModel(assembly, values)


def override(rig: Mapping[str, Any], texts: Iterable[str]) -> dict[str, Any]:
    """A rig file's content with some keys set otherwise.

    Parameters
    ----------
    rig : mapping
        The parsed file; it is left as it is.
    texts : iterable of str
        ``model.mesh=article``, ``oil.viscosity_40C_mm2_s=320``; the value as TOML writes it, quotes optional.

    Examples
    --------
    >>> override({"oil": {"density_kg_m3": 1000.0}}, ["oil.density_kg_m3=870", "model.mesh=article"])
    {'oil': {'density_kg_m3': 870}, 'model': {'mesh': 'article'}}
    """
    changed = copy.deepcopy(dict(rig))
    for text in texts:
        key, equals, value = text.partition("=")
        *path, last = key.strip().split(".")
        place: Any = changed
        for part in path:
            place = place.setdefault(part, {}) if isinstance(place, dict) else None
        if not equals or not isinstance(place, dict):
            raise RequestError(f"{text!r} cannot be set", expected="TABLE.KEY=VALUE of the rig file")
        try:
            place[last] = tomllib.loads(f"value = {value}")["value"]
        except tomllib.TOMLDecodeError:
            place[last] = value.strip()
    return changed


def _split(model: Model, text: str) -> tuple[Use, str, str | None]:
    """Use, parameter (may be empty), value (may be None) of one text."""
    name, equals, value = text.partition("=")
    use, _, parameter = name.strip().partition(".")
    if parameter and not equals:
        raise RequestError(f"{text!r} names a parameter without a value", expected=f"{text}=NUMBER")
    return Use.parse(use), parameter, value.strip() if equals else None


def _value(assembly: Assembly, full: str, text: str) -> float:
    """SI value of a parameter from a number, or a number and a unit."""
    require_known(full, assembly.parameters, f"there is no parameter {full!r}")
    parameter = assembly.parameters[full]
    number, _, unit = text.partition(" ")
    try:
        given = float(number)
    except ValueError:
        raise RequestError(
            f"{full} = {text!r} is not a number", expected=f"a number, in {parameter.unit}, or with its unit"
        ) from None
    value = float(convert(given, unit, parameter.received_unit)) if unit else parameter.to_si(given)
    if not parameter.si.lower <= value <= parameter.si.upper:
        low, high = parameter.domain
        raise RequestError(
            f"{full} = {text} is outside its domain", expected=f"{low} to {high} {parameter.unit}"
        )
    return value


Columns = dict[str, NDArray[np.float64]]


def grid(model: Model, axes: Mapping[str, Sequence[float]]) -> Columns:
    """Every combination of the values of some columns; the last column runs fastest.

    Examples
    --------
    >>> from specan.models.catalogue import example_model
    >>> rows = grid(example_model("worm-gear"), {"speed_rpm": [1500, 2000], "output_torque_Nm": [5, 10]})
    >>> rows["output_torque_Nm"]
    array([ 5., 10.,  5., 10.])
    """
    known = {c.column for c in model.conditions.values()}
    for column in axes:
        require_known(column, known, f"{model.name} has no condition {column!r}")
    rows = np.array(list(product(*axes.values())), dtype=float).T
    return dict(zip(axes, rows, strict=True))


def span(model: Model, condition: str) -> tuple[float, float]:
    """Limits of the rig for a condition, in the unit of its column."""
    known = model.conditions[condition]
    low, high = (float(convert(end, known.unit, known.column_unit)) for end in model.rig.limits[condition])
    return low, high


def to_conditions(model: Model, columns: Mapping[str, NDArray[np.float64]]) -> Columns:
    """SI conditions from the columns of a table; columns that are no condition are ignored."""
    return {
        c.name: np.asarray(convert(columns[c.column], c.column_unit, c.unit), dtype=float)
        for c in model.conditions.values()
        if c.column in columns
    }


def predict(chosen: ChosenModel, columns: Mapping[str, NDArray[np.float64]]) -> dict[str, Any]:
    """Values of the observables for each row, SI.

    Raises
    ------
    ComputationError
        A loop that an effect closes does not converge.
    """
    model = chosen.assembly.model
    nodes = [o.quantity for o in model.observables.values()]
    found = chosen.assembly.evaluate(to_conditions(model, columns), chosen.values, wanted=nodes)
    size = len(next(iter(columns.values())))
    return {
        name: np.array(np.broadcast_to(found[o.quantity], (size,)), dtype=float)
        for name, o in model.observables.items()
    }


def simulated_table(
    chosen: ChosenModel,
    columns: Mapping[str, NDArray[np.float64]],
    *,
    noise: float = 0.0,
    repeats: int = 1,
    seed: int = 0,
) -> Columns:
    """The table that would be measured: conditions and observables, one row a reading, in the columns' units.

    Parameters
    ----------
    chosen : ChosenModel
    columns : mapping
        Columns of the conditions, in their own units.
    noise : float
        Standard deviation of one reading of each observable, in its column's unit, normal and independent.
    repeats : int
        Readings of each condition, numbered in a column ``repeat`` where there are several.
    seed : int
        Of the noise.
    """
    rows = {name: np.tile(np.asarray(values, float), repeats) for name, values in columns.items()}
    size = len(next(iter(columns.values())))
    random = np.random.default_rng(seed)
    found = dict(rows)
    for name, values in predict(chosen, rows).items():
        observable = chosen.assembly.model.observables[name]
        shown = convert(values, observable.unit, observable.column_unit or observable.unit)
        found[observable.header] = np.asarray(shown) + noise * random.standard_normal(values.size)
    if repeats > 1:
        found["repeat"] = np.repeat(np.arange(1.0, repeats + 1), size)
    return found


def outside_validity(chosen: ChosenModel, columns: Mapping[str, NDArray[np.float64]]) -> list[str]:
    """What is to be said of ranges within which the effects hold and that some rows leave."""
    model, found = chosen.assembly.model, []
    ranges = chosen.assembly.validity
    if not ranges:
        return []
    quantities = [name for name in ranges if name in model.quantities]
    values = chosen.assembly.evaluate(to_conditions(model, columns), chosen.values, wanted=quantities)
    for name, (low, high) in ranges.items():
        value = np.asarray(values[name])
        rows = int(np.count_nonzero((value < low) | (value > high)))
        if rows:
            node = model.quantities.get(name) or model.conditions[name]
            within = f"{low:g} to {high:g} {node.unit}"
            found.append(f"{rows} rows have {name} outside {within}, where the effects' equations hold.")
    return found
