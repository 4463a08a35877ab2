"""What a search amounts to: the verdict, the reason for it in one sentence, and whether something unknown is left."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from specan.errors import ComputationError
from specan.models import Use
from specan.study.estimation.linear import Projection
from specan.study.estimation.problem import Problem
from specan.study.localisation.localise import MOST_ROWS, localise
from specan.study.selection.acceptance import DECISIVE
from specan.study.selection.alternatives import seen_from, sizes_beyond
from specan.study.selection.doubtful_data import WHOLE, rows_of_two_kinds, suspect_rows
from specan.study.selection.law_search import search_laws
from specan.study.selection.pulls import ODDS, DataAlone, Pull, data_alone, stretched, what_would_tell
from specan.study.selection.refits import FORM_TOLERANCE, Refit
from specan.study.selection.residual_law import residual_law
from specan.study.selection.search import Search
from specan.study.selection.significance import LACK_OF_FIT
from specan.study.verdict import parameters_of

MOST_PULLS = 3  # values or rivals in one sentence
MOST_SECOND = 3  # effects that may be there too, of which one is told


@dataclass(frozen=True)
class Conclusion:
    """Verdict, the reason in one sentence, and whether something unknown would explain the data as well."""

    kind: str
    reason: str
    doubt: bool = False
    values: tuple[Pull, ...] = ()  # that another fit takes, on which the verdict rests

    @property
    def nothing_left(self) -> bool:
        """Whether the model meets the data, with nothing left to explain."""
        return self.kind == "nothing-missing" and not self.doubt


def conclude(search: Search, sets: Sequence[Refit]) -> Conclusion:
    """The verdict on a finished search and the sets that the data cannot distinguish from its best."""
    base, best = search.base, search.best
    if not best.uses:
        return _of_larger_size(search) or _of_base(search)
    names = _names(sets)
    if search.third is not None:
        return Conclusion(
            "unknown-effect", "three effects or more would be needed; one unknown is likelier", True
        )
    if best.lack_of_fit_p_beyond(FORM_TOLERANCE**2 * (base.chi2 - best.chi2)) < LACK_OF_FIT:
        return Conclusion("unknown-effect", f"{names} explains a part, and much is left", True)
    contradicted = search.too_far(best)
    if contradicted:
        return Conclusion(
            "fits-only-if",
            f"with {names} it fits only with {_values(contradicted)}{_telling(best, contradicted)}",
            True,
        )
    return Conclusion("effect" if len(sets) == 1 else "group", "")


def _with_doubts(explained: Explained) -> Conclusion:
    """What speaks against an effect or a group that was found."""
    search, sets, found = explained.search, explained.sets, explained.found
    if found.kind not in ("effect", "group"):
        return found
    base, best = search.base, search.best
    left = best.lack_of_fit < WHOLE or bool(search.extensions) or _fails_somewhere(best)
    # What goes with powers of the operating variables is seen before the whole misfits.
    law = residual_law(best) if _has_independent_rows(best.problem) else None
    left = left or (law is not None and law.p_value < LACK_OF_FIT)
    one = "" if left or len(best.uses) == 1 or search.of_one_instrument(best) else _one_unknown(search)
    reasons = []
    if left:
        reasons.append("something is left: its form is not exact, or another effect is there too")
    elif one:
        reasons.append(f"{one} would explain the data as well")
    second = [] if left else _second_possible(search)
    if second:
        reasons.append(f"a second effect may be there too, such as {' or '.join(second)}")
    if stretched(best):
        reasons.append(
            f"it takes {_values(stretched(best))}: one unknown effect would explain the data as well"
        )
    named = {
        str(use) for one in sets for use in one.uses
    }  # an instrument that is named is no other explanation
    far = [pull for pull in search.too_far(base) if pull.parameter.owner not in named]
    held = far if base.lack_of_fit >= LACK_OF_FIT else []
    if held:
        reasons.append(f"without it the model fits only with {_values(held)}")
    beyond = [
        f"{_names([rival])} fits as well, with {_values(values)}"
        for rival, values in sizes_beyond(search, sets)
    ]
    reasons += beyond[:MOST_PULLS]
    suspect = bool(
        suspect_rows(base)
        or rows_of_two_kinds(base)
        or stretched(best)
        or held
        or beyond
        or better_but_too_far(search, sets)
    )
    if not (reasons or suspect) and len(sets) == 1:
        reasons.append(
            "no other explanation in the catalogue fits as well, and no significant residual is left"
        )
    return replace(found, reason="; ".join(reasons), doubt=left or bool(second) or bool(one) or suspect)


def _one_unknown(search: Search) -> str:
    """One effect outside the catalogue that the data admit as well as a set of several: a law of the grammar.

    It is fitted beside the base where that is with the set, and is as likely unless its BIC is higher by more than 6.
    Where no law can be fitted, and where the effects cancel each other, one unknown effect is always possible.
    """
    base, best = search.base, search.best
    if not _has_independent_rows(best.problem):
        return "one unknown effect"
    if _cancel(best):
        return "the effects largely cancel each other, and one unknown effect"
    try:
        laws = search_laws(seen_from(search.step(base).seen, best)).laws
    except ComputationError:
        return "one unknown effect"
    price = float(np.log(best.problem.n_effective))
    likely = [
        law
        for law in laws
        if law.chi2 / best.dispersion + price * (1 + len(law.shapes)) < best.bic(best.dispersion) + DECISIVE
    ]
    law = " x ".join(likely[0].formula.family).replace("_", " ") if likely else ""
    return f"one unknown effect ({law})" if law else ""


def _cancel(best: Refit) -> bool:
    """Whether the effects of a set change the data less together than each of them does, beside the base refitted."""
    fit, uses = best.fit, {str(use): use for use in best.uses}
    columns = fit.jacobian * best.weights[:, None]
    base = [k for k, name in enumerate(fit.names) if name.owner not in uses]
    beside = Projection.of(fit.residual * best.weights, columns[:, base])
    changes = np.zeros((len(uses), fit.residual.size))
    for row, use in zip(changes, uses.values(), strict=True):
        neutral = best.problem.assembly.model.effects[use.name].neutral_si
        for k, name in enumerate(fit.names):
            if name.owner == str(use) and name.own in neutral:
                row += beside.project_out(columns[:, k] * (fit.theta[k] - neutral[name.own]))
    return bool(np.sum(changes.sum(axis=0) ** 2) < np.sum(changes**2, axis=1).min())


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
    return [f"{name} (p = {p:.1g})" for p, name in sorted(found)[:MOST_SECOND]]


def _of_larger_size(search: Search) -> Conclusion | None:
    """An effect that would be named if its size were known to be so large; None where there is none."""
    for one, values in sizes_beyond(search, ()):
        if one.lack_of_fit >= LACK_OF_FIT and search.step(search.base).acceptance.decision(one).accepted:
            reason = f"it fits with {_names([one])}, but only with {_values(values)}{_telling(one)}"
            return Conclusion("fits-only-if", reason, True, values)
    return None


def _of_base(search: Search) -> Conclusion:
    """The verdict where no effect of the catalogue improves the model."""
    base = search.base
    contradicted = search.too_far(base)
    if base.lack_of_fit < LACK_OF_FIT:
        reason = "the model does not fit, and no effect of the catalogue explains it"
        if contradicted:
            reason += f"; its best fit takes {_values(contradicted)}"
        return Conclusion("unknown-effect", reason, True)
    if contradicted:
        return Conclusion(
            "fits-only-if",
            f"the model fits only with {_values(contradicted)}{_telling(base, contradicted)}",
            True,
        )
    other = data_alone(base)
    if other.contradicts:
        return Conclusion(
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
        return Conclusion("nothing-missing", reason, True)
    return Conclusion("nothing-missing", "the model fits, and no effect of the catalogue improves it")


def _names(sets: Sequence[Refit]) -> str:
    return " or ".join(" with ".join(sorted(map(str, r.uses))) for r in sets)


def _in_form(form: str) -> str:
    return f"with {form}" if form else "with the declared form"


@dataclass(frozen=True, eq=False)
class Explained:
    """A finished search, the sets that are left, and what they amount to."""

    search: Search
    sets: list[Refit]
    found: Conclusion


@dataclass(frozen=True, eq=False)
class OfForms:
    """The likeliest search over published forms of the base, the form that it rests on, and those as likely."""

    best: Explained
    form: str
    rivals: Mapping[str, Explained]
    declared: Explained | None = None

    def beside(self) -> str:
        """Effects with which the declared form fits as well as the best one does without any; what tells them apart."""
        best = self.best.search.best
        if (
            best.uses
            or not self.form
            or self.declared is None
            or self.declared.found.kind == "nothing-missing"
        ):
            return ""
        declared = self.declared.search
        within = [(refit, "") for refit in declared.refits.of_size(1) if not declared.too_far(refit)]
        beyond = [(refit, f" with {_values(values)}") for refit, values in sizes_beyond(declared, ())]
        near = {refit.uses: (refit, values) for refit, values in [*beyond, *within]
                if _ahead(best, refit) < DECISIVE}  # fmt: skip
        if not near:
            return ""
        likeliest = sorted(near.values(), key=lambda one: _ahead(best, one[0]))[:MOST_PULLS]
        names = " or ".join(f"{_names([refit])}{values}" for refit, values in likeliest)
        effects = best.problem.assembly.model.effects
        telling = dict.fromkeys(text for name in self.form.split() if name in effects
                                for text in [effects[name].separate_by] if text)  # fmt: skip
        wanted = f"; what would tell: {' and '.join(telling)}" if telling else ""
        return f"with the declared form, {names} fits as well{wanted}"

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


def likeliest_form(tried: Mapping[str, Explained]) -> OfForms:
    """The search with the form of the base that a verdict rests on: as declared unless another is decisively better.

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
    chosen = min(whole, key=lambda form: -_ahead(tried[form].search.best, lead), default=chosen)
    best = tried[chosen]
    rivals = {form: one for form, one in tried.items() if form != chosen and _as_likely(one, best)}
    return OfForms(best, chosen, rivals, tried[""])


