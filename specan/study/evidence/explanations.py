"""Every explanation of the data, and how probable each is.

An explanation is a form of the base with a set of effects, or with something that no effect of the catalogue describes,
or with a fault of the data. What a set of effects changes against the base may be wrong by a tenth, smoothly over the
operating variables: no equation is exact.

Sets are looked at best first: what every further effect promises beside a fitted set is linear algebra, and only what
comes near the best is fitted.
"""

from __future__ import annotations

import heapq
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import count, product
from math import comb, log, prod
from typing import Any

import numpy as np

from specan.errors import ComputationError
from specan.models import Use
from specan.study.estimation.fit import Fit, fit
from specan.study.estimation.levenberg_marquardt import descend
from specan.study.estimation.problem import Problem
from specan.study.evidence.faults import Fault, Faults, ln_mean, unspoilt
from specan.study.evidence.form_errors import AlongLines, OverConditions
from specan.study.evidence.marginal import FORMS, Columns, Marginal, Tangent
from specan.study.evidence.noise import Noise, autoregressions, chains_of, own_noises, scatter
from specan.study.evidence.promises import Catalogue, Promise
from specan.study.observation import Array
from specan.study.observation.time import TimeObservation
from specan.study.progress import Progress, unheard
from specan.study.selection.candidates import Candidate, without
from specan.study.selection.refits import Refit, Refits

EffectSet = frozenset[Use]

# Beforehand: half that nothing is missing, the rest by how often each is met; sets of one and of two effects.
NOTHING, OF_SIZE, UNKNOWN, FAULT = 0.5, (0.3, 0.1), 0.05, 0.05
SURE = 0.95  # probability from which something is missing, the data are faulty, or nothing is left to decide
SETS = 0.7  # share of a diagnosis that is over when sets are fitted
OF_THE_BEST = 1 / 30  # probability over that of the best set, from which a set is fitted, and named beside it
WITHIN = -log(OF_THE_BEST)
SLACK = 1.5  # ln by which a linear promise may fall short of a fit, or more where that of the best did
STARTS = 2  # of another form of the base
BESIDE = 4  # sets beside which something else is looked for


@dataclass(frozen=True, eq=False)
class Explanation:
    """One way in which the data may have come about.

    Attributes
    ----------
    kind : str
        ``nothing``, ``effects``, ``beyond`` (either with values beyond what is known), ``unknown`` or ``fault``.
    form : Form
        Of the base.
    uses : frozenset of Use
        Effects beside the base.
    tangent : Tangent
        Of the base with the effects, at the minimum.
    ln_prior, ln_evidence : float
    fault : Fault or None
    noise : Noise or None
        A further form of the noise.
    fitted : bool
        False where its evidence is what was promised, too small to be worth a fit; the tangent is that of the base.
    """

    kind: str
    form: Form
    uses: EffectSet
    tangent: Tangent
    ln_prior: float
    ln_evidence: float
    fault: Fault | None = None
    noise: Noise | None = None
    fitted: bool = True

    @property
    def of_noise(self) -> str:
        """What it says of the noise."""
        return self.noise.text if self.noise else ""

    @property
    def names_its_effects(self) -> bool:
        """Whether what its effects leave, if anything, may be due to the form of their equations, or chance.

        A share s of what they change, if it is wrong, leaves s^2 of the chi-square that they take away.
        """
        rows = self.tangent.residual.size
        left = self.tangent.chi2 - rows
        taken = self.form.tangent.chi2 - self.tangent.chi2
        if self.kind == "effects":
            if not (self.fitted and self.tangent.problem.strategy.frugal):
                return True
            # 3.0: standard deviations of chi-square (2 n its variance)
            left -= 3.0 * np.sqrt(2 * rows)
        return bool(self.uses and left < FORMS[-1] ** 2 * taken)

    @property
    def ln_joint(self) -> float:
        """ln of prior times evidence."""
        return self.ln_evidence + self.ln_prior

    def but(self, ln_chance: float, ln_evidence: float, **changed: Any) -> Explanation:
        """The same with something further, which is there with some probability beforehand."""
        return replace(self, ln_prior=self.ln_prior + ln_chance, ln_evidence=ln_evidence, **changed)


