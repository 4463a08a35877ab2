"""The acceptance that an effect has to pass before it is believed, and the smallest effect that would pass.

The test is the F-test, BIC and blocked cross-validation together.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from specan.errors import ComputationError
from specan.models import Use
from specan.models.effect import ParameterName
from specan.study.estimation.distributions import quantile
from specan.study.estimation.levenberg_marquardt import descend
from specan.study.estimation.linear import Projection
from specan.study.estimation.prediction_error import ObservableError, errors_of
from specan.study.estimation.problem import Problem
from specan.study.observation.table import TableObservation
from specan.study.selection.candidates import Candidate, candidates
from specan.study.selection.refits import FORM_TOLERANCE, EffectSet, Refit
from specan.study.selection.signatures import Point, changes, default_value
from specan.study.selection.significance import (
    LACK_OF_FIT,
    MultipleTestingFamily,
    detectable_noncentrality,
    improvement_probability,
    needed_reduction,
)

LEVEL = 0.002  # family-wise: of true models, this share may be blamed for anything
LEAST_SHARE = 1e-5  # of the family-wise level, that one test of many is left
DECISIVE = 6.0  # difference in BIC below which two explanations are held to be equally good
# Part of a difference in chi-square, of which what the better of two sets may leave at most.
COINCIDENCE = 0.2

Array = NDArray[np.float64]
MOST_LEVELS = 12  # blocks of one operating variable

MOST_ROWS = 400  # above which the refits cost more than the verdict

POWER = 0.8  # of repetitions that would find the effect; the usual one (Cohen 1988)
ROUNDS = 4  # of the secant, and of refits
SETTLED, NEARLY = 0.02, 0.1  # of the chi-square that is left: near enough by linear algebra, by refits
SHORTER = (1.0, 0.5, 0.25)  # of a step, where the whole one leads up


@dataclass(frozen=True)
class Decision:
    """How an extension of a model fares.

    Attributes
    ----------
    p_value : float
        Family-wise probability of such an improvement by chance.
    delta_bic : float
        Fall in BIC, chi-square in units of max(s^2, 1).
    held_out_gain : float
        Gain in blocked cross-validation.
    p_with_tolerance : float
        As `p_value`, allowing for effects that are in the model already but have another form in truth.
    """

    p_value: float
    p_with_tolerance: float
    delta_bic: float
    held_out_gain: float
    level: float

    @property
    def accepted(self) -> bool:
        """All of: improbable by chance, decisive, predicts better what was left out.

        Values outside of what is known have paid for it in chi-square.
        """
        return self.accepted_if_exact and self.p_with_tolerance <= self.level

    @property
    def accepted_if_exact(self) -> bool:
        """The same if the effects that are in the model already had exactly the form of their equations."""
        return self.p_value <= self.level and self.delta_bic > DECISIVE and self.held_out_gain > 0


@dataclass(frozen=True, eq=False)
class AcceptanceTest:
    """The tests of one step of the search.

    Attributes
    ----------
    start : Refit
        What is to be extended.
    family : MultipleTestingFamily
        All directions tried from there.
    explained : float
        Chi-square that the effects which the search has added so far have taken away.
    level : float
        Family-wise level of this step.
    """

    start: Refit
    family: MultipleTestingFamily
    explained: float = 0.0
    level: float = LEVEL

    def decision(self, extended: Refit, *, tests: float | None = None) -> Decision:
        """Fate of an extension.

        Parameters
        ----------
        extended : Refit
            The start, or another set with fewer effects, with further effects.
        tests : float, optional
            Number of tests in the family, where it is not that of the directions (pairs).
        """
        start, dispersion = self.start, extended.dispersion

        def probability(tolerated: float) -> float:
            single = improvement_probability(
                start.chi2 - extended.chi2,
                max(extended.amplitudes - start.amplitudes, 1),
                dispersion=dispersion,
                noise_dof=noise_dof(extended),
                sided=1 if extended.uses - start.uses <= extended.one_sided else 2,
                tolerated=tolerated,
            )
            return self.family.probability(single) if tests is None else min(tests * single, 1.0)

        return Decision(
            p_value=probability(0.0),
            p_with_tolerance=probability(self.left_by_form * self._seen_in_data(extended) / dispersion),
            delta_bic=start.bic(dispersion) - extended.bic(dispersion),
            held_out_gain=held_out_gain(start, extended),
            level=self.level,
        )

    @property
    def left_by_form(self) -> float:
        """Chi-square that the equations of the effects in the model may leave along a further one.

        A fifth of their signature. Where that would be seen at resonances it is no more than what is seen: all that is
        left beyond the noise, and of what the noise leaves in doubt the part that a coincidence would point one way.
        """
        allowed, start = FORM_TOLERANCE**2 * self.explained, self.start
        if not start.problem.strategy.continuation:
            return allowed
        seen = max(start.lack_of_fit_chi2 - start.dof, 0.0)
        return min(allowed, seen + COINCIDENCE * float(np.sqrt(2 * start.dof)))

    def _seen_in_data(self, extended: Refit) -> float:
        """Share of the direction of an extension that lies in the data, where the form of an equation may err.

        One for effects. An extension that only gives certificates up gains where data and certificates disagree, and
        of a certificate's direction, projected beside the fit, the data have the share h, the leverage of its row:
        the variance with it over that of the certificate alone. Of several, h is at most the largest eigenvalue.
        """
        freed = _freed(extended, self.start)
        if not freed or extended.count - self.start.count != len(freed):
            return 1.0
        part = self.start.linear.basis[[self.start.problem.pseudo_rows[name] for name in freed]]
        return float(np.linalg.eigvalsh(part @ part.T)[-1])

    @property
    def pairs(self) -> float:
        """Number of independent tests that all pairs are worth."""
        p = self.level / 100
        count = self.family.probability(p) / p
        return max(count * (count - 1) / 2, 1.0)

    @cached_property
    def single_level(self) -> float:
        """Two-sided probability of one test that the family-wise level leaves to it."""
        if self.family.probability(self.level) <= self.level:
            return self.level
        high = math.log(self.level)
        return math.exp(
            brentq(
                lambda x: self.family.probability(math.exp(x)) - self.level,
                high + math.log(LEAST_SHARE),
                high,
            )
        )

    @property
    def needed_reduction(self) -> float:
        """Chi-square that one amplitude has to gain to pass."""
        return quantile(self.single_level, 1)


def noise_dof(refit: Refit) -> float:
    """Degrees of freedom behind max(s^2, 1): those of the noise estimate and of the residual."""
    return refit.problem.noise_dof + refit.dof


def held_out_gain(start: Refit, extended: Refit) -> float:
    """Gain in blocked cross-validation, every level of every operating variable left out in turn.

    A certificate that the extension does without is left out as well: the data have to predict what it says.
    """
    rows, dispersion = left_out_blocks(start.problem), extended.dispersion
    freed = [np.array([start.problem.pseudo_rows[name]]) for name in _freed(extended, start)]
    return left_out_score(start.linear, [*rows, *freed], dispersion) - left_out_score(
        extended.linear, rows, dispersion
    )


def _freed(extended: Refit, start: Refit) -> list[ParameterName]:
    """Instrument errors that an extension fits to resonances without their certificates."""
    problem = start.problem
    if not problem.strategy.continuation or not start.uses < extended.uses:
        return []
    held = [problem.names[k] for k in problem.pseudo.held]
    return [name for name in held if name.whole not in extended.problem.priors]


def left_out_blocks(problem: Problem) -> list[NDArray[np.intp]]:
    """Rows that cross-validation leaves out together, numbered over all observations."""
    found, first = [], 0
    for observation in problem.observations:
        found += [rows + first for rows in blocks(observation.labels)]
        first += observation.n
    return found


def blocks(labels: Mapping[str, NDArray[Any]]) -> list[NDArray[np.intp]]:
    """Rows at every level of every operating variable, one after the other.

    Random subsets would leak, since neighbouring lines and repeats share their errors. A variable
    with many values is cut into twelve groups of neighbours.
    """
    found = []
    for values in labels.values():
        levels, index = np.unique(np.asarray(values), return_inverse=True)
        if levels.size > MOST_LEVELS:
            index = index * MOST_LEVELS // levels.size
        groups = [np.flatnonzero(index == level) for level in np.unique(index)]
        found += groups if len(groups) > 2 else []
    return found


def left_out_score(fit: Projection, left_out: Sequence[NDArray[np.intp]], dispersion: float = 1.0) -> float:
    """Minus twice the log predictive density of all left-out blocks, up to a constant.

    Without block b, linearised, the residual of b is (I - H_bb)^-1 r_b with covariance
    (I - H_bb)^-1, so that no refit is needed:

        S_b = r_b^T (I - H_bb)^-1 r_b / dispersion - ln det(I - H_bb).

    A direction that only block b determines is given a weak prior instead of an infinite variance.
    """
    total = 0.0
    for rows in left_out:
        part, residual = fit.basis[rows], fit.residual[rows]
        values, vectors = np.linalg.eigh(part.T @ part)
        left = np.clip(1.0 - values, 1e-3, 1.0)
        along = (part @ vectors).T @ residual
        total += float(residual @ residual + np.sum(along**2 / left)) / dispersion - float(
            np.sum(np.log(left))
        )
    return total


def left_out_errors(refit: Refit) -> list[ObservableError]:
    """Errors of a model on conditions that it was not fitted to, each level of each operating variable in turn.

    The model is fitted anew without every block, and predicts it. None where nothing can be left out, where a fit
    without a block fails, and where rows are many. The observable with most values comes first.
    """
    problem, observation = refit.problem, refit.problem.observations[0]
    blocks = left_out_blocks(problem)
    if not blocks or len(problem.observations) > 1 or not isinstance(observation, TableObservation):
        return []
    if problem.strategy.frugal or observation.n > MOST_ROWS:
        return []
    (slopes,), predicted = problem.sensitivities(refit.fit.theta), []
    for block in blocks:
        kept = np.ones(observation.n, dtype=bool)
        kept[block] = False
        rest = problem.over([observation.without(block)])
        if rest.n_data + rest.n_priors < len(rest.names):
            return []
        try:
            near = [rest.observations[0].whiten(slopes[kept]), refit.fit.jacobian[problem.n_data :]]
            theta = descend(rest, refit.fit.theta, np.concatenate(near)).theta
        except ComputationError:
            return []
        predicted.append(problem.over([observation.take(~kept)]).predictions(theta)[0])
    rows = np.concatenate(blocks)
    return errors_of(
        problem, observation.observable[rows], np.concatenate(predicted), observation.measured[rows]
    )


def complete(better: Refit, worse: Refit) -> bool:
    """Whether one set meets resonances to the noise where another one does not: then that is not the other's form.

    An equation that is not exact leaves a residual that may point anywhere: every resonance answers to it in its own
    way. That it points along another effect, but for a part `COINCIDENCE` of its square, has a probability of about
    ``COINCIDENCE ** ((n - 1) / 2)`` among n directions: 7e-4 with ten resonances, 2e-7 with twenty. The same
    holds of an instrument error that the worse set takes far from its certificate: what it would leave there counts.
    """
    at_certificates = 0.0
    for name in _freed(better, worse):
        mean, fitted = worse.problem.priors[name.whole][0], worse.fit.theta[worse.fit.names.index(name)]
        at_certificates += float((fitted - mean) / worse.fit.standard_error(name)) ** 2
    return worse.chi2 + at_certificates - better.chi2 > incomplete(better)


def incomplete(better: Refit) -> float:
    """Chi-square by which another set has to be behind for a better one to be `complete`; infinite where none will do.

    What the better one leaves is known to a standard deviation of chi-square; where noise is stated too large it is no
    less.
    """
    if not better.problem.strategy.continuation or better.lack_of_fit < LACK_OF_FIT:
        return float("inf")
    left = max(better.lack_of_fit_chi2 - better.dof, 0.0) + float(np.sqrt(2 * better.dof))
    return left / COINCIDENCE


@dataclass(frozen=True)
class DetectableSize:
    """Smallest visible value of an effect's amplitude; None where none in its domain would be seen."""

    use: str
    parameter: str
    value: float | None
    unit: str


