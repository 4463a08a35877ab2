"""A number that a measurement may determine, with its plausible range and its domain; and its identity.

A parameter is known by the quantity or use of an effect that owns it, its name there, and an element.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

from specan.errors import RequestError
from specan.units import convert


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

    def __post_init__(self) -> None:
        low, high = self.domain
        if not low <= self.default <= high:
            raise RequestError(
                f"a parameter ({self.doc or 'undocumented'}) starts at {self.default} {self.unit}",
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
        return (
            value
            if self._plain or math.isinf(value)
            else float(convert(value, self.unit, self.received_unit))
        )

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
        return (
            value
            if self._plain or math.isinf(value)
            else float(convert(value, self.received_unit, self.unit))
        )

    @property
    def received_unit(self) -> str:
        """Unit in which the function that owns the parameter receives it."""
        return self.unit if self._plain else _si(self.unit)

    @property
    def _plain(self) -> bool:
        return self.as_declared or self.unit == "1"


@dataclass(frozen=True)
class SiRange:
    """Default, plausible range and domain of a parameter, in SI."""

    default: float
    min: float
    max: float
    lower: float
    upper: float


def _si(unit: str) -> str:
    from specan.units import base_unit

    return base_unit(unit)


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
