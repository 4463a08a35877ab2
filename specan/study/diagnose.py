"""From a model and its measurements to the verdict: which physical effect is missing.

The method in its order: fit the model as it is; check that the data can tell anything; score every candidate, refit the
best, accept or reject them; compare what is left; see where the model fails; propose what to measure next.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, replace
from functools import cached_property
from typing import Any

from specan.errors import SpecanError, unforeseen
from specan.models.effect import ParameterName
from specan.study.conclusion import Conclusion, better_but_too_far, conclude, with_doubts
from specan.study.design.operating_points import Proposal, explore, propose
from specan.study.estimation.fit import Fit, fit
from specan.study.estimation.problem import Problem
from specan.study.evidence.diagnosis import diagnosis, not_settled, too_good
from specan.study.localisation.localise import Block, localise
from specan.study.localisation.mistaken_set_up import MistakenSetUp, mistaken_set_up, undeclared_shifts
from specan.study.observation.table import TableObservation
from specan.study.recorded_noise import with_noise_of_largest
from specan.study.selection.acceptance import by_effect, minimum_detectable_sizes
from specan.study.selection.alternatives import alternatives, refit_promising
from specan.study.selection.initial_fit import NEAR, InitialFit, initial_fit, with_covariances_about
from specan.study.selection.pulls import Pull, pulls, shown
from specan.study.selection.refits import Refit, Refits
from specan.study.selection.search import Progress, Search, unheard
from specan.study.selection.significance import LACK_OF_FIT
from specan.study.verdict import (
    Diagnosis,
    LackOfFit,
    error_fall,
    errors,
    parameters_of,
    places_of,
    ranking,
)

LEAST_DOF = 3.0  # degrees of freedom below which no test is made
STARTS = 3  # of the fit of the base
MOST_PLACES = 12  # where the model fails, that are told
MOST_OTHERS = 3  # sets behind the best between which a measurement is proposed
ENDS = 0.95  # share of a diagnosis that is over when its searches are


class Stopped(KeyboardInterrupt):
    """A diagnosis was stopped; it has the searches as far as they came.

    Attributes
    ----------
    searches : tuple of Search
    """

    def __init__(self, searches: tuple[Search, ...]) -> None:
        super().__init__()
        self.searches = searches

    @cached_property
    def content(self) -> dict[str, Any]:
        """The effects that were refitted, most likely first, as plain values; of the latest search that has any.

        ``rough`` where only a few lines, known to some per cent, were looked at so far.
        """
        done, rough = next((found for s in reversed(self.searches) if (found := s.fitted)[0]), ([], False))
        rows = []
        for refit in sorted(done, key=lambda r: r.bic(1.0)):
            error = errors(refit)[0]
            rows.append(
                {
                    "effects": sorted(map(str, refit.uses)),
                    "reduced_chi2": refit.reduced,
                    "error_after": error.rms,
                    "unit": error.unit,
                    "parameters": parameters_of(refit),
                }
            )
        return {"finished": False, "rough": rough, "refitted": rows}


def diagnose(
    problem: Problem,
    *,
    base: Fit | None = None,
    set_up: MistakenSetUp | None = None,
    progress: Progress | None = None,
    begun: list[Any] | None = None,
) -> Diagnosis:
    """Find out which effect a model is missing.

    Parameters
    ----------
    problem : Problem
        The model with the effects it has, its observations, nuisances and free parameters.
    base : Fit, optional
        A fit of it, where it has been fitted already.
    set_up : MistakenSetUp, optional
        What `mistaken_set_up` has found, where it has been looked for already.
    progress : callable, optional
        Told in a few words what is being done.
    begun : list of Search, optional
        The searches are put into it as they are begun.

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
    progress, begun = progress or unheard, [] if begun is None else begun
    if all(isinstance(o, TableObservation) for o in problem.observations):
        return diagnosis(*with_noise_of_largest(problem, start.fit), progress, begun)
    declared = Search(Refits(start), (), progress, part=(0.0, ENDS))
    if start.poor_fit:
        progress("checking positions and signs of the channels against the data", 0.0)
        mistake, near = set_up or mistaken_set_up(problem), InitialFit(start)
        if not mistake.text:
            near = initial_fit(start, progress, lambda rough: begun.append(Search(rough)))
            mistake = mistake_beside(near, problem)
        if mistake.text:
            return Diagnosis(
                "cannot-tell",
                f"{mistake.sentence}; correct it, and begin the study again",
                lack_of_fit=LackOfFit(start.reduced, start.lack_of_fit, problem.n_effective),
                model_discrepancy_percent=_discrepancy(problem),
            )
        declared = _about_a_near_field(start, near, progress, begun)
    begun.append(declared)
    declared.run()
    refit_promising(declared)
    progress("where the model fails, and what to measure next", ENDS)
    return _verdict(declared, alternatives(declared))


