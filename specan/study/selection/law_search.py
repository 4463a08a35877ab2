"""Laws of the grammar that explain what a model leaves, with the chance of such a find among all laws tried.

Every law is scored with the model's parameters free (linearised about the fit) and its shapes on a scan. Three tests:
the largest fall in chi-square of all laws is compared with that of noise (family-wise, by simulation); a law has to
predict blocks of conditions that were left out; and laws within a BIC of 6 of the best one are told together, since
these data cannot distinguish them. See docs/decisions/proposed_laws.md.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from specan.errors import ComputationError
from specan.models import Effect, Parameter, effect
from specan.study.estimation.left_out import left_out_blocks, left_out_score
from specan.study.estimation.linear import Projection
from specan.study.observation.table import TableObservation
from specan.study.selection.law_grammar import Formula, Spread, formulas
from specan.study.selection.refits import Refit

Array = NDArray[np.float64]

LEVEL = 0.005  # family-wise: of two hundred models that lack nothing, one gets a law
MOST_LAWS = 4  # that are proposed
SIMULATIONS = 200  # of data without a law, for the family-wise level
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
        That is left, linearised.
    price : float
        What the BIC asks for its parameters, and for the choice among so many laws.
    held_out_gain : float
        Gain in blocked cross-validation.
    delta_bic : float
        By how much the BIC falls, all laws in units of the same dispersion.
    """

    formula: Formula
    quantity: str
    unit: str
    size: float
    shapes: tuple[float, ...]
    chi2: float
    price: float
    held_out_gain: float
    delta_bic: float = 0.0

    @property
    def text(self) -> str:
        """The formula, its shapes by their names."""
        product = " x ".join(
            f"({f.text})" if f.text.endswith(" - 1") else f.text for f in self.formula.factors
        )
        scaled = f"{self.quantity} x (1 + size x {product})"
        return scaled if self.formula.scales else f"{self.quantity} + size x {product}"

    @property
    def text_with_values(self) -> str:
        """The same with the fitted values."""
        unit = "" if self.unit == "1" else f" {self.unit}"
        found = self.text.replace("+ size", f"{self.size:+.3g}{unit}".replace("+", "+ ").replace("-", "- "))
        for shape, value in zip(self.formula.shapes, self.shapes, strict=True):
            own = "" if shape.unit == "1" else f" {shape.unit}"
            found = found.replace(shape.name, f"{value:.3g}{own}")
        return found


@dataclass(frozen=True)
class LawSearch:
    """What a search found.

    Attributes
    ----------
    laws : tuple of Law
        Best first, at most four, one a family; none where noise explains the residuals.
    p_value : float
        Probability that noise alone gives so large a fall in chi-square to any of the laws.
    tried : int
        Formulas, each with its scan of shapes.
    more : int
        Families beyond those that the data admit as well.
    """

    laws: tuple[Law, ...]
    p_value: float
    tried: int
    more: int = 0


@dataclass(frozen=True, eq=False)
class Target:
    """A quantity, what a unit of it does to the whitened residual of each row, and its value."""

    quantity: str
    unit: str
    effect: (
        Array  # (rows, rows of data): whitened change of the residual by a change of the quantity in each row
    )
    value: Array


def search_laws(start: Refit) -> LawSearch:
    """Look for laws in what a fitted model leaves.

    Parameters
    ----------
    start : Refit
        The model as it is, fitted to tables.

    Raises
    ------
    ComputationError
        The data are no table, or too few rows.
    """
    variables, spreads = _variables(start)
    rest = start.linear.project_out(start.linear.residual)
    dof = start.linear.residual.size - start.linear.rank
    scans = [
        (target, formula)
        for target in _targets(start)
        for formula in formulas(
            spreads, relative=bool(np.ptp(target.value) > 1e-6 * np.abs(target.value).max())
        )
    ]
    falls, largest = _scan(start, scans, variables, rest, dof)
    order = sorted(range(len(scans)), key=lambda k: falls[k][0], reverse=True)
    best_ratio = max(falls[k][0] for k in order) if order else 0.0
    p_value = _family_wise(best_ratio, largest, dof)
    if p_value >= LEVEL:
        return LawSearch((), p_value, len(scans))
    alike = {count: sum(len(f.factors) == count for _, f in scans) for count in (1, 2)}
    # 40: formulas whose shapes are fitted after the scan
    found = [
        _Refined(start, *scans[k], variables, rest).law(falls[k][1], alike[len(scans[k][1].factors)])
        for k in order[:40]
    ]
    laws = _group(start, [law for law in found if law is not None], _sum(rest))
    return LawSearch(tuple(laws[:MOST_LAWS]), p_value, len(scans), max(0, len(laws) - MOST_LAWS))


