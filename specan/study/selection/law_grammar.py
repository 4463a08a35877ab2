"""Laws that a missing effect may follow: functions of one variable, and their products with a power of another.

A law is an amplitude times a factor, or times the product of two. It is added to a quantity of the model or scales
it (1 + amplitude times factor). Shapes (a width, an onset, an exponent) are scanned over ranges that the data span.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Exponents at which a power is scanned, and those of a second factor: the simple ones of physics.
EXPONENTS = (-3.0, -2.0, -1.5, -1.0, -0.5, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0)
SECOND = (-2.0, -1.0, -0.5, 0.5, 1.0, 2.0, 3.0)
LOW_EXPONENT, HIGH_EXPONENT = -4.0, 5.0
WIDTHS = 12  # widths in a scan, in equal ratios
ONSETS = 12
PEAK_WIDTHS = (0.03, 0.1, 0.3)
VARIES = 1.05  # ratio of largest to smallest magnitude below which a variable says nothing


@dataclass(frozen=True, eq=False)
class Spread:
    """How an operating variable lies in the data.

    Attributes
    ----------
    name, unit : str
    middle : float
        Root mean square, three digits: what powers are relative to.
    smallest, largest : float
        Of its magnitudes above zero.
    low, high : float
        Of its values.
    zero, negative : bool
        Whether some values are zero, or below.
    """

    name: str
    unit: str
    middle: float
    smallest: float
    largest: float
    low: float
    high: float
    zero: bool
    negative: bool

    @classmethod
    def of(cls, name: str, unit: str, values: Array) -> Spread | None:
        """The spread of a variable; None where it does not vary."""
        size = np.abs(values)
        positive = size[size > 0]
        if not positive.size or np.ptp(values) <= (VARIES - 1) * positive.max():
            return None
        middle = float(f"{np.sqrt(np.mean(values**2)):.3g}")
        return cls(
            name, unit, middle, float(positive.min()), float(positive.max()), float(values.min()),
            float(values.max()), bool(np.any(size == 0)), bool(np.any(values < 0)),
        )  # fmt: skip


@dataclass(frozen=True)
class Shape:
    """A parameter of a factor that is no amplitude."""

    name: str
    unit: str
    scan: tuple[float, ...]
    low: float
    high: float


@dataclass(frozen=True, eq=False)
class Factor:
    """A function of one operating variable with its shapes.

    Attributes
    ----------
    family : str
        What it is called: ``power``, ``exponential`` ...
    variable : str
    shapes : tuple of Shape
    value : callable
        (values of the variable, *shapes) to values.
    code : str
        The same in Python, of the variable and the names of the shapes.
    text : str
        The same for a reader.
    """

    family: str
    variable: str
    shapes: tuple[Shape, ...]
    value: Callable[..., Array]
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
        return tuple(s for f in self.factors for s in f.shapes)

    @property
    def family(self) -> tuple[str, ...]:
        """Families with their variables: formulas of one family differ in numbers only."""
        return tuple(sorted(f"{f.family} of {f.variable}" for f in self.factors))

    def value(self, variables: Mapping[str, Array], shapes: Sequence[float]) -> Array:
        """The product of the factors."""
        total, first = np.ones(1), 0
        for factor in self.factors:
            own = shapes[first : first + len(factor.shapes)]
            total = total * factor.value(variables[factor.variable], *own)
            first += len(factor.shapes)
        return total

    def scan(self) -> Iterator[tuple[float, ...]]:
        """Shapes at which it is tried."""
        return product(*(s.scan for s in self.shapes))


def formulas(spreads: Sequence[Spread], relative: bool) -> list[Formula]:
    """All laws of the grammar over some variables; with `relative`, those that scale the quantity as well."""
    singles = {s.name: list(_factors(s)) for s in spreads}
    found: list[tuple[Factor, ...]] = [(f,) for factors in singles.values() for f in factors]
    for first, second in product(spreads, spreads):
        if first.name == second.name:
            continue
        for factor in singles[first.name]:
            # The product of two powers is the same in either order.
            if factor.family == "power" and first.name > second.name:
                continue
            found += [(factor, other) for other in _powers(second, SECOND)]
    return [
        Formula(factors, scales) for factors in found for scales in ([False, True] if relative else [False])
    ]


def _factors(s: Spread) -> Iterator[Factor]:
    """Every factor of one variable."""
    yield from _powers(s, EXPONENTS)
    widths = _widths(s)
    size = f"np.abs({s.name})" if s.negative else s.name
    shown = f"|{s.name}|" if s.negative else s.name
    of_width: list[tuple[str, Callable[..., Array], str, str]] = [
        ("exponential", lambda x, w: np.exp(-np.abs(x) / w), "np.exp(-{x} / {w})", "exp(-{t} / {w})"),
        ("gaussian", lambda x, w: np.exp(-((x / w) ** 2)), "np.exp(-(({x} / {w}) ** 2))", "exp(-({t} / {w})^2)"),
        ("hyperbola", lambda x, w: 1 / (1 + np.abs(x) / w), "1 / (1 + {x} / {w})", "1 / (1 + {t} / {w})"),
        ("lorentzian", lambda x, w: 1 / (1 + (x / w) ** 2), "1 / (1 + ({x} / {w}) ** 2)", "1 / (1 + ({t} / {w})^2)"),
        ("logarithm", lambda x, w: np.log1p(np.abs(x) / w), "np.log1p({x} / {w})", "ln(1 + {t} / {w})"),
        ("saturation", lambda x, w: np.abs(x) / (np.abs(x) + w), "{x} / ({x} + {w})", "{t} / ({t} + {w})"),
        ("tanh", lambda x, w: np.tanh(np.abs(x) / w), "np.tanh({x} / {w})", "tanh({t} / {w})"),
    ]  # fmt: skip
    for family, value, code, text in of_width:
        names = {"x": size, "w": widths.name, "t": shown}
        factor = Factor(family, s.name, (widths,), value, code.format(**names), text.format(**names))
        yield factor
        if s.negative:
            yield _odd(factor)
    growth = Shape(
        f"{s.name}_growth",
        s.unit,
        tuple(np.geomspace(0.15, 3, 8) * (s.high - s.low)),
        0.05 * (s.high - s.low),
        30 * (s.high - s.low),
    )
    yield Factor(
        "exponential growth", s.name, (growth,), lambda x, w: np.expm1(np.clip((x - s.low) / w, None, 50.0)),
        f"np.expm1(({s.name} - {s.low:.6g}) / {growth.name})", f"exp(({s.name} - {s.low:.4g}) / {growth.name}) - 1",
    )  # fmt: skip
    span = s.high - s.low
    onset = Shape(
        f"{s.name}_onset",
        s.unit,
        tuple(s.low + span * np.linspace(0.05, 0.9, ONSETS)),
        s.low,
        s.low + 0.97 * span,
    )
    for power in (1, 2):
        yield Factor(
            "onset", s.name, (onset,), lambda x, o, p=power: (np.maximum(x - o, 0.0) / span) ** p,
            f"(np.maximum({s.name} - {onset.name}, 0) / {span:.6g}) ** {power}",
            f"max({s.name} - {onset.name}, 0)" + (f"^{power}" if power > 1 else ""),
        )  # fmt: skip
    yield Factor(
        "step", s.name, (onset,), lambda x, o: (x > o).astype(float),
        f"np.where({s.name} > {onset.name}, 1.0, 0.0)", f"1 where {s.name} > {onset.name}",
    )  # fmt: skip
    if s.low > 0 or s.zero:
        peak = Shape(
            f"{s.name}_peak",
            s.unit,
            tuple(s.low + span * np.linspace(0.05, 0.95, 19)),
            s.low + 0.02 * span,
            s.high,
        )
        damping = Shape(f"{s.name}_damping", "1", PEAK_WIDTHS, 0.005, 1.0)
        yield Factor(
            "resonance", s.name, (peak, damping),
            lambda x, f, d: 1 / np.hypot(1 - (x / f) ** 2, 2 * d * x / f),
            f"1 / np.hypot(1 - ({s.name} / {peak.name}) ** 2, 2 * {damping.name} * {s.name} / {peak.name})",
            f"resonance at {peak.name}",
        )  # fmt: skip
    if s.negative:
        yield Factor("sign", s.name, (), np.sign, f"np.sign({s.name})", f"sign({s.name})")


def _widths(s: Spread) -> Shape:
    low, high = max(s.smallest, 1e-3 * s.largest) / 2, 3 * s.largest
    scan = tuple(float(w) for w in np.geomspace(low, high, WIDTHS))
    return Shape(f"{s.name}_width", s.unit, scan, low / 5, high * 5)


def _powers(s: Spread, exponents: Sequence[float]) -> Iterator[Factor]:
    """Powers of the magnitude; of a variable of both signs also with its sign; no negative ones where it is zero."""
    usable = tuple(e for e in exponents if e > 0 or not s.zero)
    if not usable:
        return
    shape = Shape(f"{s.name}_exponent", "1", usable, LOW_EXPONENT if not s.zero else 0.05, HIGH_EXPONENT)
    size = f"np.abs({s.name})" if s.negative else s.name
    shown = f"|{s.name}|" if s.negative else s.name
    factor = Factor(
        "power", s.name, (shape,), lambda x, e: (np.abs(x) / s.middle) ** e,
        f"({size} / {s.middle:.6g}) ** {shape.name}", f"({shown} / {s.middle:.6g} {s.unit})^{shape.name}",
    )  # fmt: skip
    yield factor
    if s.negative:
        yield _odd(factor)


def _odd(factor: Factor) -> Factor:
    """The same with the sign of the variable."""
    return Factor(
        f"signed {factor.family}", factor.variable, factor.shapes,
        lambda x, *shapes: np.sign(x) * factor.value(x, *shapes),
        f"np.sign({factor.variable}) * {factor.code}", f"sign({factor.variable}) {factor.text}",
    )  # fmt: skip
