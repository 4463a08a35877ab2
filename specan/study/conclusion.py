"""What a search amounts to: the verdict, the reason for it in one sentence, and whether something unknown is left."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from specan.models import Use
from specan.study.selection.acceptance import DECISIVE
from specan.study.selection.doubtful_data import WHOLE
from specan.study.selection.pulls import ODDS, DataAlone, Pull, data_alone, stretched, what_would_tell
from specan.study.selection.refits import FORM_TOLERANCE, Refit
from specan.study.selection.search import Search
from specan.study.selection.significance import LACK_OF_FIT

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
        return _of_base(search)
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


def with_doubts(found: Conclusion, search: Search, sets: Sequence[Refit]) -> Conclusion:
    """What speaks against an effect or a group that was found."""
    if found.kind not in ("effect", "group"):
        return found
    base, best = search.base, search.best
    left = best.lack_of_fit < WHOLE or bool(search.extensions)
    reasons = []
    if left:
        reasons.append("something is left: its form is not exact, or another effect is there too")
    elif len(best.uses) > 1 and not search.of_one_instrument(best):
        reasons.append("one unknown effect would explain the data as well")
    second = [] if left else _second_possible(search)
    if second:
        reasons.append(f"a second effect may be there too, such as {' or '.join(second)}")
    if stretched(best):
        reasons.append(
            f"it takes {_values(stretched(best))}: one unknown effect would explain the data as well"
        )
    # An instrument that is named is no other explanation.
    named = {str(use) for one in sets for use in one.uses}
    held = [pull for pull in search.too_far(base) if pull.parameter.owner not in named]
    if held and base.lack_of_fit >= LACK_OF_FIT:
        reasons.append(f"without it the model fits only with {_values(held)}")
    doubt = bool(reasons) or bool(better_but_too_far(search, sets))
    if not doubt and len(sets) == 1:
        reasons.append(
            "no other explanation in the catalogue fits as well, and no significant residual is left"
        )
    return replace(found, reason="; ".join(reasons), doubt=doubt)


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


def better_but_too_far(search: Search, sets: Sequence[Refit]) -> tuple[str, ...]:
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
