"""A physical effect: a small pure function that adds to, scales or joins named quantities; and its parameters.

A parameter is a number that a measurement may determine, with its plausible range and its domain. It is known by the
quantity or use of an effect that owns it, its name there, and an element.
"""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

from pydantic_core import core_schema

from specan.errors import RequestError, require_known
from specan.units import base_unit, convert, spoken


@dataclass(frozen=True)
class Parameter:
    """A parameter of an effect or a quantity, declared in its own unit and passed on in SI.

    Attributes
    ----------
    default : float
        Where a fit starts.
    unit : str
        Unit of every number given here; the function that owns the parameter receives SI.
    min, max : float
        Plausible range: outside it a fitted value is not believed.
    lower, upper : float
        Domain: a fit never leaves it. It contains the neutral value; without it the plausible range
        is the domain.
    doc : str
        What it is, in a few words.
    fixed : bool
        Held at its default unless a study sets it free.
    per : str
        A model axis (``microphone``, ``card``, ``wall``, ``third_octave``, ``recording``, ``harmonic``)
        over which the parameter is a vector; empty for a scalar.
    needs : tuple of str
        Conditions that must take several values in the data for the parameter to be determined. Where one
        does not, the parameter is held: it says nothing there (a power of a viscosity that never changes).
    as_declared : bool
        The function that owns the parameter receives it in `unit`, not in SI: so in a model that
        `specan.models.model.Model.from_function` makes.
    spread : float
        Of one that is held: its standard uncertainty, in `unit`. It widens the intervals of what is fitted beside it.

    Examples
    --------
    >>> drag = Parameter(100.0, "mN*m", min=20.0, max=500.0, lower=0.0, doc="seal torque")
    >>> drag.si.default, drag.si.lower
    (0.1, 0.0)
    """

    default: float
    unit: str = "1"
    min: float = -math.inf
    max: float = math.inf
    lower: float | None = None
    upper: float | None = None
    doc: str = ""
    fixed: bool = False
    per: str = ""
    needs: tuple[str, ...] = ()
    as_declared: bool = False
    spread: float = 0.0

    def __post_init__(self) -> None:
        low, high = self.domain
        if not low <= self.default <= high:
            start = spoken(self.default, unit=self.unit, digits=6)
            raise RequestError(
                f"a parameter ({self.doc or 'undocumented'}) starts at {start}",
                expected=f"a value between {low} and {high}",
            )
        if self.min > self.max:
            raise RequestError(f"a parameter ({self.doc}) has min {self.min} above max {self.max}")

    @property
    def domain(self) -> tuple[float, float]:
        """Lower and upper end of the domain, in `unit`."""
        return (
            self.min if self.lower is None else self.lower,
            self.max if self.upper is None else self.upper,
        )

    @cached_property
    def si(self) -> SiRange:
        """The same numbers in SI."""
        low, high = self.domain
        return SiRange(*(self.to_si(value) for value in (self.default, self.min, self.max, low, high)))

    def to_si(self, value: float) -> float:
        """A value in `unit` as the function receives it.

        Parameters
        ----------
        value : float
            In `unit`.

        Returns
        -------
        float
            In SI, unless the parameter is `as_declared`.
        """
        return _converted(value, self.unit, self.received_unit)

    def from_si(self, value: float) -> float:
        """A value as the function receives it in `unit`.

        Parameters
        ----------
        value : float
            As the function receives it.

        Returns
        -------
        float
            In `unit`.
        """
        return _converted(value, self.received_unit, self.unit)

    @property
    def received_unit(self) -> str:
        """Unit in which the function that owns the parameter receives it."""
        return self.unit if self.as_declared or self.unit == "1" else base_unit(self.unit)


def _converted(value: float, unit: str, target: str) -> float:
    return value if unit == target or math.isinf(value) else float(convert(value, unit, target))


@dataclass(frozen=True)
class SiRange:
    """Default, plausible range and domain of a parameter, in SI."""

    default: float
    min: float
    max: float
    lower: float
    upper: float


