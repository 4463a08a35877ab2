"""Pulls: how far fitted values lie outside of what was known of them, and what the data alone would take."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from specan.models.effect import ParameterName
from specan.study.estimation.fit import describe, fit
from specan.study.estimation.problem import range_of
from specan.study.selection.acceptance import LEVEL, held_out_gain, noise_dof
from specan.study.selection.refits import FORM_TOLERANCE, Refit
from specan.study.selection.significance import improvement_probability

# Standard deviations beyond which a fit holds only with a value that contradicts what is known: three, as for an
# outlier of a normal law (p = 0.003).
TOO_FAR = 3.0
COVERAGE = 2.0  # standard uncertainties of a prior that its range is shown as (coverage factor 2)
MOST_NAMED = 2  # operating variables that are named, in the model's order
SHOWN = 1.0  # pulls below this are no news

STARTS = 3  # of the fit without known ranges
# chi-square that a freed value has to gain to predict better (Akaike 1974, IEEE Trans. AC-19:716)
PRICE = 2.0
# Twice the logarithm of the ratio of cross-validated predictive densities (pseudo-Bayes factor, Geisser and Eddy 1979,
# JASA 74:153) at which equal prior odds leave the known ranges a probability of `LEVEL`: 12.4.
ODDS = -2 * float(np.log(LEVEL))


@dataclass(frozen=True)
class Pull:
    """One fitted value beside what was known of it.

    Attributes
    ----------
    parameter : str
    value : float
    known : tuple of float
        Range known beforehand, in `unit`.
    pull : float
        Standard deviations by which the value lies outside, with its sign.
    at_bound : bool
        The value rests on an end of its domain that lies outside the range: the data would go further.
    """

    parameter: ParameterName
    value: float
    known: tuple[float, float]
    pull: float
    unit: str
    at_bound: bool

    @property
    def too_far(self) -> bool:
        """Whether the fit contradicts what is known."""
        return abs(self.pull) > TOO_FAR or self.at_bound

    @property
    def text(self) -> str:
        """``mu = 0.22, known 0.01 to 0.12``."""
        value, known, unit = self.shown(2)
        space = f" {unit}" if unit else ""
        bound = ", at the end of its domain" if self.at_bound else ""
        return f"{self.parameter} = {value}{space}, known {known}{space}{bound}"

    def shown(self, digits: int = 3) -> tuple[str, str, str]:
        """Value, range and unit as a person reads them: a relative error in percent.

        What has no unit and a range to either side of nothing is a relative error.
        """
        relative = self.unit == "1" and self.known[0] == -self.known[1]
        share, unit = (100.0, "%") if relative else (1.0, "" if self.unit == "1" else self.unit)
        low, high = (share * end for end in self.known)
        known = (
            f"{low:.3g} to {high:.3g}"
            if np.isfinite([low, high]).all()
            else (f"above {low:.3g}" if np.isfinite(low) else f"below {high:.3g}")
        )
        return f"{share * self.value:.{digits}g}", known, unit


def pulls(refit: Refit) -> tuple[Pull, ...]:
    """Every value outside of what was known of it, the worst first."""
    found = [_pull(refit, name) for name in refit.fit.names]
    return tuple(
        sorted(
            (p for p in found if abs(p.pull) > 0 or p.at_bound), key=lambda p: (not p.too_far, -abs(p.pull))
        )
    )


def too_far(refit: Refit, base: Refit) -> tuple[Pull, ...]:
    """Values that contradict what is known, worst first.

    Of a base parameter beside added effects, what the form of their equations may have pushed is taken off. An
    equation is trusted to the share `FORM_TOLERANCE` of its signature. What it leaves out has at most the length
    FORM_TOLERANCE sqrt(explained chi-square), and moves no parameter of a least-squares fit by more standard errors
    than that.
    """
    by_form = FORM_TOLERANCE * float(np.sqrt(max(base.chi2 - refit.chi2, 0.0)))
    own = {str(use) for use in refit.uses}
    found = []
    for pull in pulls(refit):
        if pull.parameter.owner in own:
            found += [pull] if pull.too_far else []
            continue
        tail = _tail(refit, pull.parameter, pull.pull)
        pushed = by_form * refit.fit.standard_error(pull.parameter) / tail
        found += [pull] if abs(pull.pull) - pushed > TOO_FAR or (pull.at_bound and not refit.uses) else []
    return tuple(found)


def stretched(refit: Refit) -> tuple[Pull, ...]:
    """Own values of added effects that lie outside of what is known: sizes by more than their 95 % interval, shapes.

    A machine may have more of an effect than is known of others, and its size is doubted where the data refute what
    is known. A shape says which effect it is: with its best estimate outside of its range, the odds are more than even
    that it is another effect whose form is alike.
    """
    effects = {str(use): refit.problem.assembly.model.effects[use.name] for use in refit.uses}
    found = []
    for pull in pulls(refit):
        owner, own = pull.parameter.owner, pull.parameter.own
        if owner in effects:
            away = abs(pull.pull) * _tail(refit, pull.parameter, pull.pull)
            error = refit.fit.standard_error(pull.parameter) * float(np.sqrt(refit.dispersion))
            needed = COVERAGE * error if own in effects[owner].neutral else 0.0
            found += [pull] if away > needed else []
    return tuple(found)


def shown(found: tuple[Pull, ...]) -> tuple[Pull, ...]:
    """Those that a person is told of."""
    return tuple(p for p in found if abs(p.pull) >= SHOWN or p.at_bound)


def what_would_tell(refit: Refit) -> str:
    """Operating variables of the model that the data hold at one value: varying them determines more.

    ``a second load, a second viscosity``; empty where all vary.
    """
    problem = refit.problem
    constant = []
    for name, condition in problem.assembly.model.conditions.items():
        if not condition.varies or condition.unit == "s":
            continue
        values = [o.conditions[name] for o in problem.observations if name in o.conditions]
        if all(np.ptp(v) <= 1e-9 * np.max(np.abs(v), initial=0.0) for v in values):
            constant.append(condition.column.rpartition("_")[0].replace("_", " ") or name)
    return ", ".join(f"a second {name}" for name in constant[:MOST_NAMED])


def _pull(refit: Refit, name: ParameterName) -> Pull:
    problem, fit = refit.problem, refit.fit
    plain = name.whole
    parameter = problem.assembly.parameters[plain]
    value = float(fit.theta[fit.names.index(name)])
    if plain in problem.priors:
        mean, sd = problem.priors[plain]
        known, pull = (mean - COVERAGE * sd, mean + COVERAGE * sd), (value - mean) / sd
    else:
        known = problem.plausible(plain)
        pull = float(problem.pulls(fit.theta)[_place(refit, name)])
    outside = not known[0] <= value <= known[1]
    return Pull(
        name, parameter.from_si(value), (parameter.from_si(known[0]), parameter.from_si(known[1])),
        pull, parameter.unit, name in fit.at_bound and outside,
    )  # fmt: skip


def _place(refit: Refit, name: ParameterName) -> int:
    """Number of a parameter's range among the ranges."""
    problem = refit.problem
    return problem.pseudo_rows[range_of(name)] - problem.n_data - problem.n_priors