def mistake_beside(near: InitialFit, problem: Problem) -> MistakenSetUp:
    """A mistake of the set-up in what the effects of a first fit leave, where a lining, say, makes the larger part.

    Data that they meet within the few per cent of a down-weighted view are not looked at again.
    """
    if not near.found or near.left < 1:
        return MistakenSetUp()
    values = {n: v for n, v in near.known[near.found].items() if ParameterName(n).owned_by(near.found)}
    with_effects = problem.with_uses(sorted(near.found))
    found = mistaken_set_up(replace(with_effects, values={**with_effects.values, **values}))
    names = " and ".join(sorted(map(str, near.found)))
    return replace(found, text=f"beside {names}, {found.text}") if found.text else found


def _about_a_near_field(start: Refit, near: InitialFit, progress: Progress, begun: list[Search]) -> Search:
    """A search with covariances about the single effect that it finds best, where they were about another field.

    About another field, what the best effect leaves seems to be a channel's place or gain.
    """
    search = Search(Refits(near.base, near.known), near.likely, progress, part=(NEAR, ENDS))
    begun.append(search)
    if not search.refits.poor_fit or search.single is None or search.single.uses == near.found:
        return search
    single = search.single
    search.progress("once more, with covariances about the field that was found", (NEAR + ENDS) / 2)
    done = {uses: r.problem.values_at(r.fit.theta) for uses, r in search.refits.done.items() if uses}
    order = sorted(search.refits.of_size(1), key=lambda r: r.chi2)
    likely = [use for r in order[:MOST_OTHERS] for use in r.uses]
    base = with_covariances_about(start, single.uses, done[single.uses])
    known = {**near.known, **done}
    return Search(Refits(base, known), likely, progress, only=True, part=((NEAR + ENDS) / 2, ENDS))


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


def _failures(search: Search) -> list[str]:
    """Sets that the score test would have let through, and whose fit failed."""
    said = []
    for uses, reason in search.refits.failed.items():
        step = search.step(search.base)
        scored = step.by_use.get(next(iter(uses)), [])
        if len(uses) == 1 and not search.best.uses and scored:
            gain = scored[0].chi2_reduction
            if gain / search.base.dispersion >= step.acceptance.needed_reduction:
                said.append(
                    f"the fit with {', '.join(map(str, uses))} failed ({reason}) though the data support it: give its "
                    "parameters other bounds or start values"
                )
    return said


class Beside:
    """What is told beside a verdict: a part that fails is told in a sentence, and costs nothing else.

    Attributes
    ----------
    failures : list of str
    """

    def __init__(self) -> None:
        self.failures: list[str] = []

    def __call__(self, what: str, find: Callable[[], Any], otherwise: Any) -> Any:
        """What `find` gives; `otherwise` where it fails."""
        try:
            return find()
        except Exception as fault:
            reason = fault.found if isinstance(fault, SpecanError) else unforeseen(fault)
            self.failures.append(f"{what} could not be worked out ({reason})")
            return otherwise