def likeliest_law(start: Refit) -> Law | None:
    """The first law for what a model leaves of tables; None where there is none."""
    if start.problem.n_data < LEAST_ROWS or not all(
        isinstance(o, TableObservation) for o in start.problem.observations
    ):
        return None
    return next(iter(search_laws(start).laws), None)


def _variables(start: Refit) -> tuple[dict[str, Array], list[Spread]]:
    """Operating variables of all rows, and those of them that vary."""
    observations = start.problem.observations
    if not all(isinstance(o, TableObservation) for o in observations):
        raise ComputationError(
            "laws are searched for in tables only", expected="a measurement with one row an operating point"
        )
    if start.problem.n_data < LEAST_ROWS:
        raise ComputationError(
            f"{start.problem.n_data} rows are too few to search for a law", expected=f"at least {LEAST_ROWS}"
        )
    model = start.problem.assembly.model
    shared = set.intersection(*(set(o.conditions) for o in observations))
    variables: dict[str, Array] = {}
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
        target = target_named(start, name)
        if target is not None:
            yield target


def values_of(start: Refit, name: str) -> Array:
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


def target_named(start: Refit, name: str) -> Target | None:
    """A quantity that a law may act on, and what a unit of it does; None where it does nothing."""
    problem, quantity = start.problem, start.problem.assembly.model.quantities[name]
    if quantity.collection or quantity.opaque:
        return None
    value = values_of(start, name)
    # 1e-3: of a quantity's typical size: by how much it is changed to see what the observables do
    size = 1e-3 * (float(np.mean(np.abs(value))) or 1.0)
    shifted = np.concatenate(_shifted(start, name, quantity.unit, size))
    slope = (shifted - np.concatenate(problem.predictions(start.fit.theta))) / size
    if not np.isfinite(slope).all() or not slope.any():
        return None
    white = np.zeros((start.fit.residual.size, slope.size))
    first = 0
    for each in problem.observations:
        rows = slice(first, first + each.n)
        white[rows, rows] = each.whiten(np.diag(slope[rows]))
        first += each.n
    return Target(name, quantity.unit, white, value)


def _shifted(start: Refit, name: str, unit: str, size: float) -> list[Array]:
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
    target: Target, formula: Formula, variables: dict[str, Array], places: Sequence[Sequence[float]]
) -> Array:
    """What laws of amplitude one do to the whitened residual, one a column."""
    with np.errstate(all="ignore"):
        values = np.stack(
            [np.broadcast_to(formula.value(variables, shapes), target.value.shape) for shapes in places],
            axis=1,
        )
    if formula.scales:
        values = values * target.value[:, None]
    return np.asarray(target.effect @ np.where(np.isfinite(values), values, 0.0))


def _scan(
    start: Refit, scans: Sequence[tuple[Target, Formula]], variables: dict[str, Array], rest: Array, dof: int
) -> tuple[list[tuple[float, tuple[float, ...]]], Array]:
    """Largest share of chi-square that each formula takes, with its best shapes; and the largest of any for noise."""
    rng = np.random.default_rng(0)  # the same answer every time
    noise = start.linear.project_out(rng.standard_normal((rest.size, SIMULATIONS)))
    noise /= np.linalg.norm(noise, axis=0)
    there = rest / np.linalg.norm(rest)
    largest = np.zeros(SIMULATIONS)
    falls: list[tuple[float, tuple[float, ...]]] = []
    for target, formula in scans:
        places = list(formula.scan())
        columns = _columns(target, formula, variables, places)
        before = np.linalg.norm(columns, axis=0)
        columns = start.linear.project_out(columns)
        after = np.linalg.norm(columns, axis=0)
        # What the model's own parameters do already is not a law.
        columns = np.where(after > 1e-6 * before, columns / np.maximum(after, 1e-300), 0.0)
        share = (columns.T @ there) ** 2
        best = int(np.argmax(share))
        falls.append((float(share[best]), places[best]))
        np.maximum(largest, np.max((columns.T @ noise) ** 2, axis=0), out=largest)
    return falls, largest


def _family_wise(share: float, largest: Array, dof: int) -> float:
    """Probability that noise gives any law so large a share of chi-square.

    One law's share is distributed as Beta(1/2, (dof - 1)/2); the laws are worth as many independent ones as put the
    median of the simulated maxima there.
    """
    from scipy.stats import beta

    single = beta(0.5, max(dof - 1, 1) / 2.0)
    median = float(single.sf(np.median(largest)))
    count = math.log(2.0) / max(-math.log1p(-min(median, 1 - 1e-12)), 1e-12)
    return float(-np.expm1(count * np.log1p(-min(float(single.sf(share)), 1 - 1e-12))))


