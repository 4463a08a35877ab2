"""What is missing of a room: a field near the measured one, mistakes of its set-up, then every explanation.

For covariances that depend on where the field is a first fit goes near the data. No verdict comes from there: only
which candidates are looked at first, and where their fits begin, is taken over.

What an error of one receiver does is in its own rows alone: all receivers are moved at the same time, each is led by
its own rows.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.arrays import Real
from specan.errors import ComputationError
from specan.models import Use
from specan.models.effect import ParameterName
from specan.models.kept import each_anew
from specan.room.study.mistaken_set_up import while_recorded
from specan.study.estimation.continuation import JACOBIANS, about, continuation_fit, down_weighted
from specan.study.estimation.fit import fit
from specan.study.estimation.levenberg_marquardt import descend_steps
from specan.study.estimation.problem import Problem
from specan.study.evidence.diagnosis import told
from specan.study.evidence.explanations import EffectSet, Explanation
from specan.study.evidence.of_responses import Led, OfResponses
from specan.study.evidence.promises import Promise
from specan.study.localisation.localise import MistakenSetUp, mistaken_set_up
from specan.study.progress import Progress, unheard
from specan.study.selection.candidates import Candidate, candidates, confounded_with
from specan.study.selection.refits import POOR_FIT, PRUNING_FACTOR, Refit, Refits, start_from
from specan.study.selection.signatures import Scored, Signatures, default_value, residuals
from specan.study.selection.starting_values import BEST, Search, likely_places, scan_shapes, scored_best
from specan.study.verdict import Diagnosis, LackOfFit


def diagnosed(start: Refit, set_up: MistakenSetUp | None, progress: Progress) -> Diagnosis:
    """The verdict on a room, as `specan.study.diagnose.diagnose` asks for it."""
    problem, near = start.problem, InitialFit(start)
    mistake = while_recorded(problem, start.fit)
    if start.poor_fit and not mistake.text:
        progress("checking positions and signs of the channels against the data", 0.0)
        mistake = set_up or mistaken_set_up(problem)
        if not mistake.text:
            near = initial_fit(start, progress)
            mistake = mistake_beside(near, problem)
    if mistake.text:
        return Diagnosis(
            "cannot-tell",
            f"{mistake.sentence}; correct it, and begin the study again",
            lack_of_fit=LackOfFit(start.fit.reduced_chi2, start.fit.p_value, problem.n_effective),
        )
    return told(OfField(near, progress), start)


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


class OfField(OfResponses):
    """Explanations of the transfer functions of a room.

    What is declared of receivers and modes acts in the field of the best single effect.

    Parameters
    ----------
    near : InitialFit
        The base, what is fitted first, and values near the minimum of some sets.
    """

    def __init__(self, near: InitialFit, progress: Progress = unheard) -> None:
        self.near = near
        super().__init__(near.base, progress, near.known)

    def _search(self) -> None:
        """Single effects first; where the base is far off, all once more about the field of the best of them."""
        self.growing = not (self.near.base.poor_fit and self.problem.strategy.linearised_covariance)
        super()._search()
        sets = sorted((e for e in self.found if e.kind == "effects"), key=lambda e: -e.ln_joint)
        if self.growing or not sets or sets[0].ln_joint <= self._bare(self.forms[0]).ln_joint:
            return
        self.growing = True
        self.progress("refitting with the covariance of the field found")
        done = {e.uses: e.tangent.problem.values_at(e.tangent.theta) for e in sets}
        base = with_covariances_about(self.near.base, sets[0].uses, done[sets[0].uses])
        # 4: likeliest single effects that are compared in the field of the best
        likely = tuple(use for e in sets[:4] for use in e.uses)
        self.near = InitialFit(base, likely, done, sets[0].uses)
        self.begin(base, done)
        super()._search()

    def _promises(self, one: Explanation) -> Iterator[tuple[float, Promise]]:
        """What is likely is fitted whatever it promises."""
        if not one.uses and self.catalogues:  # once more, about another field
            one.form.catalogue = self.catalogues[one.uses]
            for use in self.near.likely:
                yield np.inf, Promise(use, 0.0, ())
            return
        for promised, promise in super()._promises(one):
            likely = not one.uses and promise.use in self.near.likely
            yield np.inf if likely else promised, promise

    def led(self, refit: Refit, uses: Collection[Use]) -> Mapping[Use, Led]:
        """Errors of single receivers, each led by its own rows."""
        return displaced(refit, uses)


def displaced(refit: Refit, uses: Collection[Use]) -> dict[Use, Led]:
    """Errors of single receivers that have no shape, each led by its own rows, best first.

    Left out are those that explain less than half of what their rows leave beyond the noise. The other parameters stay
    where they are. All rows are looked at: on a subsample without windows a small error of one receiver is hidden by
    what windows do to the errors that are declared of it.
    """
    found = [c for c in candidates(refit.problem)[0] if c.use in uses and c.effect.instrument and c.use.at]
    found = [c for c in found if c.amplitudes and not c.shapes and not c.without_prior]
    channel = np.concatenate(
        [np.asarray(o.labels.get("channel", [""] * o.n)).astype(str) for o in refit.problem.observations]
    )
    rows = {c.use: np.flatnonzero(channel == str(c.use.at)) for c in found}
    found = [c for c in found if rows[c.use].size]
    out: dict[Use, Led] = {}
    for name in sorted({c.use.name for c in found}):  # two errors of a receiver are in the same rows
        out |= _led(refit, [c for c in found if c.use.name == name], rows)
    return dict(sorted(out.items(), key=lambda item: -item[1][1]))


def _led(refit: Refit, found: Sequence[Candidate], rows: Mapping[Use, NDArray[np.intp]]) -> dict[Use, Led]:
    """One kind of error of all receivers, moved at the same time."""
    problem = refit.problem.with_uses([c.use for c in found])
    neutral: dict[str, float] = {name: c.neutral(name) for c in found for name in c.amplitudes}
    theta = problem.start({**refit.fit.values, **neutral})
    low, high = problem.bounds
    own = {c.use: np.array([problem.names.index(name) for name in c.amplitudes]) for c in found}
    # 0.1: of a usual size, for slopes
    size = {c.use: 0.1 * np.array([default_value(c, n) - c.neutral(n) for n in c.amplitudes]) for c in found}

    def at(many: list[Real]) -> Real:
        return residuals(problem, [problem.values_at(one) for one in many])

    start = at([theta])[:, 0]
    here, reach = start.copy(), dict.fromkeys(own, 1.0)
    # 5: of Gauss-Newton steps
    for _ in range(5):
        moved = np.tile(theta, (max(part.size for part in own.values()), 1))
        for use, part in own.items():
            moved[np.arange(part.size), part] += size[use]
        slopes, trial = at(list(moved)) - here[:, None], theta.copy()
        for use, part in own.items():
            step, *_ = np.linalg.lstsq(slopes[rows[use], : len(part)], -here[rows[use]], rcond=1e-9)
            trial[part] = np.clip(theta[part] + reach[use] * step * size[use], low[part], high[part])
        there = at([trial])[:, 0]
        for use, part in own.items():
            mine = rows[use]
            if there[mine] @ there[mine] < here[mine] @ here[mine]:
                theta[part], here[mine] = trial[part], there[mine]
            else:
                reach[use] /= 4
    out = {}
    for use, part in own.items():
        before, after = (float(x[rows[use]] @ x[rows[use]]) for x in (start, here))
        gain = before - after
        # 0.5: of what a receiver's own rows leave beyond the noise, that its error has to explain
        if gain > 0.5 * (before - min(refit.fit.reduced_chi2, 1.0) * rows[use].size):
            out[use] = {problem.names[k]: float(theta[k]) for k in part}, gain
    return out


Priced = tuple[float, dict[str, Any]]  # chi-square with the price of the parameters, and SI values


@dataclass(frozen=True, eq=False)
class InitialFit:
    """Where a search sets out.

    Attributes
    ----------
    base : Refit
        Fitted with covariances about a field that is near the measured one.
    likely : tuple of Use
        What came nearest, the nearest first.
    known : mapping
        SI values that led near the data, by the set of effects that was added.
    found : set of Use
        The set that the covariances are about.
    left : float
        Reduced chi-square that the nearest effect leaves on the down-weighted view.
    """

    base: Refit
    likely: tuple[Use, ...] = ()
    known: Mapping[EffectSet, Mapping[str, Any]] = field(default_factory=dict)
    found: EffectSet = frozenset()
    left: float = 0.0


def initial_fit(start: Refit, progress: Progress) -> InitialFit:
    """Look for a field near the measured one, where the base is far from it.

    Single effects are fitted to few, uncertain lines; those that come near, to all lines.
    """
    if not start.problem.strategy.linearised_covariance or start.fit.reduced_chi2 < POOR_FIT:
        return InitialFit(start)
    refits = _singles(start.problem, progress)
    base, near = refits.base, _nearest(refits)
    # 0.7: share of the base's chi-square on the down-weighted view that may be left by what is nearer
    if near.fit.chi2 > 0.7 * base.fit.chi2:  # the base is as near as the view can tell
        return InitialFit(start)
    sets = {
        uses: r for uses, r in refits.done.items() if uses and r.fit.chi2 < PRUNING_FACTOR * near.fit.chi2
    }
    led = _on_all_lines(start, near, sets)
    order = sorted(led, key=lambda uses: led[uses][0])
    return InitialFit(
        with_covariances_about(start, order[0], led[order[0]][1]),
        tuple(use for uses in order for use in uses),
        {uses: values for uses, (_, values) in led.items()},
        order[0],
        near.fit.reduced_chi2,
    )


def _singles(problem: Problem, progress: Progress) -> Refits:
    """Rough fits of the model with single effects, to few, uncertain lines."""
    text = "searching for a field close to the measured one"
    progress(text, 0.1)
    values = continuation_fit(problem)
    view = down_weighted(problem, values=values)
    base = Refit(frozenset(), view, fit(view, start=values))
    refits, found = Refits(base, rough=True), scan_promising(base)

    def look(use: Use) -> None:
        progress(f"{text}: with {use}", 0.4)
        richer = refits.with_uses([use])
        items = found.get(use) or scan_shapes(base, [use]).get(use, [])
        if items:
            refits.fit(base, frozenset({use}), [start_from(base, [item], richer) for item in items])

    counts: Counter[str] = Counter()
    for use in sorted(found, key=lambda use: promised(base, found[use][0])):
        counts[use.name] += 1
        # 6, 2: candidates that promise most, and at most so many of one effect
        if counts[use.name] <= 2 and len(refits.done) <= 6:
            look(use)
    for use in _nearest(refits).uses:
        # What is easily taken for it, and the same elsewhere: opposite ends are alike from afar.
        alike = [other for other in found if other.name == use.name]
        for other in (*alike, *confounded_with(problem.assembly.model, use)):
            look(other)
    return refits


def scan_promising(refit: Refit) -> dict[Use, list[Scored]]:
    """Starting values: the most promising of all, of every effect, and the two best at every place.

    Few shapes may be what holds an effect back; and a low mode is much the same at the opposite end.
    """
    found, _ = candidates(refit.problem)
    at, likely = Signatures(refit.problem, refit.fit), likely_places(refit, found)
    points = at.grid(found)
    for candidate in found:
        if candidate.use in likely:
            one = Search(refit, candidate, at)
            more = one.at_place(likely[candidate.use][0], one.sizes[:1])
            points[candidate.use] = [*points.get(candidate.use, []), *more]
    scored = scored_best(refit, at, found, points)
    order = sorted(scored, key=lambda use: promised(refit, scored[use][0]))
    names: dict[str, Use] = {}
    for use in order:
        names.setdefault(use.name, use)
    # 6: candidates that are looked at over all of their shapes, beside the best place of every effect
    seen = scan_shapes(refit, [*order[:6], *names.values()])
    best = dict.fromkeys(use.name for use in sorted(seen, key=lambda use: promised(refit, seen[use][0])))
    return seen | scan_shapes(refit, [u for u in order if u.name in [*best][:BEST] and u not in seen])


def promised(refit: Refit, item: Scored) -> float:
    """Change of BIC that a signature promises."""
    return -item.chi2_reduction / refit.fit.dispersion + item.count * float(np.log(refit.problem.n_effective))


def _nearest(refits: Refits) -> Refit:
    return min(refits.done.values(), key=lambda r: r.bic(1.0))


def _on_all_lines(start: Refit, near: Refit, sets: Mapping[EffectSet, Refit]) -> dict[EffectSet, Priced]:
    """Where some steps on all lines lead the likeliest of some sets, with covariances about the nearest.

    What seems nearest to the few lines of a down-weighted view, which has no windows, need not be the field. A
    subsample has them: it says which sets are worth the steps.
    """
    problem = about(start.problem, near.problem.assembly, near.problem.values_at(near.fit.theta))
    price = float(np.log(problem.n_effective))
    problems = {uses: problem.with_uses(sorted(uses)) for uses in sets}

    def on_a_subsample(uses: EffectSet) -> Priced:
        refit = sets[uses]
        whole, values = problems[uses], refit.problem.values_at(refit.fit.theta)
        theta = whole.start(values)
        subsample = whole.subsampled(theta)
        with suppress(ComputationError):  # it stays where the down-weighted view has it
            # 5: Jacobians of a subsample
            theta = descend_steps(subsample, theta, 5)
        chi2 = float(np.sum(subsample.residual(theta) ** 2)) * problem.n_data / subsample.n_data
        return chi2 + refit.count * price, whole.values_at(theta)

    def on_all(uses: EffectSet) -> Priced:
        whole = problems[uses]
        theta = descend_steps(whole, whole.start(subsampled[uses][1]), JACOBIANS)
        return float(np.sum(whole.residual(theta) ** 2)) + sets[uses].count * price, whole.values_at(theta)

    subsampled = dict(zip(sets, each_anew(on_a_subsample, list(sets)), strict=True))
    # 3: effects that are led on over all lines, and that a search looks at first
    likeliest = sorted(sets, key=lambda uses: subsampled[uses][0])[:3]
    return dict(zip(likeliest, each_anew(on_all, likeliest), strict=True))


def with_covariances_about(start: Refit, uses: EffectSet, values: Mapping[str, Any]) -> Refit:
    """The base with covariances about the field of a model with further effects, fitted."""
    problem = about(start.problem, start.problem.with_uses(sorted(uses)).assembly, values)
    return replace(start, problem=problem, fit=fit(problem, start=start.fit.theta))