def minimum_detectable_sizes(
    start: Refit, acceptance: AcceptanceTest, dispersion: float, only: EffectSet | None = None
) -> list[DetectableSize]:
    """For every candidate the amplitude that the acceptance test would pass in 80 % of repetitions.

    An effect of this size, its shapes at their defaults, leaves a chi-square lambda on the refitted model
    without it. In 80 % of repetitions the fall then exceeds what acceptance needs: the larger of the F-test at the
    single-test level that the family-wise one leaves, and BIC (Saris, Satorra & van der Veld 2009; the noncentral law
    of F where the noise is estimated). Smaller effects may be there all the same.

    Parameters
    ----------
    start : Refit
        The model that the effect would be added to.
    acceptance : AcceptanceTest
        Of a step from there.
    dispersion : float
        max(s^2, 1) of the best model.
    only : set of Use, optional
        Candidates that are asked for; by default all.
    """
    found, _ = candidates(start.problem)
    level = acceptance.single_level
    return [_of(start, c, level, dispersion) for c in found if only is None or c.use in only]


def _of(start: Refit, candidate: Candidate, level: float, dispersion: float) -> DetectableSize:
    name = candidate.amplitudes[0]
    price = DECISIVE + candidate.count * float(np.log(start.problem.n_effective))
    amplitudes, dof = max(len(candidate.amplitudes), 1), noise_dof(start)
    gain = max(needed_reduction(level, amplitudes, dof, 1 if _one_sided(candidate) else 2), price)
    # Under the alternative the shapes are identified, and their fit gains as well: the law has all of the parameters.
    needed = detectable_noncentrality(gain, max(candidate.count, amplitudes), dof, POWER) * dispersion
    value = (
        _size_without_prior(start, candidate, needed)
        if candidate.without_prior
        else _moved(start, candidate, needed)
    )
    parameter = candidate.parameter(name)
    return DetectableSize(
        str(candidate.use), name, None if value is None else float(parameter.from_si(value)), parameter.unit
    )