class _Refined:
    """A law with its shapes fitted (variable projection)."""

    def __init__(
        self, start: Refit, target: Target, formula: Formula, variables: dict[str, Array], rest: Array
    ) -> None:
        self.start, self.target, self.formula = start, target, formula
        self.variables, self.rest = variables, rest

    def column(self, x: Array) -> Array:
        """What the law of amplitude one does that the model's own parameters cannot."""
        columns = _columns(self.target, self.formula, self.variables, [x.tolist()])
        return np.asarray(self.start.linear.project_out(columns[:, 0]))

    def left(self, x: Array) -> Array:
        """The residual beside the best amplitude."""
        column = self.column(x)
        return self.rest + self.amplitude(column) * column

    def amplitude(self, column: Array) -> float:
        square = _sum(column)
        return -float(column @ self.rest) / square if square > 0 else 0.0

    def shapes(self, place: tuple[float, ...]) -> Array:
        """Shapes fitted from a place of the scan."""
        from scipy.optimize import least_squares

        low, high = np.array([[s.low, s.high] for s in self.formula.shapes]).T
        x: Array = np.array(place, dtype=np.float64)
        scale = np.where(low > 0, np.abs(x), 1.0)  # widths move in proportion
        inside = np.clip(x, low + 1e-9 * scale, high - 1e-9 * scale)
        with suppress(ValueError):  # not finite
            x = least_squares(self.left, inside, bounds=(low, high), x_scale=scale, diff_step=1e-4).x
        # An exponent that a simple number explains as well is that number.
        for k, factor in enumerate(self.formula.factors):
            simple = x.copy()
            simple[k] = round(2 * x[k]) / 2
            allowed = simple[k] != 0 or factor.family == "signed power"
            if factor.shape.unit == "1" and allowed and _sum(self.left(simple)) < _sum(self.left(x)) + 1.0:
                x = simple
        return x

    def law(self, place: tuple[float, ...], alike: int) -> Law | None:
        """The law with its BIC and its cross-validated gain.

        The BIC is that for a choice among many (Chen & Chen 2008, Biometrika 95:759): a law pays for the number `alike`
        of laws with as many factors, so that products, which are many, do not crowd out single functions.
        """
        start, x = self.start, self.shapes(place)
        c = self.column(x)
        size = self.amplitude(c)
        chi2 = _sum(self.rest + size * c)
        if not np.isfinite(chi2) or size == 0:
            return None
        dispersion = max(chi2 / max(start.dof - 1 - x.size, 1.0), 1.0)
        price = (1 + x.size) * math.log(start.problem.n_effective) + 2.0 * math.log(alike)
        steps = np.eye(x.size) * 1e-4 * np.maximum(np.abs(x), 1e-6)[:, None]
        slopes = [(size / s.max()) * (self.column(x + s) - c) for s in steps]
        extended = Projection.of(self.rest + size * c, np.column_stack([start.linear.basis, c, *slopes]))
        rows, before = left_out_blocks(start.problem), Projection(self.rest, start.linear.basis)
        gain = left_out_score(before, rows, dispersion) - left_out_score(extended, rows, dispersion)
        unit = "1" if self.formula.scales else self.target.unit
        shapes = tuple(float(v) for v in x)
        return Law(self.formula, self.target.quantity, unit, size, shapes, chi2, price, gain)


def _sum(values: Array) -> float:
    return float(values @ values)


def _group(start: Refit, laws: Sequence[Law], before: float) -> list[Law]:
    """Laws that cannot be distinguished from the best one, the best of each family, the best first.

    The unit of every chi-square is the dispersion that the law with the lowest one leaves, never below one.
    """
    usable = [law for law in laws if law.held_out_gain > 0]
    if not usable:
        return []
    lowest = min(usable, key=lambda law: law.chi2)
    dispersion = max(lowest.chi2 / max(start.dof - 1 - len(lowest.shapes), 1.0), 1.0)
    usable = [replace(law, delta_bic=(before - law.chi2) / dispersion - law.price) for law in usable]
    usable.sort(key=lambda law: -law.delta_bic)
    if usable[0].delta_bic <= 0:
        return []
    kept: dict[tuple[str, ...], Law] = {}
    for law in usable:
        # 6.0: BIC: posterior odds of twenty to one
        if law.delta_bic > usable[0].delta_bic - 6.0:
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
        and simpler.delta_bic >= law.delta_bic
    )
