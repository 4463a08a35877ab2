"""Laws that a missing effect may follow, and how probable each is beside what a model leaves.

A law is an amplitude times a power, an exponential or a saturation of one variable, or times such a factor and a power
of another variable. It is added to a quantity of the model or scales it (1 + amplitude times factor). Shapes (a width,
an exponent) are scanned over ranges that the data span.

Of every law the evidence is that of `specan.study.evidence.marginal`, the model's own parameters free: over a scan of
its shapes first, then, of the likeliest, about its fitted shapes. Its amplitude may make it as large as the quantity
that it acts on; widths are known over a ratio, exponents over a range. See docs/decisions/proposed_laws.md.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from scipy.special import softmax

from specan.arrays import Real
from specan.errors import RequestError
from specan.models import Effect, Parameter, effect
from specan.study.estimation.linear import Projection
from specan.study.evidence.explanations import NOTHING, OF_THE_BEST, SURE
from specan.study.evidence.faults import ln_mean
from specan.study.observation.table import TableObservation
from specan.study.selection.refits import Refit
from specan.units import spoken

MOST_LAWS = 4  # that are proposed
LEAST_ROWS = 12  # below which no law is looked for
NAME = "proposed-shift"

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


@dataclass(frozen=True, eq=False)
class Law:
    """A law that the data admit.

    Attributes
    ----------
    formula : Formula
    quantity, unit : str
        Quantity that it is added to or scales, and the unit of that.
    size : float
        Amplitude: in `unit`, or 1 for a law that scales.
    shapes : tuple of float
        In the order of `formula.shapes`.
    chi2 : float
        That it leaves, the model's own parameters free of their ranges.
    probability : float
        Beside noise alone and all other laws.
    """

    formula: Formula
    quantity: str
    unit: str
    size: float
    shapes: tuple[float, ...]
    chi2: float
    probability: float = 0.0

    @property
    def text(self) -> str:
        """The formula, its shapes by their names."""
        product = " x ".join(
            f"({f.text})" if f.text.endswith(" - 1") else f.text for f in self.formula.factors
        )
        scaled = f"{self.quantity} x (1 + size x {product})"
        return scaled if self.formula.scales else f"{self.quantity} + size x {product}"


@dataclass(frozen=True)
class LawSearch:
    """What a search found.

    Attributes
    ----------
    laws : tuple of Law
        Best first, at most four, one a family; none where noise explains the residuals.
    noise : float
        Probability that noise alone explains the residuals.
    tried : int
        Formulas, each with its scan of shapes.
    more : int
        Families beyond those that the data admit as well.
    """

    laws: tuple[Law, ...]
    noise: float
    tried: int
    more: int = 0


@dataclass(frozen=True, eq=False)
class Target:
    """A quantity, what a unit of it does to the whitened residual of each row, and its value."""

    quantity: str
    unit: str
    # (rows, rows of data): whitened change of the residual by a change of the quantity in each row
    effect: Real
    value: Real


def search_laws(start: Refit) -> LawSearch:
    """Look for laws in what a fitted model leaves.

    Parameters
    ----------
    start : Refit
        The model as it is, fitted to tables.

    Raises
    ------
    RequestError
        The data are no table, or too few rows.
    """
    variables, spreads = _variables(start)
    rest = start.linear.project_out(start.linear.residual)
    trials = [
        _Trial(start, target, formula, variables, rest)
        for target in _targets(start)
        for formula in formulas(
            spreads, relative=bool(np.ptp(target.value) > 1e-6 * np.abs(target.value).max())
        )
    ]
    # Half beforehand that there is no law; the other half is shared by laws of one factor and of two.
    alike = Counter(len(trial.formula.factors) for trial in trials)
    prior = [0.5 * NOTHING / alike[len(trial.formula.factors)] for trial in trials]
    scanned = [trial.scanned() for trial in trials]
    # 40: formulas whose shapes are fitted after the scan
    order = sorted(range(len(trials)), key=lambda k: -scanned[k][0] - np.log(prior[k]))[:40]
    fitted = {k: one for k in order if (one := trials[k].fitted(scanned[k][1]))}
    # What no law describes makes the scatter larger: chi-squares are in units of what the best one leaves.
    least = min((one.law.chi2 for one in fitted.values()), default=0.0)
    dispersion = max(1.0, least / max(start.dof - 2, 1.0))
    joint = [
        np.log(prior[k]) - one.price + gain_of(start.linear, one.columns, dispersion)
        for k, one in fitted.items()
    ]
    noise, *own = softmax([np.log(NOTHING), *joint]).tolist()
    laws = _group([replace(one.law, probability=p) for one, p in zip(fitted.values(), own, strict=True)])
    if noise > 1 - SURE:
        laws = []
    return LawSearch(tuple(laws[:MOST_LAWS]), noise, len(trials), max(0, len(laws) - MOST_LAWS))


def gain_of(linear: Projection, columns: Real, dispersion: float = 1.0) -> float:
    """ln of the evidence with columns over that without, the model's own parameters free.

    Parameters
    ----------
    linear : Projection
        The model, fitted.
    columns : array, shape (n, k)
        What they do to the whitened residual; each has a coefficient of unit deviation beforehand.
    dispersion : float
        Variance of the noise in units of the declared one.
    """
    projected = linear.project_out(columns) / np.sqrt(dispersion)
    normal = np.eye(columns.shape[1]) + projected.T @ projected
    slope = projected.T @ linear.residual / np.sqrt(dispersion)
    return float(slope @ np.linalg.solve(normal, slope) - np.linalg.slogdet(normal)[1]) / 2


def likeliest_law(start: Refit) -> Law | None:
    """The first law for what a model leaves of tables; None where there is none."""
    with suppress(RequestError):  # no table, or too few rows
        return next(iter(search_laws(start).laws), None)
    return None


def _variables(start: Refit) -> tuple[dict[str, Real], list[Spread]]:
    """Operating variables of all rows, and those of them that vary."""
    observations = start.problem.observations
    if not all(isinstance(o, TableObservation) for o in observations):
        raise RequestError(
            "laws are searched for in tables only", expected="a measurement with one row per operating point"
        )
    if start.problem.n_data < LEAST_ROWS:
        raise RequestError(
            f"{start.problem.n_data} rows are too few to search for a law", expected=f"at least {LEAST_ROWS}"
        )
    model = start.problem.assembly.model
    shared = set.intersection(*(set(o.conditions) for o in observations))
    variables: dict[str, Real] = {}
    spreads: list[Spread] = []
    for name, condition in model.conditions.items():
        if name not in shared:
            continue
        values = np.concatenate([np.asarray(o.conditions[name], dtype=float) for o in observations])
        spread = Spread.of(name, condition.unit, values) if np.isfinite(values).all() else None
        if spread is not None:
            variables[name] = values
            spreads.append(spread)
    return variables, spreads


def _targets(start: Refit) -> Iterator[Target]:
    """Quantities that a law may act on: the observables' own, and the one that the model names for it."""
    problem, model = start.problem, start.problem.assembly.model
    measured = {str(name) for o in problem.observations for name in set(o.observable.tolist())}  # type: ignore[attr-defined]
    names = [model.observables[name].quantity for name in sorted(measured)]
    names += [model.law] if model.law else []
    for name in dict.fromkeys(names):
        quantity = model.quantities[name]
        if quantity.collection or quantity.opaque:
            continue
        value = values_of(start, name)
        # 1e-3: of a quantity's typical size: by how much it is changed to see what the observables do
        size = 1e-3 * (float(np.mean(np.abs(value))) or 1.0)
        shifted = np.concatenate(_shifted(start, name, quantity.unit, size))
        slope = (shifted - np.concatenate(problem.predictions(start.fit.theta))) / size
        if np.isfinite(slope).all() and slope.any():
            white = np.zeros((start.fit.residual.size, slope.size))
            white[: slope.size] = problem.whiten(np.diag(slope))
            yield Target(name, quantity.unit, white, value)


