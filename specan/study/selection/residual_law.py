"""What an unknown effect looks like: a power law in the operating variables, with intervals.

The law A (T/T0)^a (n/n0)^b ... is added to one quantity of the model as if it were an effect; amplitude and base
parameters are eliminated (variable projection, Golub & Pereyra 1973), the exponents are fitted from several
starts, and each is named by the simplest rational number inside its interval.
"""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.errors import ComputationError
from specan.models import Effect, LawSpace, Parameter, effect
from specan.study.estimation.fit import NORMAL_95
from specan.study.estimation.linear import least_inside
from specan.study.estimation.problem import Problem
from specan.study.observation.table import TableObservation
from specan.study.selection.acceptance import noise_dof
from specan.study.selection.refits import Refit, kept_with_refit
from specan.study.selection.signatures import residuals
from specan.study.selection.significance import improvement_probability

Array = NDArray[np.float64]

LOW, HIGH = -1.0, 4.0  # exponents that are looked for
COARSE = (0.0, 1.0, 2.0, 3.0)  # exponents of the grid on which the starts are chosen
STARTS = 4  # exponents of the grid from which the law is fitted
VARIES = 1.05  # ratio of largest to smallest value below which a variable says nothing
FLOOR = 0.01  # of the largest value or of the mean: a power of zero load is not asked for
NAME = "unknown-law"
EXPONENT_STEP = 1e-3  # for derivatives by an exponent
MOST_STEPS, SETTLED = (
    60,
    1e-8,
)  # of a descent over exponents, and the share of chi-square that its last step gains
STEP = 0.01  # of the quantity's mean: amplitude of the law whose signature is worked out


@dataclass(frozen=True)
class ResidualLaw:
    """A power law for what is missing.

    Attributes
    ----------
    exponents, low, high : dict
        By symbol (T, n, nu), with the ends of the 95 % interval.
    amplitude : float
        At the reference point, in `unit`.
    reference : dict
        Value of each variable at the reference point, SI.
    p_value : float
        Probability that a law takes so much of what is left by chance; every exponent counts as an amplitude.
    """

    text: str
    exponents: dict[str, float]
    low: dict[str, float]
    high: dict[str, float]
    amplitude: float
    unit: str
    reference: dict[str, float]
    p_value: float


@kept_with_refit  # a conclusion asks, and what is printed beside it
def residual_law(start: Refit) -> ResidualLaw | None:
    """Fit a law to what a fitted model leaves; None where the model offers no variables or they do not vary."""
    space = start.problem.assembly.model.law
    if space is None:
        return None
    means = _means(start, space)
    if not means:
        return None
    law = _effect(start.problem, space, means)
    model = start.problem.assembly.model.with_effect(law)
    problem = _with_model(start.problem, model, start.fit.values)
    size = STEP * _typical(start, space)
    fitted = _fit(start, problem, list(means), size)
    return None if fitted is None else _describe(space, start, means, fitted, size)


def _means(start: Refit, space: LawSpace) -> dict[str, float]:
    """Geometric mean of each variable that varies and is positive somewhere; idle runs are not the middle."""
    found = {}
    for symbol, name in space.variables.items():
        values = np.concatenate([np.atleast_1d(v) for v in _evaluated(start, name)])
        loaded = values[values > FLOOR * max(values.max(), 0.0)]
        if loaded.size and loaded.max() > VARIES * loaded.min():
            found[symbol] = float(np.exp(np.mean(np.log(loaded))))
    return found


def _evaluated(start: Refit, name: str) -> list[Array]:
    problem, assembly = start.problem, start.problem.assembly
    if name not in assembly.model.quantities:
        return [np.asarray(o.conditions[name], float) for o in problem.observations]
    found = []
    for o in problem.observations:
        values = problem.seen_by(o, start.fit.values)
        values = o.by_row(assembly, values) if isinstance(o, TableObservation) else values
        found.append(np.asarray(assembly.evaluate(o.conditions, values, [name])[name], float))
    return found


def _typical(start: Refit, space: LawSpace) -> float:
    values = np.concatenate([np.atleast_1d(v) for v in _evaluated(start, space.quantity)])
    return float(np.mean(np.abs(values))) or 1.0


def _effect(problem: Problem, space: LawSpace, means: Mapping[str, float]) -> Effect:
    """The law as an effect of the model."""
    symbols = list(means)
    names = [space.variables[s] for s in symbols]

    def law(*values: Any, amplitude: Any, **exponents: Any) -> Any:
        total = amplitude
        for symbol, value in zip(symbols, values):
            total = total * np.maximum(np.asarray(value) / means[symbol], FLOOR) ** exponents[_of(symbol)]
        return total

    kind = inspect.Parameter
    unit = problem.assembly.model.quantities[space.quantity].unit
    law.__signature__ = inspect.Signature(  # type: ignore[attr-defined]
        [
            *(kind(n, kind.POSITIONAL_OR_KEYWORD) for n in names),
            kind("amplitude", kind.KEYWORD_ONLY, default=Parameter(0.0, unit)),
            *(
                kind(_of(s), kind.KEYWORD_ONLY, default=Parameter(0.0, "1", min=LOW, max=HIGH))
                for s in symbols
            ),
        ]
    )
    return effect(NAME, adds_to=space.quantity, neutral={"amplitude": 0.0})(law)


def _of(symbol: str) -> str:
    return f"exponent_of_{symbol}"


