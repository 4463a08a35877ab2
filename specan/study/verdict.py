"""The verdict on what a model is missing, as a user and other programs get it, and its headline."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from specan.errors import ComputationError
from specan.models import Use
from specan.result import Result, counted
from specan.study.estimation.fit import intervals_95, profile_interval
from specan.study.estimation.prediction_error import ObservableError, observable_errors
from specan.study.selection.acceptance import left_out_error
from specan.study.selection.doubtful_data import CARRIES
from specan.study.selection.initial_fit import about_itself
from specan.study.selection.pulls import Pull, pulls, shown
from specan.study.selection.refits import Refit
from specan.study.selection.residual_law import ResidualLaw
from specan.study.selection.search import Search


@dataclass(frozen=True)
class Ranked:
    """One set of effects and how the model does with it.

    Attributes
    ----------
    effects : tuple of str
        Bare names.
    at : mapping
        Elements of an axis at which an effect acts: ``{"drag": ("z1",)}``.
    delta_bic : float
        Fall in BIC from the base.
    p_value : float
        Family-wise probability of such a fall by chance; of two effects, from the better one alone.
    held_out_gain : float
        Gain in blocked cross-validation, in units of chi-square.
    error_after : float
        RMS of measured less predicted, in the observable's SI unit.
    level_after_dB : float or None
        Of transfer functions: RMS over channels and third octaves of the error of their levels.
    parameters : mapping
        ``{"effect.parameter": {"value", "low", "high", "unit"}}``, 95 % intervals.
    plausible, at_bound : bool
        Whether no value contradicts what is known of it; whether one rests on an end of its domain.
    pulls : tuple of Pull
        Values outside of what was known of them, worst first.
    """

    effects: tuple[str, ...]
    at: Mapping[str, tuple[str, ...]]
    delta_bic: float
    p_value: float
    held_out_gain: float
    error_after: float
    parameters: Mapping[str, Mapping[str, Any]]
    plausible: bool
    at_bound: bool
    pulls: tuple[Pull, ...] = ()
    level_after_dB: float | None = None

    def content(self) -> dict[str, Any]:
        """What JSON says of it; no level where there is none."""
        return {
            name: value for name, value in vars(self).items() if (name, value) != ("level_after_dB", None)
        }


@dataclass(frozen=True)
class ErrorFall:
    """What an error is of the model as it is and with what is named: fitted, and on conditions that were left out.

    Attributes
    ----------
    before, after : ObservableError
        On the fitted data.
    left_out_before, left_out_after : ObservableError or None
        In cross-validation: every level of every operating variable predicted from the others.
    """

    before: ObservableError
    after: ObservableError
    left_out_before: ObservableError | None = None
    left_out_after: ObservableError | None = None

    @property
    def text(self) -> str:
        """``0.45 to 0.21 mm (3.2 to 1.5 %); on conditions left out of the fit 0.50 to 0.25 mm (3.5 to 1.8 %)``."""
        text = _fall(self.before, self.after)
        if self.left_out_before is not None and self.left_out_after is not None:
            text += f"; on conditions left out of the fit {_fall(self.left_out_before, self.left_out_after)}"
        return text

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        names = ("before", "after", "left_out_before", "left_out_after")
        found = {name: getattr(self, name) for name in names}
        return {name: None if e is None else e.as_dict() for name, e in found.items()}


def _fall(before: ObservableError, after: ObservableError) -> str:
    unit = "" if before.unit == "1" else f" {before.unit}"
    if before == after:
        text = f"{before.rms:.3g}{unit} ({before.relative_rms:.2g} %)"
        return text if before.level_dB is None else f"{text}, {before.level_of} {before.level_dB:.2g} dB"
    text = (
        f"{before.rms:.3g} to {after.rms:.3g}{unit} ({before.relative_rms:.2g} to {after.relative_rms:.2g} %)"
    )
    if before.level_dB is None or after.level_dB is None:
        return text
    return f"{text}, {before.level_of} {before.level_dB:.2g} to {after.level_dB:.2g} dB"


@dataclass(frozen=True)
class LackOfFit:
    """How badly the base model fits."""

    reduced_chi2: float
    p_value: float
    n_effective: float


@dataclass(frozen=True, repr=False)
class NextMeasurements(Result):
    """Measurements that would decide, the best first.

    Attributes
    ----------
    rows : tuple of mapping
        As ``specan study next --json`` gives them; each has a ``text``.
    verdict : str
        That they would decide.
    """

    rows: tuple[Mapping[str, Any], ...]
    verdict: str

    dimensions = ("place",)

    def summary(self) -> str:
        """How many there are."""
        return counted(len(self.rows), "proposal") if self.rows else "nothing is left to decide"

    def columns(self) -> dict[str, Any]:
        """One row for each measurement, in words."""
        return {"place": list(range(1, len(self.rows) + 1)), "text": [row["text"] for row in self.rows]}

    def content(self) -> dict[str, Any]:
        """The contract of ``specan study next --json``."""
        return {"verdict": self.verdict, "next_measurement": self.rows}


@dataclass(frozen=True, repr=False)
class Diagnosis(Result):
    """Verdict, what it rests on, and what could be measured next. See docs/diagnosis.md for each number.

    Attributes
    ----------
    verdict : str
        ``effect``, ``group``, ``nothing-missing``, ``fits-only-if``, ``unknown-effect`` or ``cannot-tell``.
    reason : str
        One sentence on how the verdict came about.
    alternatives : tuple of tuple of str
        Every set of effects that the data cannot distinguish from the best; names in one set act together.
    at : mapping
        Where effects of the alternatives act.
    unknown_possible : bool
        Something that is not in the catalogue explains the data as well.
    pulls : tuple of Pull
        Values of the fit that the verdict rests on which lie outside of what was known of them, worst first.
    error : ErrorFall or None
        Error of the model as it is and with what is named.
    remarks : tuple of str
        What else a person has to know: rivals that fit better with values that contradict what is known, data that
        look wrong.
    other_form : str
        Published form of a part of the base that the verdict rests on instead of the declared one: ``palmgren-bearings
        in place of bearing-friction``.
    """

    verdict: str
    reason: str
    alternatives: tuple[tuple[str, ...], ...] = ()
    at: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    unknown_possible: bool = False
    ranking: tuple[Ranked, ...] = ()
    lack_of_fit: LackOfFit | None = None
    model_discrepancy_percent: float = 0.0
    fails_at: tuple[Mapping[str, Any], ...] = ()
    residual_law: ResidualLaw | None = None
    smallest_visible: Mapping[str, Mapping[str, Any] | None] = field(default_factory=dict)
    not_testable: Mapping[str, str] = field(default_factory=dict)
    next_measurement: tuple[Mapping[str, Any], ...] = ()
    pulls: tuple[Pull, ...] = ()
    error: ErrorFall | None = None
    remarks: tuple[str, ...] = ()
    other_form: str = ""

    dimensions = ("effects",)

    def summary(self) -> str:
        """The verdict, and its reason."""
        names = " or ".join(" with ".join(members) for members in self.alternatives)
        return f"{self.verdict}{': ' if names else ''}{names} ({self.reason})"

    def columns(self) -> dict[str, Any]:
        """One row for each set of effects that was tried, the likeliest first."""
        plain = ("delta_bic", "p_value", "held_out_gain", "error_after", "plausible", "at_bound")
        return {
            "effects": [" + ".join(row.effects) for row in self.ranking],
            "at": [
                "; ".join(f"{n}@{p}" for n, places in row.at.items() for p in places) for row in self.ranking
            ],
            **{name: [getattr(row, name) for row in self.ranking] for name in plain},
        }

    @property
    def effects(self) -> tuple[str, ...]:
        """Names in any of the alternatives."""
        return tuple(sorted({name for names in self.alternatives for name in names}))

    def next(self) -> NextMeasurements:
        """What to measure next."""
        return NextMeasurements(self.next_measurement, self.verdict)

    def content(self) -> dict[str, Any]:
        """The contract of ``specan study diagnose --json``."""
        lack, law = self.lack_of_fit, self.residual_law
        names = ("reduced_chi2", "p_value", "n_effective")
        return {
            "verdict": self.verdict,
            "reason": self.reason,
            "alternatives": self.alternatives,
            "effects": self.effects,
            "at": self.at,
            "unknown_possible": self.unknown_possible,
            "pulls": self.pulls,
            "error": None if self.error is None else self.error.to_json(),
            "remarks": self.remarks,
            "other_form": self.other_form,
            "ranking": [row.content() for row in self.ranking],
            "lack_of_fit": dict.fromkeys(names) if lack is None else lack,
            "model_discrepancy_percent": self.model_discrepancy_percent,
            "fails_at": self.fails_at,
            "residual_law": None
            if law is None
            else {"text": law.text, "exponents": law.exponents, "low": law.low, "high": law.high},
            "smallest_visible": self.smallest_visible,
            "not_testable": self.not_testable,
            "next_measurement": self.next_measurement,
        }


def ranking(search: Search, sets: Sequence[Refit]) -> tuple[Ranked, ...]:
    """Every set that was refitted: those that the data cannot distinguish, then the others, the likeliest first."""
    base, dispersion = search.base, search.best.dispersion
    others = [r for r in search.refits.done.values() if r.uses and r not in sets]
    others.sort(key=lambda r: (not search.believable(r), r.bic(dispersion)))
    rows = []
    for refit in [*sets, *others]:
        decision, error = search.decision(refit), main_error(refit)
        linearised = refit.problem.strategy.linearised_covariance
        told = about_itself(refit) if refit in sets and linearised else refit
        rows.append(
            Ranked(
                effects=tuple(sorted(u.name for u in refit.uses)),
                at=places_of(refit.uses),
                delta_bic=base.bic(dispersion) - refit.bic(dispersion),
                p_value=decision.p_value,
                held_out_gain=decision.held_out_gain,
                error_after=error.rms,
                level_after_dB=error.level_dB,
                parameters=parameters_of(told, refit in sets),
                plausible=search.believable(refit),
                at_bound=any(n.owner in {str(u) for u in refit.uses} for n in refit.fit.at_bound),
                pulls=shown(pulls(refit)),
            )
        )
    return tuple(rows)


def parameters_of(refit: Refit, profiled: bool = False) -> dict[str, dict[str, Any]]:
    """Own parameters of the effects, with 95 % intervals, in their declared units.

    `profiled`: all other parameters are refitted along an interval, which then follows a valley and the ends of known
    ranges; else, or where such a refit fails, it is that of the covariance, inside the domain.
    """
    table: dict[str, dict[str, Any]] = {}
    own = {str(u) for u in refit.uses}
    intervals = intervals_95(refit.problem, refit.fit, float(np.sqrt(refit.dispersion)))
    for k, name in enumerate(refit.fit.names):
        if name.owner not in own:
            continue
        value = float(refit.fit.theta[k])
        low, high = intervals[name]
        if profiled and refit.problem.strategy.secondary_refits:
            # A refit that fails, or an end that is not bracketed, leaves the interval of the covariance.
            with contextlib.suppress(ComputationError, ValueError):
                low, high = profile_interval(refit.problem, refit.fit, name, inflate=True)
        parameter = refit.problem.assembly.parameters[name.whole]
        table[name] = {
            "value": parameter.from_si(value),
            "low": parameter.from_si(low),
            "high": parameter.from_si(high),
            "unit": parameter.unit,
        }
    return table


def error_fall(base: Refit, best: Refit) -> ErrorFall:
    """Errors of a model as it is and with what was found; on left-out conditions where refits are cheap."""
    before, after = main_error(base), main_error(best)
    if not base.problem.strategy.secondary_refits:
        return ErrorFall(before, after)
    return ErrorFall(before, after, left_out_error(base), left_out_error(best))


def main_error(refit: Refit) -> ObservableError:
    """Error of the observable with most values, in its unit."""
    problem = refit.problem
    predicted = problem.plain(refit.fit.theta)
    return observable_errors(problem, problem.observations, predicted)[0]


def places_of(uses: Iterable[Use]) -> Mapping[str, tuple[str, ...]]:
    """Where each effect acts that acts somewhere."""
    found: dict[str, set[str]] = {}
    for use in uses:
        if use.at:
            found.setdefault(use.name, set()).add(use.at)
    return {name: tuple(sorted(places)) for name, places in sorted(found.items())}


VERDICTS = {
    "effect": "Missing: {names}.",
    "group": "Missing: {names}; these data cannot tell which.",
    "nothing-missing": "Nothing is missing, as far as these data can tell.",
    "fits-only-if": "It fits, but only with values outside what is known.",
    "unknown-effect": "Something is missing that is not on the list of effects.",
    "cannot-tell": "These data cannot tell.",
}
MOST_IN_HEADLINE = 3  # sets of effects; the others stand in the table
# Nothing-missing where the data alone would rather take values that contradict what is known.
WITHIN_WHAT_IS_KNOWN = "Nothing is missing if the values are as known; the data alone would take others."

# Unknown where the model meets all data but one condition or reading.
OR_WRONG_DATA = "One condition is wrong, or something is missing there that is not on the list of effects."


def headline(found: Diagnosis) -> str:
    """The verdict as one sentence: ``Missing: windage or seal-drag; these data cannot tell which.``"""
    return headline_of(found.to_json())


def headline_of(content: Mapping[str, Any]) -> str:
    """The same from what ``study diagnose --json`` prints.

    Examples
    --------
    >>> headline_of({"verdict": "group", "alternatives": [["windage"], ["seal-drag", "churning"]]})
    'Missing: windage or seal-drag with churning; these data cannot tell which.'
    """
    if content["verdict"] == "nothing-missing" and content.get("other_form"):
        return f"Nothing is missing with {content['other_form']}."
    if content["verdict"] == "nothing-missing" and content.get("unknown_possible"):
        return WITHIN_WHAT_IS_KNOWN
    if content["verdict"] == "unknown-effect" and any(CARRIES in text for text in content.get("remarks", ())):
        return OR_WRONG_DATA
    # The simplest first; the table below has them by likelihood.
    sets = [" with ".join(members) for members in sorted(content["alternatives"], key=len)]
    more = len(sets) - MOST_IN_HEADLINE
    names = " or ".join(
        [*sets[:MOST_IN_HEADLINE], *([f"one of {more} others"] if more > 1 else sets[MOST_IN_HEADLINE:])]
    )
    return VERDICTS[content["verdict"]].format(names=names)


def reason(content: Mapping[str, Any]) -> str:
    """Why, as a sentence; empty where nothing is said."""
    text = str(content.get("reason") or "")
    return f"{text[:1].upper()}{text[1:]}." if text else ""