def values_of(start: Refit, name: str) -> Real:
    """A quantity or a condition of the fitted model, in every row of the tables."""
    problem, assembly, parts = start.problem, start.problem.assembly, []
    for o in problem.observations:
        assert isinstance(o, TableObservation)
        found = o.conditions.get(name)
        if name in assembly.model.quantities:
            values = o.by_row(assembly, problem.seen_by(o, start.fit.values))
            found = assembly.evaluate(o.conditions, values, [name])[name]
        parts.append(np.broadcast_to(np.asarray(found, dtype=np.float64), (o.n,)))
    return np.concatenate(parts)


def _shifted(start: Refit, name: str, unit: str, size: float) -> list[Real]:
    """Predictions with a quantity raised by the same amount everywhere."""

    def shift(*, by: float = Parameter(0.0, unit)) -> float:  # type: ignore[assignment]
        return by

    shift.__doc__ = "A change."
    made: Effect = effect(NAME, adds_to=name, neutral={"by": 0.0})(shift)
    model = start.problem.assembly.model.with_effect(made)
    problem = replace(start.problem, assembly=model.assemble([*start.problem.assembly.uses, NAME]))
    values = {**start.fit.values, f"{NAME}.by": size}
    return [o.predict(problem.assembly, problem.seen_by(o, values)) for o in problem.observations]


@dataclass(frozen=True, eq=False)
class _Fitted:
    """A law about its fitted shapes: what it does per deviation of its amplitude and shapes, and what it leaves."""

    law: Law
    columns: Real
    price: float


