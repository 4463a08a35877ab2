"""Pulls: how far fitted values lie outside of what was known of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from specan.models.effect import ParameterName, Use
from specan.study.selection.refits import Refit
from specan.units import spoken

# Standard deviations beyond which a fit holds only with a value that contradicts what is known: three, as for an
# outlier of a normal law (p = 0.003).
TOO_FAR = 3.0


@dataclass(frozen=True)
class Pull:
    """One fitted value beside what was known of it.

    Attributes
    ----------
    parameter : str
    value : float
    known : tuple of float
        Range known beforehand, in `unit`.
    pull : float
        Standard deviations by which the value lies outside, with its sign.
    at_bound : bool
        The value rests on an end of its domain: the data would go further. At zero only where that lies outside the
        range: many a part may be nothing.
    """

    parameter: ParameterName
    value: float
    known: tuple[float, float]
    pull: float
    unit: str
    at_bound: bool

    @property
    def too_far(self) -> bool:
        """Whether the fit contradicts what is known."""
        return abs(self.pull) > TOO_FAR or self.at_bound

    @property
    def range(self) -> str:
        """What was known, as a person reads it."""
        ends = [end for end in self.known if np.isfinite(end)]
        side = "" if len(ends) > 1 else "above " if np.isfinite(self.known[0]) else "below "
        return side + spoken(*ends, unit=self.unit)

    @property
    def text(self) -> str:
        """``mu = 0.22, known 0.01 to 0.12``."""
        bound = ", at the end of its domain" if self.at_bound else ""
        return f"{self.parameter} = {spoken(self.value, unit=self.unit, digits=2)}, known {self.range}{bound}"


def pulls(refit: Refit) -> tuple[Pull, ...]:
    """Every value outside of what was known of it, the worst first."""
    found = [_pull(refit, name) for name in refit.fit.names]
    outside = [p for p in found if abs(p.pull) > 0 or p.at_bound]
    return tuple(sorted(outside, key=lambda p: (not p.too_far, -abs(p.pull))))


def shown(found: tuple[Pull, ...]) -> tuple[Pull, ...]:
    """Those that a person is told of."""
    outside = [p for p in found if not p.known[0] <= p.value <= p.known[1] or p.at_bound]
    # 1.0: pulls below this are no news
    return tuple(p for p in outside if abs(p.pull) >= 1.0 or p.at_bound)


def what_would_tell(refit: Refit) -> str:
    """Operating variables of the model that the data hold at one value: varying them determines more.

    ``a second load, a second viscosity``; empty where all vary.
    """
    problem = refit.problem
    constant = []
    for name, condition in problem.assembly.model.conditions.items():
        if not condition.varies or condition.unit == "s":
            continue
        values = [o.conditions[name] for o in problem.observations if name in o.conditions]
        if all(np.ptp(v) <= 1e-9 * np.max(np.abs(v), initial=0.0) for v in values):
            constant.append(condition.column.rpartition("_")[0].replace("_", " ") or name)
    # 2: operating variables that are named, in the model's order
    return ", ".join(f"a second {name}" for name in constant[:2])


def _pull(refit: Refit, name: ParameterName) -> Pull:
    problem, fit = refit.problem, refit.fit
    plain = name.whole
    parameter = problem.assembly.parameters[plain]
    value = float(fit.theta[fit.names.index(name)])
    if plain in problem.priors:
        mean, sd = problem.priors[plain]
        # coverage factor 2
        known, pull = (mean - 2 * sd, mean + 2 * sd), (value - mean) / sd
    else:
        known, pull = problem.plausible(plain), problem.pulls(fit.theta)[name]
    owner = problem.assembly.model.effects.get(Use.parse(name.owner).name)
    # Relative errors of instruments, and those under a certificate, are given in percent.
    relative = parameter.unit == "1" and (plain in problem.priors or (owner is not None and owner.instrument))
    share, unit = (100.0, "percent") if relative else (1.0, parameter.unit)
    shown, low, high = (share * parameter.from_si(one) for one in (value, *known))
    outside = not known[0] <= value <= known[1]
    at_bound = name in fit.at_bound and (outside or value != 0)
    return Pull(name, shown, (low, high), pull, unit, at_bound)