class ParameterName(str):
    """Full name of a parameter or of one element of it: ``wall-impedance@z1.beta[31.5]``.

    It is the text that study files, histories and tables keep, and can stand wherever that text does. This is the
    only place that knows how the text is made up.

    Parameters
    ----------
    text : str
        As a file or a table has it.

    Examples
    --------
    >>> name = ParameterName("wall-impedance@z1.beta[31.5]")
    >>> name.owner, name.own, name.element
    ('wall-impedance@z1', 'beta', '31.5')
    >>> name.whole
    'wall-impedance@z1.beta'
    >>> ParameterName.of("gain-error", "gain", "Channel 3")
    'gain-error.gain[Channel 3]'
    """

    __slots__ = ()

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: Any) -> Any:
        return core_schema.no_info_plain_validator_function(cls)

    @classmethod
    def of(cls, owner: object, own: str, element: str = "") -> ParameterName:
        """Name out of its parts; `owner` is a use of an effect or the name of a quantity."""
        return cls(f"{owner}.{own}[{element}]" if element else f"{owner}.{own}")

    def at(self, element: str) -> ParameterName:
        """Name of one element of the parameter; itself for no element."""
        whole = self.partition("[")[0]
        return ParameterName(f"{whole}[{element}]" if element else whole)

    @property
    def whole(self) -> ParameterName:
        """The parameter that an element belongs to."""
        return ParameterName(self.partition("[")[0])

    @property
    def owner(self) -> str:
        """Use of an effect as it is written (``wall-impedance@z1``), or a quantity."""
        return self.partition("[")[0].rpartition(".")[0]

    def owned_by(self, uses: Iterable[object]) -> bool:
        """Whether it is a parameter of one of some uses."""
        return self.owner in map(str, uses)

    @property
    def own(self) -> str:
        """Name that the owner gives it."""
        return self.partition("[")[0].rpartition(".")[2]

    @property
    def element(self) -> str:
        """Element of a parameter that is a vector over channels, recordings or the like; empty else."""
        return self.partition("[")[2].removesuffix("]")


_IDENTIFIER = re.compile(r"[a-z0-9]+(-[a-z0-9]+)*")


@dataclass(frozen=True)
class Effect:
    """What `effect` makes of a function; see there for the attributes."""

    name: str
    function: Callable[..., Any]
    reads: tuple[str, ...]
    parameters: dict[str, Parameter]
    adds_to: tuple[str, ...] = ()
    scales: tuple[str, ...] = ()
    joins: tuple[str, ...] = ()
    at: str = ""
    neutral: Mapping[str, float] = field(default_factory=dict)
    valid: Mapping[str, tuple[float, float, str]] = field(default_factory=dict)
    needs: tuple[str, ...] = ()
    aliases: tuple[str, ...] = ()
    separate_by: str = ""
    reference: str = ""
    explanation: str = ""
    instrument: bool = False
    source: str = ""
    states: Mapping[str, Any] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)

    @property
    def changes(self) -> tuple[str, ...]:
        """Every quantity that the effect acts on."""
        return (*self.adds_to, *self.scales, *self.joins)

    @cached_property
    def neutral_si(self) -> dict[str, float]:
        """Neutral values in SI."""
        return {name: self.parameters[name].to_si(value) for name, value in self.neutral.items()}

    def prior_si(self, name: str, sd: float) -> tuple[float, float]:
        """Mean and standard deviation in SI of a parameter that is held at its neutral value; `sd` in its unit."""
        mean = self.neutral_si[name]
        return mean, abs(self.parameters[name].to_si(self.neutral[name] + sd) - mean)


def effect(
    name: str,
    *,
    adds_to: str | Sequence[str] = (),
    scales: str | Sequence[str] = (),
    joins: str | Sequence[str] = (),
    at: str = "",
    neutral: Mapping[str, float] | None = None,
    valid: Mapping[str, tuple[float, float, str]] | None = None,
    needs: Sequence[str] = (),
    aliases: Sequence[str] = (),
    separate_by: str = "",
    reference: str = "",
    instrument: bool = False,
    states: Mapping[str, Any] | None = None,
    units: Mapping[str, str] | None = None,
) -> Callable[[Callable[..., Any]], Effect]:
    """Make a function an Effect.

    The function's positional arguments are the quantities and conditions that it reads (final values,
    SI), its keyword-only arguments its Parameters. It returns the contribution, or a dict
    ``{quantity: contribution}`` where it changes several. Its docstring is the explanation that a
    user reads.

    Parameters
    ----------
    name : str
        Identifier that users type: lower case, words joined by hyphens.
    adds_to, scales, joins : str or sequence of str
        Quantities that the contribution is added to, multiplied by, or (collections) appended to.
    at : str
        Model axis at one element of which the effect acts (``wall``): used as ``name@z1``.
    neutral : mapping, optional
        Amplitudes and the values, in the parameter's unit, at which the effect vanishes; by default the first parameter
        at zero.
    valid : mapping
        ``{quantity: (low, high, unit)}`` within which the equation holds.
    needs : sequence of str
        Conditions without which it cannot be tested.
    aliases : sequence of str
        Effects that leave the same trace in ordinary data; it is enough that one of two says so.
    separate_by : str
        The measurement that would tell it from those.
    reference : str
        Standard and clause, or paper.
    instrument : bool
        True for what the instruments do wrong rather than the machine.
    states : mapping, optional
        ``{name: State(unit, rate=function)}`` that it brings into a model of rates.
    units : mapping, optional
        Of quantities of a model of rates, where the effect holds in these units only.

    Returns
    -------
    callable
        Decorator that returns an Effect.

    Examples
    --------
    >>> @effect("seal-drag", adds_to="power_loss", neutral={"torque": 0.0})
    ... def seal_drag(worm_speed, *, torque=Parameter(0.1, "N*m", min=0.02, max=0.5, lower=0.0)):
    ...     "A radial shaft seal rubs with a torque that knows neither load nor oil."
    ...     return torque * worm_speed
    >>> seal_drag.changes
    ('power_loss',)
    """
    if not _IDENTIFIER.fullmatch(name):
        raise RequestError(
            f"the effect identifier {name!r} is not valid", expected="lower case words joined by hyphens"
        )

    def make(function: Callable[..., Any]) -> Effect:
        reads, parameters = signature_of(function, name)
        own = dict(states or {})
        for key, state in own.items():
            if state.rate is not None and not state.reads:
                arguments = inspect.signature(state.rate).parameters
                own[key] = replace(state, reads=tuple(a for a in arguments if a not in parameters))
        made = Effect(
            name, function, reads, parameters, _names(adds_to), _names(scales), _names(joins), at,
            dict.fromkeys([*parameters][:1], 0.0) if neutral is None else dict(neutral),
            dict(valid or {}), tuple(needs), tuple(aliases), separate_by, reference,
            " ".join((inspect.getdoc(function) or "").split()), instrument,
            inspect.getsourcefile(inspect.unwrap(function)) or "", own, dict(units or {}),
        )  # fmt: skip
        _check_declaration(made)
        return made

    return make


