"""Laws for what is left of a study's error, written as effect files that can be added."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from specan.errors import ComputationError
from specan.models import Use
from specan.models.catalogue import effects_from_file
from specan.result import Result, counted
from specan.study.design.operating_points import propose as propose_measurements
from specan.study.estimation.fit import fit
from specan.study.estimation.prediction_error import left_out_errors
from specan.study.estimation.problem import Problem
from specan.study.evidence.law_search import Law, search_laws
from specan.study.selection.refits import Refit
from specan.study.study import Study
from specan.study.user_effects import LAWS, trust_file, write_beside_older
from specan.study.verdict import errors, parameter_table, percent


@dataclass(frozen=True, eq=False)
class ProposedLaw:
    """One law.

    Attributes
    ----------
    name : str
        Of the effect in the file.
    file : Path
        Where it was written.
    text : str
        The formula.
    quantity : str
        What it is added to, or scales.
    parameters : dict
        Values with 95 % intervals in their units, of a refit of the whole model.
    probability : float
        Beside noise alone and all laws that were tried.
    error_after : float
        RMS error of the observable with most values.
    left_out_after : float or None
        The same on conditions that were left out, each in turn.
    """

    name: str
    file: Path
    text: str
    quantity: str
    parameters: dict[str, dict[str, Any]]
    probability: float
    error_after: float
    left_out_after: float | None


@dataclass(frozen=True, eq=False, repr=False)
class ProposedLaws(Result):
    """What `specan study propose` found.

    Attributes
    ----------
    laws : tuple of ProposedLaw
        Best first; the data cannot distinguish them. None where noise explains the residuals.
    noise : float
        Probability that noise alone explains the residuals.
    tried : int
        How many laws were tried.
    more : int
        Further families that the data admit as well.
    error_before, left_out_before : float, float or None
    unit : str
        Of the errors.
    next_measurement : tuple of mapping
        Measurements that would tell the laws apart.
    """

    laws: tuple[ProposedLaw, ...]
    noise: float
    tried: int
    more: int
    error_before: float
    left_out_before: float | None
    unit: str
    next_measurement: tuple[Mapping[str, Any], ...] = ()

    dimensions = ("law",)

    def summary(self) -> str:
        """How many there are."""
        if not self.laws:
            out = "those that fit the residuals need values outside the bounds of the model's parameters"
            why = "noise explains the residuals" if self.noise > 0.5 else out
            return f"No law: {why} (noise {percent(self.noise)}; {self.tried} laws tried)"
        return f"{counted(len(self.laws), 'law')} of {self.tried} tried"

    def columns(self) -> dict[str, Any]:
        """One row for each law."""
        return {
            "law": [law.name for law in self.laws],
            "formula": [law.text for law in self.laws],
            "probability": [law.probability for law in self.laws],
            "error_after": [law.error_after for law in self.laws],
            "left_out_after": [law.left_out_after for law in self.laws],
            "file": [str(law.file) for law in self.laws],
        }

    def to_dict(self) -> dict[str, Any]:
        """Plain values."""
        return {**vars(self), "laws": [{**vars(law), "file": str(law.file)} for law in self.laws]}


def propose_laws(study: Study) -> ProposedLaws:
    """Search the residuals of a study for laws, and write those that the data admit as effect files.

    Parameters
    ----------
    study : Study
        With tables as its data; files go to ``laws`` in its directory.

    Raises
    ------
    RequestError
        The uncertainty of the measurement is unknown; the data are no table, or too few rows.
    """
    study.require_uncertainty("propose")
    start = Refit(frozenset(), study.problem, study.best)
    found = search_laws(start)
    before, left_out = errors(start)[0], next(iter(left_out_errors(start.problem, start.fit)), None)
    plain = [name_of(law) for law in found.laws]
    named = {  # all different
        name if plain.count(name) == 1 else name + ("-scaling" if law.formula.scales else "-added"): law
        for name, law in zip(plain, found.laws, strict=True)
    }
    sources = {name: source_of(law, name, found.tried) for name, law in named.items()}
    files = {name: study.directory / LAWS / f"{name}.py" for name in sources}
    # One catalogue for all, so that the refits can be compared.
    own = [e for n, s in sources.items() for e in effects_from_file(files[n], s.encode())]
    model = start.problem.assembly.model.with_effect(*own)
    rival = replace(start.problem, assembly=model.assemble(start.problem.assembly.uses))
    # far from its minimum a law may exceed every number, as may a power of a variable that is zero within the limits
    with np.errstate(all="ignore"):
        fitted = [
            (*one, sources[name])
            for name, law in named.items()
            if (one := _fitted(rival, start, law, name, files[name])) is not None
        ]
        fitted.sort(key=lambda one: -one[0].probability)
        refits = [refit for _, refit, _ in fitted]
        following = (
            propose_measurements(refits, [law.probability for law, *_ in fitted]) if len(refits) > 1 else ()
        )
    for law, _, source in fitted:
        write_beside_older(law.file, source.encode())
        trust_file(law.file)
    return ProposedLaws(
        laws=tuple(law for law, _, _ in fitted),
        noise=found.noise,
        tried=found.tried,
        more=found.more,
        error_before=before.rms,
        left_out_before=None if left_out is None else left_out.rms,
        unit=before.unit,
        next_measurement=tuple(asdict(p) for p in following),
    )


def _fitted(
    rival: Problem, start: Refit, law: Law, name: str, file: Path
) -> tuple[ProposedLaw, Refit] | None:
    """The whole model refitted with a law; None where that does not converge."""
    use = Use(name)
    problem = rival.with_uses([use])
    try:
        best = fit(problem, start.fit.values)
    except ComputationError:
        return None
    # What fits only with values that the model's parameters cannot have is no explanation.
    # 9.0: chi-square, three standard deviations, by which a fit may end above what the search found
    if best.chi2 > law.chi2 + 9.0 * max(law.chi2 / max(start.dof, 1.0), 1.0):
        return None
    refit = Refit(frozenset({use}), problem, best)
    left_out = next(iter(left_out_errors(refit.problem, refit.fit)), None)
    proposed = ProposedLaw(
        name=name,
        file=file,
        text=law.text,
        quantity=law.quantity,
        parameters=parameter_table(problem, best, {name}),
        probability=law.probability,
        error_after=errors(refit)[0].rms,
        left_out_after=None if left_out is None else left_out.rms,
    )
    return proposed, refit


def name_of(law: Law) -> str:
    """Name of a law's effect: its families and variables.

    Returns
    -------
    str
        Such as ``law-gaussian-flow``.
    """
    words = [f"{f.family}-{f.variable}" for f in law.formula.factors]
    return re.sub(r"[^a-z0-9]+", "-", "law-" + "-".join(words).lower()).strip("-")


_FILE = '''"""A law that was found in the residuals: give it its physical name and its plausible range."""

{numpy}from specan.models import Parameter, effect


@effect("{name}", {acts}="{quantity}", neutral={{"size": 0.0}}, reference="found in these data, {tried} laws tried")
def {function}(
{arguments}
):
    """{text}."""
    return {result}
'''


def source_of(law: Law, name: str, tried: int) -> str:
    """The law as an effect file.

    Parameters
    ----------
    law : Law
    name : str
        Of the effect.
    tried : int
        Laws that were tried.

    Returns
    -------
    str
        Python, with the fitted values as defaults and the units of the model.
    """
    reads = list(dict.fromkeys(f.variable for f in law.formula.factors))
    # 20.0: an amplitude may grow by this factor in a fit
    most = 20.0 * abs(law.size)
    parameters = [f'size=Parameter({law.size:.6g}, "{law.unit}", lower={-most:.4g}, upper={most:.4g})']
    parameters += [
        f'{s.name}=Parameter({value:.6g}, "{s.unit}", min={s.low:.6g}, max={s.high:.6g})'
        for s, value in zip(law.formula.shapes, law.shapes, strict=True)
    ]
    product = " * ".join(f"({f.code})" for f in law.formula.factors)
    result = f"1 + size * {product}" if law.formula.scales else f"size * {product}"
    return _FILE.format(
        name=name,
        tried=tried,
        function=name.replace("-", "_"),
        acts="scales" if law.formula.scales else "adds_to",
        quantity=law.quantity,
        arguments="\n".join(f"    {argument}," for argument in [*reads, "*", *parameters]),
        text=law.text,
        result=result,
        numpy="import numpy as np\n\n" if "np." in result else "",
    )