def _verdict(search: Search, sets: list[Refit]) -> Diagnosis:
    """What is found, what it rests on, and what to measure next."""
    plain = conclude(search, sets)
    base, best, beside = search.base, search.best, Beside()
    found = beside("what speaks against the verdict", lambda: with_doubts(plain, search, sets), plain)
    fails_at = beside("where the model fails", lambda: localise(base.problem, base.fit).fails_at, ())
    rows = beside("the table of what was tried", lambda: ranking(search, sets), ())
    proposals = beside("what to measure next", lambda: _next(search, sets, found.kind, fails_at), ())
    error = beside("the error", lambda: error_fall(base, best), None)
    visible = beside("the smallest visible sizes", lambda: _visible(search, sets), {})
    pulled = found.values or beside("what is off its known value", lambda: pulls(best), ())
    remarks: list[tuple[str, Callable[[], Iterable[str]]]] = [
        ("rivals with values that are not known", lambda: better_but_too_far(search, sets)),
        ("instruments off their certificates", lambda: _off_certificates(best, pulled)),
        ("the scatter beside its uncertainty", lambda: [too_good(base)]),
        ("shifts of modes", lambda: _undeclared(base, found)),
        ("fits that failed", lambda: [not_settled(base), *_failures(search)]),
    ]
    said = [text for what, find in remarks for text in beside(what, find, ()) if text]
    return Diagnosis(
        verdict=found.kind,
        reason=found.reason,
        alternatives=tuple(tuple(sorted({u.name for u in r.uses})) for r in sets),
        at=places_of(u for r in sets for u in r.uses),
        unknown_possible=found.doubt,
        ranking=rows,
        lack_of_fit=LackOfFit(base.reduced, base.lack_of_fit, base.problem.n_effective),
        model_discrepancy_percent=_discrepancy(base.problem),
        fails_at=tuple(block.as_dict() for block in fails_at[:MOST_PLACES]),
        smallest_visible=visible,
        not_testable=search.step(base).not_testable,
        next_measurement=tuple(asdict(p) for p in proposals),
        pulls=shown(pulled),
        error=error,
        remarks=(*said, *beside.failures),
    )


def _visible(search: Search, sets: Sequence[Refit]) -> dict[str, Any]:
    """Smallest sizes that would be seen: of what is named from the base, of the others beside the best set."""
    named = frozenset(use for refit in sets for use in refit.uses)
    beside, base = search.step(search.best), search.step(search.base)
    worth = search.best.dispersion
    others = minimum_detectable_sizes(beside.seen, beside.acceptance, worth)
    own = minimum_detectable_sizes(base.seen, base.acceptance, worth, named) if named else []
    seen = [one for one in own if one.value is not None]  # what was seen is not invisible
    names = {str(use) for use in named}
    return by_effect([*(one for one in others if one.use not in names), *seen])


def _next(search: Search, sets: list[Refit], verdict: str, fails_at: Sequence[Block]) -> Sequence[Proposal]:
    """Measurements between the rivals; between the best and the next in rank where there are none."""
    if verdict == "unknown-effect":
        return explore(search.best, fails_at)
    others = [r for r in search.refits.of_size(1) if r not in sets and search.believable(r)]
    others.sort(key=lambda r: r.bic(search.best.dispersion))
    if len(sets) > 1:
        return propose(sets)
    if search.base.problem.strategy.frugal:
        others = [r for r in others[:1] if not search.refits.beyond_pruning_bound(r.chi2, search.best.chi2)]
    return propose([search.best, *others[:MOST_OTHERS]], other_kinds=False)


def _undeclared(base: Refit, found: Conclusion) -> tuple[str, ...]:
    """Shifts of modes that explain what no effect does, though the rig file does not say so."""
    return (undeclared_shifts(base.problem, LACK_OF_FIT),) if found.kind == "unknown-effect" else ()


def _off_certificates(best: Refit, pulled: Sequence[Pull]) -> tuple[str, ...]:
    """Instruments that a fit with effects takes far outside of their certificates, as its equations may explain."""
    names = " with ".join(sorted(map(str, best.uses)))
    far = [p for p in pulled if p.too_far and p.parameter.whole in best.problem.priors]
    return tuple(
        f"{pull.text}: {abs(pull.pull):.1f} standard uncertainties off. It is wrong too, or makes up for the form of "
        f"{names}: add that, and diagnose again"
        for pull in far
        if names
    )


def _discrepancy(problem: Problem) -> float:
    return float(problem.assembly.model.rig.discrepancy_percent)