def _ahead(one: Refit, other: Refit) -> float:
    """BIC by which one fit is likelier than another, chi-square in units of the smaller dispersion."""
    dispersion = min(one.dispersion, other.dispersion)
    return other.bic(dispersion) - one.bic(dispersion)


def _as_likely(one: Explained, best: Explained) -> bool:
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


def with_forms(forms: OfForms) -> Conclusion:
    """The verdict with the form of a part that it rests on; a doubt only where another form would change it."""
    found, others = _with_doubts(forms.best), forms.others()
    said = f"it rests on {forms.form}, another published form of the same part" if forms.form else ""
    reason = "; ".join(text for text in (said, found.reason, forms.beside()) if text)
    if found.kind not in ("nothing-missing", "effect", "group") or not others:
        return replace(found, reason=reason)
    said = f"the form of the base is not certain, and {' and '.join(others)}"
    return replace(found, reason="; ".join(text for text in (reason, said) if text), doubt=True)


def better_but_too_far(search: Search, sets: list[Refit]) -> tuple[str, ...]:
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


def _values(contradicted: Sequence[Pull]) -> str:
    """``mu = 0.22, known 0.01 to 0.12, and exponent = 3.2, known 0.8 to 2.2``."""
    return ", and ".join(pull.text for pull in contradicted[:MOST_PULLS])


