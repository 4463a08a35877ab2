"""What an unknown effect looks like: a power law in the operating variables, with intervals.

The law A (T/T0)^a (n/n0)^b ... is added to one quantity of the model as if it were an effect; amplitude and base
parameters are eliminated (variable projection, Golub & Pereyra 1973), the exponents are fitted from several
starts, and each is named by the simplest rational number inside its interval.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from itertools import product

import numpy as np
from numpy.typing import NDArray

from specan.models import LawSpace
from specan.study.estimation.distributions import tail
from specan.study.estimation.fit import NORMAL_95
from specan.study.estimation.linear import least_inside
from specan.study.observation.table import TableObservation
from specan.study.selection.law_search import Target, target_named, values_of
from specan.study.selection.refits import Refit, kept_with_refit

Array = NDArray[np.float64]

LOW, HIGH = -1.0, 4.0  # exponents that are looked for
COARSE = (0.0, 1.0, 2.0, 3.0)  # exponents of the grid on which the starts are chosen
FLOOR = 0.01  # of the largest value or of the mean: a power of zero load is not asked for
EXPONENT_STEP = 1e-3  # for derivatives by an exponent


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


class _Powers:
    """Products of powers of some variables, added to a quantity: what they leave of a fitted model's residual.

    Parameters
    ----------
    bases : array (variables, rows)
        Variables over their means.
    """

    def __init__(self, start: Refit, target: Target, bases: Array) -> None:
        self.linear, self.effect, self.bases = start.linear, target.effect, bases
        self.most = float(np.mean(np.abs(target.value))) or 1.0
        self.rest = start.linear.residual[:, None]

    def columns(self, many: Array) -> Array:
        """What laws of amplitude one do to the whitened residual, one a column; `many` holds their exponents."""
        powers = np.prod(self.bases[:, :, None] ** many.T[:, None], axis=0)
        return self.linear.project_out(self.effect @ powers)

    def amplitudes(self, columns: Array) -> Array:
        """The best ones, none larger than the whole quantity: a law next to one that the model has already would
        otherwise trade hundreds of times the loss against it."""
        with np.errstate(invalid="ignore", divide="ignore"):
            free = -(columns.T @ self.rest)[:, 0] / np.sum(columns**2, axis=0)
        return np.asarray(np.clip(np.nan_to_num(free), -self.most, self.most))

    def left(self, many: Array) -> Array:
        near = self.columns(many)
        return np.asarray(self.rest + near * self.amplitudes(near))

    def slopes(self, x: Array) -> Array:
        inward = np.where(x + EXPONENT_STEP > HIGH, -EXPONENT_STEP, EXPONENT_STEP)
        near = self.left(np.stack([x, *(x + np.diag(inward))]))
        return np.asarray((near[:, 1:] - near[:, :1]) / inward)

    def fitted(self) -> tuple[Array, float]:
        """Exponents, and the chi-square that they leave."""
        size = len(self.bases)
        ends = np.full(size, LOW), np.full(size, HIGH)
        coarse = np.array(list(product(COARSE, repeat=size)))
        # 4: exponents of the grid from which the law is fitted
        chosen = np.argsort(np.sum(self.left(coarse) ** 2, axis=0))[:4]
        found = [
            least_inside(lambda x: self.left(x[None])[:, 0], self.slopes, coarse[k], *ends) for k in chosen
        ]
        return min(found, key=lambda one: one[1])


@kept_with_refit  # a conclusion asks, and what is printed beside it
def residual_law(start: Refit) -> ResidualLaw | None:
    """Fit a law to what a fitted model leaves of tables; None where no variable that the model offers varies."""
    space = start.problem.assembly.model.law
    if space is None or not all(isinstance(o, TableObservation) for o in start.problem.observations):
        return None
    variables = {symbol: values_of(start, name) for symbol, name in space.variables.items()}
    means = _means(variables)
    target = target_named(start, space.quantity) if means else None
    if target is None:
        return None
    powers = _Powers(
        start, target, np.stack([np.maximum(variables[s] / mean, FLOOR) for s, mean in means.items()])
    )
    x, least = powers.fitted()
    near = powers.columns(np.stack([x, *(x + EXPONENT_STEP * np.eye(x.size))]))
    amplitude = float(powers.amplitudes(near[:, :1])[0])
    jacobian = np.column_stack([near[:, 0], amplitude * (near[:, 1:] - near[:, :1]) / EXPONENT_STEP])
    dispersion = max(least / max(start.dof - 1 - x.size, 1.0), 1.0)
    variances = dispersion * np.diag(np.linalg.pinv(jacobian.T @ jacobian, rcond=1e-10))
    errors = NORMAL_95 * np.sqrt(np.maximum(variances[1:], 0.0))
    fall = float(np.sum(powers.rest**2)) - least
    known = start.problem.noise_dof + start.dof
    p_value = tail(fall / start.dispersion / (1 + x.size), 1 + x.size, known) if fall > 0 else 1.0
    exponents, low, high = (dict(zip(means, map(float, y))) for y in (x, x - errors, x + errors))
    as_large = abs(amplitude) > 0.999 * powers.most
    text = _text(space, exponents, low, high, f"{amplitude:.3g} {target.unit}", as_large)
    return ResidualLaw(text, exponents, low, high, amplitude, target.unit, means, p_value)


def _means(variables: Mapping[str, Array]) -> dict[str, float]:
    """Geometric mean of each variable that varies and is positive somewhere; idle runs are not the middle."""
    found = {}
    for symbol, values in variables.items():
        loaded = values[values > FLOOR * max(values.max(), 0.0)]
        # 1.05: ratio of largest to smallest value below which a variable says nothing
        if loaded.size and loaded.max() > 1.05 * loaded.min():
            found[symbol] = float(np.exp(np.mean(np.log(loaded))))
    return found


def _text(
    space: LawSpace,
    exponents: Mapping[str, float],
    low: Mapping[str, float],
    high: Mapping[str, float],
    amplitude: str,
    as_large_as_all: bool,
) -> str:
    simple = {s: simplest(low[s], high[s]) for s in exponents}
    text = "~ " + " ".join(f"{s}^{_short(x)}" for s, x in exponents.items())
    if not as_large_as_all and all(value is not None for value in simple.values()):
        text += " (near " + " ".join(f"{s}^{value}" for s, value in simple.items()) + ")"
    meant = ", ".join(f"{s}: {space.variables[s].replace('_', ' ')}" for s in exponents)
    text += f", {amplitude} in the middle of the data ({meant})"
    if as_large_as_all:
        text += "; the model has a term of nearly this form, so that the exponents are not sure"
    return text


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
