"""A model made of an FMU and the TOML file beside it."""

from __future__ import annotations

import inspect
import itertools
import math
import re
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, Field, model_validator

from specan.errors import RequestError, library, require_known
from specan.fmu.process import FmuProcess
from specan.models.effect import Effect, Parameter, effect
from specan.models.model import Model
from specan.schema import Settings, parse, read_toml
from specan.units import base_unit, convert, is_compatible


def _identifier(name: str) -> str:
    if not name.isidentifier():
        raise ValueError(
            "a name of letters, digits and underscores; name the FMU's variable under 'variable'"
        )
    return name


Name = Annotated[str, AfterValidator(_identifier)]
Positive = Annotated[float, Field(gt=0)]


class Variable(Settings):
    """A variable of the FMU, under a name and a unit of one's own."""

    variable: str = ""
    unit: str = ""


class ConditionEntry(Variable):
    """What the experimenter sets: a constant input or a parameter of the FMU, one value a row."""

    low: float
    high: float


class ObservableEntry(Variable):
    """What is measured: an output of the FMU."""

    uncertainty: float | None = None


class ParameterEntry(Variable):
    """What a fit may change: a parameter of the FMU."""

    value: float
    min: Annotated[float, Field(allow_inf_nan=True)] = -math.inf
    max: Annotated[float, Field(allow_inf_nan=True)] = math.inf
    lower: float | None = None
    upper: float | None = None
    fixed: bool = False


class EffectParameterEntry(ParameterEntry):
    """A parameter of an effect; where it is `neutral`, the effect vanishes. Without that it is a shape."""

    neutral: float | None = None


class EffectEntry(Settings):
    """A candidate effect that the FMU can switch on."""

    doc: str = ""
    reference: str = ""
    switch: str = ""
    parameters: dict[Name, EffectParameterEntry] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _does_something(self) -> EffectEntry:
        if not self.switch and not any(p.neutral is not None for p in self.parameters.values()):
            raise ValueError("an effect needs a switch, or a parameter with a neutral value")
        return self


class Simulation(Settings):
    """How one row is simulated: with constant inputs, from the FMU's start to `duration`.

    Attributes
    ----------
    duration : float
        s; outputs are read there.
    step : float, optional
        s, of the communication; the FMU's own by default.
    average : float
        s before the end over which outputs are averaged; 0 for the last value.
    kind : str, optional
        Co-simulation where the FMU has it.
    tolerance : float
        Relative, of the integration. Derivatives are differences: they need more digits than a curve.
    time_limit : float
        s of computing for one row; longer is an error.
    """

    duration: Positive = 1.0
    step: Positive | None = None
    average: Annotated[float, Field(ge=0)] = 0.0
    kind: Literal["co-simulation", "model-exchange"] | None = None
    tolerance: Positive = 1e-8
    time_limit: Positive = 20.0


class FmuSettings(Settings):
    """The whole file."""

    title: str = ""
    simulation: Simulation = Simulation()
    conditions: dict[Name, ConditionEntry]
    observables: dict[Name, ObservableEntry]
    parameters: dict[Name, ParameterEntry] = Field(default_factory=dict)
    effects: dict[str, EffectEntry] = Field(default_factory=dict)


def read_settings(path: Path) -> FmuSettings:
    """Read the TOML file beside an FMU.

    Raises
    ------
    RequestError
        It is missing, or wrong.
    """
    file = path.with_suffix(".toml")
    if not file.exists():
        raise RequestError(
            f"{path} has no file {file.name} beside it",
            expected="one that says which of its variables are conditions, observables, parameters and effects",
            remedy="docs/fmu.md shows one",
        )
    return parse(FmuSettings, read_toml(file), str(file))


Array = NDArray[np.float64]
MOST_KEPT = 200_000  # simulations whose outputs are kept
SHARE = "share"  # of a switch that has no amplitude of its own


def files_of(path: Path) -> tuple[Path, ...]:
    """The FMU and the TOML file that describes it."""
    return path, path.with_suffix(".toml")