def _one_sided(candidate: Candidate) -> bool:
    """Whether its only amplitude is neutral at an end of its domain."""
    if candidate.without_prior or len(candidate.amplitudes) != 1:
        return False
    (name,) = candidate.amplitudes
    return candidate.neutral(name) in candidate.extended.domain(name.whole)


def _size_without_prior(start: Refit, candidate: Candidate, needed: float) -> float | None:
    """Size of an instrument error: its prior holds it near zero until the data outweigh it."""
    name = candidate.without_prior[0]
    row = start.problem.pseudo_rows[name]
    step = np.zeros(start.fit.residual.size)
    step[row] = 1.0
    left = start.linear.free_chi2(step)
    width = start.problem.priors[name.whole][1]
    low, high = candidate.extended.domain(name.whole)
    if left <= 0:
        return None
    size = width * float(np.sqrt(needed / left))
    return size if size <= max(high, -low) else None


def _moved(start: Refit, candidate: Candidate, needed: float) -> float | None:
    """Size at which what the model cannot absorb of the effect reaches `needed`; refitted where a refit is cheap.

    What multiplies a parameter of the base, as a preload does the factor of bearing friction, is absorbed by far steps
    of that parameter: of a preload that is seen in four cases of five by the tangent plane, half of the chi-square.
    """
    name = candidate.amplitudes[0]
    toward = default_value(candidate, name) - candidate.neutral(name)
    size = _secant(start, candidate, needed, toward, abs(toward), start.linear.free_chi2, SETTLED)
    if size is None or start.problem.strategy.frugal:
        return size
    return _secant(start, candidate, needed, toward, size, partial(_left_by_refit, start), NEARLY)


