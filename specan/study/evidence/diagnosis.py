"""A diagnosis from the probabilities of all explanations: what they amount to, and all that goes with it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from specan.errors import SpecanError, reason_of
from specan.study import verdict
from specan.study.design.operating_points import Proposal, explore, propose
from specan.study.estimation.fit import describe
from specan.study.estimation.problem import Problem
from specan.study.evidence.explanations import OF_THE_BEST, SURE, EffectSet, Explanation, Explanations
from specan.study.evidence.law_search import likeliest_law
from specan.study.evidence.marginal import FORMS
from specan.study.localisation.localise import localise
from specan.study.observation import brought
from specan.study.observation.time import TimeObservation
from specan.study.selection.refits import TOO_FAR, Pull, Refit, pulls, shown, what_would_tell
from specan.study.selection.starting_values import about_itself
from specan.units import spoken


@dataclass(frozen=True, eq=False)
class Stated:
    """An explanation whatever the form of the base and of the noise.

    Attributes
    ----------
    kind : str
        ``nothing``, ``effects``, ``beyond``, ``unknown`` or ``fault``.
    uses : frozenset of Use
    probability : float
    best : Explanation
        The likeliest among its forms.
    """

    kind: str
    uses: EffectSet
    fault: str
    probability: float
    best: Explanation

    @property
    def text(self) -> str:
        """``nothing``, ``windage with seal-drag``, ``something else``, or the fault."""
        names = " with ".join(sorted(map(str, self.uses)))
        if self.kind == "effects":
            return names
        if self.kind == "beyond":
            return (names or "nothing is missing") + ", with values outside their known range"
        if self.kind == "fault":
            return self.fault + (f" beside {names}" if names else "")
        return {"nothing": "nothing is missing", "unknown": "something else"}[self.kind]


@dataclass(frozen=True, eq=False)
class Judgement:
    """What the probabilities amount to.

    Attributes
    ----------
    kind : str
        ``nothing-missing``, ``effect``, ``group``, ``fits-only-if``, ``unknown-effect`` or ``faulty-data``.
    sets : tuple of Stated
        What is named, the likeliest first.
    stated : tuple of Stated
        Every explanation, the likeliest first.
    """

    kind: str
    sets: tuple[Stated, ...]
    stated: tuple[Stated, ...]

    def probability(self, kind: str) -> float:
        """Of all explanations of a kind together."""
        return sum(one.probability for one in self.stated if one.kind == kind)


def stated(explanations: Explanations) -> tuple[Stated, ...]:
    """Explanations summed over forms of the base and of the noise, the likeliest first."""
    kinds: dict[tuple[str, EffectSet, str], list[tuple[float, Explanation]]] = {}
    alone: dict[EffectSet | str, float] = {}  # ln of the largest evidence of a set, of a fault
    for _, one in explanations.probabilities:
        if one.kind == "effects" or (one.fault and not one.uses):
            by = one.fault.name if one.fault else one.uses
            alone[by] = max(alone.get(by, -np.inf), one.ln_evidence)
    for probability, one in explanations.probabilities:
        kind, uses = one.kind, one.uses
        if kind in ("effects", "unknown") and one.names_its_effects:
            kind = "effects"
        elif kind in ("effects", "unknown"):
            if kind == "effects":  # it stays among what was tried
                kinds.setdefault((kind, uses, ""), []).append((0.0, one))
            kind, uses = "unknown", frozenset()
        # effects beside what explains more than they do were fitted at conditions that are not the right ones
        fault = one.fault
        if fault and uses and fault.of_condition and alone.get(fault.name, 0.0) > alone.get(uses, -np.inf):
            uses, one = frozenset(), replace(one, uses=frozenset(), tangent=one.form.tangent)
        key = kind, uses, fault.name if fault else ""
        kinds.setdefault(key, []).append((probability, one))
    found = [Stated(*key, sum(p for p, _ in own), own[0][1]) for key, own in kinds.items()]
    return tuple(sorted(found, key=lambda one: (-one.probability, -one.best.ln_joint)))


def judge(explanations: Explanations) -> Judgement:
    """What is said."""
    all_of_them = stated(explanations)
    whole = Judgement("", (), all_of_them)
    named = whole.probability("effects")
    fault, nothing = whole.probability("fault"), whole.probability("nothing")
    rest = max(named, whole.probability("beyond"), whole.probability("unknown"))
    alone = sum(one.probability for one in all_of_them if one.kind == "fault" and not one.uses)
    # Its owner has to look for what is sure, or for the likeliest where something is sure to be wrong.
    if fault > SURE or (nothing <= 1 - SURE and alone > rest):
        faults = tuple(one for one in all_of_them if one.kind == "fault")
        return Judgement("faulty-data", faults[:1], all_of_them)
    # A fault that is not sure is no reason to say that an effect is missing.
    if nothing > (1 - SURE) * (1 - fault):
        return Judgement("nothing-missing", (), all_of_them)
    beyond = [one for one in all_of_them if one.kind == "beyond"]
    if whole.probability("beyond") > max(named, whole.probability("unknown")):
        return Judgement("fits-only-if", tuple(beyond[:1]), all_of_them)
    if whole.probability("unknown") > named:
        return Judgement("unknown-effect", (), all_of_them)
    effects = [one for one in all_of_them if one.kind == "effects"]
    sets = without_larger(one for one in effects if one.probability > effects[0].probability * OF_THE_BEST)
    return Judgement("effect" if len(sets) == 1 else "group", tuple(sets), all_of_them)


def without_larger(found: Iterable[Stated]) -> list[Stated]:
    """Explanations without those that a likelier one with fewer effects says already."""
    kept: list[Stated] = []
    for one in found:
        if not any(other.uses and other.uses < one.uses for other in kept):
            kept.append(one)
    return kept


MOST_TOLD = 12  # sets of effects in the table, and places where the model fails
LACK_OF_FIT = 1e-3  # probability below which a model does not fit
DOUBT = 0.2  # probability of something else from which it is said: twice what it is before any data


def told(explanations: Explanations, given: Refit | None = None) -> verdict.Diagnosis:
    """What is said of all explanations of some data; where the model fails is told of a `given` fit of it."""
    judged = judge(explanations)
    explanations.progress("where the model fails, and what to measure next", 0.9)
    return _Telling(explanations, judged, given).diagnosis()


class _Telling:
    """What is told of a judgement; a part that fails is told in a sentence, and costs nothing else."""

    def __init__(self, explanations: Explanations, judged: Judgement, given: Refit | None) -> None:
        self.problem, self.explanations, self.judged = explanations.problem, explanations, judged
        self.base = Refit(frozenset(), explanations.problem, explanations.base)
        self.given = given or self.base
        self.failures: list[str] = []
        self._refits: dict[int, Refit] = {}

    def try_to(self, what: str, find: Any, otherwise: Any) -> Any:
        """What `find` gives; `otherwise` where it fails."""
        try:
            return find()
        except Exception as fault:
            reason = fault.found if isinstance(fault, SpecanError) else reason_of(fault)
            self.failures.append(f"{what} could not be computed ({reason})")
            return otherwise

    def refit(self, one: Explanation) -> Refit:
        """The fit of an explanation."""
        if id(one) not in self._refits:
            problem = replace(one.tangent.problem, unheld=self.problem.unheld)
            known = () if one.tangent.noises else one.tangent.with_pseudo_rows(problem)
            fitted = describe(problem, one.tangent.theta, *known)
            self._refits[id(one)] = Refit(one.uses, problem, fitted)
        return self._refits[id(one)]

    def diagnosis(self) -> verdict.Diagnosis:
        """All of it."""
        judged, base = self.judged, self.base
        kind, sets = judged.kind, judged.sets
        best = self.refit(self._best.best)
        shown_of = self.given if kind == "unknown-effect" else best
        pulled = self.try_to("values outside their known range", lambda: pulls(shown_of), ())
        fails_at = self.try_to(
            "where the model fails", lambda: localise(self.given.problem, self.given.fit).fails_at, ()
        )
        error = self.try_to(
            "the error", lambda: verdict.error_fall(self.given, best if sets else self.given), None
        )
        law = None
        if kind == "unknown-effect":
            law = self.try_to("a law for the residuals", lambda: likeliest_law(base), None)
        proposals = self.try_to("what to measure next", lambda: self._next(kind, fails_at), ())
        rows = self.try_to("the table of what was tried", self._ranking, ())
        visible = self.try_to(
            "the smallest detectable sizes", lambda: self.explanations.visible(self._best.best), {}
        )
        remarks = self._remarks()
        return verdict.Diagnosis(
            verdict=kind,
            reason=self._only_with(best, pulled) if kind == "fits-only-if" else self._reason(kind),
            alternatives=tuple(tuple(sorted({u.name for u in one.uses})) for one in sets),
            at=verdict.places_of(u for one in sets for u in one.uses),
            unknown_possible=kind in ("fits-only-if", "unknown-effect")
            or self.explanations.probability_of_something_else > DOUBT
            or self._off_form,
            probabilities=tuple(self._probabilities()),
            ranking=rows,
            lack_of_fit=verdict.LackOfFit(
                self.given.fit.reduced_chi2, self.given.fit.p_value, self.problem.n_effective
            ),
            model_discrepancy_percent=float(self.problem.assembly.model.rig.discrepancy_percent),
            fails_at=tuple(block.as_dict() for block in fails_at[:MOST_TOLD]),
            residual_law=law and {"text": law.text, "quantity": law.quantity},
            smallest_visible=visible,
            not_testable=self.explanations.not_testable,
            other_form=_form(self._best.best) if kind == "nothing-missing" else "",
            next_measurement=tuple(asdict(p) for p in proposals),
            pulls=shown(pulled),
            error=error,
            remarks=(*remarks, *self.failures),
        )

    @property
    def _best(self) -> Stated:
        """The explanation that the verdict rests on."""
        if self.judged.sets:
            return self.judged.sets[0]
        kind = "nothing" if self.judged.kind == "nothing-missing" else "unknown"
        return next(one for one in self.judged.stated if one.kind == kind)

    def _probabilities(self) -> list[verdict.Probability]:
        # 1e-4: probability below which an explanation is not listed
        return [
            verdict.Probability(
                one.text,
                one.kind,
                tuple(sorted({u.name for u in one.uses})) if one.kind != "unknown" else (),
                verdict.places_of(one.uses),
                one.probability,
            )
            for one in self.judged.stated
            if one.probability > 1e-4
        ]

    def _only_with(self, best: Refit, pulled: Sequence[Pull]) -> str:
        """The values off what is known that a fit needs."""
        far = [p for p in pulled if abs(p.pull) > TOO_FAR or (p.at_bound and p.parameter.owner)]
        values = " and ".join(p.text for p in (far or pulled)[:3])
        with_what = f"with {_names(self.judged.sets)} it" if self.judged.sets[0].uses else "the model"
        telling = what_would_tell(best)
        return f"{with_what} fits only with {values}" + (f"; to decide: {telling}" if telling else "")

    def _reason(self, kind: str) -> str:
        judged, sets, parts = self.judged, self.judged.sets, []
        if kind == "faulty-data":
            return f"{self._faults()}: correct that, and diagnose again"
        if kind == "nothing-missing":
            likelier = [o for o in judged.stated if o.kind == "effects"]
            least = judged.probability("nothing")
            likelier = [o for o in likelier if o.probability > max(least, DOUBT)]
            if likelier:
                parts.append(
                    f"{likelier[0].text} is likelier ({verdict.percent(likelier[0].probability)}), but not likely "
                    "enough to be named"
                )
            else:
                rough = self._best.best.noise is not None and self.given.fit.p_value < LACK_OF_FIT
                fits = "with the declared uncertainty the model does not fit" if rough else "the model fits"
                parts.append(f"{fits}, and no effect of the catalogue improves it")
        if kind in ("effect", "group"):
            parts.append(self._others())
        if kind in ("effect", "group") and self._off_form:
            parts.append(
                f"the equation of {sets[0].text} would have to be off by about {100 * FORMS[-1]:.0f} %: it may be "
                "another effect of a similar form"
            )
        if kind == "unknown-effect":
            parts.append("the model does not fit, and no effect of the catalogue explains it")
            parts.append(self._partly())
        forms = {_form(one.best) for one in judged.sets} - {""}
        if forms and kind in ("effect", "group"):
            parts.append(f"with {' or '.join(sorted(forms))}")
        return "; ".join(filter(None, parts))

    @property
    def _off_form(self) -> bool:
        """Whether the named set fits only if its equations are off by as much as is thought possible."""
        sets = self.judged.sets
        # 0.9: probability that the errors of form are the largest, above which a name is doubted
        return bool(sets) and self.explanations.largest_errors_of_form(sets[0].best) > 0.9

    def _others(self) -> str:
        """The likeliest explanation without what is named."""
        named = [one.uses for one in self.judged.sets]
        rest = [one for one in self.judged.stated if not any(uses <= one.uses for uses in named)]
        if not rest or rest[0].probability < verdict.LEAST_TOLD:
            return f"every explanation without what is named is below {verdict.percent(verdict.LEAST_TOLD)}"
        return f"the likeliest other explanation is {rest[0].text} ({verdict.percent(rest[0].probability)})"

    def _partly(self) -> str:
        """The set that takes most away where none is named, with both errors."""
        found = [one for one in self.judged.stated if one.kind == "effects" and one.best.fitted]
        if not found:
            return ""
        best = max(found, key=lambda one: one.best.ln_joint)
        before, after = verdict.errors(self.given)[0], verdict.errors(self.refit(best.best))[0]
        if after.rms > 0.8 * before.rms:
            return ""
        fall = spoken(before.rms, after.rms, unit=before.unit)
        return f"{best.text} would reduce the error from {fall} and leave the rest"

    def _ranking(self) -> tuple[verdict.Ranked, ...]:
        rows = []
        tried = [one for one in self.judged.stated if one.kind == "effects" and one.best.fitted]
        # Of each form of the noise, the best: an effect under which readings scatter more is no better for that.
        bare = {
            type(e.noise): e.ln_evidence
            for e in sorted(self.explanations.found, key=lambda e: e.ln_evidence)
            if e.kind == "nothing"
        }
        for one in tried[:MOST_TOLD]:
            refit = self.refit(one.best)
            named = one in self.judged.sets
            told = about_itself(refit) if named else refit
            error, *more = verdict.errors(refit)
            own, pulled = {str(u) for u in one.uses}, pulls(refit)
            rows.append(
                verdict.Ranked(
                    effects=tuple(sorted(u.name for u in one.uses)),
                    at=verdict.places_of(one.uses),
                    probability=one.probability,
                    ln_evidence=one.best.ln_evidence - bare.get(type(one.best.noise), bare[type(None)]),
                    error_after=error.rms,
                    level_after_dB=error.level_dB,
                    others_after={e.observable: e.rms for e in more},
                    parameters=verdict.parameter_table(told.problem, told.fit, own, profiled=named),
                    plausible=not any(abs(p.pull) > TOO_FAR for p in pulled),
                    at_bound=any(n.owner in own for n in refit.fit.at_bound),
                    pulls=shown(pulled),
                )
            )
        return tuple(rows)

    def _next(self, kind: str, fails_at: Sequence[Any]) -> Sequence[Proposal]:
        if kind == "faulty-data":
            return ()
        if kind == "unknown-effect":
            return explore(self.given, fails_at)
        told = [one for one in self.judged.stated if one.kind in ("effects", "nothing") and one.best.fitted]
        if told[0].probability > SURE:
            return ()
        near = without_larger(one for one in told if one.probability > told[0].probability * OF_THE_BEST)
        plain = [one for one in near if not one.best.form.parts][:4]
        refits, probabilities = [self.refit(one.best) for one in plain], [one.probability for one in plain]
        return propose(refits, probabilities, other_kinds=kind == "group")

    def _remarks(self) -> list[str]:
        base, best = self.base, self._best.best
        remarks = [
            ("the scatter beside its uncertainty", lambda: too_good(base)),
            ("faults of the data", self._fault),
            ("the fit of the base", lambda: not_settled(base)),
            ("shifts of modes", self._undeclared_shifts),
            ("the noise of recordings", lambda: larger_noise(self.problem)),
            ("noise", lambda: best.of_noise),
        ]
        return [text for what, find in remarks if (text := self.try_to(what, find, ""))]

    def _undeclared_shifts(self) -> str:
        """Shifts of single modes that explain what no effect does, though the rig file does not say so."""
        look = brought(self.problem.observations, "undeclared_shifts")
        unknown = self.judged.kind == "unknown-effect"
        return look(self.given.problem, LACK_OF_FIT) if look and unknown else ""

    def _fault(self) -> str:
        """The likeliest fault where it is not the verdict."""
        whole = self.judged.probability("fault")
        if self.judged.kind == "faulty-data" or whole < DOUBT:
            return ""
        return f"{self._faults()} ({verdict.percent(whole)} that the data have a fault)"

    def _faults(self) -> str:
        """Sentences of the faults that may be the one; three at most."""
        found = [one for one in self.judged.stated if one.kind == "fault"]
        texts = {one.fault: one.best.fault.text for one in reversed(found) if one.best.fault}
        names = verdict.likeliest_faults((one.fault, one.probability) for one in found)
        return "; or ".join(texts[name] for name in list(names)[:3])


def not_settled(base: Refit) -> str:
    """A sentence where the fit of the model as it is was given up."""
    if base.fit.converged:
        return ""
    return (
        "the fit of the model as it is did not converge and may be poor: give start values or narrower bounds"
    )


def larger_noise(problem: Problem) -> str:
    """A sentence where what is taken for noise of a recording is larger than it should be: a lack may hide in it."""
    # 2.0: times the noise that a recording is taken to have, from which its user has to know
    found = [
        f"the noise of {name} ({noise.words}) seems {spoken(noise.times, digits=2)} times as large as "
        + ("declared" if name in o.stated else "estimated from its fastest changes")
        for o in problem.observations
        if isinstance(o, TimeObservation)
        for name, noise in o.noise.items()
        if noise.times > 2.0
    ]
    stated = all(
        set(o.noise) <= set(o.stated) for o in problem.observations if isinstance(o, TimeObservation)
    )
    advice = "" if stated else " (state the noise of the channel, Signal(unit, noise), to decide)"
    return f"{' and '.join(found)}: something may be missing there{advice}" if found else ""


def _form(one: Explanation) -> str:
    """``palmgren-bearings in place of bearing-friction``; empty for the declared form."""
    return " and ".join(f"{form} in place of {part}" for part, form in one.form.parts.items())


def _names(sets: Sequence[Stated]) -> str:
    return " or ".join(" with ".join(sorted(map(str, one.uses))) for one in sets)


def too_good(base: Refit) -> str:
    """A remark where the data scatter less than their uncertainty says: then nothing small is seen."""
    reduced = base.fit.reduced_chi2
    # 0.3: reduced chi-square below which the stated uncertainty contradicts the scatter
    # 10.0: degrees of freedom: with fewer, chance alone goes below that (chi-square, 2 in 100)
    if not reduced < 0.3 or base.dof < 10.0:
        return ""
    return (
        f"reduced chi-square {reduced:.2f}: the stated uncertainty is {1 / np.sqrt(max(reduced, 1e-4)):.1f} times the "
        "scatter, so that small effects cannot be detected. Different conditions may have been taken for repeats, or "
        "the declared model discrepancy or uncertainty is too large"
    )
