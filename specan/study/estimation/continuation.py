"""Fits that find their way from afar: all lines equally uncertain, by much at first, then by less.

A resonance that is half a bandwidth off pulls a sharp fit anywhere: into instruments beyond their priors,
into another minimum. Seen with an uncertainty of a third of the sound field's level, peaks only have to lie near
each other, and priors weigh more than lines; where that fit ends, one with less begins.

Covariances that depend on where the model is are taken about such a fit. A receiver that stands two millimetres off
reads the gradient of the field there: how much that is, only a fitted model tells. The covariance is linearised about
one fit, and then stays the same for every model that is compared, so that chi-squares can be.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from specan.errors import ComputationError
from specan.models import Assembly
from specan.models.kept import each_anew
from specan.study.estimation.levenberg_marquardt import SCREENING_JACOBIANS, best_screened, descend_steps, led
from specan.study.estimation.problem import Problem
from specan.study.observation import Array, brought

STAGES = (20.0, 5.0)  # per cent of the RMS over channels
ENOUGH = 8  # Jacobians a stage: what a fit still gains then, such uncertainties do not tell from nothing

JACOBIANS = 3  # of all lines, about whose end the covariance is taken


def down_weighted(
    problem: Problem, percent: float = STAGES[-1], values: Mapping[str, Any] | None = None
) -> Problem:
    """The problem on few lines of recordings, each known to so many per cent of the level around it.

    No windows are in it; where values of a fit are given, what the windows do to that fit is taken off the data.
    """
    seen = problem.observations
    if values is not None:
        seen = tuple(o.without_leakage(problem.assembly, problem.seen_by(o, values)) for o in seen)
    return problem.over([o.down_weighted(percent) for o in seen])


def continuation_fit(
    problem: Problem, starts: Sequence[Mapping[str, Any]] = ({},), rough: bool = False
) -> dict[str, Any]:
    """SI values where a fit in stages ends, the best of several starts.

    Of many starts the two that some Jacobians lead lowest go on. A down-weighted view does not see small effects. Of
    several starts that fit it equally well, a subsample with the windows chooses; not where a `rough` fit will do.

    Raises
    ------
    ComputationError
        No start leads anywhere.
    """
    continued = 2  # of several starts
    first, last = (down_weighted(problem, percent) for percent in STAGES)
    few = SCREENING_JACOBIANS if len(starts) > continued else ENOUGH
    given = [problem.start(values) for values in starts]
    reached, reason = led(first, given, few)
    near = reached[:continued]
    try:
        theta = descend_steps(last, best_screened(last, near), ENOUGH)
    except ComputationError as fault:
        raise ComputationError(
            f"a first fit failed: {reason or fault.found}",
            remedy="give other start values or narrower bounds",
        ) from fault
    if len(starts) == 1 or rough:
        return problem.values_at(theta)
    # what windows do would hide a small effect
    plain = down_weighted(problem, values=problem.values_at(theta))
    stepped = each_anew(lambda t: descend_steps(plain, t, SCREENING_JACOBIANS), near)
    seen = [(chi2_at(plain, t), t) for t in (theta, *given, *stepped)]
    met = max(min(chi2 for chi2, _ in seen), plain.n_data)
    return problem.values_at(_nearest(problem, [t for chi2, t in seen if chi2 <= met]))


def _nearest(problem: Problem, thetas: Sequence[Array]) -> Array:
    """That of several places from where some Jacobians lead lowest, each on a subsample of its own."""
    if len(thetas) == 1:
        return thetas[0]

    def there(theta: Array) -> tuple[float, Array]:
        subsample = problem.subsampled(theta)
        found = descend_steps(subsample, theta, SCREENING_JACOBIANS)
        return chi2_at(subsample, found), found

    return min(each_anew(there, thetas), key=lambda r: r[0])[1]


def chi2_at(problem: Problem, theta: Array) -> float:
    """Sum of squares; infinite where the model has no value, which is no reason to give up the other starts."""
    try:
        residual = problem.residual(theta)
    except ComputationError:
        return float("inf")
    return float(residual @ residual)


def linearised(
    problem: Problem, starts: Sequence[Mapping[str, Any]] = ({},), ended: Mapping[str, Any] | None = None
) -> Problem:
    """The problem with covariances about a fit of its own, and a start there; itself where they depend on none.

    A continuation fit is not near enough, because it does not see the windows: a receiver's gain, say, would act on
    another field than its calibration's uncertainty does, and seem to be known better than the calibration.
    From there all lines are fitted by a few steps, and the covariances taken about that.

    Parameters
    ----------
    problem : Problem
    starts : sequence of mapping
        SI values from which the continuation fit sets out; those that lack stand as the problem has them.
    ended : mapping, optional
        Where it ended, if that is known.
    """
    if not problem.strategy.linearised_covariance:
        return problem
    values: Mapping[str, Any] = continuation_fit(problem, starts) if ended is None else ended
    values = with_shifts(problem, problem.assembly, values)
    near = _linear_about(problem, problem.assembly, values)
    theta = descend_steps(near, near.start(values), JACOBIANS)
    values = with_shifts(problem, problem.assembly, near.values_at(theta))
    found = _linear_about(problem, problem.assembly, values)
    return replace(found, values={**found.values, **{name: values[name] for name in problem.free}})


def about(problem: Problem, assembly: Assembly, values: Mapping[str, Any]) -> Problem:
    """The problem with covariances about a model at given values; places that are free in the problem have no error.

    Where single modes may be shifted, the problem then holds the shifts that are most probable with that model.
    """
    return _linear_about(problem, assembly, with_shifts(problem, assembly, values))


def with_shifts(problem: Problem, assembly: Assembly, values: Mapping[str, Any]) -> Mapping[str, Any]:
    """The values with the most probable shifts of modes, where any are declared."""
    find = brought(problem.observations, "with_mode_shifts")
    return values if find is None else find(problem, assembly, values)


def _linear_about(problem: Problem, assembly: Assembly, values: Mapping[str, Any]) -> Problem:
    placed = [str(use) for use in problem.assembly.uses]
    found = problem.over(
        [o.about(assembly, problem.seen_by(o, values), placed=placed) for o in problem.observations]
    )
    shifts = brought(problem.observations, "mode_shifts")
    return replace(found, values={**found.values, **shifts(assembly, values)}) if shifts else found