def _secant(
    start: Refit,
    candidate: Candidate,
    needed: float,
    toward: float,
    size: float,
    left_of: Callable[[Array], float],
    close: float,
) -> float | None:
    """Size at which what is left of the weighted signature reaches `needed`, by a secant in its logarithm."""
    name = candidate.amplitudes[0]
    neutral = candidate.neutral(name)
    low, high = candidate.extended.domain(name.whole)
    most, power = abs((high if toward > 0 else low) - neutral), 2.0
    shapes: Point = {n: default_value(candidate, n) for n in candidate.shapes}
    previous: tuple[float, float] | None = None
    for _ in range(ROUNDS):
        size = min(size, most)
        point = {**shapes, name: neutral + float(np.sign(toward)) * size}
        column = changes(start.problem, start.fit, candidate, [point])[0]
        left = 0.0 if column is None else left_of(column * start.weights)
        if left <= 0:
            return None
        if abs(np.log(left / needed)) < close:
            return size
        if previous and previous[0] != size and previous[1] != left:
            power = float(np.clip(np.log(left / previous[1]) / np.log(size / previous[0]), 0.5, 4.0))
        previous = (size, left)
        if size == most and left < needed:
            return None
        size *= (needed / left) ** (1 / power)
    return size if size <= most else None


def _left_by_refit(start: Refit, change: Array) -> float:
    """Rise of the minimum of the base where a weighted change is added to its noise-free data: Gauss-Newton steps.

    The first step is along the tangent plane; where its end is as low as that promises, it is the minimum.
    """
    problem, theta = start.problem, start.fit.theta
    truth = start.fit.residual * start.weights + change
    truth[problem.n_data :] = 0.0  # priors and known ranges pull at the base as they are
    at_start = float(np.sum((start.fit.residual * start.weights)[problem.n_data :] ** 2))
    residual, jacobian = start.fit.residual * start.weights - truth, start.fit.jacobian
    low, high = problem.bounds()
    for _ in range(ROUNDS):
        columns = jacobian * start.weights[:, None] * problem.scale
        step = np.linalg.lstsq(columns, -residual, rcond=1e-10)[0]
        promised, now = float(np.sum((residual + columns @ step) ** 2)), float(residual @ residual)
        for share in SHORTER:
            there = np.clip(theta + share * step * problem.scale, low, high)
            moved = problem.residual(there) * start.weights - truth
            reached = float(moved @ moved)
            if reached < now:
                break
        else:
            break
        theta, residual = there, moved
        if reached - promised < NEARLY * reached:
            break
        jacobian = problem.jacobian(theta)
    return float(residual @ residual) - at_start


def by_effect(found: Sequence[DetectableSize]) -> dict[str, dict[str, Any] | None]:
    """Per bare effect name; of an effect at several places that of the place where it is least visible.

    ``places`` then holds the size at each place, None where it is invisible there; only an effect that is invisible
    everywhere is None as a whole.
    """
    groups: dict[str, list[DetectableSize]] = {}
    for visible in found:
        groups.setdefault(Use.parse(visible.use).name, []).append(visible)
    return {name: _together(groups[name]) for name in sorted(groups)}


def _together(found: Sequence[DetectableSize]) -> dict[str, Any] | None:
    seen = [v for v in found if v.value is not None]
    if not seen:
        return None
    worst = max(seen, key=lambda v: abs(v.value or 0.0))
    at = {v.use: Use.parse(v.use) for v in found if "@" in v.use}
    places = {at[v.use].at or str(at[v.use].copy): v.value for v in found if v.use in at}
    return {"value": worst.value, "unit": worst.unit, **({"places": places} if len(places) > 1 else {})}