def _with_model(problem: Problem, model: Any, values: Mapping[str, Any]) -> Problem:
    assembly = model.assemble([*problem.assembly.uses, NAME])
    return replace(problem, assembly=assembly, values=values)


@dataclass(frozen=True)
class _Fitted:
    exponents: Array
    multiple: float
    covariance: Array  # of the multiple and the exponents
    left: float  # chi-square


def _fit(start: Refit, problem: Problem, symbols: list[str], size: float) -> _Fitted | None:
    n, linear, weights = start.problem.n_data, start.linear, start.weights

    def signatures(many: list[Array]) -> Array:
        sets = [
            {
                **start.fit.values,
                f"{NAME}.amplitude": size,
                **{f"{NAME}.{_of(s)}": e for s, e in zip(symbols, x)},
            }
            for x in many
        ]
        columns = np.zeros((linear.residual.size, len(many)))
        columns[:n] = residuals(problem, sets) - start.fit.residual[:n, None]
        return linear.project_out(columns * weights[:, None])

    def multiple(columns: Array) -> Array:
        """Best amplitudes, none larger than the whole quantity: a law next to one that the model has already
        would otherwise trade hundreds of times the loss against it."""
        with np.errstate(invalid="ignore", divide="ignore"):
            free = -(columns.T @ linear.residual) / np.sum(columns**2, axis=0)
        return np.asarray(np.clip(np.nan_to_num(free), -1 / STEP, 1 / STEP))

    def left(many: list[Array]) -> Array:
        columns = signatures(many)
        return linear.residual[:, None] + columns * multiple(columns)

    def slopes(x: Array) -> Array:
        inward = np.where(x + EXPONENT_STEP > HIGH, -EXPONENT_STEP, EXPONENT_STEP)
        columns = signatures([x, *(x + np.diag(inward))])
        near = columns * multiple(columns)
        return np.asarray((near[:, 1:] - near[:, :1]) / inward)

    ends = np.full(len(symbols), LOW), np.full(len(symbols), HIGH)
    coarse = [np.array(x) for x in product(COARSE, repeat=len(symbols))]
    columns = signatures(coarse)
    rest = np.sum((linear.residual[:, None] + columns * multiple(columns)) ** 2, axis=0)
    best: tuple[Array, float] | None = None
    for k in np.argsort(rest)[:STARTS]:
        try:
            found = least_inside(lambda x: left([x])[:, 0], slopes, coarse[k], *ends)
        except ComputationError:  # a start from which the model has no finite value
            continue
        if np.isfinite(found[1]) and (best is None or found[1] < best[1]):
            best = found
    if best is None:
        return None
    (x, least), step = best, EXPONENT_STEP
    near = signatures([x, *(x + step * row for row in np.eye(x.size))])
    c = float(multiple(near[:, :1])[0])
    jacobian = np.column_stack([near[:, 0], c * (near[:, 1:] - near[:, :1]) / step])
    dispersion = max(least / max(start.dof - 1 - x.size, 1.0), 1.0)
    covariance = np.asarray(np.linalg.pinv(jacobian.T @ jacobian, rcond=1e-10), dtype=float)
    return _Fitted(x, c, dispersion * covariance, least)


def _describe(
    space: LawSpace, start: Refit, means: Mapping[str, float], fitted: _Fitted, size: float
) -> ResidualLaw:
    symbols = list(means)
    errors = NORMAL_95 * np.sqrt(np.maximum(np.diag(fitted.covariance), 0.0))[1:]
    exponents = {s: float(x) for s, x in zip(symbols, fitted.exponents)}
    low = {s: float(x - e) for s, x, e in zip(symbols, fitted.exponents, errors)}
    high = {s: float(x + e) for s, x, e in zip(symbols, fitted.exponents, errors)}
    unit = start.problem.assembly.model.quantities[space.quantity].unit
    amplitude = fitted.multiple * size
    simple = {s: simplest(low[s], high[s]) for s in symbols}
    text = "~ " + " ".join(f"{s}^{_short(exponents[s])}" for s in symbols)
    as_large_as_all = abs(fitted.multiple) > 0.999 / STEP
    if not as_large_as_all and all(value is not None for value in simple.values()):
        text += " (near " + " ".join(f"{s}^{simple[s]}" for s in symbols) + ")"
    meant = ", ".join(f"{s}: {space.variables[s].replace('_', ' ')}" for s in symbols)
    text += f", {amplitude:.3g} {unit} in the middle of the data ({meant})"
    if as_large_as_all:
        text += "; the model has a term of nearly this form, so that the exponents are not sure"
    p_value = improvement_probability(
        float(start.linear.residual @ start.linear.residual) - fitted.left,
        1 + len(symbols),
        dispersion=start.dispersion,
        noise_dof=noise_dof(start),
    )
    return ResidualLaw(text, exponents, low, high, amplitude, unit, dict(means), p_value)


def _short(value: float) -> str:
    text = f"{value:.1f}".rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text


def simplest(low: float, high: float) -> Fraction | None:
    """The rational number of smallest denominator, then smallest size, in an interval.

    Intervals wider than one say nothing; denominators above four are no physics.

    Examples
    --------
    >>> str(simplest(2.7, 3.1)), str(simplest(0.4, 0.6)), simplest(0.0, 1.5)
    ('3', '1/2', None)
    """
    if high - low > 1:
        return None
    for denominator in (1, 2, 3, 4):
        first, last = int(np.ceil(low * denominator)), int(np.floor(high * denominator))
        if first <= last:
            return Fraction(min(range(first, last + 1), key=abs), denominator)
    return None
