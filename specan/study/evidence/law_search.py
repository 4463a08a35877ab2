"""Laws of the grammar that explain what a model leaves, and how probable each is.

Of every law the evidence is that of `specan.study.evidence.marginal`, the model's own parameters free: over a scan of
its shapes first, then, of the likeliest, about its fitted shapes. Its amplitude may make it as large as the quantity
that it acts on; widths are known over a ratio, exponents over a range. See docs/decisions/proposed_laws.md.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import softmax

from specan.arrays import Real
from specan.errors import RequestError
from specan.models import Effect, Parameter, effect
from specan.study.estimation.linear import Projection
from specan.study.evidence.explanations import NOTHING, OF_THE_BEST, SURE
from specan.study.evidence.faults import ln_mean
from specan.study.evidence.law_grammar import Formula, Spread, formulas
from specan.study.observation.table import TableObservation
from specan.study.selection.refits import Refit

MOST_LAWS = 4  # that are proposed
LEAST_ROWS = 12  # below which no law is looked for
NAME = "proposed-shift"


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
    scans = [
        (target, formula)
        for target in _targets(start)
        for formula in formulas(
            spreads, relative=bool(np.ptp(target.value) > 1e-6 * np.abs(target.value).max())
        )
    ]
    # Half beforehand that there is no law; the other half is shared by laws of one factor and of two.
    alike = Counter(len(formula.factors) for _, formula in scans)
    prior = [0.5 * NOTHING / alike[len(formula.factors)] for _, formula in scans]
    rest = start.linear.project_out(start.linear.residual)
    scanned = [_scanned(start, *scan, variables, rest) for scan in scans]
    # 40: formulas whose shapes are fitted after the scan
    order = sorted(range(len(scans)), key=lambda k: -scanned[k][0] - np.log(prior[k]))[:40]
    fitted = {
        k: one for k in order if (one := _Refined(start, *scans[k], variables, rest).fitted(scanned[k][1]))
    }
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
    return LawSearch(tuple(laws[:MOST_LAWS]), noise, len(scans), max(0, len(laws) - MOST_LAWS))


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


def _columns(
    target: Target, formula: Formula, variables: dict[str, Real], places: Sequence[Sequence[float]]
) -> tuple[Real, Real]:
    """What laws of amplitude one do to the whitened residual, one a column, and deviations of their amplitudes.

    Beforehand an amplitude is what makes a law as large as the quantity, over the root of 3.
    """
    with np.errstate(all="ignore"):
        each = [np.broadcast_to(formula.value(variables, shapes), target.value.shape) for shapes in places]
        values = np.where(np.isfinite(each), each, 0.0).T
        rms = np.sqrt(np.mean(values**2, axis=0))
        whole = 1.0 if formula.scales else np.sqrt(np.mean(target.value**2))
        sizes = np.where(rms > 0, whole / rms / np.sqrt(3), 0.0)
    return target.effect @ (values * target.value[:, None] if formula.scales else values), sizes


def _scanned(
    start: Refit, target: Target, formula: Formula, variables: dict[str, Real], rest: Real
) -> tuple[float, tuple[float, ...]]:
    """ln of the evidence that a formula gains over all places of its scan, and the likeliest of these."""
    places = list(formula.scan())
    plain, sizes = _columns(target, formula, variables, places)
    columns = start.linear.project_out(plain * sizes)
    square = np.sum(columns**2, axis=0)
    gains = ((columns.T @ rest) ** 2 / (1 + square) - np.log1p(square)) / 2
    return float(ln_mean(gains)), places[int(np.argmax(gains))]


@dataclass(frozen=True, eq=False)
class _Fitted:
    """A law about its fitted shapes: what it does per deviation of its amplitude and shapes, and what it leaves."""

    law: Law
    columns: Real
    price: float


class _Refined:
    """A law with its shapes fitted (variable projection)."""

    def __init__(
        self, start: Refit, target: Target, formula: Formula, variables: dict[str, Real], rest: Real
    ) -> None:
        self.start, self.target, self.formula = start, target, formula
        self.variables, self.rest = variables, rest

    def column(self, x: Real) -> Real:
        """What the law of amplitude one does that the model's own parameters cannot."""
        columns, _ = _columns(self.target, self.formula, self.variables, [x.tolist()])
        return np.asarray(self.start.linear.project_out(columns[:, 0]))

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
        own, sizes = _columns(target, formula, self.variables, places)
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