def _names(given: str | Sequence[str]) -> tuple[str, ...]:
    return (given,) if isinstance(given, str) else tuple(given)


def _check_declaration(made: Effect) -> None:
    if not made.changes:
        raise RequestError(
            f"the effect {made.name!r} changes nothing", remedy="give adds_to=, scales= or joins="
        )
    if not made.neutral:
        raise RequestError(
            f"the effect {made.name!r} does not state its neutral values", remedy="give neutral={...}"
        )
    for parameter, value in made.neutral.items():
        require_known(
            parameter,
            made.parameters,
            f"the effect {made.name!r} is neutral in {parameter!r}, which is not one of its parameters",
        )
        low, high = made.parameters[parameter].domain
        if not low <= value <= high:
            raise RequestError(
                f"the effect {made.name!r} is neutral at {parameter} = {value}",
                expected=f"a value inside its domain {low} to {high}",
                remedy="widen lower= or upper=",
            )


@dataclass(frozen=True, order=True)
class Use:
    """One use of an effect in a model: ``seal-drag``, ``wall-impedance@z1``, ``panel-resonance@2``."""

    name: str
    at: str = ""
    copy: int = 1

    def __str__(self) -> str:
        return self.name + (f"@{self.at}" if self.at else "") + (f"@{self.copy}" if self.copy > 1 else "")

    @classmethod
    def parse(cls, text: str) -> Use:
        """Read the written form.

        Examples
        --------
        >>> Use.parse("wall-impedance@z1")
        Use(name='wall-impedance', at='z1', copy=1)
        """
        name, *places = text.split("@")
        at, copy = "", 1
        for place in places:
            if place.isdigit():
                copy = int(place)
            else:
                at = place
        return cls(name, at, copy)


def check_function(function: Any, owner: str) -> None:
    """Refuse what has no source to read names and units in: `functools.partial`, a function of numpy."""
    plain = inspect.unwrap(function)
    if not (inspect.isfunction(plain) or inspect.ismethod(plain)):
        raise RequestError(
            f"{owner}: {type(function).__name__!r} is not a function of Python",
            expected="def, with what it reads and its parameters",
            remedy="call it inside such a function",
        )


def signature_of(function: Callable[..., Any], owner: str) -> tuple[tuple[str, ...], dict[str, Parameter]]:
    """Names that a function, compiled or not, reads (positional) and its Parameters (keyword-only)."""
    check_function(function, owner)
    reads: list[str] = []
    parameters: dict[str, Parameter] = {}
    for name, argument in inspect.signature(function).parameters.items():
        if argument.kind in (argument.POSITIONAL_ONLY, argument.POSITIONAL_OR_KEYWORD):
            reads.append(name)
        elif argument.kind is argument.KEYWORD_ONLY:
            if not isinstance(argument.default, Parameter):
                raise RequestError(
                    f"{owner}: the keyword argument {name!r} has no Parameter",
                    expected=f"{name}=Parameter(default, unit, ...)",
                )
            parameters[name] = argument.default
        else:
            raise RequestError(
                f"{owner}: *args and **kwargs hide what it reads",
                expected="named arguments",
                remedy="name them",
            )
    return tuple(reads), parameters
