"""Another published form of a part of the base, where the declared one does not meet the data by itself.

Catalogues and standards describe the same part differently (bearings: SKF, Palmgren). Which form a machine follows is
not known beforehand, so a misfit that another form removes is no missing effect.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from specan.errors import ComputationError
from specan.models import Use
from specan.study.estimation.fit import fit
from specan.study.selection.acceptance import DECISIVE
from specan.study.selection.refits import Refit

STARTS = 3


@dataclass(frozen=True, eq=False)
class OtherForm:
    """The base with one part in another published form.

    Attributes
    ----------
    part, form : str
        Base effect, and what stands in its place.
    start : Refit
    """

    part: str
    form: str
    start: Refit

    @property
    def text(self) -> str:
        """``palmgren-bearings in place of bearing-friction``."""
        return f"{self.form} in place of {self.part}"


def other_forms(base: Refit) -> Iterator[OtherForm]:
    """Every other form of a part of the base that meets the data decisively better, fitted.

    Both have as many parameters or pay for them: better is a BIC, pulls of known ranges included, lower by 6.
    """
    problem = base.problem
    model = problem.assembly.model
    for part, forms in model.other_forms.items():
        if not problem.strategy.secondary_refits or Use(part) not in problem.assembly.uses:
            continue
        for form in forms:
            other = problem.without(part).with_uses([form])
            count = len(other.names) - len(problem.names)
            try:
                start = Refit(frozenset(), other, fit(other, starts=STARTS), count=count)
            except ComputationError:
                continue
            if base.bic(start.dispersion) - start.bic(start.dispersion) > DECISIVE:
                yield OtherForm(part, form, start)
