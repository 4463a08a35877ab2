"""Another published form of a part of the base, where the declared one does not meet the data by itself.

Catalogues and standards describe the same part differently (bearings: SKF, Palmgren). Which form a machine follows is
not known beforehand, so a misfit that another form removes is no missing effect.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import product

from specan.errors import ComputationError
from specan.models import Use
from specan.study.estimation.fit import fit
from specan.study.selection.acceptance import DECISIVE
from specan.study.selection.refits import Refit

STARTS = 3  # of the fit of each form


@dataclass(frozen=True, eq=False)
class OtherForm:
    """The base with one part or several in another published form.

    Attributes
    ----------
    parts : mapping
        Base effect, and what is in its place.
    start : Refit
    """

    parts: Mapping[str, str]
    start: Refit

    @property
    def text(self) -> str:
        """``palmgren-bearings in place of bearing-friction``."""
        return " and ".join(f"{form} in place of {part}" for part, form in self.parts.items())


def other_forms(base: Refit) -> Iterator[OtherForm]:
    """Every choice of other forms of parts of the base that meets the data decisively better, fitted, best first.

    Parameters are paid for: better is a BIC, pulls of known ranges included, lower by 6.
    """
    problem = base.problem
    if not problem.strategy.secondary_refits:
        return
    there = {part: forms for part, forms in problem.assembly.model.other_forms.items()
             if Use(part) in problem.assembly.uses}  # fmt: skip
    found = []
    for chosen in product(*((part, *forms) for part, forms in there.items())):
        parts = {part: form for part, form in zip(there, chosen, strict=True) if form != part}
        start = _with(base, parts) if parts else None
        if start is not None and base.bic(start.dispersion) - start.bic(start.dispersion) > DECISIVE:
            found.append(OtherForm(parts, start))
    least = min((other.start.dispersion for other in found), default=1.0)
    yield from sorted(found, key=lambda other: other.start.bic(least))


def _with(base: Refit, parts: Mapping[str, str]) -> Refit | None:
    """The base with other forms of some parts; None where it cannot be fitted."""
    other = base.problem
    for part, form in parts.items():
        other = other.without(part).with_uses([form])
    try:
        fitted = fit(other, starts=STARTS)
    except ComputationError:
        return None
    return Refit(frozenset(), other, fitted, count=len(other.names) - len(base.problem.names))
