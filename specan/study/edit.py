"""Add an effect to a study's model or take one out: refit, and tell what it did to the errors."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from specan.errors import RequestError, SpecanError, nearest, require_known
from specan.models import Use
from specan.models.catalogue import effects_from_file
from specan.result import Result, picked
from specan.study.build_problem import undetermined
from specan.study.create import effect_entry, hold_undetermined
from specan.study.estimation.fit import Fit, fit
from specan.study.estimation.problem import Problem
from specan.study.evidence.explanations import NOTHING, OF_SIZE
from specan.study.evidence.marginal import Marginal, Tangent
from specan.study.history import History, Step, changing, commit, error_pairs
from specan.study.selection.candidates import without
from specan.study.selection.refits import Refit, pulls, shown
from specan.study.study import STARTS, Study
from specan.study.study_file import NAME, StudyText, read_study_file, use_of
from specan.study.user_effects import rival_laws
from specan.study.verdict import percent
from specan.units import spoken


@dataclass(frozen=True, eq=False, repr=False)
class Change(Result):
    """A step that changed the model.

    Attributes
    ----------
    before, after : Step
    was, study : Study
        As it was before, and as it is now.
    held : tuple of str
        Parameters of the new effect that the data do not determine and that were fixed.
    remarks : tuple of str
        What a user should know: an error that did not fall, a bound, an effect no longer needed.
    """

    before: Step
    after: Step
    was: Study
    study: Study
    held: tuple[str, ...]
    remarks: tuple[str, ...]

    dimensions = ("data",)

    def summary(self) -> str:
        """What was changed, and what that did to the errors."""
        falls = [
            f"{data} {spoken(one['value'])} -> {spoken(two['value'], unit=two['unit'])}"
            for data, one, two in error_pairs(self.before, self.after)
        ]
        return f"{self.after.action} {self.after.effect}, " + ", ".join([*falls, *self.remarks])

    def content(self) -> dict[str, Any]:
        """What ``specan study add --json`` and ``drop --json`` print."""
        after = self.after
        return {
            **picked(after, "step action effect model_effects"),
            **{
                when: picked(
                    step, "fit_error held_out_error errors reduced_chi2 held_out_reduced_chi2 p_value"
                )
                for when, step in (("before", self.before), ("after", after))
            },
            "parameters": after.parameters,
            "parameters_held": self.held,
            "remarks": self.remarks,
        }

    def columns(self) -> dict[str, Any]:
        """Errors before and after, on fitted and on held-out data."""
        pairs = error_pairs(self.before, self.after)
        return {
            "data": [data for data, _, _ in pairs],
            "metric": [two["metric"] for _, _, two in pairs],
            "before": [one["value"] for _, one, _ in pairs],
            "after": [two["value"] for _, _, two in pairs],
            "unit": [two["unit"] for _, _, two in pairs],
        }


def add_effect(study: Study, effect: str, because: str = "") -> Change:
    """Add an effect, refit, and keep the step.

    Parameters
    ----------
    study : Study
    effect : str
        Name, with its place: ``drag``, ``drag@z1``, ``drag@2``; or a Python
        file that holds one effect.
    because : str
        Reason, for the history.

    Raises
    ------
    RequestError
        Unknown, in the model already, or not testable with these data.
    ComputationError
        The fit failed; the study stays as it was.
    """
    led_to = _as_it_stands(study).diagnosed  # a file adds a candidate, and no diagnosis is of that study
    if effect.endswith(".py"):
        study, effect = _own_file(study, Path(effect))
    use = Use.parse(effect)
    with changing(study.directory):
        study = _as_it_stands(study)
        _check_addable(study, use)
        before, text = _begun(study)
        changed, held = with_effects(study, text, [use])
        after = changed.step("add", str(use), because, study.diagnosed or led_to)
        remarks = _remarks_on_adding(study, changed, before, after, use, held)
        changed.keep(after)
    return Change(before, after, study, changed, held, tuple(remarks))


def with_effects(study: Study, text: StudyText, uses: Sequence[Use]) -> tuple[Study, tuple[str, ...]]:
    """The study with effects added to its text, kept nowhere; and which parameters are held as undetermined."""
    for use in uses:
        if use in study.problem.nuisances:
            text.set_role(use, "model")
        else:
            text.append("effect", effect_entry(use))
    changed, held = hold_undetermined(Study(study.directory, draft=text))
    return changed.settled(), held


def drop_effect(study: Study, effect: str, because: str = "") -> Change:
    """Take an effect out, refit, and keep the step."""
    use = Use.parse(effect)
    with changing(study.directory):
        study = _as_it_stands(study)
        names = study.model_effects
        if str(use) not in names:
            raise RequestError(f"{effect!r} is not in the model", remedy=nearest(effect, names))
        before, text = _begun(study)
        has_prior = any(Use.parse(n.effect) == use for n in study.model.nuisances)
        if has_prior:
            text.set_role(use, "nuisance")
        else:
            text.drop("effect", lambda entry: use_of(entry) == use)
        changed = Study(study.directory, draft=text).settled()
        after = changed.step("drop", str(use), because, study.diagnosed)
        changed.keep(after)
    remarks = [f"{use} is constrained by its certificate again"] if has_prior else []
    remarks += _on_errors(before, after, expected_to_fall=False)
    return Change(before, after, study, changed, (), tuple(remarks))


def drop_effect_file(directory: Path, name: str) -> str:
    """Take a user's effect file out of a study.

    The study is not opened, so that a file that cannot be loaded or evaluated any more can be taken out too.

    Parameters
    ----------
    directory : Path
        Of the study.
    name : str
        ``my_effect.py``.

    Returns
    -------
    str
        The file as the study named it; it stays in the study's directory.

    Raises
    ------
    RequestError
        The study has no such file, or its model holds an effect of that file.
    """
    with changing(directory):
        text = StudyText(directory / NAME)
        content = text.content
        files = [e.file for e in content.effect_file]
        wanted = next((file for file in files if Path(file).name == Path(name).name), None)
        if wanted is None:
            raise RequestError(
                f"{name!r} is not an effect file of the study",
                expected="one of " + ", ".join(Path(file).name for file in files) if files else "",
            )
        path = directory / wanted
        source = path.read_text(encoding="utf-8", errors="replace") if path.exists() else ""
        # the file may be broken and is not run
        declared = re.findall(r"@effect\(\s*(?:name\s*=\s*)?['\"]([^'\"]+)['\"]", source)
        held = [e.use.name for e in content.effect if e.use.name in declared]
        if held:
            raise RequestError(f"the model holds {held[0]!r} of {wanted}", remedy="drop that effect first")
        text.drop("effect_file", lambda entry: entry["file"] == wanted)
        commit(directory, text.text, "")
    return wanted


def _as_it_stands(study: Study) -> Study:
    """The study as its files are now: another process may have changed it since it was opened."""
    same_file = read_study_file(study.directory) == study.content
    same_history = len(History(study.directory).steps) == len(study.history.steps)
    return study if same_file and same_history else Study(study.directory)


def _begun(study: Study) -> tuple[Step, StudyText]:
    """The state before a change, and the text to change; what was done by hand before is kept as a step of its own."""
    by_hand = study.unrecorded()
    if by_hand is not None:
        study.keep(by_hand)
    return study.step("now"), study.text()


def _own_file(study: Study, path: Path) -> tuple[Study, str]:
    """Take an effect file into the study; its one effect is what is added. Rivals of a proposed law are candidates."""
    study = Study(study.directory, effects=[path, *rival_laws(path)])
    names = [e.name for e in effects_from_file(path)]
    if len(names) > 1:
        raise RequestError(
            f"{path} holds several effects: {', '.join(names)}",
            remedy="they are candidates now; add one of them by its name",
        )
    return study, names[0]


def _check_addable(study: Study, use: Use) -> None:
    model = study.model
    require_known(use.name, model.effects, f"{model.name} has no effect {use.name!r}")
    model.assemble([use])
    if str(use) in study.model_effects:
        raise RequestError(
            f"{use} is in the model already", remedy=f"a second one of its kind is {use.name}@{use.copy + 1}"
        )
    available = set().union(*(o.available for o in study.data.fitted))
    why = model.not_testable(available).get(use.name)
    if why:
        raise RequestError(f"{use} cannot be tested with these data: it {why}")


def _remarks_on_adding(
    old: Study, new: Study, before: Step, after: Step, use: Use, held: Sequence[str]
) -> list[str]:
    remarks = [f"{name} is held: these data do not determine it" for name in held]
    remarks += _on_errors(before, after, expected_to_fall=True)
    odds = _ln_odds(new.problem, new.best, old.problem, old.best)
    if new.data.known and odds < 0:
        remarks.append(f"{use} is not supported by the data (probability {percent(1 / (1 + np.exp(-odds)))})")
    remarks += [pull.text for pull in shown(pulls(Refit(frozenset(), new.problem, new.best)))]
    free = [n for n in undetermined(new.problem, new.best.theta) if n.whole not in new.problem.priors]
    remarks += [f"{name} is not determined by these data at the values that were found" for name in free]
    if new.data.known:
        spare = [n for n in old.model_effects if _can_go(new, n) and not _can_go(old, n)]
        remarks += [f"{other} is no longer needed" for other in spare]
    return remarks


def _on_errors(before: Step, after: Step, expected_to_fall: bool) -> list[str]:
    remarks, same = [], 0.005  # relative change of an error below which it has not moved
    for what, one, two in error_pairs(before, after):
        # Twice the relative standard deviation of the RMS of n independent values, 1 / sqrt(2 n).
        by_chance = np.sqrt(2.0 / max(two["n"], 1))
        if expected_to_fall and two["value"] > one["value"] * (1 + max(same, by_chance)):
            remarks.append(f"the error on {what} data rises")
        elif expected_to_fall and two["value"] > one["value"] * (1 - same):
            remarks.append(f"the error on {what} data does not fall")
        elif not expected_to_fall and two["value"] < one["value"] * (1 - same):
            remarks.append(f"the error on {what} data falls")
    return remarks


def _can_go(study: Study, name: str) -> bool:
    """Whether a model without an effect is likelier than the model with it."""
    try:
        lean = without(study.problem, name)
        refitted = fit(lean, start=study.best.values, starts=STARTS)
    except SpecanError:  # without it there is no fit: it is needed
        return False
    return _ln_odds(study.problem, study.best, lean, refitted) < 0


def _ln_odds(problem: Problem, found: Fit, lean: Problem, without_it: Fit) -> float:
    """ln of the odds that an effect is there, of all that could be, over that it is not."""
    each = ((problem, found), (lean, without_it))
    more, fewer = (Marginal(Tangent.at(p, b.theta, b.residual, b.jacobian)).ln_evidence for p, b in each)
    return more - fewer + float(np.log(OF_SIZE[0] / len(problem.assembly.model.effects) / NOTHING))
