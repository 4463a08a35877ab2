"""Nodes of a model's graph: conditions, quantities; and what is measured of them.

What is measured is a quantity, and the column or channel, or the transfer function, that holds it. A rig says of
conditions what its limits are, and of both how uncertain they are.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from specan.arrays import Flags, Real
from specan.errors import RequestError, nearest, require_known
from specan.models.effect import Parameter, signature_of
from specan.units import base_unit, convert, scale_to

Columns = Mapping[str, Real]


class TableFault(Exception):
    """What is wrong with a table; whoever reads the file says which file and lines.

    Parameters
    ----------
    found : str
        What was found.
    rows : array of bool, optional
        The rows that it is true of; the whole table by default.
    expected, remedy : str
        See `specan.errors.SpecanError`.
    """

    def __init__(self, found: str, rows: Flags | None = None, expected: str = "", remedy: str = "") -> None:
        super().__init__(found)
        self.found, self.rows, self.expected, self.remedy = found, rows, expected, remedy


@dataclass(frozen=True)
class Completed:
    """Columns that replace those of the table, the step in which each row's value was printed, and notes.

    Attributes
    ----------
    columns, steps : mapping
        ``{header: array (rows,)}``; NaN where a value is unknown or of no use.
    notes : tuple of str
        What was worked out or left out, for a person.
    doubts : tuple of str
        What looks wrong, to be said beside every verdict.
    """

    columns: Columns
    steps: Columns
    notes: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()


@dataclass(frozen=True)
class TableRules:
    """What a model does with the columns of a table before they are compared with it.

    Attributes
    ----------
    complete : callable
        ``complete(columns, steps) -> Completed`` from the columns that a table has (in the units of their
        headers) and the steps in which they are printed. Raises `TableFault`.
    derivable : mapping
        ``{header: headers that it follows from}`` of conditions that a table need not hold.
    """

    complete: Callable[[Columns, Mapping[str, float]], Completed]
    derivable: Mapping[str, frozenset[str]] = field(default_factory=dict)


KIND = "transfer"  # kind of measurement that holds it


@dataclass(frozen=True)
class SettingError:
    """Standard uncertainty of setting a condition: a fraction of its value, and an absolute part in SI.

    Examples
    --------
    >>> float(SettingError(relative=0.03, absolute=4.0).at(100.0))
    5.0
    """

    relative: float = 0.0
    absolute: float = 0.0

    def at(self, value: Any) -> Any:
        """Standard uncertainty at a value, of the shape of the value."""
        import numpy as np

        return np.hypot(self.relative * np.abs(value), self.absolute)


@dataclass(frozen=True)
class Condition:
    """An operating condition: what the experimenter sets or reads, one value per row (or line).

    Attributes
    ----------
    name, unit, doc : str
        Its name, its SI unit, and what it is in a sentence.
    column, column_unit : str
        How a table names it and in which unit; inside, values are SI.
    default : float or None
        Used where the data have no such column, in `column_unit`; None makes the column necessary
        for whatever reads it. NaN says that it is not known then: what reads it does without, and what
        `needs` it cannot be tested.
    varies : bool
        False: never an axis along which a failure is looked for.
    usual_setting : SettingError or None
        Usual uncertainty of setting it; tells levels apart where the rig states none. An absolute one says that
        its scale has no zero that a percentage could be taken of (a temperature). With None rows that are merely
        near each other are no repeats.
    label : str
        What sentences and axes call it; by default the column without its unit.
    group : bool
        Whether the column holds names (of specimens, days), and the value is a name's number; see
        `specan.models.groups`.
    idles : str
        Name of the condition that tells whether rows near zero are runs of another kind (idling), which no bench names
        as its lower limit; empty where they are like the others.

    Examples
    --------
    >>> Condition("load", "N", "Load.", "pulling_load_kN", "kN").words
    'pulling load'
    """

    name: str
    unit: str
    doc: str
    column: str = ""
    column_unit: str = ""
    default: float | None = None
    varies: bool = True
    usual_setting: SettingError | None = None
    label: str = ""
    idles: str = ""
    group: bool = False

    @property
    def words(self) -> str:
        """Name in words."""
        if self.label:
            return self.label
        stem, _, suffix = self.column.rpartition("_")
        unit = "".join(c for c in self.column_unit.removeprefix("deg") if c.isalnum())
        return (stem if stem and suffix.lower() == unit.lower() else self.column or self.name).replace(
            "_", " "
        )

    @property
    def setting(self) -> SettingError:
        """The usual uncertainty of setting it, or a guess."""
        if self.usual_setting is not None:
            return self.usual_setting
        units = {self.unit, self.column_unit or self.unit}
        if any(convert(0.0, unit, base_unit(unit)) for unit in units):
            return SettingError(absolute=1.0)
        # 1 K at room temperature: a percentage of an absolute temperature is many degrees.
        return SettingError(relative=1 / 300 if base_unit(self.unit) == base_unit("K") else 0.02)

    @property
    def known(self) -> bool:
        """Whether there is a value without a column."""
        return self.default is not None and not math.isnan(self.default)


@dataclass(frozen=True)
class Quantity:
    """A quantity and the function that gives its base value from others.

    The names of the function's positional arguments are the quantities and conditions that it reads,
    in SI; its keyword-only arguments are Parameters. A constant is a function without arguments.
    """

    name: str
    unit: str
    doc: str
    function: Callable[..., Any]
    reads: tuple[str, ...]
    parameters: dict[str, Parameter]
    axes: tuple[str, ...] = ()
    reference: str = ""
    collection: bool = False
    opaque: bool = False  # a solver's own object: nothing to compare or to add to

    @property
    def is_parameter(self) -> bool:
        """Whether it is nothing but a parameter."""
        return not self.reads and set(self.parameters) == {"value"}

    @property
    def comparable(self) -> bool:
        """Whether its values are numbers: no collection, no object of a solver."""
        return not (self.collection or self.opaque)

    def __call__(self, *args: Any, **parameters: Any) -> Any:
        """The base value."""
        return self.function(*args, **parameters)


def quantity(
    *,
    unit: str,
    axes: tuple[str, ...] = (),
    reference: str = "",
    collection: bool = False,
    opaque: bool = False,
) -> Callable[[Callable[..., Any]], Quantity]:
    """Make a function a Quantity of its own name; its docstring's first line says what it is.

    Parameters
    ----------
    unit : str
        SI unit of what it returns.
    axes : tuple of str
        Model axes of a vector or matrix.
    reference : str
        Standard and clause, or paper.
    collection : bool
        It returns a tuple that effects append to (`joins`).
    opaque : bool
        Its value is not a number or array: units and finiteness are not checked.

    Returns
    -------
    callable
        Decorator that returns a Quantity.

    Examples
    --------
    >>> @quantity(unit="m/s")
    ... def sliding_speed(worm_speed, pitch_radius, cos_lead):
    ...     "Sliding speed in the mesh."
    ...     return worm_speed * pitch_radius / cos_lead
    >>> sliding_speed.reads
    ('worm_speed', 'pitch_radius', 'cos_lead')
    """

    def make(function: Callable[..., Any]) -> Quantity:
        name = getattr(function, "__name__", "quantity")
        reads, parameters = signature_of(function, name)
        doc = inspect.getdoc(function) or ""
        return Quantity(
            name, unit, doc.split("\n")[0], function, reads, parameters, axes, reference, collection, opaque
        )

    return make


def of_parameter(name: str, parameter: Parameter, doc: str = "") -> Quantity:
    """A quantity that is a parameter, so that effects can act on it and several functions read it."""
    doc = doc or parameter.doc or name
    return Quantity(name, parameter.received_unit, doc, lambda *, value: value, (), {"value": parameter})


def constant(
    name: str, value: Any, unit: str, doc: str, axes: tuple[str, ...] = (), *, opaque: bool = False
) -> Quantity:
    """A Quantity that a rig file fixes; an effect may still add to it or scale it.

    Parameters
    ----------
    name : str
        By which functions read it.
    value : float or array
        In `unit`.
    unit : str
        SI unit.
    doc : str
        What it is, in a sentence.
    axes : tuple of str
        Model axes of a vector.
    opaque : bool
        That it is no number: no effect adds to it.

    Returns
    -------
    Quantity
        Without parameters.
    """
    return Quantity(name, unit, doc, lambda: value, (), {}, axes, opaque=opaque)


def quantities_in(*modules: Any) -> list[Quantity]:
    """Every quantity of some modules, in the order in which they stand there."""
    return [value for module in modules for value in vars(module).values() if isinstance(value, Quantity)]


@dataclass(frozen=True)
class Observable:
    """What is measured: a quantity of the model and the column or channel that holds it.

    Attributes
    ----------
    name, quantity : str
        Its name, and the model's quantity that predicts it.
    unit : str
        SI unit of that quantity; results are printed in it.
    doc : str
        What it is, in a sentence.
    column, column_unit : str
        Header of a table's column and the unit of its values; by default made of name and unit.
    kind : str
        Kind of measurement that holds it: ``table``, ``frf``, ``orders``, ``transfer``, or one that an entry point
        brings.
    response, reference : str
        Of a transfer function, the channels whose quotient it is; empty where the measurement leaves no choice.
    averages : float
        Number of averages behind its lines, where files do not say it; 0 where it is not known.
    reading_of : str
        Another observable from whose reading it is worked out: it has the same relative uncertainty where
        the rig states none of its own.

    Examples
    --------
    >>> Observable("drag", "drag_torque", "N*m", "Drag.").header
    'drag_Nm'
    """

    name: str
    quantity: str
    unit: str
    doc: str
    column: str = ""
    column_unit: str = ""
    kind: str = "table"
    reading_of: str = ""
    response: str = ""
    reference: str = ""
    averages: float = 0.0

    @property
    def header(self) -> str:
        """Header under which a table holds it."""
        if self.column:
            return self.column
        unit = self.unit.replace("*", "").replace("/", "_per_").replace("^", "")
        return self.name if self.unit == "1" else f"{self.name}_{unit}"


@dataclass(frozen=True)
class Frf:
    """An observable that is a complex function of frequency: response over reference, exp(+j w t).

    Attributes
    ----------
    unit : str
        Of the quotient: ``um/N``. The measurement is converted to it.
    response, reference : str
        Channels of a recording, or nodes of a file of transfer functions (``2Z``). Without a name of its own, the
        response is called like the observable, and the reference is the only one that there is.
    uncertainty_percent, uncertainty : float, optional
        Standard uncertainty of the real and of the imaginary part of one line, in percent of the magnitude and in
        `unit`: for files that do not tell their own (by a column, or by coherence and number of averages).
    averages : float, optional
        Number of independent averages behind a line, for files that hold a coherence and do not say it.

    Examples
    --------
    >>> from specan.models import Model
    >>> def receptance(frequency, mass=2.0, stiffness=5e4, damping=12.0):
    ...     s = 2j * np.pi * frequency
    ...     return 1e6 / (mass * s**2 + damping * s + stiffness)
    >>> model = Model.from_function(
    ...     receptance, conditions={"frequency": ("Hz", 5, 60)},
    ...     observables={"receptance": Frf("um/N", response="2Z", reference="1Z")},
    ... )
    >>> import numpy as np
    >>> found = model.assemble().evaluate({"frequency": np.array([0.0, 25.0])})
    >>> found["receptance"].round(2).tolist()
    [(20+0j), (163.89-473.83j)]
    """

    unit: str
    response: str = ""
    reference: str = ""
    uncertainty_percent: float | None = None
    uncertainty: float | None = None
    averages: float | None = None


@dataclass(frozen=True)
class Reading:
    """An observable that is read from an instrument.

    Attributes
    ----------
    unit : str
        Of the column.
    uncertainty, percent : float, optional
        Standard uncertainty of one reading, in `unit` and in percent of the reading; both are added in squares.
    discrepancy : (str, float), optional
        A quantity of the model, and how many percent of it the model itself is expected to be wrong by: it changes
        smoothly over the operating range.

    Examples
    --------
    >>> from specan.models import Model
    >>> def drop(flow, resistance=2.0): return resistance * flow
    >>> def outlet(inlet, drop): return inlet - drop
    >>> model = Model.from_function(
    ...     outlet, drop, conditions={"flow": ("kg/s", 1, 9), "inlet": ("degC", 20, 80)},
    ...     observables={"outlet": Reading("degC", 0.05, percent=0.2, discrepancy=("drop", 0.5))},
    ...     units={"drop": "K"},
    ... )
    >>> model.rig.discrepancies
    {'outlet': ('drop', 0.5)}
    """

    unit: str
    uncertainty: float | None = None
    percent: float | None = None
    discrepancy: tuple[str, float] | None = None


@dataclass(frozen=True)
class RigStatement:
    """Limits and uncertainties of a rig, in SI, by the model's names of conditions and observables.

    Instrument errors that are common to all readings (a zero, a gain) are not here: they are effects that
    the model holds by a certificate, see `specan.models.model.Nuisance`.

    Attributes
    ----------
    limits : mapping
        ``{condition: (low, high)}`` that the rig can run.
    setting : mapping
        ``{condition: SettingError}`` of setting a condition anew.
    reading : mapping
        ``{observable or condition: standard uncertainty}`` of one reading.
    reading_percent : mapping
        The same in percent of the reading; added to `reading` in squares.
    discrepancy_percent : float
        Declared standard discrepancy of the model, in percent of what its effects do to the reading.
    defaults_used : mapping
        ``{"table.key": value}`` that the rig file did not give and the model assumed.
    discrepancies : mapping
        ``{observable: (quantity, percent)}`` where the model states it of one observable.
    """

    limits: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    setting: Mapping[str, SettingError] = field(default_factory=dict)
    reading: Mapping[str, float] = field(default_factory=dict)
    discrepancy_percent: float = 0.0
    reading_percent: Mapping[str, float] = field(default_factory=dict)
    defaults_used: Mapping[str, Any] = field(default_factory=dict)
    discrepancies: Mapping[str, tuple[str, float]] = field(default_factory=dict)


def rig_statement(
    rig: Mapping[str, Any], conditions: Iterable[Condition], observables: Iterable[Observable]
) -> RigStatement:
    """Read ``[limits]`` and ``[uncertainty]`` of a rig file by the columns of a model's conditions and observables.

    Parameters
    ----------
    rig : mapping
        The parsed rig file. ``[limits]`` holds ``COLUMN = [low, high]``. ``[uncertainty]`` holds
        ``COLUMN = sd`` of a reading, ``COLUMN_percent = sd`` of a reading in percent of it,
        ``COLUMN_setting_percent = sd`` or ``COLUMN_setting = sd`` of setting a
        condition, and ``model_discrepancy_percent``; values are in the column's unit.
    conditions, observables : iterable
        Those of the model.

    Raises
    ------
    RequestError
        A key that names no column; an uncertainty that is none.

    Examples
    --------
    >>> from specan.models import Condition, Observable
    >>> load = Condition("load", "N", "Load.", "load_kN", "kN")
    >>> stretch = Observable("stretch", "stretch", "m", "Stretch.", column="stretch_mm", column_unit="mm")
    >>> said = rig_statement(
    ...     {"limits": {"load_kN": [0, 2]}, "uncertainty": {"stretch_mm": 0.5, "load_kN_setting_percent": 1.0}},
    ...     [load], [stretch],
    ... )
    >>> said.limits, said.reading, said.setting
    ({'load': (0.0, 2000.0)}, {'stretch': 0.0005}, {'load': SettingError(relative=0.01, absolute=0.0)})
    """
    settable = {c.column: c for c in conditions}
    known: dict[str, Condition | Observable] = {**settable, **{o.header: o for o in observables}}
    limits: dict[str, tuple[float, float]] = {}
    for key, ends in dict(rig.get("limits", {})).items():
        require_known(key, settable, f"[limits] names {key!r}, which is not a condition")
        node = settable[key]
        numbers = [e for e in ends if isinstance(e, int | float)] if isinstance(ends, list | tuple) else []
        if len(numbers) != 2 or len(ends) != 2:
            raise RequestError(f"[limits] gives {key} = {ends}", expected="two numbers, [lowest, highest]")
        low, high = (float(convert(float(end), node.column_unit, node.unit)) for end in ends)
        limits[node.name] = (low, high)
    setting: dict[str, SettingError] = {}
    reading: dict[str, float] = {}
    percent: dict[str, float] = {}
    given = dict(rig.get("uncertainty", {}))
    for key, value in given.items():
        # 1e100: its square is a floating point number, in any unit
        if not isinstance(value, int | float) or not 0 <= value < 1e100:
            raise RequestError(
                f"[uncertainty] gives {key} = {value}", expected="a standard uncertainty, zero or more"
            )
    discrepancy = float(given.pop("model_discrepancy_percent", 0.0))
    for key, value in given.items():
        fitting = (("", known), ("_percent", known), ("_setting_percent", settable), ("_setting", settable))
        parts = [s for s, columns in fitting if key.endswith(s) and key.removesuffix(s) in columns]
        if not parts:
            usual = [*known, *(f"{c}_setting_percent" for c in settable), "model_discrepancy_percent"]
            raise RequestError(
                f"[uncertainty] has the key {key!r}, which names nothing", remedy=nearest(key, usual)
            )
        of = known[key.removesuffix(parts[0])]
        si = float(value) * scale_to(of.column_unit or of.unit, of.unit)
        if parts[0] == "":
            reading[of.name] = si
        elif parts[0] == "_percent":
            percent[of.name] = float(value)
        else:
            relative = parts[0] == "_setting_percent"
            setting[of.name] = SettingError(float(value) / 100) if relative else SettingError(absolute=si)
    return RigStatement(limits, setting, reading, discrepancy, percent)


def direction(values: Any, time: Any, least: float) -> Any:
    """+1 where values rose last by more than `least`, -1 where they fell, 0 before the first change.

    Examples
    --------
    >>> direction(np.array([1.0, 2.0, 2.01, 1.0]), np.arange(4.0), 0.1).tolist()
    [0.0, 1.0, 1.0, -1.0]
    """
    order = np.argsort(time, kind="stable")
    found, state, before = np.zeros(order.size), 0.0, values[order[0]]
    for row in order:
        if abs(values[row] - before) > least:
            state, before = float(np.sign(values[row] - before)), values[row]
        found[row] = state
    return found
