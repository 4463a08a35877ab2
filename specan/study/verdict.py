"""The verdict on what a model is missing, as a user and other programs get it, and its headline."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from specan.models import Use
from specan.result import Result, counted, gathered
from specan.study.estimation.fit import Fit, intervals_95
from specan.study.estimation.prediction_error import ObservableError, left_out_errors, observable_errors
from specan.study.estimation.problem import Problem
from specan.study.selection.refits import TOO_FAR, Pull, Refit
from specan.units import spoken


def placed(effects: Sequence[str], at: Mapping[str, Sequence[str]]) -> list[str]:
    """Effects with their places, as ``study add`` takes them; each once.

    Examples
    --------
    >>> placed(["leak", "offset", "offset"], {"offset": ["Mic 1", "Mic 2"]})
    ['leak', 'offset@Mic 1', 'offset@Mic 2']
    """
    places = [f"{name}@{place}" for name, found in at.items() for place in found]
    return sorted([*places, *(name for name in effects if name not in at)])


@dataclass(frozen=True, kw_only=True)
class Ranked:
    """One set of effects and how the model does with it.

    Attributes
    ----------
    effects : tuple of str
        Bare names.
    at : mapping
        Elements of an axis at which an effect acts: ``{"drag": ("z1",)}``.
    probability : float
        That of this explanation among all.
    ln_evidence : float
        ln of its evidence over that of the model as it is.
    error_after : float
        RMS of measured less predicted, in the observable's SI unit.
    others_after : mapping
        The same of further observables, by name.
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
    probability: float
    ln_evidence: float
    error_after: float
    parameters: Mapping[str, Mapping[str, Any]]
    plausible: bool
    at_bound: bool
    pulls: tuple[Pull, ...] = ()
    level_after_dB: float | None = None
    others_after: Mapping[str, float] = field(default_factory=dict)

    @property
    def names(self) -> list[str]:
        """Effects with their places."""
        return placed(self.effects, self.at)

    def content(self) -> dict[str, Any]:
        """What JSON says of it; nothing of what there is none."""
        return {
            name: value
            for name, value in vars(self).items()
            if value is not None and (name, value) != ("others_after", {})
        }


@dataclass(frozen=True)
class Probability:
    """How probable one explanation of the data is.

    Attributes
    ----------
    explanation : str
        ``windage``, ``nothing is missing``, ``something else``, or a fault of the data.
    kind : str
        ``effects``, ``nothing``, ``unknown`` or ``fault``.
    effects : tuple of str
        Bare names.
    at : mapping
        Where they act.
    probability : float
        Among all explanations; they add up to one.
    """

    explanation: str
    kind: str
    effects: tuple[str, ...]
    at: Mapping[str, tuple[str, ...]]
    probability: float

    @property
    def spoken(self) -> str:
        """The explanation; a single effect is ``alone``, unlike in a verdict, which adds up all that contain it."""
        single = self.kind == "effects" and len(self.effects) == 1
        return f"{self.explanation} alone" if single else self.explanation


@dataclass(frozen=True)
class ErrorFall:
    """What an error is of the model as it is and with what is named: fitted, and on conditions that were left out.

    Attributes
    ----------
    before, after : ObservableError
        On the fitted data.
    left_out_before, left_out_after : ObservableError or None
        In cross-validation: every level of every operating variable predicted from the others.
    others : tuple of ErrorFall
        Of further observables.
    """

    before: ObservableError
    after: ObservableError
    left_out_before: ObservableError | None = None
    left_out_after: ObservableError | None = None
    others: tuple[ErrorFall, ...] = ()

    @property
    def sentences(self) -> list[str]:
        """One for each observable: ``Error (RMS of stretch): 0.45 to 0.21 mm (3.2 to 1.5 %).``"""
        return [f"Error (RMS of {one.before.observable}): {one.text}." for one in (self, *self.others)]

    @property
    def text(self) -> str:
        """``0.45 to 0.21 mm (3.2 to 1.5 %); in cross-validation 0.50 to 0.25 mm (3.5 to 1.8 %)``."""
        text = _fall(self.before, self.after)
        if self.left_out_before is not None and self.left_out_after is not None:
            text += f"; in cross-validation {_fall(self.left_out_before, self.left_out_after)}"
        return text

    def to_dict(self) -> dict[str, Any]:
        """Plain values."""
        found = {**vars(self), "others": [one.to_dict() for one in self.others]}
        return {
            name: e.as_dict() if isinstance(e, ObservableError) else e for name, e in found.items() if e != []
        }