@dataclass(eq=False)
class Form:
    """The base with parts of it in a published form: ``{"bearing-friction": "palmgren-bearings"}``, or as declared.

    `known` holds SI values near the minimum of some sets.
    """

    parts: Mapping[str, str]
    problem: Problem
    fit: Fit
    ln_prior: float
    known: Mapping[EffectSet, Mapping[str, Any]] = field(default_factory=dict)

    @cached_property
    def tangent(self) -> Tangent:
        """Of the base."""
        return Tangent.at(self.problem, self.fit.theta, self.fit.residual, self.fit.jacobian)

    @cached_property
    def marginal(self) -> Marginal:
        """Of the base."""
        return Marginal(self.tangent)

    @cached_property
    def refits(self) -> Refits:
        """Fits of it with effects."""
        problem = replace(self.problem, one_sided=True)
        return Refits(Refit(frozenset(), problem, self.fit), self.known)

    @cached_property
    def catalogue(self) -> Catalogue:
        """What may be added."""
        return Catalogue(self.problem, self.fit)

    @cached_property
    def faults(self) -> Faults:
        """What is looked for in the rows."""
        return Faults(self.tangent, self.predicted)

    @cached_property
    def predicted(self) -> Array:
        """Of the base, one value a measured row."""
        return np.concatenate(self.problem.predictions(self.fit.theta))


