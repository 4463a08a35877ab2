"""Explanations of transfer functions.

A fit is expensive there, resonances are narrow, and from a field that is far off a linear promise is worth little. So
what may be added is looked at on part of the rows.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np

from specan.models import Use
from specan.models.effect import ParameterName
from specan.study.estimation.problem import Problem
from specan.study.evidence.explanations import (
    NOTHING,
    UNKNOWN,
    WITHIN,
    EffectSet,
    Explanation,
    Explanations,
    Form,
)
from specan.study.evidence.form_errors import AlongLines
from specan.study.evidence.marginal import FORMS, Marginal, Tangent
from specan.study.evidence.noise import Noise
from specan.study.evidence.promises import Catalogue, Promise
from specan.study.observation import Array
from specan.study.progress import Progress, unheard
from specan.study.selection.candidates import confounded_with
from specan.study.selection.refits import Refit

SHORT = 2 / 3  # of what a promise leaves beyond the noise from afar, that a fit may take away in addition


Led = tuple[dict[str, float], float]  # values of an effect alone, and the chi-square that they take away


class OfResponses(Explanations):
    """Explanations of transfer functions.

    Parameters
    ----------
    base : Refit
    known : mapping, optional
        SI values near the minimum of some sets.
    """

    cheap = False
    growing = True  # whether more is looked for beside fitted sets

    def __init__(
        self,
        base: Refit,
        progress: Progress = unheard,
        known: Mapping[EffectSet, Mapping[str, Any]] = MappingProxyType({}),
    ) -> None:
        self.fitted_anyway = 8 if base.poor_fit else 1
        self.errors = AlongLines()
        self.catalogues: dict[EffectSet, Catalogue] = {}
        self.begin(base, known)
        super().__init__(base.problem, base.fit, progress)

    def set_up(self) -> None:
        """No rig declares another form of the base for such data."""

    def begin(self, base: Refit, known: Mapping[EffectSet, Mapping[str, Any]]) -> None:
        """Look from a base, whose covariance may be about some field."""
        self.problem, self.base = base.problem, base.fit
        self.forms = [Form({}, self.problem, self.base, 0.0, known)]
        self.found = []
        self._far = base.poor_fit
        self._grown: set[EffectSet] = set()
        self._promised: dict[EffectSet, Promise] = {}
        self._from_afar: dict[EffectSet, tuple[EffectSet, float, float]] = {}
        self._taken: dict[EffectSet, list[float]] = defaultdict(list)

    def _search(self) -> None:
        super()._search()
        self.found = [e for e in self.found if not self._only_repairs(e)]

    def led(self, refit: Refit, uses: Collection[Use]) -> Mapping[Use, Led]:
        """Effects that part of the rows lead by itself, beside a fit."""
        return {}

    def _only_repairs(self, one: Explanation) -> bool:
        """Whether a set is no likelier than a part of it that is wrong by the least share in each line."""
        for part in self.found:
            if not (part.uses and part.uses < one.uses and part.fitted and one.fitted):
                continue
            problem, theta = part.tangent.problem, part.tangent.theta
            _, (rough, _, _), *_ = self.errors.of_change(problem, self._change(part.form, problem, theta))
            fewer, more = (
                Marginal(e.tangent.with_noise(rough)).ln_evidence + e.ln_prior for e in (part, one)
            )
            if fewer > more:
                return True
        return False

    def _forms_in_reach(self) -> list[Form]:
        return self.forms

    # --- what may be added -------------------------------------------------------------------------

    def looked_at(self, one: Explanation) -> Marginal:
        """An explanation on part of its rows, each weighted up, with its likeliest errors of form."""
        problem, theta = one.tangent.problem, one.tangent.theta
        part = problem.subsampled(theta)
        if part is problem:
            return self.weighed(one.form, one.tangent)[0]
        root = np.sqrt(problem.n_data / part.n_data)
        residual, jacobian = root * part.residual(theta), root * part.jacobian(theta)
        tangent = Tangent.at(part, theta, residual, jacobian)
        if not one.uses:
            return Marginal(tangent)
        wrong = [
            (rough, columns, share)
            for rough, columns, shares in self.errors.of_change(part, self._change(one.form, part, theta))
            for share in shares
        ]
        likeliest = self.likeliest[theta.tobytes()]
        # What another effect would repair within the least share is no sign of it: the next row of errors of lines.
        rough, columns, share = wrong[likeliest + (len(FORMS) if wrong[likeliest][0] is None else 0)]
        return Marginal(tangent.with_noise(rough), root * columns, share)

    def _promises(self, one: Explanation) -> Iterator[tuple[float, Promise]]:
        """What every further effect promises beside a set, and where some rows lead it by themselves."""
        refit, beside = one.form.refits.done[one.uses], self.looked_at(one)
        whole, _ = self.weighed(one.form, one.tangent)
        part, tangent = beside.tangent.problem, beside.tangent
        worth = self.problem.n_data / part.n_data
        here = replace(
            refit.fit, residual=part.residual(tangent.theta), jacobian=part.jacobian(tangent.theta)
        )
        before = self.catalogues.get(frozenset())
        catalogue = Catalogue(part, here, worth, before, anew=self._far and refit.fit.reduced_chi2 > 1)
        if not one.uses:
            one.form.catalogue = catalogue
        self.catalogues[one.uses] = catalogue
        led = self.led(refit, [c.use for c in catalogue.candidates])
        for promise in catalogue.promises(beside):
            # From afar few lines at resonances are most of chi-square, and part of the rows has too many of them.
            gain, own = promise.ln_gain * min(whole.chi2 / beside.chi2, 1.0), led.get(promise.use)
            if own is not None:
                values = {**refit.problem.values_at(refit.fit.theta), **own[0]}
                promise = replace(promise, starts=(values, *promise.starts))
                price = len(own[0]) * np.log(self.problem.n_data)
                gain = max(gain, (own[1] - price) / 2)
            if refit.poor_fit:
                rest = max((whole.chi2 - self.problem.n_data) / 2 - gain, 0.0)  # no effect explains the noise
                self._from_afar[one.uses | {promise.use}] = one.uses, gain, rest
                gain += SHORT * rest
            self._promised[one.uses | {promise.use}] = promise
            yield one.ln_evidence + gain, promise

    def _grow(self) -> bool:
        """Expect more beside the likeliest sets, where they are likelier than nothing, and rivals of the best."""
        sets = sorted((e for e in self.found if e.kind == "effects"), key=lambda e: -e.ln_joint)
        nothing = self._bare(self.forms[0]).ln_joint
        # 30.0: ln of the best probability over that of a set that is looked at closer
        sets = [e for e in sets if e.ln_joint > max(nothing, sets[0].ln_joint - 30.0)]
        if not sets:
            return False
        self._expect_rivals(sets[0])
        for one in sets if self.growing else ():
            if not self._waiting and one.uses not in self._grown and self._may_grow(one.uses):
                self._grown.add(one.uses)
                self._expect(one)
        if not self._waiting:
            for form, promise in self._parts():
                self._wait(np.inf, form, frozenset({promise.use}), promise)
        return bool(self._waiting)

    def _expect_rivals(self, best: Explanation) -> None:
        """Fit what is easily taken for the best effect, by what the catalogue says or at another place."""
        if len(best.uses) > 1:
            return
        (use,) = best.uses
        elsewhere = [other.use for other in best.form.catalogue.candidates if other.use.name == use.name]
        for rival in (*confounded_with(self.problem.assembly.model, use), *elsewhere):
            promise = self._promised.pop(frozenset({rival}), None)
            if promise is not None and frozenset({rival}) not in best.form.refits.done:
                self._wait(np.inf, best.form, frozenset({rival}), promise)

    def _may_grow(self, uses: EffectSet) -> bool:
        """One effect so far; or the error of one instrument, which may be met at several receivers."""
        effects = self.problem.assembly.model.effects
        return len(uses) == 1 or (
            len({use.name for use in uses}) == 1 and all(effects[use.name].instrument for use in uses)
        )

    def _worth_a_fit(self, uses: EffectSet, promised: float) -> bool:
        """Whether a set may come to be named: it comes near the best, and is better than likely parts of it alone."""
        if uses in self._from_afar:
            beside, _, rest = self._from_afar[uses]
            taken = self._taken[beside]
            if beside and len(taken) >= self.fitted_anyway:  # others beside the same set took no larger share
                promised -= max(SHORT - max(taken), 0.0) * rest
        known = [e for e in self.found if e.kind != "unknown"]
        parts = [e.ln_joint for e in known if e.kind == "effects" and e.uses < uses]
        return promised > max([max(e.ln_joint for e in known) - WITHIN, *parts])

    def _keep(self, form: Form, uses: EffectSet) -> Explanation:
        """Keep a set, and what share its fit took away of what its promise left."""
        one = super()._keep(form, uses)
        self._grown.discard(uses)
        if uses in self._from_afar:
            beside, gain, rest = self._from_afar[uses]
            fewer, more = form.refits.done[beside].fit.chi2, form.refits.done[uses].fit.chi2
            self._taken[beside].append(((fewer - more) / 2 - gain) / max(rest, 1.0))
        return one

    def _weigh(self, form: Form, tangent: Tangent, noise: Noise | None) -> tuple[Marginal, float]:
        """See `Explanations.weighed`; of many rows the columns of errors of form are not kept."""
        best, ln_evidence = super()._weigh(form, tangent, noise)
        return (Marginal(best.tangent) if self.problem.strategy.frugal else best), ln_evidence

    def _change(self, form: Form, problem: Problem, theta: Array) -> Array:
        """No line more than the effects themselves change: a base that is far off is dragged elsewhere besides."""
        lines: Any = problem.observations
        base = form.predicted
        if lines is not form.problem.observations:
            base = np.concatenate(form.problem.over(lines).predictions(form.fit.theta))
        known = {*form.problem.assembly.uses} - (form.problem.nuisances - problem.nuisances)
        own_values = problem.assembly.neutral.items()
        nothing = {n: v for n, v in own_values if not ParameterName(n).owned_by(known)}
        values = problem.values_at(theta) | nothing
        without = [o.predict(problem.assembly, problem.seen_by(o, values)) for o in lines]
        predicted = np.concatenate(problem.predictions(theta))
        net, own = predicted - base, predicted - np.concatenate(without)
        sizes = [
            np.concatenate([o.sizes(part) for o, part in zip(lines, problem.split(change)[:-1], strict=True)])
            for change in (net, own)
        ]
        return np.asarray(net * np.minimum(sizes[1] / np.maximum(sizes[0], 1e-300), 1.0))

    def _add_unknown(self, one: Explanation) -> None:
        """Something else takes in what is smoothly wrong of a set."""
        beside, _ = self.weighed(one.form, one.tangent)
        gain = self.errors.gain_of_unknown(one.form.problem, one.form.predicted, beside)
        self.found.append(one.but(np.log(UNKNOWN / NOTHING), beside.ln_evidence + gain, kind="unknown"))
