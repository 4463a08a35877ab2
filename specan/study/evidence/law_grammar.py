"""Laws that a missing effect may follow: a power, an exponential or a saturation of one variable, or a product of two.

A law is an amplitude times a factor, or times a factor and a power of another variable. It is added to a quantity of
the model or scales it (1 + amplitude times factor). Shapes (a width, an exponent) are scanned over ranges that the data
span.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from specan.arrays import Real
from specan.units import spoken

# Exponents at which a power is scanned, and those of a second factor: the simple ones of physics.
EXPONENTS = (-3.0, -2.0, -1.5, -1.0, -0.5, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0)
SECOND = (-2.0, -1.0, -0.5, 0.5, 1.0, 2.0, 3.0)
RANGE = (-4.0, 5.0)  # of a fitted exponent


@dataclass(frozen=True, eq=False)
class Spread:
    """How an operating variable lies in the data.

    Attributes
    ----------
    name, unit : str
    middle : float
        Root mean square, three digits: what powers are relative to.
    smallest : float
        Of its magnitudes above zero.
    low, high : float
        Of its values.
    zero : bool
        Whether some values are zero.
    """

    name: str
    unit: str
    middle: float
    smallest: float
    low: float
    high: float
    zero: bool

    @classmethod
    def of(cls, name: str, unit: str, values: Real) -> Spread | None:
        """The spread of a variable; None where it does not vary."""
        size = np.abs(values)
        positive = size[size > 0]
        # a variable that varies by less says nothing
        if not positive.size or np.ptp(values) <= 0.05 * positive.max():
            return None
        middle = float(f"{np.sqrt(np.mean(values**2)):.3g}")
        low, high = float(values.min()), float(values.max())
        return cls(name, unit, middle, float(positive.min()), low, high, bool(np.any(size == 0)))


@dataclass(frozen=True)
class Shape:
    """The parameter of a factor: a width or an exponent."""

    name: str
    unit: str
    scan: tuple[float, ...]
    low: float
    high: float

    def deviation(self, value: float) -> float:
        """Standard deviation of what is known beforehand: an exponent over its range, a width over a ratio."""
        known = (
            self.high - self.low if self.name.endswith("_exponent") else value * np.log(self.high / self.low)
        )
        return float(known / np.sqrt(12))


@dataclass(frozen=True, eq=False)
class Factor:
    """A function of one operating variable with its shape.

    Attributes
    ----------
    family : str
        What it is called: ``power``, ``exponential`` ...
    variable : str
    shape : Shape
    value : callable
        (values of the variable, shape) to values.
    code : str
        The same in Python, of the variable and the name of the shape.
    text : str
        The same for a reader.
    """

    family: str
    variable: str
    shape: Shape
    value: Callable[[Real, float], Real]
    code: str
    text: str


@dataclass(frozen=True, eq=False)
class Formula:
    """An amplitude times one factor or two, added to a quantity or scaling it."""

    factors: tuple[Factor, ...]
    scales: bool

    @property
    def shapes(self) -> tuple[Shape, ...]:
        """Shapes of all factors."""
        return tuple(f.shape for f in self.factors)

    @property
    def family(self) -> tuple[str, ...]:
        """Families with their variables: formulas of one family differ in numbers only."""
        return tuple(sorted(f"{f.family} of {f.variable}" for f in self.factors))

    def value(self, variables: Mapping[str, Real], shapes: Sequence[float]) -> Real:
        """The product of the factors."""
        parts = [f.value(variables[f.variable], x) for f, x in zip(self.factors, shapes, strict=True)]
        return np.asarray(np.prod(parts, axis=0))

    def scan(self) -> Iterator[tuple[float, ...]]:
        """Shapes at which it is tried."""
        return product(*(s.scan for s in self.shapes))


def formulas(spreads: Sequence[Spread], relative: bool) -> list[Formula]:
    """All laws of the grammar over some variables; with `relative`, those that scale the quantity as well."""
    powers = {s.name: list(_both_signs(s, _power(s, EXPONENTS))) for s in spreads}
    seconds = {s.name: list(_both_signs(s, _power(s, SECOND))) for s in spreads}
    others = {s.name: [f for one in _exponentials(s) for f in _both_signs(s, one)] for s in spreads}
    found: list[tuple[Factor, ...]] = [(f,) for s in spreads for f in powers[s.name] + others[s.name]]
    for first, second in product(powers, powers):
        if first != second:
            # The product of two powers is the same in either order.
            own = others[first] + (powers[first] if first < second else [])
            found += list(product(own, seconds[second]))
    return [
        Formula(factors, scales) for factors in found for scales in ([False, True] if relative else [False])
    ]


def _size(s: Spread) -> tuple[str, str]:
    """The magnitude of a variable, in Python and for a reader."""
    return (f"np.abs({s.name})", f"|{s.name}|") if s.low < 0 else (s.name, s.name)


def _power(s: Spread, exponents: Sequence[float]) -> Factor:
    """A power of the magnitude; no negative one where it is zero."""
    usable = tuple(e for e in exponents if e > 0 or not s.zero)
    shape = Shape(f"{s.name}_exponent", "1", usable, 0.05 if s.zero else RANGE[0], RANGE[1])
    size, shown = _size(s)
    return Factor(
        "power", s.name, shape, lambda x, e: (np.abs(x) / s.middle) ** e,
        f"({size} / {s.middle:.6g}) ** {shape.name}",
        f"({shown} / {spoken(s.middle, unit=s.unit, digits=6)})^{shape.name}",
    )  # fmt: skip


def _exponentials(s: Spread) -> Iterator[Factor]:
    """Decay, saturation and growth."""
    size, shown = _size(s)
    largest, span = max(s.high, -s.low), s.high - s.low
    least = max(s.smallest, 1e-3 * largest) / 2
    # 12: in a scan, in equal ratios
    scan = tuple(float(w) for w in np.geomspace(least, 3 * largest, 12))
    width = Shape(f"{s.name}_width", s.unit, scan, least / 5, 15 * largest)
    growth = Shape(f"{s.name}_growth", s.unit, tuple(np.geomspace(0.15, 3, 8) * span), 0.05 * span, 30 * span)
    yield Factor(
        "exponential", s.name, width, lambda x, w: np.exp(-np.abs(x) / w),
        f"np.exp(-{size} / {width.name})", f"exp(-{shown} / {width.name})",
    )  # fmt: skip
    yield Factor(
        "saturation", s.name, width, lambda x, w: np.abs(x) / (np.abs(x) + w),
        f"{size} / ({size} + {width.name})", f"{shown} / ({shown} + {width.name})",
    )  # fmt: skip
    yield Factor(
        "exponential growth", s.name, growth, lambda x, w: np.expm1(np.clip((x - s.low) / w, None, 50.0)),
        f"np.expm1(({s.name} - {s.low:.6g}) / {growth.name})", f"exp(({s.name} - {s.low:.4g}) / {growth.name}) - 1",
    )  # fmt: skip


def _both_signs(s: Spread, factor: Factor) -> Iterator[Factor]:
    """A factor; of a variable of both signs also with the sign of the variable, the sign alone included."""
    yield factor
    if s.low < 0:
        shape = factor.shape
        if factor.family == "power":
            shape = replace(shape, scan=(0.0, *shape.scan), low=min(shape.low, 0.0))
        yield Factor(
            f"signed {factor.family}", s.name, shape, lambda x, e: np.sign(x) * factor.value(x, e),
            f"np.sign({s.name}) * {factor.code}", f"sign({s.name}) {factor.text}",
        )  # fmt: skip