def model_from(path: Path) -> Model:
    """Make a model of an FMU.

    Each row of a table is one simulation with constant inputs. Parameters of the FMU are quantities, to which effects
    add. A switch between 0 and 1 is a share: what the FMU gives without and with it is mixed.

    Raises
    ------
    RequestError
        The file or the TOML file beside it is missing or wrong, FMPy is not installed, or the FMU is for another
        platform.
    """
    if not path.exists():
        raise RequestError(f"the model file {path} does not exist", remedy="check the path")
    settings = read_settings(path)
    simulations = _Simulations(path, settings)
    names = (*settings.conditions, *simulations.quantities)
    observed = [
        _function(name, names, _reader(simulations, k), name) for k, name in enumerate(settings.observables)
    ]
    return Model.from_function(
        *observed,
        conditions={
            n: (simulations.variables[n].unit, c.low, c.high) for n, c in settings.conditions.items()
        },
        observables={
            n: out.unit if o.uncertainty is None else (out.unit, o.uncertainty)
            for (n, o), out in zip(settings.observables.items(), simulations.outputs, strict=True)
        },
        parameters=simulations.quantities,
        effects=[_effect(name, entry, simulations) for name, entry in settings.effects.items()],
        name=path.stem,
        title=settings.title or simulations.title,
    )


