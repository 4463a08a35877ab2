"""The search for what is missing: singles, pairs, and whether a third would be needed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Protocol

import numpy as np

from specan.models import Use
from specan.models.effect import ParameterName
from specan.study.selection.acceptance import (
    COINCIDENCE,
    DECISIVE,
    LEVEL,
    AcceptanceTest,
    Decision,
    complete,
)
from specan.study.selection.candidates import Candidate, candidates
from specan.study.selection.doubtful_data import WHOLE
from specan.study.selection.pulls import Pull, too_far
from specan.study.selection.refits import EffectSet, Refit, Refits
from specan.study.selection.score_test import Scored, best_of_each, different, family, score, score_pairs
from specan.study.selection.signatures import (
    Known,
    Point,
    Signature,
    carried,
    not_finite,
    shape_grid,
    signatures,
)
from specan.study.selection.significance import LACK_OF_FIT
from specan.study.selection.single_instruments import (
    MOST_OUTSTANDING,
    displaced,
    off_certificate,
    outstanding,
    stands_as_known,
)
from specan.study.selection.starting_values import scan_promising

SCANNED = 6  # candidates with few signatures that are looked at closer before, beside the best place of every effect
WINDOW = 10.0  # and all whose BIC lies within this of the best
STARTS = 2  # signatures of a candidate from which it is refitted
HALF = 0.5  # of what a set leaves, that a further effect must promise to be refitted whatever the form of the others

# Share of a search that is over when singles, pairs and thirds are begun: about that of its CPU time for fields with a
# damped boundary, of six and of twelve receivers. A share is told, nothing rests on it.
SINGLES, PAIRS, THIRDS = 0.3, 0.7, 0.9


class Progress(Protocol):
    """What is told of a long computation: what is being done, and the share of the whole that is over before it."""

    def __call__(self, text: str, share: float | None = None) -> None:
        """Tell."""


def unheard(text: str, share: float | None = None) -> None:
    """A progress that nobody is told of."""


@dataclass(eq=False)
class Step:
    """One set of effects, what could be added to it, and the acceptance test for that.

    Attributes
    ----------
    seen : Refit
        The set on the rows that were looked at: all, where they are not very many.
    """

    start: Refit
    seen: Refit
    scored: list[Scored]
    by_use: dict[Use, list[Scored]]
    acceptance: AcceptanceTest
    not_testable: dict[str, str]


@dataclass(eq=False)
class Search:
    """All sets of effects that were looked at, and the best of them.

    Attributes
    ----------
    likely : sequence of Use
        What to look at first.
    only : bool
        Refit no other single effect.
    part : tuple of float
        Shares of the diagnosis that are over when the search begins and when it ends.
    best : Refit
        The set that passed, the base where none did.
    extensions : list of Refit
        Pairs with the best single effect that would be needed if its equation were exact.
    points, tried
        Where the candidates are tried, and the signatures that they left there.
    decisions : dict
        How every refitted set fared against the base or, where it has two effects, its best part.
    third : Refit or None
        A set with a third effect that would pass as well.
    """

    refits: Refits
    likely: Sequence[Use] = ()
    progress: Progress = unheard
    only: bool = False
    part: tuple[float, float] = (0.0, 1.0)
    steps: dict[EffectSet, Step] = field(default_factory=dict)
    decisions: dict[EffectSet, Decision] = field(default_factory=dict)
    points: dict[Use, list[Point]] = field(default_factory=dict)
    tried: list[Signature] = field(default_factory=list)
    best: Refit = field(init=False)
    extensions: list[Refit] = field(default_factory=list)
    third: Refit | None = None

    @property
    def base(self) -> Refit:
        """The fit that something may be missing from."""
        return self.refits.base

    @property
    def fitted(self) -> tuple[list[Refit], bool]:
        """Sets of effects that were fitted so far, and whether only roughly."""
        return [refit for uses, refit in self.refits.done.items() if uses], self.refits.rough

    def run(self) -> None:
        """Search."""
        self.best = self.base
        single = self.single
        if single is not None:
            self.best = single
        pair = self._best_pair(single, self._promising_pairs(single))
        if pair is not None:
            self.best = pair
        several = self._several_places()
        if several is not None and several.bic(several.dispersion) < self.best.bic(several.dispersion):
            self.best = several
        if len(self.best.uses) >= 2:
            self.third = self._best_third()
        while self.third is not None and self._explanations(self.third) <= 2:
            self.best = self.third
            self.third = self._best_third()

    def _tell(self, text: str, over: float) -> None:
        """Tell what is done, and of the share of this search that is over the share of the whole."""
        self.progress(text, self.part[0] + over * (self.part[1] - self.part[0]))

    def _explanations(self, refit: Refit) -> int:
        """How many a set is: the same instrument error at several places counts once, as long as most are in order."""
        names = {use.name for use in refit.uses}
        own = [frozenset(use for use in refit.uses if use.name == name) for name in names]
        return sum(1 if self.of_one_instrument(replace(refit, uses=uses)) else len(uses) for uses in own)

    def of_one_instrument(self, refit: Refit) -> bool:
        """Whether a set is one instrument error at several places: several receivers that stand elsewhere, say.

        That is one explanation, however many they are, as long as most are in order.
        """
        names = {use.name for use in refit.uses}
        if len(names) != 1 or any(not use.at for use in refit.uses):
            return False
        effect = self.base.problem.assembly.model.effects[next(iter(names))]
        places = sum(use.name in names for use in self.step(self.base).by_use)
        return effect.instrument and 2 * len(refit.uses) <= places

    def too_far(self, refit: Refit) -> tuple[Pull, ...]:
        """Values of a refitted set that contradict what is known, worst first."""
        return too_far(refit, self.base)

    def believable(self, refit: Refit) -> bool:
        """Whether no value of a refitted set contradicts what is known."""
        return not self.too_far(refit)

    def decision(self, refit: Refit) -> Decision:
        """How a refitted set fares; of a pair, from the better of its parts where that was refitted."""
        if refit.uses not in self.decisions:
            parts = [self.refits.done.get(refit.uses - {use}) for use in refit.uses]
            start = min((p for p in parts if p is not None), key=lambda r: r.chi2, default=self.base)
            acceptance = (self.steps.get(start.uses) or self.step(self.base)).acceptance
            self.decisions[refit.uses] = acceptance.decision(refit)
        return self.decisions[refit.uses]

    # --- one effect ------------------------------------------------------------------------------

    def step(self, start: Refit, level: float = LEVEL / 2) -> Step:
        """Score everything that could be added to a set."""
        if start.uses not in self.steps:
            what = _text(start.uses) or "the base"
            self._tell(f"scoring what could be added to {what}", PAIRS if start.uses else 0.0)
            seen = _on_a_subsample(start)
            found, not_testable = candidates(seen.problem)
            known: Known = {}
            if not self.points:
                self.points = shape_grid(seen.problem, seen.fit, found, known)
                not_testable |= not_finite(
                    seen.problem, seen.fit, [c for c in found if c.use not in self.points]
                )
            again = self._to_score_again(start, found)
            tried = [t for t in self.tried_at(seen, found, known) if t.use not in {c.use for c in again}]
            tried += signatures(seen.problem, seen.fit, again, self.points)
            scored = score(seen.linear, tried, seen.weights)
            explained = max(self.base.chi2 - start.chi2, 0.0)
            acceptance = AcceptanceTest(start, family(scored), explained, level)
            self.steps[start.uses] = Step(start, seen, scored, best_of_each(scored), acceptance, not_testable)
        return self.steps[start.uses]

    def _to_score_again(self, start: Refit, found: Sequence[Candidate]) -> list[Candidate]:
        """Candidates that act in the field of the best set otherwise than in the base's, where that was far off.

        All where something is left; else the errors of single instruments, which cost little.
        """
        if not self.refits.poor_fit or not start.uses or start is not self.best:
            return []
        if start.lack_of_fit < WHOLE or outstanding(start, [c.use for c in found]):
            return list(found)
        return [c for c in found if c.use.at and c.effect.instrument]

    def tried_at(
        self, seen: Refit, found: Sequence[Candidate], known: Known | None = None
    ) -> list[Signature]:
        """Signatures of candidates at a set; those of the base again where the strategy reuses them."""
        if seen.problem.strategy.frugal and self.tried:
            return carried(
                self.tried, self.step(self.base).seen.problem, seen.problem, {c.use for c in found}
            )
        self.tried = signatures(seen.problem, seen.fit, found, self.points, known)
        return self.tried

    @cached_property
    def single(self) -> Refit | None:
        """The best single effect that passes, of those that are worth a refit."""
        step = self.step(self.base)
        for k, use in enumerate(self._singles_to_refit(step)):
            done = min(k / (3 if step.start.problem.strategy.frugal else 5), 1.0)
            self._tell(f"refitting with {use}", SINGLES + (PAIRS - SINGLES) * done)
            self.refits.fit(step.seen, [[s] for s in different(step.by_use[use], STARTS)])
        found = self._best_passed(self.refits.of_size(1))
        left = (found or self.base).lack_of_fit < LACK_OF_FIT
        if left and not self.base.problem.strategy.frugal:
            # An effect whose slope is nothing where it vanishes promises nothing, however much it explains.
            for candidate in candidates(self.base.problem)[0]:
                self.refits.fit_from_default(candidate.use)
            found = self._best_passed(self.refits.of_size(1))
        return found

    def _singles_to_refit(self, step: Step) -> Iterator[Use]:
        """Candidates that are worth a refit, in view of the sets that were fitted before each."""
        first = [use for use in self.likely if use in step.by_use]
        yield from first
        strategy = step.start.problem.strategy
        if strategy.frugal and not (self.only or self._met):
            self._look_closer(step)
        for use in _worth_refitting(step):
            if use not in first and not (self.only or self._pruned(step, use)):
                yield use
        if strategy.frugal and not self._met:
            yield from outstanding(step.start, step.by_use)
            yield from self._displaced(step)
            yield from self._elsewhere(step)

    def _elsewhere(self, step: Step) -> list[Use]:
        """The effect that takes most away at other elements, where it does not meet the data.

        Where two elements meet, what acts at one does much the same as at the other.
        """
        best = min(self.refits.of_size(1), key=lambda refit: refit.chi2, default=self.base)
        if self._met or not best.poor_fit or best.chi2 > COINCIDENCE * self.base.chi2:
            return []
        effects, names = step.start.problem.assembly.model.effects, {use.name for use in best.uses}
        return [
            use
            for use in step.by_use
            if use.name in names and not effects[use.name].instrument and use not in best.uses
        ]

    def _displaced(self, step: Step) -> list[Use]:
        """Receivers whose own rows ask for another place or gain decisively by BIC; their refits begin there.

        A refit gains more than their rows do alone, with all else held.
        """
        price = float(np.log(step.start.problem.n_effective))
        start, least = step.start.problem.values_at(step.start.fit.theta), step.acceptance.left_by_form
        found = [
            (use, one.values)
            for use, one in displaced(step.start, step.by_use).items()
            if one.gain > least + DECISIVE + price * len(one.values)
        ]
        first = [*dict.fromkeys(use.at for use, _ in found)][:MOST_OUTSTANDING]
        found = [(use, values) for use, values in found if use.at in first]
        for use, values in found:
            self.refits.known = {**self.refits.known, step.start.uses | {use}: {**start, **values}}
        return [use for use, _ in found]

    @property
    def _met(self) -> bool:
        """Whether one effect brings a base that was far off near the data: chance does not do that."""
        return self.refits.poor_fit and not all(refit.poor_fit for refit in self.refits.of_size(1))

    def _look_closer(self, step: Step) -> None:
        """Where candidates were scored at few shapes, those that promise most are looked at over all of them."""
        unknown = {u: items for u, items in step.by_use.items() if frozenset({u}) not in self.refits.known}
        step.by_use |= scan_promising(step.seen, unknown, SCANNED)

    def _pruned(self, step: Step, use: Use) -> bool:
        """Whether a set was found that is so much better than the linearised promise that no refit is needed."""
        if not step.start.problem.strategy.frugal:
            return False
        found = min((r.chi2 for r in self.refits.of_size(1)), default=np.inf)
        return self.refits.beyond_pruning_bound(step.start.chi2 - step.by_use[use][0].chi2_reduction, found)

    def _best_passed(self, found: Sequence[Refit]) -> Refit | None:
        passed = [r for r in found if self.decision(r).accepted]
        dispersion = min((r.dispersion for r in passed), default=1.0)
        return min(passed, key=lambda r: r.bic(dispersion), default=None)

    # --- two effects -----------------------------------------------------------------------------

    def _best_pair(
        self, single: Refit | None, promising: Sequence[tuple[float, Refit, list[Scored]]]
    ) -> Refit | None:
        """The pair that is better than the best single effect, or than the base where none passed."""
        reference = single or self.base
        for predicted, start, members in promising[: 4 if self.base.problem.strategy.frugal else 8]:
            if self._below_pruning_bound(reference, predicted):
                break
            if (
                single is not None
                and self._completed(single)
                and predicted > single.bic(1.0) - _excess(single)
            ):
                break  # what may still win promises at least to take away what the single effect leaves
            self._tell("refitting with " + _text({*start.uses, *(m.use for m in members)}), PAIRS)
            self.refits.fit(start, [members])
        if single is not None and self.refits.poor_fit and not self._completed(single):
            step = self.step(single)
            asked_for = [*off_certificate(single, step.by_use), *outstanding(single, step.by_use)]
            for use in dict.fromkeys([*asked_for, *self._displaced(step)]):
                self._tell("refitting with " + _text({*single.uses, use}), PAIRS)
                self.refits.fit(step.seen, [[s] for s in different(step.by_use[use], STARTS)])
        passed, needed = [], []
        for refit in self.refits.of_size(2):
            self.decisions[refit.uses] = decision = self._pair_decision(refit, single)
            if decision.accepted_if_exact and self.needs_all(refit):
                needed.append(refit)
                passed += (
                    [refit] if decision.accepted or (single is not None and complete(refit, single)) else []
                )
        dispersion = min((r.dispersion for r in needed), default=1.0)
        best = min(passed, key=lambda r: r.bic(dispersion), default=None)
        while best is not None and stands_as_known(best):
            passed, needed = [[r for r in some if r is not best] for some in (passed, needed)]
            best = min(passed, key=lambda r: r.bic(dispersion), default=None)
        if best is None and single is not None and needed:
            least = min(r.bic(dispersion) for r in needed)
            as_likely = [r for r in needed if r.bic(dispersion) < least + DECISIVE]
            self.extensions = [r for r in as_likely if not stands_as_known(r)]
        return best

    def _completed(self, single: Refit) -> bool:
        """Whether a second effect was found that explains all that the best single one leaves."""
        return any(single.uses < pair.uses and complete(pair, single) for pair in self.refits.of_size(2))

    def _pair_decision(self, refit: Refit, single: Refit | None) -> Decision:
        if single is None:
            acceptance = self.step(self.base).acceptance
            return acceptance.decision(refit, tests=acceptance.pairs)
        return self.step(single).acceptance.decision(refit)

    def needs_all(self, refit: Refit) -> bool:
        """Backward: without any one of its effects BIC must rise decisively."""
        parts = [self.refits.done.get(refit.uses - {use}) for use in refit.uses]
        return all(
            p is None or p.bic(refit.dispersion) - refit.bic(refit.dispersion) > DECISIVE for p in parts
        )

    def _promising_pairs(self, single: Refit | None) -> list[tuple[float, Refit, list[Scored]]]:
        """Pairs by the chi-square that their refit promises, BIC price included, best first."""
        base = self.step(self.base)
        price = float(np.log(self.base.problem.n_effective))
        best: dict[EffectSet, tuple[float, Refit, list[Scored]]] = {}
        for pair in score_pairs(base.seen.linear, base.scored):
            members = [pair.first, pair.second]
            cost = price * sum(m.count for m in members)
            best[pair.uses] = (self.base.chi2 - pair.chi2_reduction + cost, base.seen, members)
        starts = self._starts_of_pairs(single)
        if starts:  # scored at the fit of one of them: better than at the base
            nearer: dict[EffectSet, tuple[float, Refit, list[Scored]]] = {}
            for start in starts:
                step = self.step(start)
                for use, items in step.by_use.items():
                    value = start.chi2 - items[0].chi2_reduction + price * (start.count + items[0].count)
                    uses = start.uses | {use}
                    if uses not in nearer or value < nearer[uses][0]:  # a refit from there falls deepest
                        nearer[uses] = (value, step.seen, [items[0]])
            best |= nearer
        return sorted(best.values(), key=lambda item: item[0])

    def _starts_of_pairs(self, single: Refit | None) -> list[Refit]:
        """Single effects whose fit pairs set out from: the best, where one passed."""
        if single is None:
            return []
        return sorted(self.refits.of_size(1), key=lambda r: r.bic(single.dispersion))[:3]

    def _below_pruning_bound(self, reference: Refit, promised_bic: float) -> bool:
        """Whether a promised BIC is too far from passing for a refit to make up for it.

        Where a refit is expensive the promise comes from a subsample, whose noise counts several times; and what the
        form of the effects that were found may have left does not pass, so that to know it is not worth a refit.
        """
        least, promised_fall = 0.4 * DECISIVE, reference.bic(1.0) - promised_bic
        if reference.problem.strategy.frugal and not promised_fall > HALF * _excess(reference):
            price, acceptance = float(np.log(self.base.problem.n_effective)), self.step(reference).acceptance
            least = max(
                least,
                acceptance.needed_reduction - price,
                acceptance.left_by_form / reference.dispersion,
            )
        return promised_fall < least * reference.dispersion

    # --- one instrument error at several places --------------------------------------------------

    def _several_places(self) -> Refit | None:
        """The errors of several receivers together, where each of them passes alone and the set needs all of them."""
        step = self.step(self.base)
        by_name: dict[str, list[Refit]] = {}
        for refit in self.refits.of_size(1):
            if self.of_one_instrument(refit) and self.decision(refit).accepted:
                by_name.setdefault(next(iter(refit.uses)).name, []).append(refit)
        found = []
        for parts in by_name.values():
            uses = frozenset().union(*(refit.uses for refit in parts))
            if len(parts) < 2:
                continue
            values = {
                name: v for refit in parts for name, v in refit.problem.values_at(refit.fit.theta).items()
            }
            own = {
                n: v
                for refit in parts
                for n, v in refit.fit.values.items()
                if ParameterName(n).owned_by(refit.uses)
            }
            self._tell("refitting with " + _text(uses), PAIRS)
            self.refits.known = {**self.refits.known, uses: values | own}
            whole = self.refits.fit(step.seen, [[step.by_use[use][0] for use in sorted(uses)]])
            if whole is not None and self.of_one_instrument(whole) and self.needs_all(whole):
                found += [whole] if self.decision(whole).accepted else []
        return min(found, key=lambda r: r.bic(r.dispersion), default=None)

    # --- three -----------------------------------------------------------------------------------

    def _best_third(self) -> Refit | None:
        step = self.step(self.best)
        price = float(np.log(self.base.problem.n_effective))
        passed = []
        effects = self.base.problem.assembly.model.effects
        again = {use.name for use in self.best.uses if use.at and effects[use.name].instrument}
        more = [use for use in outstanding(self.best, step.by_use) if use.name in again]
        for use in dict.fromkeys([*list(step.by_use)[:2], *more]):
            items = step.by_use[use]
            if use not in more and self._below_pruning_bound(
                self.best, self.best.bic(1.0) - items[0].chi2_reduction + price * items[0].count
            ):
                continue
            self._tell(f"refitting with {use}", THIRDS)
            refit = self.refits.fit(step.seen, [[s] for s in different(items, STARTS)])
            if refit is None:
                continue
            decision = step.acceptance.decision(refit)
            if decision.accepted and not stands_as_known(refit):
                passed.append(refit)
        return min(passed, key=lambda r: r.chi2, default=None)


def _excess(refit: Refit) -> float:
    """Chi-square that a set leaves beyond the noise; at least what the noise leaves in doubt."""
    return max(refit.lack_of_fit_chi2 - refit.dof, float(np.sqrt(2 * refit.dof)))


def _worth_refitting(step: Step) -> list[Use]:
    """Candidates that promise most, in their order."""
    bic = {use: step.start.promised(items[0]) for use, items in step.by_use.items()}
    order = sorted(bic, key=lambda use: bic[use])
    # With pruning, what promises nothing is not refitted only because nothing else promises more.
    strategy = step.start.problem.strategy
    least = bic[order[0]] if order else np.inf
    limit = min(least + WINDOW, 0.0 if strategy.frugal else np.inf)
    return [use for k, use in enumerate(order) if k < (3 if strategy.frugal else 5) or bic[use] < limit]


def _text(uses: frozenset[Use] | set[Use]) -> str:
    return " and ".join(str(u) for u in sorted(uses))


def _on_a_subsample(refit: Refit) -> Refit:
    """The same fit on part of its rows, each weighted up; the fit itself where the rows are few.

    A score test over a hundred candidates on 48 000 rows costs more than the refits that it is meant to save. It is
    done on a subsample of the data, with gains scaled up. What it finds is refitted and judged on all rows.
    """
    problem, theta = refit.problem, refit.fit.theta
    part = problem.subsampled(theta)
    if part is problem:
        return refit
    seen = replace(refit.fit, residual=part.residual(theta), jacobian=part.jacobian(theta))
    return replace(refit, problem=part, fit=seen, row_worth=problem.n_data / part.n_data)
