"""From a model and its measurements to the verdict: which physical effect is missing."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from specan.errors import ComputationError
from specan.models import Use
from specan.study.design.operating_points import Proposal, explore, propose
from specan.study.estimation.fit import NORMAL_95, Fit, fit, profile_interval
from specan.study.estimation.prediction_error import ObservableError, observable_errors
from specan.study.estimation.problem import Problem
from specan.study.localisation.by_blocks import MOST_ROWS, Block
from specan.study.localisation.localise import localise
from specan.study.localisation.mistaken_set_up import mistaken_set_up
from specan.study.selection.acceptance import DECISIVE, left_out_error
from specan.study.selection.alternatives import alternatives, other_forms
from specan.study.selection.detectable_size import by_effect, minimum_detectable_sizes
from specan.study.selection.doubtful_data import (
    WHOLE,
    copied_rows,
    drift_over_rows,
    odd_repeat,
    rows_of_two_kinds,
    suspect_rows,
)
from specan.study.selection.initial_fit import InitialFit, initial_fit, with_covariances_about
from specan.study.selection.pulls import (
    ODDS,
    DataAlone,
    Pull,
    data_alone,
    pulls,
    shown,
    stretched,
    what_would_tell,
)
from specan.study.selection.refits import FORM_TOLERANCE, POOR_FIT, Refit, Refits
from specan.study.selection.residual_law import residual_law
from specan.study.selection.search import Progress, Search
from specan.study.selection.significance import LACK_OF_FIT
from specan.study.verdict import Diagnosis, ErrorFall, LackOfFit, Ranked

LEAST_DOF = 3.0  # degrees of freedom below which no test is made
STARTS = 3  # of the fit of the base
MOST_PLACES = 12  # where the model fails, that are told
MOST_OTHERS = 3  # sets behind the best between which a measurement is proposed
MOST_PULLS = 3  # values or rivals in one sentence
TOO_GOOD = 0.3  # reduced chi-square below which the stated uncertainty contradicts the scatter
ENOUGH = 10.0  # degrees of freedom: with fewer, chance alone goes below that (chi-square, 2 in 100)


def diagnose(
    problem: Problem,
    *,
    base: Fit | None = None,
    bootstrap: bool = False,
    progress: Progress | None = None,
) -> Diagnosis:
    """Find out which effect a model is missing.

    Parameters
    ----------
    problem : Problem
        The model with the effects it has, its observations, nuisances and free parameters.
    base : Fit, optional
        A fit of it, where it has been fitted already.
    bootstrap : bool
        Family-wise probabilities by simulation of the maximum over all candidates instead of a bound.
    progress : callable, optional
        Told in a few words what is being done.

    Returns
    -------
    Diagnosis

    Raises
    ------
    ComputationError
        A fit that a verdict would rest on did not converge or is not finite.
    """
    start = Refit(frozenset(), problem, base or fit(problem, starts=STARTS))
    why = untestable(start)
    if why:
        return Diagnosis("cannot-tell", why, model_discrepancy_percent=_discrepancy(problem))
    progress = progress or (lambda text: None)
    if start.problem.strategy.continuation and start.reduced > POOR_FIT:
        progress("checking positions and signs of the channels against the data")
        mistake = mistaken_set_up(problem)
        if mistake.text:
            return Diagnosis(
                "cannot-tell",
                f"{mistake.sentence}; correct it, and begin the study again",
                lack_of_fit=LackOfFit(start.reduced, start.lack_of_fit, problem.n_effective),
                model_discrepancy_percent=_discrepancy(problem),
            )
    near = initial_fit(start, progress)
    search = _nearer(start, near, Search(Refits(near.base, near.known), near.likely, bootstrap, progress))
    whole = _searched(search)
    return _conclude(_of_likeliest_form(whole, progress, bootstrap))


@dataclass(frozen=True, eq=False)
class _Searched:
    """A finished search, its alternatives and what they amount to."""

    search: Search
    sets: list[Refit]
    found: _Found


@dataclass(frozen=True, eq=False)
class _OfForms:
    """The likeliest search over published forms of the base, the form that it rests on, and those as likely."""

    best: _Searched
    form: str = ""
    rivals: Mapping[str, _Searched] = field(default_factory=dict)

    def others(self) -> list[str]:
        """What is missing with a form that is as likely, where that is not what the verdict says."""
        named = {r.uses for r in self.best.sets} or {frozenset()}
        return [
            f"{_in_form(form)} {_names(rival.sets) or 'nothing'} would be missing"
            for form, rival in self.rivals.items()
            if rival.search.best.uses not in named
        ]

    def sizes(self, named: Mapping[str, Mapping[str, Any]]) -> list[str]:
        """Values of the named effects that lie outside their intervals with a form that is as likely."""
        said = []
        for form, rival in self.rivals.items():
            if rival.search.best.uses != self.best.search.best.uses:
                continue
            for name, there in parameters_of(rival.search.best).items():
                if not named[name]["low"] <= there["value"] <= named[name]["high"]:
                    unit = "" if there["unit"] == "1" else f" {there['unit']}"
                    said.append(f"{name} is {there['value']:.2g}{unit} {_in_form(form)}, which fits as well")
        return said


def _searched(search: Search) -> _Searched:
    search.run()
    sets = alternatives(search)
    _check_failures(search)
    return _Searched(search, sets, _verdict(search, sets))


def _of_likeliest_form(declared: _Searched, progress: Progress, bootstrap: bool) -> _OfForms:
    """The search, with a part of the base in another published form where that explains the data better.

    Only where the declared form leaves something to explain.
    """
    if declared.found.kind == "nothing-missing" and not declared.found.doubt:
        return _OfForms(declared)
    tried = {"": declared}
    for other in other_forms(declared.search.base):
        progress(f"searching with {other.text}")
        tried[other.text] = _searched(Search(Refits(other.start), (), bootstrap, progress))
    chosen = _likeliest(tried)
    best = tried.pop(chosen)
    return _OfForms(best, chosen, {form: one for form, one in tried.items() if _as_likely(one, best)})


def _likeliest(tried: Mapping[str, _Searched]) -> str:
    """The form that a verdict rests on: the declared one unless another is decisively better.

    What needs no effect comes first, unless an effect is decisively better than every form without one: that something
    is missing is tested against all published forms together.
    """
    chosen = ""
    for form, one in tried.items():
        if _ahead(one.search.best, tried[chosen].search.best) > DECISIVE:
            chosen = form
    lead = tried[chosen].search.best
    whole = [
        form
        for form, one in tried.items()
        if one.found.kind == "nothing-missing" and _ahead(lead, one.search.best) <= DECISIVE
    ]
    return min(whole, key=lambda form: -_ahead(tried[form].search.best, lead), default=chosen)


def _ahead(one: Refit, other: Refit) -> float:
    """BIC by which one fit is likelier than another, chi-square in units of the smaller dispersion."""
    dispersion = min(one.dispersion, other.dispersion)
    return other.bic(dispersion) - one.bic(dispersion)


def _as_likely(one: _Searched, best: _Searched) -> bool:
    """Whether the data admit a verdict with another form of the base as well as the best one.

    The same rule as between effects: behind by less than what is decisive and what the equation of the effects that
    are named may be off. What does not fit, or only with values that are not known, explains nothing.
    """
    explained = (best.search.base.chi2 - best.search.best.chi2) / best.search.best.dispersion
    behind = _ahead(best.search.best, one.search.best)
    return (
        one.found.kind in ("nothing-missing", "effect", "group")
        and behind < DECISIVE + FORM_TOLERANCE**2 * explained
    )


def _nearer(start: Refit, near: InitialFit, search: Search) -> Search:
    """The search with covariances about the single effect that it finds best, where they were about another field.

    About another field, what the best effect leaves seems to be a channel's place or gain.
    """
    if not search.refits.poor_fit:
        return search
    single = search.single
    if single is None or single.uses == near.found:
        return search
    search.progress("once more, with covariances about the field that was found")
    done = {uses: r.problem.values_at(r.fit.theta) for uses, r in search.refits.done.items() if uses}
    order = sorted(search.refits.of_size(1), key=lambda r: r.chi2)
    likely = [use for r in order[:MOST_OTHERS] for use in r.uses]
    base = with_covariances_about(start, single.uses, done[single.uses])
    return Search(Refits(base, {**near.known, **done}), likely, search.bootstrap, search.progress, only=True)


def untestable(start: Refit) -> str:
    """Why no test is possible; empty where one is."""
    problem = start.problem
    if start.dof < LEAST_DOF:
        return (
            f"{problem.n_effective:.0f} measured values leave {max(start.dof, 0):.0f} degrees of freedom "
            f"beside {len(problem.names)} parameters; at least {LEAST_DOF:.0f} are needed"
        )
    if start.linear.rank < len(problem.names):
        return (
            f"the data determine only {start.linear.rank} of the model's {len(problem.names)} parameters: "
            f"hold some of them fixed or measure more conditions"
        )
    return ""


def _check_failures(search: Search) -> None:
    """A set that the score test would have let through must not be lost to a fit that failed."""
    for uses, reason in search.refits.failed.items():
        if len(uses) == 1:
            step = search.step(search.base)
            gain = step.by_use[next(iter(uses))][0].chi2_reduction
            if search.best.uses or gain / search.base.dispersion < step.acceptance.needed_reduction:
                continue
            raise ComputationError(
                f"the fit with {', '.join(map(str, uses))} failed ({reason}) though the data ask for it",
                remedy="give its parameters other bounds or start values",
            )


def _conclude(forms: _OfForms) -> Diagnosis:
    search, sets = forms.best.search, forms.best.sets
    found = _with_forms(forms)
    base, best = search.base, search.best
    step = search.step(best)
    fails_at = localise(base.problem, base.fit).fails_at
    ranking = _ranking(search, sets)
    visible = by_effect(
        [*minimum_detectable_sizes(step.seen, step.acceptance, best.dispersion), *_of_members(search)]
    )
    return Diagnosis(
        verdict=found.kind,
        reason=found.reason,
        alternatives=tuple(tuple(sorted({u.name for u in r.uses})) for r in sets),
        at=_places(u for r in sets for u in r.uses),
        unknown_possible=found.doubt,
        ranking=ranking,
        lack_of_fit=LackOfFit(base.reduced, base.lack_of_fit, base.problem.n_effective),
        model_discrepancy_percent=_discrepancy(base.problem),
        fails_at=tuple(block.as_dict() for block in fails_at[:MOST_PLACES]),
        residual_law=residual_law(_what_is_left(search, found.kind))
        if _left_to_describe(search, found)
        else None,
        smallest_visible=visible,
        not_testable=search.step(base).not_testable,
        other_form=forms.form,
        next_measurement=tuple(p.to_json() for p in _next(search, sets, found.kind, fails_at)),
        pulls=shown(found.values or pulls(best)),
        error=_error_fall(base, best),
        remarks=tuple(
            r
            for r in (
                copied_rows(base),
                suspect_rows(base),
                rows_of_two_kinds(base),
                drift_over_rows(base),
                odd_repeat(base),
                *_better_but_too_far(search, sets),
                *_too_good(base),
                *(forms.sizes(ranking[0].parameters) if best.uses else ()),
            )
            if r
        ),
    )


def _next(search: Search, sets: list[Refit], verdict: str, fails_at: Sequence[Block]) -> Sequence[Proposal]:
    """Measurements between the rivals; between the best and the next in rank where there are none."""
    if verdict == "unknown-effect":
        return explore(search.best, fails_at)
    others = [r for r in search.refits.of_size(1) if r not in sets and search.believable(r)]
    others.sort(key=lambda r: r.bic(search.best.dispersion))
    if len(sets) > 1:
        return propose(sets)
    if search.base.problem.strategy.pruning:
        others = [r for r in others[:1] if not search.refits.beyond_pruning_bound(r.chi2, search.best.chi2)]
    return propose([search.best, *others[:MOST_OTHERS]], other_kinds=False)


@dataclass(frozen=True)
class _Found:
    """Verdict, the reason in one sentence, and whether something unknown would explain the data as well."""

    kind: str
    reason: str
    doubt: bool = False
    values: tuple[Pull, ...] = ()  # that another fit takes, on which the verdict rests


def _verdict(search: Search, sets: list[Refit]) -> _Found:
    base, best = search.base, search.best
    if not best.uses:
        return _of_base(search)
    names = _names(sets)
    if search.third is not None:
        return _Found(
            "unknown-effect", "three effects or more would be needed; one unknown is likelier", True
        )
    if best.lack_of_fit_p_beyond(FORM_TOLERANCE**2 * (base.chi2 - best.chi2)) < LACK_OF_FIT:
        return _Found("unknown-effect", f"{names} explains a part, and much is left", True)
    contradicted = search.too_far(best)
    if contradicted:
        return _Found(
            "fits-only-if", f"with {names} it fits only with {_values(contradicted)}{_telling(best)}", True
        )
    return _Found("effect" if len(sets) == 1 else "group", "")


def _with_doubts(search: Search, sets: list[Refit], found: _Found) -> _Found:
    """What speaks against an effect or a group that was found."""
    if found.kind not in ("effect", "group"):
        return found
    base, best = search.base, search.best
    left = best.lack_of_fit < WHOLE or bool(search.extensions) or _fails_somewhere(best)
    left = left or (len(best.uses) == 1 and _follows_a_law(best))
    several = len(best.uses) > 1 and not search.of_one_instrument(best)
    reasons = []
    if left:
        reasons.append("something is left: its form is not exact, or another effect is there too")
    elif several:
        reasons.append("one unknown effect would explain the data as well")
    second = [] if left else _second_possible(search)
    if second:
        reasons.append(f"a second effect may be there too, such as {' or '.join(second)}")
    if stretched(best):
        reasons.append(
            f"it takes {_values(stretched(best))}: one unknown effect would explain the data as well"
        )
    if base.lack_of_fit >= LACK_OF_FIT and search.too_far(base):
        reasons.append(f"without it the model fits only with {_values(search.too_far(base))}")
    suspect = bool(suspect_rows(base) or stretched(best) or _better_but_too_far(search, sets))
    return replace(found, reason="; ".join(reasons), doubt=left or bool(second) or several or suspect)


def _second_possible(search: Search) -> list[str]:
    """Effects that improve a single one decisively by BIC and in cross-validation, but too little to be named.

    The family-wise probability is above the level of a name and below `WHOLE`, above which the rest is called whole.
    """
    best = search.best
    if len(best.uses) != 1:
        return []
    found = [
        (decision.p_value, ", ".join(sorted(map(str, refit.uses - best.uses))))
        for refit in search.refits.of_size(2)
        if best.uses < refit.uses
        and (decision := search.decision(refit)).p_value < WHOLE
        and decision.delta_bic > DECISIVE
        and decision.held_out_gain > 0
    ]
    return [f"{name} (p = {p:.1g})" for p, name in sorted(found)[:MOST_OTHERS]]


def _names(sets: Sequence[Refit]) -> str:
    return " or ".join(" with ".join(sorted(map(str, r.uses))) for r in sets)


def _in_form(form: str) -> str:
    return f"with {form}" if form else "with the declared form"


def _with_forms(forms: _OfForms) -> _Found:
    """The verdict with the form of a part that it rests on; a doubt only where another form would change it."""
    best, others = forms.best, forms.others()
    found = _with_doubts(best.search, best.sets, best.found)
    said = f"with {forms.form}, another published form of the same part" if forms.form else ""
    reason = ": ".join(text for text in (said, found.reason) if text)
    if found.kind not in ("nothing-missing", "effect", "group") or not others:
        return replace(found, reason=reason)
    said = f"the form of the base is not certain, and {' and '.join(others)}"
    return replace(found, reason="; ".join(text for text in (reason, said) if text), doubt=True)


def _of_base(search: Search) -> _Found:
    """The verdict where no effect of the catalogue improves the model."""
    base = search.base
    contradicted = search.too_far(base)
    if base.lack_of_fit < LACK_OF_FIT:
        reason = "the model does not fit, and no effect of the catalogue explains it"
        if contradicted:
            reason += f"; even so it takes {_values(contradicted)}"
        return _Found("unknown-effect", reason, True)
    if contradicted:
        return _Found(
            "fits-only-if", f"the model fits only with {_values(contradicted)}{_telling(base)}", True
        )
    other = data_alone(base)
    if other.contradicts:
        return _Found(
            "fits-only-if",
            f"the model fits only with {_values(other.values)}{_beside(other)}{_telling(base)}",
            True,
            other.values,
        )
    if other.values and other.likelier:
        reason = (
            f"the model fits within what is known (p = {base.lack_of_fit:.2g}), and no effect of the catalogue "
            f"improves it; it fits better with {_values(other.values)}{_beside(other)}{_telling(base)}"
        )
        return _Found("nothing-missing", reason, True)
    return _Found("nothing-missing", "the model fits, and no effect of the catalogue improves it")


def _values(contradicted: Sequence[Pull]) -> str:
    """``mu = 0.22, known 0.01 to 0.12, and exponent = 3.2, known 0.8 to 2.2``."""
    return ", and ".join(pull.text for pull in contradicted[:MOST_PULLS])


def _beside(other: DataAlone) -> str:
    said = f"; held to what is known chi-square is higher by {other.gain:.1f} (p = {other.p_value:.2g})"
    if other.predicts > ODDS:
        odds = float(f"{np.exp(min(other.predicts / 2, 30.0)):.1g}")
        said += f", and conditions that are left out are predicted worse (odds of {odds:,.0f} to 1)"
    return said


def _telling(refit: Refit) -> str:
    wanted = what_would_tell(refit)
    return f"; what would tell: {wanted}" if wanted else ""


def _better_but_too_far(search: Search, sets: list[Refit]) -> tuple[str, ...]:
    """Sets that meet the data decisively better than the best, with values that contradict what is known."""
    best = search.best
    if not best.uses or not search.believable(best):
        return ()
    paid = best.bic(best.dispersion) - best.pulled / best.dispersion
    found = []
    for refit in search.refits.done.values():
        if not refit.uses or refit in sets or refit.uses > best.uses or len(refit.uses) > len(best.uses):
            continue
        gain = paid - (refit.bic(best.dispersion) - refit.pulled / best.dispersion)
        if gain > DECISIVE and search.too_far(refit):
            names = " with ".join(sorted(map(str, refit.uses)))
            found.append((gain, f"{names} fits better, but only with {_values(search.too_far(refit))}"))
    return tuple(text for _, text in sorted(found, reverse=True)[:MOST_PULLS])


def _too_good(base: Refit) -> tuple[str, ...]:
    """A remark where the data scatter less than their uncertainty says: then nothing small is seen."""
    if not base.reduced < TOO_GOOD or base.dof < ENOUGH:
        return ()
    return (
        f"reduced chi-square {base.reduced:.2f}: the measurement is stated {1 / np.sqrt(max(base.reduced, 1e-4)):.1f} "
        "times as uncertain as it scatters, so that small effects stay hidden. Different conditions may have been "
        "taken for repeats, or the declared model discrepancy or uncertainty is too large",
    )


def _error_fall(base: Refit, best: Refit) -> ErrorFall:
    before, after = _errors(base), _errors(best)
    if not base.problem.strategy.secondary_refits:
        return ErrorFall(before, after)
    return ErrorFall(before, after, left_out_error(base), left_out_error(best))


def _left_to_describe(search: Search, found: _Found) -> bool:
    """Whether there is a residual to describe: not where the model meets the data."""
    return found.doubt and (bool(search.best.uses) or found.kind == "unknown-effect")


def _has_independent_rows(problem: Problem) -> bool:
    """Whether rows can be looked at one by one: those of tables, not lines of a transfer function."""
    return problem.n_data <= MOST_ROWS and problem.n_effective >= problem.n_data


def _fails_somewhere(best: Refit) -> bool:
    """Whether blocks of conditions stand out of what a set leaves."""
    return _has_independent_rows(best.problem) and bool(localise(best.problem, best.fit).fails_at)


def _follows_a_law(best: Refit) -> bool:
    """Whether what a set leaves goes with powers of the operating variables; seen before the whole misfits."""
    law = residual_law(best) if _has_independent_rows(best.problem) else None
    return law is not None and law.p_value < LACK_OF_FIT


def _what_is_left(search: Search, verdict: str) -> Refit:
    """The fit whose residual is described: the base's where nothing of the catalogue is sure."""
    return search.base if verdict == "unknown-effect" or len(search.best.uses) > 1 else search.best


