"""The TOML file beside an FMU: which of its variables are conditions, observables, parameters and effects."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, Field, model_validator

from specan.errors import RequestError
from specan.schema import Settings, parse, read_toml


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