class _Simulations:
    """Outputs of an FMU for rows of values; what was simulated once is kept.

    Attributes
    ----------
    variables : dict
        Variable of the FMU for every condition, parameter and quantity that an effect changes, with its unit.
    quantities : dict
        Parameters and quantities of effects, as the model takes them.
    outputs : list of Variable
    """

    def __init__(self, path: Path, settings: FmuSettings) -> None:
        self.settings, self.path = settings, path
        self._folder = tempfile.TemporaryDirectory(prefix="specan_fmu_", ignore_cleanup_errors=True)
        description = _unpacked(path, self._folder.name)
        self.title = (description.description or description.modelName or path.stem).strip().rstrip(".")
        self._known = {v.name: v for v in description.modelVariables}
        given = {**settings.conditions, **settings.parameters}
        self.variables = {name: self.variable(name, entry) for name, entry in given.items()}
        self.quantities = {n: _parameter(p, self.variables[n].unit) for n, p in settings.parameters.items()}
        for effect_entry in settings.effects.values():
            if effect_entry.switch:
                self._add(Variable(variable=effect_entry.switch, unit="1"), effect_entry.switch, 0.0)
            for own, parameter in effect_entry.parameters.items():
                variable = self.variable(own, parameter)
                self._add(variable, variable.variable, self.rest_of(variable, parameter.neutral))
        self.outputs = [self.variable(n, o) for n, o in settings.observables.items()]
        self._switches = [
            k for k, v in enumerate(self.variables.values())
            if self._known[v.variable].type not in ("Real", "Float64", "Float32")
        ]  # fmt: skip
        self._kept: dict[bytes, list[float]] = {}
        run = settings.simulation
        how = {
            **run.model_dump(),
            "names": [v.variable for v in self.variables.values()],
            "outputs": [o.variable for o in self.outputs],
            "kind": run.kind
            and run.kind.title().replace("-", ""),  # co-simulation first where none is asked for
        }
        self._process = FmuProcess(str(path), self._folder.name, how, run.time_limit)

    def quantity_of(self, variable: str) -> str:
        """Name of the quantity that stands for a variable of the FMU."""
        return next(n for n, v in self.variables.items() if v.variable == variable)

    def rest_of(self, variable: Variable, neutral: float | None) -> float:
        """Where an effect leaves a variable alone: its neutral value, or the FMU's own, in its unit."""
        if neutral is not None:
            return neutral
        given = str(self._known[variable.variable].start or 0.0).lower()
        own = {"true": 1.0, "false": 0.0}.get(given)
        return float(convert(float(given) if own is None else own, self._fmu_unit(variable), variable.unit))

    def __call__(self, values: Mapping[str, Any]) -> Array:
        """Outputs, one row a row of the table, for arrays or numbers in the units of the TOML file."""
        columns = [
            convert(np.asarray(values[n], dtype=float), v.unit, self._fmu_unit(v))
            for n, v in self.variables.items()
        ]
        table = np.stack(np.broadcast_arrays(*map(np.atleast_1d, columns)), axis=1)
        table[:, self._switches] = np.clip(table[:, self._switches], 0.0, None)
        found = np.zeros((len(table), len(self.outputs)))
        for places, weight in self._corners(table):
            found += weight[:, None] * self._simulated(places)
        for k, output in enumerate(self.outputs):
            found[:, k] = convert(found[:, k], self._fmu_unit(output), output.unit)
        return found

    def _corners(self, table: Array) -> list[tuple[Array, Array]]:
        """Tables with every switch on or off, and their weights: the mixture that the shares ask for."""
        mixed = [k for k in self._switches if np.any((table[:, k] != 0) & (table[:, k] != 1))]
        found = []
        for corner in itertools.product((0.0, 1.0), repeat=len(mixed)):
            places = table.copy()
            places[:, mixed] = corner
            weights = np.where(np.array(corner) > 0, table[:, mixed], 1 - table[:, mixed])
            found.append((places, weights.prod(axis=1)))
        return found

    def _simulated(self, table: Array) -> Array:
        keys = [row.tobytes() for row in table]
        new = {key: row for key, row in zip(keys, table, strict=True) if key not in self._kept}
        if new:
            answers = dict(zip(new, self._process.simulate(list(new.values())), strict=True))
            if len(self._kept) + len(new) > MOST_KEPT:
                self._kept = {key: self._kept[key] for key in set(keys) - set(new)}
            self._kept |= answers
        return np.array([self._kept[key] for key in keys])

    def variable(self, name: str, entry: Variable) -> Variable:
        """The entry with its variable and unit filled in."""
        variable, file = entry.variable or name, self.path.with_suffix(".toml")
        require_known(variable, self._known, f"{file}: the FMU has no variable {variable!r}")
        known = Variable(variable=variable, unit=entry.unit or _unit(self._known[variable].unit) or "1")
        try:
            base_unit(known.unit)
        except RequestError as fault:
            raise RequestError(f"{file}: {name!r}: {fault.found}", expected=fault.expected) from None
        fmu = self._fmu_unit(known)
        if not is_compatible(known.unit, fmu):
            raise RequestError(
                f"{file}: {name!r} is in {known.unit}, and the FMU's {variable!r} in {fmu}",
                expected="units of one kind",
            )
        return known

    def _fmu_unit(self, variable: Variable) -> str:
        return _unit(self._known[variable.variable].unit) or variable.unit

    def _add(self, variable: Variable, name: str, value: float) -> None:
        """A quantity for a variable that an effect changes, unless there is one."""
        if any(v.variable == variable.variable for v in self.variables.values()):
            return
        quantity = re.sub(r"\W+", "_", name).strip("_")
        while quantity in self.variables or quantity in self.settings.observables:
            quantity += "_"
        self.variables[quantity] = known = self.variable(quantity, variable)
        self.quantities[quantity] = Parameter(
            value, known.unit, doc=f"{variable.variable} of the FMU", fixed=True
        )


def _unpacked(path: Path, directory: str) -> Any:
    """Unpack an FMU for this platform, and read what it says of itself."""
    fmpy = library("fmpy", "fmu")
    try:
        description = fmpy.read_model_description(str(path))
        platforms = fmpy.supported_platforms(str(path))
        fmpy.extract(str(path), unzipdir=directory)
    except Exception as fault:
        raise RequestError(
            f"{path} cannot be read as an FMU ({fault})", expected="an FMU of FMI 2 or 3"
        ) from None
    if not description.fmiVersion.startswith(("2", "3")):
        raise RequestError(f"{path} is an FMU of FMI {description.fmiVersion}", expected="FMI 2 or 3")
    if fmpy.platform not in platforms and fmpy.platform_tuple not in platforms:
        raise RequestError(
            f"{path} is made for {', '.join(platforms) or 'no platform'}, and this machine is {fmpy.platform_tuple}",
            remedy="export the FMU for this platform as well",
        )
    return description


