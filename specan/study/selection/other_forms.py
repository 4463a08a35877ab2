"""Another published form of a part of the base, where the declared one does not meet the data by itself.

Catalogues and standards describe the same part differently (bearings: SKF, Palmgren, ISO). Which form a machine
follows is not known beforehand, so a misfit that another form removes is no missing effect.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from itertools import product

from specan.errors import ComputationError
from specan.models import Use
from specan.study.estimation.fit import Fit, describe, fit
from specan.study.estimation.levenberg_marquardt import descend
from specan.study.selection.acceptance import DECISIVE
from specan.study.selection.refits import Refit


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
        if start is not None:
            found.append(OtherForm(parts, start))
    least = min((other.start.dispersion for other in found), default=1.0)
    yield from sorted(found, key=lambda other: other.start.bic(least))


def _with(base: Refit, parts: Mapping[str, str]) -> Refit | None:
    """The base with other forms of some parts; None where that is not decisively better, or cannot be fitted."""
    other = base.problem
    for part, form in parts.items():
        other = other.without(part).with_uses([form])
    count = len(other.names) - len(base.problem.names)

    def better(fitted: Fit) -> Refit | None:
        form = Refit(frozenset(), other, fitted, count=count)
        gain = base.bic(form.dispersion) - form.bic(form.dispersion)
        return form if gain > DECISIVE else None

    reached = []
    for start in (base.fit.values, None):  # where the base is, and where forms are by default
        with suppress(ComputationError):
            reached.append(descend(other, other.start(start)))
    if not reached:
        return None
    near = min(reached, key=lambda minimum: minimum.chi2)
    if better(describe(other, near.theta, near.residual, near.jacobian)) is None:
        return None
    try:
        return better(fit(other, near.theta))
    except ComputationError:
        return None