def _tail(refit: Refit, name: ParameterName, pull: float) -> float:
    """Standard deviation of the tail, or of the prior, that a value is in; SI."""
    problem = refit.problem
    plain = name.whole
    if plain in problem.priors:
        return problem.priors[plain][1]
    k = _place(refit, name)
    return float((problem.pseudo.ranges.below if pull < 0 else problem.pseudo.ranges.above)[k])


@dataclass(frozen=True)
class DataAlone:
    """A second explanation of data that the model meets within what is known: the same model with other values.

    Attributes
    ----------
    values : tuple of Pull
        Values of the free fit that contradict what is known, worst first; empty where there are none.
    gain : float
        Chi-square of the fit held by known ranges, pulls included, less that of the free one.
    held : int
        Number of values that the ranges hold: those that rest on an end or are pulled out.
    p_value : float
        Probability of such a gain if the true values lie within what is known.
    likelier : bool
        The free fit predicts better by Akaike's criterion, which asks 2 for every value that is held.
    predicts : float
        Gain of the free fit in blocked cross-validation: twice the logarithm of the ratio of predictive densities.
    """

    values: tuple[Pull, ...] = ()
    gain: float = 0.0
    held: int = 0
    p_value: float = 1.0
    likelier: bool = False
    predicts: float = 0.0

    @property
    def contradicts(self) -> bool:
        """Whether the data refute the known ranges, at the family-wise level at which an effect is named.

        Either by the fall in chi-square, or by predicting: conditions that are left out are predicted better by odds
        that are the inverse of that level.
        """
        return bool(self.values) and (self.p_value <= LEVEL or (self.likelier and self.predicts > ODDS))


def data_alone(base: Refit) -> DataAlone:
    """Fit a model without its known ranges, and test them all at once.

    The fall of chi-square has, if the true values lie within the ranges and k of them hold the fit, the law of
    chi-square with k degrees of freedom: the likelihood-ratio test against an ordered alternative with data-dependent
    degrees of freedom (Susko 2013, Biometrika 100:1019). It is one test for all values together. Soft tails make it
    cautious. The noise is known from as many degrees of freedom as in the tests of effects. Not done where an
    evaluation is expensive.
    """
    problem = base.problem
    held = sum(1 for pull in pulls(base) if pull.pull != 0 and pull.parameter.whole not in problem.priors)
    if problem.strategy.frugal or not held:
        return DataAlone()
    free = replace(problem, unheld=frozenset(problem.free))
    alone = Refit(frozenset(), free, fit(free, start=base.fit.theta, starts=STARTS))
    gain = base.chi2 - alone.chi2
    there = Refit(frozenset(), problem, describe(problem, alone.fit.theta))
    values = tuple(pull for pull in pulls(there) if pull.too_far)
    if not values or gain <= 0:
        return DataAlone()
    chance = improvement_probability(gain, held, dispersion=alone.dispersion, noise_dof=noise_dof(alone))
    likelier = gain / alone.dispersion > PRICE * held
    return DataAlone(values, gain, held, chance, likelier, held_out_gain(base, alone) if likelier else 0.0)