def _unit(text: str | None) -> str:
    """A unit as FMI writes it (``N.m``, ``kg.m2/s2``), for `specan.units`; empty where it cannot be read.

    Examples
    --------
    >>> _unit("kg.m2/s2"), _unit("1/min"), _unit(None)
    ('kg*m^2/s^2', '1/min', '')
    """
    if not text:
        return ""
    written = re.sub(r"(?<=[A-Za-z])(-?\d+)", r"^\1", re.sub(r"\.(?=[A-Za-z])", "*", text))
    try:
        base_unit(written)
    except RequestError:
        return ""
    return written


def _parameter(entry: Any, unit: str, name: str = "") -> Parameter:
    return Parameter(
        entry.value, unit, min=entry.min, max=entry.max, lower=entry.lower, upper=entry.upper,
        fixed=entry.fixed, doc=name or entry.variable,
    )  # fmt: skip


def _effect(name: str, entry: EffectEntry, simulations: _Simulations) -> Effect:
    """An effect that sets the FMU's switch and adds to the FMU's parameters, and does neither where it is neutral."""
    units = {n: simulations.variable(n, p) for n, p in entry.parameters.items()}
    parameters = {n: _parameter(p, units[n].unit, n) for n, p in entry.parameters.items()}
    neutral = {n: p.neutral for n, p in entry.parameters.items() if p.neutral is not None}
    if not neutral:
        neutral[SHARE] = 0.0
        doc = "how much of it the data support; 1 as the FMU has it"
        parameters[SHARE] = Parameter(1.0, "1", min=0.5, max=1.5, lower=0.0, upper=5.0, doc=doc)
    targets = {n: simulations.quantity_of(units[n].variable) for n in units}
    rests = {n: simulations.rest_of(units[n], p.neutral) for n, p in entry.parameters.items()}
    switch = simulations.quantity_of(entry.switch) if entry.switch else ""

    def contribution(**given: Any) -> Any:
        acts = np.any(np.broadcast_arrays(*(np.asarray(given[n]) != v for n, v in neutral.items())), axis=0)
        added = {targets[n]: np.where(acts, given[n] - rests[n], 0.0) for n in units}
        if switch:
            added[switch] = np.where(acts, given.get(SHARE, 1.0), 0.0)
        return added if len(added) > 1 else next(iter(added.values()))

    function = _function(name.replace("-", "_"), (), contribution, entry.doc or name, parameters)
    changed = [*dict.fromkeys([*targets.values(), *([switch] if switch else [])])]
    return effect(name, adds_to=changed, neutral=neutral, reference=entry.reference)(function)


def _reader(simulations: _Simulations, column: int) -> Callable[..., Any]:
    def read(**values: Any) -> Any:
        found = simulations(values)[:, column]
        return found if any(np.ndim(v) for v in values.values()) else found[0]

    return read


def _function(
    name: str, reads: tuple[str, ...], function: Callable[..., Any], doc: str, parameters: Mapping[str, Parameter] = {}
) -> Callable[..., Any]:  # fmt: skip
    """A function with a signature as a person would have written it."""
    kinds = inspect.Parameter

    def named(*given: Any, **others: Any) -> Any:
        return function(**dict(zip(reads, given, strict=False)), **others)

    named.__name__, named.__doc__ = name, doc
    named.__signature__ = inspect.Signature(  # type: ignore[attr-defined]
        [
            *(kinds(n, kinds.POSITIONAL_OR_KEYWORD) for n in reads),
            *(kinds(n, kinds.KEYWORD_ONLY, default=p) for n, p in parameters.items()),
        ]
    )
    return named