@dataclass(frozen=True, eq=False)
class _Trial:
    """A formula beside a fit: over its scan, and with its shapes fitted (variable projection)."""

    start: Refit
    target: Target
    formula: Formula
    variables: dict[str, Real]
    rest: Real

    def columns(self, places: Sequence[Sequence[float]]) -> tuple[Real, Real]:
        """What laws of amplitude one do to the whitened residual, one a column, and deviations of their amplitudes.

        Beforehand an amplitude is what makes a law as large as the quantity, over the root of 3.
        """
        formula, value = self.formula, self.target.value
        with np.errstate(all="ignore"):
            each = [np.broadcast_to(formula.value(self.variables, shapes), value.shape) for shapes in places]
            values = np.where(np.isfinite(each), each, 0.0).T
            rms = np.sqrt(np.mean(values**2, axis=0))
            whole = 1.0 if formula.scales else np.sqrt(np.mean(value**2))
            sizes = np.where(rms > 0, whole / rms / np.sqrt(3), 0.0)
        return self.target.effect @ (values * value[:, None] if formula.scales else values), sizes

    def scanned(self) -> tuple[float, tuple[float, ...]]:
        """ln of the evidence that it gains over all places of its scan, and the likeliest of these."""
        places = list(self.formula.scan())
        plain, sizes = self.columns(places)
        columns = self.start.linear.project_out(plain * sizes)
        square = np.sum(columns**2, axis=0)
        gains = ((columns.T @ self.rest) ** 2 / (1 + square) - np.log1p(square)) / 2
        return float(ln_mean(gains)), places[int(np.argmax(gains))]

    def column(self, x: Real) -> Real:
        """What the law of amplitude one does that the model's own parameters cannot."""
        return np.asarray(self.start.linear.project_out(self.columns([x.tolist()])[0][:, 0]))

    def left(self, x: Real) -> Real:
        """The residual beside the best amplitude."""
        column = self.column(x)
        return self.rest + self.amplitude(column) * column

    def amplitude(self, column: Real) -> float:
        square = _sum(column)
        return -float(column @ self.rest) / square if square > 0 else 0.0

    def shapes(self, place: tuple[float, ...]) -> Real:
        """Shapes fitted from a place of the scan."""
        from scipy.optimize import least_squares

        low, high = np.array([[s.low, s.high] for s in self.formula.shapes]).T
        x: Real = np.array(place, dtype=np.float64)
        scale = np.where(low > 0, np.abs(x), 1.0)  # widths move in proportion
        inside = np.clip(x, low + 1e-9 * scale, high - 1e-9 * scale)
        with suppress(ValueError):  # not finite
            x = least_squares(self.left, inside, bounds=(low, high), x_scale=scale, diff_step=1e-4).x
        # An exponent that a simple number explains as well is that number.
        for k, factor in enumerate(self.formula.factors):
            simple = x.copy()
            simple[k] = round(2 * x[k]) / 2
            allowed = "power" in factor.family and (simple[k] != 0 or factor.family == "signed power")
            if allowed and _sum(self.left(simple)) < _sum(self.left(x)) + 1.0:
                x = simple
        return x

    def fitted(self, place: tuple[float, ...]) -> _Fitted | None:
        """The law with its shapes fitted; None where it comes to nothing."""
        target, formula, x = self.target, self.formula, self.shapes(place)
        size = self.amplitude(self.column(x))
        chi2 = _sum(self.left(x))
        if not np.isfinite(chi2) or size == 0:
            return None
        steps = np.eye(x.size) * 1e-4 * np.maximum(np.abs(x), 1e-6)[:, None]
        places = [x.tolist(), *(x + steps).tolist()]
        own, sizes = self.columns(places)
        simple = [
            "power" in f.family and not 2 * value % 1 for f, value in zip(formula.factors, x, strict=True)
        ]
        slopes = [
            shape.deviation(value) * size * (column - own[:, 0]) / step.max()
            for shape, value, column, step, fixed in zip(
                formula.shapes, x, own.T[1:], steps, simple, strict=True
            )
            if not fixed
        ]
        # An exponent is one of the simple numbers as likely as any other.
        price = sum(
            float(np.log(2 * len(shape.scan) if fixed else 2)) if "power" in factor.family else 0.0
            for factor, shape, fixed in zip(formula.factors, formula.shapes, simple, strict=True)
        )
        columns = np.column_stack([sizes[0] * own[:, 0], *slopes])
        unit = "1" if formula.scales else target.unit
        return _Fitted(Law(formula, target.quantity, unit, size, tuple(x.tolist()), chi2), columns, price)


def _sum(values: Real) -> float:
    return float(values @ values)


def _group(laws: Sequence[Law]) -> list[Law]:
    """Laws that cannot be distinguished from the best one, the best of each family, the best first."""
    order = sorted(laws, key=lambda law: -law.probability)
    kept: dict[tuple[str, ...], Law] = {}
    for law in order:
        if law.probability > OF_THE_BEST * order[0].probability:
            kept.setdefault(law.formula.family, law)
    return [law for law in kept.values() if not any(_within(other, law) for other in kept.values())]


def _within(simpler: Law, law: Law) -> bool:
    """Whether a law is another one times a further factor, for which the data give nothing.

    To list both would say twice what one says.
    """
    return (
        set(simpler.formula.family) < set(law.formula.family)
        and simpler.quantity == law.quantity
        and simpler.formula.scales == law.formula.scales
        and simpler.probability >= law.probability
    )