def _fall(before: ObservableError, after: ObservableError) -> str:
    both = [before] if before == after else [before, after]
    relative = spoken(*(e.relative_rms for e in both), unit="percent", digits=2)
    text = f"{spoken(*(e.rms for e in both), unit=before.unit)} ({relative})"
    levels = [e.level_dB for e in both if e.level_dB is not None]
    return f"{text}, {before.level_of} {spoken(*levels, digits=2)} dB" if len(levels) == len(both) else text


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
    otherwise : str
        Why there are none.
    """

    rows: tuple[Mapping[str, Any], ...]
    verdict: str
    otherwise: str

    dimensions = ("place",)

    def summary(self) -> str:
        """How many there are."""
        return counted(len(self.rows), "proposal") if self.rows else self.otherwise

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
        ``effect``, ``group``, ``nothing-missing``, ``fits-only-if``, ``unknown-effect``, ``faulty-data`` or
        ``cannot-tell``.
    reason : str
        One sentence on how the verdict came about.
    alternatives : tuple of tuple of str
        Every set of effects that the data cannot distinguish from the best; names in one set act together.
    at : mapping
        Where effects of the alternatives act.
    probabilities : tuple of Probability
        Of a table: every explanation, the likeliest first.
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
    probabilities: tuple[Probability, ...] = ()
    pulls: tuple[Pull, ...] = ()
    error: ErrorFall | None = None
    remarks: tuple[str, ...] = ()
    other_form: str = ""
    ranking: tuple[Ranked, ...] = ()
    lack_of_fit: LackOfFit | None = None
    model_discrepancy_percent: float = 0.0
    fails_at: tuple[Mapping[str, Any], ...] = ()
    residual_law: Mapping[str, str] | None = None
    smallest_visible: Mapping[str, Mapping[str, Any] | None] = field(default_factory=dict)
    not_testable: Mapping[str, str] = field(default_factory=dict)
    next_measurement: tuple[Mapping[str, Any], ...] = ()

    dimensions = ("effects",)

    def summary(self) -> str:
        """The verdict, and its reason."""
        return f"{headline(self)} {reason(self.to_dict())}".rstrip()

    def columns(self) -> dict[str, Any]:
        """One row for each set of effects that was tried, most likely first."""
        plain = ["probability", "ln_evidence", "error_after", "plausible", "at_bound"]
        return {
            "effects": [" + ".join(dict.fromkeys(row.effects)) for row in self.ranking],
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
        from specan.study.evidence.explanations import SURE  # loads much that no other verb needs

        # an effect beside those that explain the data already is no rival of theirs
        first, *others = [
            {*p.effects}
            for p in self.probabilities
            if p.kind in ("effects", "nothing") and p.probability > 1 - SURE
        ] or [set()]
        competing = any(not first or not first < other for other in others)
        faulty = [p for p in self.probabilities if p.kind == "fault"]
        why = "no measurement within the rig's limits would distinguish the explanations"
        if self.verdict in ("faulty-data", "cannot-tell"):
            why = self.reason
        elif sum(p.probability for p in faulty) > 1 - SURE:
            why = f"measure the same rows again: what is in them may be a fault of the data ({faulty[0].explanation})"
        elif self.verdict in ("effect", "nothing-missing") and not competing:
            why = "no further measurement is needed: no two explanations compete for these data"
        return NextMeasurements(self.next_measurement, self.verdict, why)

    def content(self) -> dict[str, Any]:
        """The contract of ``specan study diagnose --json``."""
        names = ("reduced_chi2", "p_value", "n_effective")
        found = {
            **vars(self),
            "effects": self.effects,
            "error": None if self.error is None else self.error.to_dict(),
            "ranking": [row.content() for row in self.ranking],
            "lack_of_fit": self.lack_of_fit or dict.fromkeys(names),
        }
        if not self.probabilities:
            del found["probabilities"]
        return found


def parameter_table(
    problem: Problem, best: Fit, owners: Container[str] | None = None, *, profiled: bool = True
) -> dict[str, dict[str, Any]]:
    """Fitted parameters of effects with 95 % intervals (`intervals_95`), in their declared units; all by default.

    `plausible` is false where the value lies outside the declared
    plausible range by more than two standard uncertainties, or more than three of its certificate off.
    """
    table: dict[str, dict[str, Any]] = {}
    own = [name for name in problem.names if owners is None or name.owner in owners]
    for name, interval in intervals_95(problem, best, own, profiled=profiled).items():
        parameter = problem.assembly.parameters[name.whole]
        value = float(best.theta[problem.names.index(name)])
        sd = best.standard_error(name) * np.sqrt(best.dispersion)
        least, most = problem.plausible(name.whole)
        prior = problem.priors.get(name.whole)
        within = (
            least - 2 * sd <= value <= most + 2 * sd
            if prior is None
            else abs(value - prior[0]) <= TOO_FAR * prior[1]
        )
        table[name] = {
            **dict(zip(("value", "low", "high"), map(parameter.from_si, (value, *interval)), strict=True)),
            "unit": parameter.unit,
            "plausible": bool(within),
            "at_bound": name in best.at_bound,
            "nuisance": name.whole in problem.priors,
        }
    return table


def error_fall(base: Refit, best: Refit) -> ErrorFall:
    """Errors of a model as it is and with what was found; on left-out conditions where refits are cheap."""
    refits = not base.problem.strategy.frugal
    one, two = (
        {e.observable: e for e in left_out_errors(r.problem, r.fit)} if refits else {} for r in (base, best)
    )
    first, *others = (
        ErrorFall(before, after, one.get(before.observable), two.get(before.observable))
        for before, after in zip(errors(base), errors(best), strict=True)
    )
    return replace(first, others=tuple(others))


def errors(refit: Refit) -> list[ObservableError]:
    """Errors of every observable in its unit, the one with most values first."""
    problem = refit.problem
    return observable_errors(problem, problem.observations, problem.plain(refit.fit.theta))


def places_of(uses: Iterable[Use]) -> Mapping[str, tuple[str, ...]]:
    """Where each effect acts that acts somewhere."""
    found = gathered((use.name, use.at) for use in uses if use.at)
    return {name: tuple(sorted(set(places))) for name, places in sorted(found.items())}


VERDICTS = {
    "effect": "Missing: {names}.",
    "group": "Missing: {names}; these data cannot tell which.",
    "nothing-missing": "Nothing is missing{form}{sure}.",
    "nothing-named": "No effect can be named: perhaps nothing is missing{sure}{names}.",
    "fits-only-if": "It fits, but only with values outside their known range.",
    "unknown-effect": "Something is missing that is not on the list of effects{sure}.",
    "faulty-data": "The data have a fault: {fault}.",
    "cannot-tell": "These data cannot tell.",
}
AS_FAR = ", as far as these data can tell"
LEAST_TOLD = 0.02  # probability of what is no effect, from which a headline with names says it


def headline(found: Diagnosis) -> str:
    """The verdict as one sentence: ``Missing: windage (97 %) or seal-drag (2 %); these data cannot tell which.``"""
    return headline_of(found.to_dict())


def headline_of(content: Mapping[str, Any]) -> str:
    """The same from what ``study diagnose --json`` prints.

    Examples
    --------
    >>> headline_of({"verdict": "group", "alternatives": [["windage"], ["seal-drag", "churning"]]})
    'Missing: windage or seal-drag with churning; these data cannot tell which.'
    """
    stated = content.get("probabilities") or ()

    def sure(kinds: Sequence[str], suits: Callable[[set[str]], bool] = lambda effects: True) -> str:
        """How probable explanations are, together; nothing where no probabilities are stated."""
        told = [one for one in stated if one["kind"] in kinds and suits(set(one["effects"]))]
        return f" ({percent(sum(one['probability'] for one in told))})" if stated else ""

    kind = content["verdict"]
    # The simplest first; the table below has them by likelihood.
    alternatives = sorted(content["alternatives"], key=len)
    if len(alternatives) == 1:  # it stands for itself with and without further effects or faults of the data
        sets = [" with ".join(alternatives[0]) + sure(["effects", "fault"], set(alternatives[0]).issubset)]
    else:
        sets = [" with ".join(one) + sure(["effects"], set(one).__eq__) for one in alternatives]
    if len(set(sets)) < len(sets):  # the same effects at several places
        likeliest = [one for one in stated if one["kind"] == "effects"][: len(sets)]
        sets = [f"{one['explanation']} ({percent(one['probability'])})" for one in likeliest]
    whole = gathered((one["kind"], one["probability"]) for one in stated)
    rest = {"something else": sum(whole.get("unknown", ()))}
    if kind in ("effect", "group"):
        alone = (one["probability"] for one in stated if one["kind"] == "fault" and not one["effects"])
        rest["a fault of the data"] = sum(alone)
    otherwise = "".join(f" or {what} ({percent(p)})" for what, p in rest.items() if p >= LEAST_TOLD)
    names = _one_of(sets) + otherwise
    of = {"nothing-missing": "nothing", "unknown-effect": "unknown"}
    told = sure([of[kind]]) if kind in of else ""
    of_faults = (one for one in stated if one["kind"] == "fault")
    faults = likeliest_faults((f["explanation"].split(" beside ")[0], f["probability"]) for f in of_faults)
    fault = _one_of([f"{name} ({percent(share)})" for name, share in faults.items()]) + otherwise
    which = "; these data cannot tell which" if len(faults) > 1 else ""
    beside = f" Missing beside it: {names}." if kind == "faulty-data" and any(content["alternatives"]) else ""
    if kind == "nothing-missing" and sum(whole.get("nothing", [1])) < 0.5:
        kind = "nothing-named"
    form = f" with {content['other_form']}" if content.get("other_form") else AS_FAR
    return VERDICTS[kind].format(names=names, sure=told, fault=fault + which, form=form) + beside


def _one_of(names: Sequence[str]) -> str:
    """The first of them, for a headline; all others stand in the table."""
    most, more = 3, len(names) - 3
    return " or ".join([*names[:most], *([f"one of {more} others"] if more > 1 else names[most:])])


def likeliest_faults(told: Iterable[tuple[str, float]]) -> dict[str, float]:
    """Names and probabilities of the faults that may be the one, the likeliest first, whatever stands beside them.

    Examples
    --------
    >>> likeliest_faults([("drift", 0.25), ("one reading", 0.5), ("drift", 0.5), ("copied rows", 0.001)])
    {'drift': 0.75, 'one reading': 0.5}
    """
    whole = {name: sum(each) for name, each in gathered(told).items()}
    order = sorted(whole, key=lambda name: -whole[name])
    return {name: whole[name] for name in order if whole[name] >= min(LEAST_TOLD, whole[order[0]])}


def percent(probability: float) -> str:
    """A probability as a person reads it, never as a certainty.

    Examples
    --------
    >>> percent(0.974), percent(0.9999), percent(0.001)
    ('97 %', 'above 99 %', 'below 1 %')
    """
    if probability > 0.995:
        return "above 99 %"
    return f"{100 * probability:.0f} %" if probability >= 0.005 else "below 1 %"


def reason(content: Mapping[str, Any]) -> str:
    """Why, as a sentence; empty where nothing is said."""
    text = str(content.get("reason") or "")
    return f"{text[:1].upper()}{text[1:]}." if text else ""