def _of_members(search: Search) -> list[Any]:
    """Smallest visible sizes of the effects that were found, from the base."""
    if not search.best.uses:
        return []
    step = search.step(search.base)
    found = minimum_detectable_sizes(step.seen, step.acceptance, search.best.dispersion)
    return [v for v in found if v.use in {str(u) for u in search.best.uses}]


def _ranking(search: Search, sets: list[Refit]) -> tuple[Ranked, ...]:
    dispersion = search.best.dispersion
    others = [r for r in search.refits.done.values() if r.uses and r not in sets]
    others.sort(key=lambda r: (not search.believable(r), r.bic(dispersion)))
    return tuple(_ranked(search, refit, refit in sets) for refit in [*sets, *others])


def _ranked(search: Search, refit: Refit, named: bool) -> Ranked:
    base, dispersion = search.base, search.best.dispersion
    decision, error = search.decision(refit), _errors(refit)
    return Ranked(
        effects=tuple(sorted(u.name for u in refit.uses)),
        at=_places(refit.uses),
        delta_bic=base.bic(dispersion) - refit.bic(dispersion),
        p_value=decision.p_value,
        held_out_gain=decision.held_out_gain,
        error_after=error.rms,
        level_after_dB=error.level_dB,
        parameters=parameters_of(refit, named),
        plausible=search.believable(refit),
        at_bound=any(n.owner in {str(u) for u in refit.uses} for n in refit.fit.at_bound),
        pulls=shown(pulls(refit)),
    )