def _beside(other: DataAlone) -> str:
    said = f"; held to what is known chi-square is higher by {other.gain:.1f} (p = {other.p_value:.2g})"
    if other.predicts > ODDS:
        odds = float(f"{np.exp(min(other.predicts / 2, 30.0)):.1g}")
        said += f", and conditions that are left out are predicted worse (odds of {odds:,.0f} to 1)"
    return said


def _telling(refit: Refit, contradicted: Sequence[Pull] = ()) -> str:
    """What would decide: what checks a certificate, what separates an added effect, or conditions that did not vary."""
    effects = refit.problem.assembly.model.effects
    held = [p.parameter for p in contradicted[:MOST_PULLS] if p.parameter.whole in refit.problem.priors]
    uses = dict.fromkeys(
        [*(Use.parse(name.owner).name for name in held), *(u.name for u in sorted(refit.uses))]
    )
    checks = [effects[name].separate_by for name in uses if name in effects and effects[name].separate_by]
    wanted = " or ".join(checks) or what_would_tell(refit)
    return f"; what would tell: {wanted}" if wanted else ""


def _fails_somewhere(best: Refit) -> bool:
    """Whether blocks of conditions stand out of what a set leaves."""
    return _has_independent_rows(best.problem) and bool(localise(best.problem, best.fit).fails_at)


def _has_independent_rows(problem: Problem) -> bool:
    """Whether rows can be looked at one by one: those of tables, not lines of a transfer function."""
    return problem.n_data <= MOST_ROWS and problem.n_effective >= problem.n_data
