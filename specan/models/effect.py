"""A physical effect: a small pure function that adds to, scales or joins named quantities."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from specan.errors import RequestError, nearest
from specan.models.parameter import Parameter
from specan.models.quantity import signature_of

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

    @property
    def changes(self) -> tuple[str, ...]:
        """Every quantity that the effect acts on."""
        return (*self.adds_to, *self.scales, *self.joins)

    @cached_property
    def neutral_si(self) -> dict[str, float]:
        """Neutral values in SI."""
        return {name: self.parameters[name].to_si(value) for name, value in self.neutral.items()}

    @property
    def shapes(self) -> tuple[str, ...]:
        """Parameters that mean nothing while the effect is neutral."""
        return tuple(name for name in self.parameters if name not in self.neutral)


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
    neutral : mapping
        Amplitudes and the values, in the parameter's unit, at which the effect vanishes.
    valid : mapping
        ``{quantity: (low, high, unit)}`` within which the equation holds.
    needs : sequence of str
        Conditions without which it cannot be tested.
    aliases : sequence of str
        Effects that leave the same trace in ordinary data.
    separate_by : str
        The measurement that would tell it from those.
    reference : str
        Standard and clause, or paper.
    instrument : bool
        True for what the instruments do wrong rather than the machine.

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
            f"the effect identifier {name!r} is not one", expected="lower case words joined by hyphens"
        )

    def make(function: Callable[..., Any]) -> Effect:
        reads, parameters = signature_of(function, name)
        made = Effect(
            name, function, reads, parameters, _names(adds_to), _names(scales), _names(joins), at,
            dict(neutral or {}), dict(valid or {}), tuple(needs), tuple(aliases), separate_by, reference,
            " ".join((inspect.getdoc(function) or "").split()), instrument,
            inspect.getsourcefile(function) or "",
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
            f"the effect {made.name!r} says nowhere at which values it vanishes", remedy="give neutral={...}"
        )
    for parameter, value in made.neutral.items():
        if parameter not in made.parameters:
            raise RequestError(
                f"the effect {made.name!r} is neutral in {parameter!r}, which is none of its parameters",
                remedy=nearest(parameter, made.parameters),
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