def _errors(refit: Refit) -> ObservableError:
    """Error of the observable with most values, in its unit."""
    problem = refit.problem
    predicted = problem.predictions(refit.fit.theta)
    return observable_errors(problem, problem.observations, predicted)[0]


def parameters_of(refit: Refit, profiled: bool = False) -> dict[str, dict[str, Any]]:
    """Own parameters of the effects, with 95 % intervals, in their declared units.

    `profiled`: all other parameters are refitted along an interval, which then follows a valley and the ends of known
    ranges; else, or where such a refit fails, it is that of the covariance.
    """
    table: dict[str, dict[str, Any]] = {}
    own = {str(u) for u in refit.uses}
    for k, name in enumerate(refit.fit.names):
        if name.owner not in own:
            continue
        parameter = refit.problem.assembly.parameters[name.whole]
        low, high = _interval(refit, k, profiled and refit.problem.strategy.secondary_refits)
        table[name] = {
            "value": parameter.from_si(float(refit.fit.theta[k])),
            "low": parameter.from_si(low),
            "high": parameter.from_si(high),
            "unit": parameter.unit,
        }
    return table


def _interval(refit: Refit, k: int, profiled: bool) -> tuple[float, float]:
    """95 % interval of one element of theta, SI, inside its domain."""
    name = refit.fit.names[k]
    if profiled:
        try:
            return profile_interval(refit.problem, refit.fit, name, inflate=True)
        except (ComputationError, ValueError):  # a refit that fails, or an end that is not bracketed
            pass
    low, high = refit.problem.bounds()
    value = float(refit.fit.theta[k])
    reach = NORMAL_95 * refit.fit.standard_error(name) * float(np.sqrt(refit.dispersion))
    return float(max(value - reach, low[k])), float(min(value + reach, high[k]))


def _places(uses: Iterable[Use]) -> Mapping[str, tuple[str, ...]]:
    found: dict[str, set[str]] = {}
    for use in uses:
        if use.at:
            found.setdefault(use.name, set()).add(use.at)
    return {name: tuple(sorted(places)) for name, places in sorted(found.items())}


def _discrepancy(problem: Problem) -> float:
    return float(problem.assembly.model.rig.discrepancy_percent)