class Explanations:
    """Explanations of a problem's data.

    Parameters
    ----------
    problem : Problem
        The model as it is.
    base : Fit
        A fit of it.
    catalogue : Catalogue, optional
        Of the base as it is declared, where it is known already.

    Attributes
    ----------
    found : list of Explanation
    """

    fitted_anyway = 5  # effects that are fitted whatever they promise
    # Every effect is fitted from its default too, which one needs whose slope is nothing where it vanishes; and more is
    # expected beside a set as soon as it is fitted.
    cheap = True

    def __init__(
        self,
        problem: Problem,
        base: Fit,
        progress: Progress = unheard,
        catalogue: Catalogue | None = None,
    ) -> None:
        self.problem, self.base, self.progress = problem, base, progress
        self.found: list[Explanation] = []
        # By the parameters of a fit: the likeliest errors of its form, and the probability that they are the largest.
        self.likeliest: dict[bytes, int] = {}
        self._largest: dict[bytes, float] = {}
        self._weighed: dict[tuple[Tangent, Noise | None], tuple[Marginal, float]] = {}
        self._waiting: list[tuple[float, int, Form, EffectSet, Promise]] = []
        self._order = count()
        self._slack: dict[int, float] = {}
        self._left: dict[tuple[int, EffectSet], tuple[float, Form, Promise]] = {}
        self.set_up()
        if catalogue is not None:
            self.forms[0].catalogue = catalogue
        self.look()

    def look(self) -> None:
        """Find all explanations."""
        self._search()
        self.progress("unknown effects, implausible values, noise, faults of the data", SETS)
        self._beyond()
        for one in [e for e in self._top(BESIDE) if e.uses]:
            self._add_unknown(one)
        self._noise()
        self._not_noise()
        self._faults()

    def set_up(self) -> None:
        """The errors of form, and the forms of the base."""
        self.errors: OverConditions | AlongLines = OverConditions(self.problem)
        self.forms = list(forms_of(self.problem, self.base))

    # --- the model as it is, and with effects ---------------------------------------------------

    def _search(self) -> None:
        """Sets of effects, the most promising first."""
        for form in self.forms:
            ln_prior = form.ln_prior + np.log(NOTHING)
            self.found.append(
                Explanation("nothing", form, frozenset(), form.tangent, ln_prior, form.marginal.ln_evidence)
            )
        for form in self._forms_in_reach():
            self._add_unknown(self._bare(form))
        in_reach = self._forms_in_reach()
        for one in [e for e in self.found if e.kind == "nothing" and e.form in in_reach]:
            self._expect(one)
        fitted: set[tuple[int, EffectSet]] = set()
        while self._waiting or self._grow():
            promised, _, form, uses, promise = heapq.heappop(self._waiting)
            key = id(form), uses
            if key in fitted:
                continue
            singles = sum(len(other) == 1 for _, other in fitted)
            anyway = not form.parts and len(uses) == 1 and (self._bends or singles < self.fitted_anyway)
            # Where the base is far off, only what came nearest.
            anyway &= promise.use in (form.catalogue.led or uses)
            if not (anyway or self._worth_a_fit(uses, -promised)):
                self._left.setdefault(key, (-promised, form, promise))
                continue
            fitted.add(key)
            self._left.pop(key, None)
            self.progress(
                f"fitting with {' and '.join(map(str, sorted(uses)))}", SETS * (1 - 0.9 ** len(fitted))
            )
            new = self._add(form, uses, promise)
            if new is not None and new.ln_joint == self.best:
                # What is much like the best has as much to gain by a fit.
                self._slack[self._alike(uses)] = max(SLACK, new.ln_joint + promised)
        for form, promise in list(self._parts()):
            self._add(form, frozenset({promise.use}), promise)
        self._list()

    def _worth_a_fit(self, uses: EffectSet, promised: float) -> bool:
        """Whether a promise comes near the best; where something is left a straight line tells little."""
        near = promised + self._slack.get(self._alike(uses), SLACK) > self.best - WITHIN
        return near or (len(uses) == 1 and self._something_is_left)

    def _alike(self, uses: EffectSet) -> int:
        """Which sets have as much to gain: of integrated models, where one effect leads near the data, of one size."""
        return len(uses) if self._bends else 0

    def _expect(self, one: Explanation) -> None:
        """Put what every further effect promises beside a set with what waits to be fitted."""
        for evidence, promise in self._promises(one):
            more = one.uses | {promise.use}
            self._wait(evidence + self._ln_prior(one.form, more), one.form, more, promise)

    def _wait(self, promised: float, form: Form, uses: EffectSet, promise: Promise) -> None:
        heapq.heappush(self._waiting, (-promised, next(self._order), form, uses, promise))

    def _promises(self, one: Explanation) -> Iterator[tuple[float, Promise]]:
        """Every further effect beside a set, and ln of the evidence that it promises."""
        beside, _ = self.weighed(one.form, one.tangent)
        for promise in one.form.catalogue.promises(beside):
            yield beside.ln_evidence + promise.ln_gain, promise

    def _grow(self) -> bool:
        """Whether there is more to expect: pairs of the likeliest effects, where something is left beside all sets."""
        if not self._something_is_left:
            return False
        singles = [e for e in self.found if e.kind == "effects" and len(e.uses) == 1 and not e.form.parts]
        singles.sort(key=lambda e: -e.ln_joint)
        # 4, 8: likeliest effects whose pairs are all fitted, of integrated models and of others
        likeliest = frozenset().union(*(e.uses for e in singles[: 4 if self._bends else 8]))
        for (_, uses), (_, form, promise) in list(self._left.items()):
            if len(uses) == 2 and uses <= likeliest and not form.parts:
                self._wait(np.inf, form, uses, promise)
        return bool(self._waiting)

    def _list(self) -> None:
        """Keep what promises too little for a fit, where it counts at all."""
        for (_, uses), (promised, form, _) in self._left.items():
            # 9.0: ln of the best probability over that of what counts at all
            if promised > self.best - 9.0:
                ln_prior = self._ln_prior(form, uses)
                self.found.append(
                    Explanation(
                        "effects", form, uses, form.tangent, ln_prior, promised - ln_prior, fitted=False
                    )
                )

    @property
    def _something_is_left(self) -> bool:
        """Whether something that no effect describes is not much less probable than the best so far.

        A promise is a straight line: then every effect is fitted.
        """
        # 1.0: ln of the best probability over that of something else, from where every effect is fitted
        return max(e.ln_joint for e in self.found if e.kind == "unknown") > self.best - 1.0

    @property
    def _bends(self) -> bool:
        """Whether predictions are integrated: a straight line tells little of them then."""
        return any(o.kind == "time" for o in self.problem.observations)

    def _starts(
        self, form: Form, uses: EffectSet, promise: Promise, fewer: Fit
    ) -> Sequence[Mapping[str, Any]]:
        """Where to fit from; also from the default values, and on the way there where predictions bend."""
        if self._bends and promise.origin:
            problem = form.refits.with_uses(uses)
            return [problem.values_at(theta) for theta in promise.on_the_way(problem)]
        return [*promise.starts, *([fewer.values] if self.cheap and len(uses) == 1 else [])]

    def _forms_in_reach(self) -> list[Form]:
        """Forms of the base, the likeliest first, that something smooth could make as probable as the likeliest."""
        order = sorted(self.forms, key=lambda form: -form.marginal.ln_evidence)
        found = []
        for form in order:
            *_, (_, columns, shares) = self.errors.of_change(self.problem, form.predicted)
            most = Marginal(form.tangent, columns, shares[-1])
            if float(form.tangent.ln_likelihood(most.chi2)) > self.best - WITHIN or not form.parts:
                found.append(form)
        return found

    def _add(self, form: Form, uses: EffectSet, promise: Promise) -> Explanation | None:
        """Fit a set and keep it, and what is to be expected beside it; None where no fit is found."""
        start = form.refits.done[uses - {promise.use}]
        refit = form.refits.fit(start, uses, self._starts(form, uses, promise, start.fit))
        if refit is None:
            return None
        one = self._keep(form, uses)
        for part in form.refits.lowered(uses):
            self.found = [e for e in self.found if (e.form, e.kind, e.uses) != (form, "effects", part)]
            self._waiting = [w for w in self._waiting if not (w[2] is form and part < w[3])]
            heapq.heapify(self._waiting)
            self._keep(form, part)
        return one

    def _keep(self, form: Form, uses: EffectSet) -> Explanation:
        """Keep a set that was fitted, and what is to be expected beside it."""
        refit = form.refits.done[uses]
        tangent = Tangent.at(refit.problem, refit.fit.theta, refit.fit.residual, refit.fit.jacobian)
        _, ln_evidence = self.weighed(form, tangent)
        one = Explanation("effects", form, uses, tangent, self._ln_prior(form, uses), ln_evidence)
        self.found.append(one)
        if self.cheap and len(uses) < len(OF_SIZE):
            self._expect(one)
        return one

    def _parts(self) -> Iterator[tuple[Form, Promise]]:
        """Effects of the likeliest pairs that were not fitted alone: a linear promise may have ruled one out."""
        for pair in [e for e in self.found if len(e.uses) > 1 and e.ln_joint > self.best - WITHIN - SLACK]:
            values = pair.tangent.problem.values_at(pair.tangent.theta)
            for use in pair.uses:
                tried = pair.form.refits.done.keys() | pair.form.refits.failed
                if frozenset({use}) not in tried:
                    yield pair.form, Promise(use, 0.0, (values,))

    @property
    def best(self) -> float:
        """ln of the largest prior times evidence."""
        return max(e.ln_joint for e in self.found)

    def _ln_prior(self, form: Form, uses: EffectSet) -> float:
        """Of a set: shared by all with so many names, and by the places where each of these may act."""
        places = Counter(candidate.use.name for candidate in self.candidates(form))
        acting = Counter(use.name for use in uses)
        size, names = len(acting), max(len(places), len(acting))
        shared = comb(names, size) * prod(comb(places.get(name, n), n) for name, n in acting.items())
        several = prod(OF_SIZE[1] ** (n - 1) for n in acting.values())
        return form.ln_prior + float(np.log(OF_SIZE[min(size, len(OF_SIZE)) - 1] * several / shared))

    def weighed(self, form: Form, tangent: Tangent, noise: Noise | None = None) -> tuple[Marginal, float]:
        """An explanation with errors of form of the likeliest size and length, and ln of the evidence of all of them.

        Errors of form: what the equations of a set may be wrong by, a share of what they change against the base.
        """
        key = tangent, noise
        if key not in self._weighed:
            self._weighed[key] = self._weigh(form, tangent, noise)
        return self._weighed[key]

    def _weigh(self, form: Form, tangent: Tangent, noise: Noise | None) -> tuple[Marginal, float]:
        tangent = tangent.with_noise(noise)
        if tangent.problem is form.problem:
            one = Marginal(tangent)
            return one, one.ln_evidence
        change, theta = self._change(form, tangent.problem, tangent.theta), tangent.theta.tobytes()
        each: list[float] = []
        largest: list[float] = []
        best: Marginal | None = None
        for rough, white, shares in self.errors.of_change(tangent.problem, change):
            columns = Columns(tangent.with_noise(rough), white)
            for share in shares:
                one = Marginal(columns.tangent, columns, share)
                if best is None or one.ln_evidence > best.ln_evidence:
                    best, self.likeliest[theta] = one, len(each)
                each.append(one.ln_evidence)
                largest += [one.ln_evidence] if share == FORMS[-1] else []
        assert best is not None
        self._largest[theta] = float(np.exp(np.logaddexp.reduce(largest) - np.logaddexp.reduce(each)))
        return best, float(ln_mean(each))

    def _change(self, form: Form, problem: Problem, theta: Array) -> Array:
        """What a set changes against the base, each at its own minimum."""
        return np.asarray(np.concatenate(problem.predictions(theta)) - form.predicted)

    # --- values beyond what is known -----------------------------------------------------------------

    def _beyond(self) -> None:
        """The likeliest explanations with values that lie outside of what is known, and no range that pulls them."""
        for one in self._top(BESIDE):
            problem = one.tangent.problem
            pulls = problem.pulls(one.tangent.theta).items()
            # 1.0: standard deviations outside of what is known, from which a value is also fitted without that
            far = frozenset(name.whole for name, pull in pulls if abs(pull) > 1.0)
            if not far:
                continue
            free = replace(problem, unheld=problem.unheld | far)
            with suppress(ComputationError):
                there = descend(free, one.tangent.theta)
                tangent = Tangent.at(free, there.theta, there.residual, there.jacobian)
                _, ln_evidence = self.weighed(one.form, tangent)
                # 0.01: probability that a value lies beyond what is known of it: what a range is declared for
                chance = len(far) * log(0.01)
                self.found.append(one.but(chance, ln_evidence, kind="beyond", tangent=tangent))

    # --- something else ---------------------------------------------------------------------------

    def _add_unknown(self, one: Explanation) -> None:
        """The same with a smooth function that no effect describes, which is missing as often as beside nothing."""
        marginal, ln_evidence = self.weighed(one.form, one.tangent)
        gain = self.errors.gain_of_unknown(one.form.problem, one.form.predicted, marginal)
        self.found.append(one.but(log(UNKNOWN / NOTHING), ln_evidence + gain, kind="unknown"))

    # --- noise and data -----------------------------------------------------------------------------

    def _noise(self) -> None:
        """The same explanations under other forms of the noise."""
        top, chains = self._top(20), chains_of(self.problem)
        largest = max(top, key=lambda e: e.tangent.theta.size)
        unknown = [e for e in self.found if e.kind == "unknown" and not e.uses]
        for one in [*top, *unknown]:
            if self._bends and one.kind != "unknown":
                # each explanation's own: samples that follow each other closely foretell what is missing
                own, tangent = one, one.tangent
                for noise in own_noises(
                    tangent.problem, unspoilt(tangent.problem, tangent.theta, tangent.residual)
                ):
                    own = self._under(own, noise)
                self.found += [own] if own is not one else []
            elif one.kind != "unknown":
                forms = autoregressions(chains, largest.tangent.residual)
                self.found += [self._under(one, noise) for noise in forms]
            self.found += self._scattered(one)

    def _not_noise(self) -> None:
        """Something else in place of the noise of recordings, where that is larger than known."""
        for one in self._top(BESIDE) if self._bends else ():
            predicted = one.tangent.problem.predictions(one.tangent.theta)
            *before, _ = self.problem.split(one.form.predicted)
            gain = sum(
                o.ln_not_noise(now, FORMS[-1] * (now - then))
                for o, now, then in zip(self.problem.observations, predicted, before, strict=True)
                if isinstance(o, TimeObservation)
            )
            if gain > 0:
                chance = log(UNKNOWN / NOTHING)
                self.found.append(one.but(chance, one.ln_evidence + gain, kind="unknown", uses=frozenset()))

    def _scattered(self, one: Explanation) -> Iterator[Explanation]:
        """An explanation of tables where the readings scatter more than declared, of the likeliest sizes."""
        if self._bends or not self.cheap:
            return
        best: dict[int, Explanation] = {}
        # halves of the variance that an explanation leaves: what may be scatter of the readings
        for times in 0.5 ** np.arange(12.0):
            better = False
            for k, noise in enumerate(
                scatter(one.tangent.problem, one.tangent.residual, one.form.predicted, times)
            ):
                found = self._under(one, noise)
                if k not in best or found.ln_evidence > best[k].ln_evidence:
                    best[k], better = found, True
            if not better:
                break
        yield from best.values()

    def _under(self, one: Explanation, noise: Noise) -> Explanation:
        """An explanation under a further form of the noise."""
        beside, ln_evidence = self.weighed(one.form, one.tangent, noise)
        if one.kind == "unknown":
            ln_evidence += self.errors.gain_of_unknown(one.form.problem, one.form.predicted, beside)
        # 0.05: probability of each further form of the noise
        return one.but(log(0.05), ln_evidence, tangent=one.tangent.with_noise(noise), noise=noise)

    def _faults(self) -> None:
        """A fault of the data beside the likeliest of the others."""
        for one in self._top(8):
            marginal, ln_evidence = self.weighed(one.form, one.tangent)
            found = one.form.faults.beside(marginal)
            chance = log(FAULT / max(len(found), 1))
            self.found += [one.but(chance, ln_evidence + gain, kind="fault", fault=f) for gain, f in found]

    def visible(self, one: Explanation) -> dict[str, dict[str, Any] | None]:
        """Sizes at which the probability of what lacks an effect falls below its level in four cases of five.

        Beside an explanation; of what that has, beside the base.
        """
        form = one.form
        return form.catalogue.visible(self.looked_at(one), self.looked_at(self._bare(form)), self.needed)

    @property
    def needed(self) -> float:
        """ln of the evidence that an effect has to gain to be named."""
        count = len({c.use.name for c in self.candidates(self.forms[0])})
        return float(np.log(NOTHING / (OF_SIZE[0] / max(count, 1))) - np.log1p(-SURE))

    def candidates(self, form: Form) -> Sequence[Candidate]:
        """Effects that may be missing."""
        return form.catalogue.candidates

    @property
    def not_testable(self) -> Mapping[str, str]:
        """Effects that the data say nothing about, with the reason."""
        return self.forms[0].catalogue.not_testable

    def looked_at(self, one: Explanation) -> Marginal:
        """An explanation on the rows on which promises are made."""
        return self.weighed(one.form, one.tangent)[0]

    def _bare(self, form: Form) -> Explanation:
        """A form of the base without anything."""
        return next(e for e in self.found if e.kind == "nothing" and e.form is form)

    def _top(self, most: int) -> list[Explanation]:
        found = [e for e in self.found if e.kind in ("nothing", "effects") and e.fitted]
        found.sort(key=lambda e: -e.ln_joint)
        return [e for k, e in enumerate(found) if k < most or not (e.uses or e.noise)]

    def largest_errors_of_form(self, one: Explanation) -> float:
        """Probability that the equations of a set are off by as much as is thought possible."""
        return self._largest.get(one.tangent.theta.tobytes(), 0.0)

    @property
    def probability_of_something_else(self) -> float:
        """That something is missing which no effect describes, alone or beside others."""
        return sum(probability for probability, one in self.probabilities if one.kind == "unknown")

    @cached_property
    def probabilities(self) -> list[tuple[float, Explanation]]:
        """Of every explanation, the likeliest first."""
        joint = np.array([e.ln_joint for e in self.found])
        found = np.exp(joint - np.logaddexp.reduce(joint))
        return sorted(zip(found.tolist(), self.found, strict=True), key=lambda one: -one[0])


def forms_of(problem: Problem, base: Fit) -> Iterator[Form]:
    """A model as it is, and with parts of its base in their other published forms, each fitted."""
    model, uses = problem.assembly.model, problem.assembly.uses
    there = {part: forms for part, forms in model.other_forms.items() if Use(part) in uses}
    chosen = list(product(*((part, *others) for part, others in there.items())))
    ln_prior = -float(np.log(len(chosen)))
    for names in chosen:
        parts = {part: name for part, name in zip(there, names, strict=True) if name != part}
        with_forms = problem
        for part, name in parts.items():
            with_forms = without(with_forms, part).with_uses([name])
        try:
            yield Form(parts, with_forms, fit(with_forms, starts=STARTS) if parts else base, ln_prior)
        except ComputationError:
            continue
