"""A study: a directory that compares a model with measurements, step by step."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from specan import __version__
from specan.errors import ComputationError, RequestError
from specan.models import Model, Use
from specan.models.catalogue import is_file, load_model, read_rig_file
from specan.models.groups import with_groups
from specan.result import counted
from specan.study import history, study_file, user_effects
from specan.study.build_problem import assemble
from specan.study.comparison import Comparison
from specan.study.estimation.continuation import continuation_fit, linearised
from specan.study.estimation.fit import Fit, describe, fit
from specan.study.estimation.prediction_error import (
    HeldOut,
    ObservableError,
    held_out_error,
    observable_errors,
)
from specan.study.estimation.problem import Problem
from specan.study.localisation.localise import MistakenSetUp, localise, mistaken_set_up
from specan.study.observation import DataFile, MeasuredFiles, brought, kind_named, together
from specan.study.progress import Progress
from specan.study.selection.candidates import grouped_by
from specan.study.selection.refits import POOR_FIT
from specan.study.selection.starting_values import kept_values, starting_values
from specan.study.verdict import Diagnosis, Ranked, parameter_table
from specan.units import spoken

STARTS = 3  # of every fit that a study reports: the same each time, so that a number can be had again
PREDICTED = 0.01  # probability of chi-square from which data are predicted as well as they can be


class Study:
    """An opened study.

    Attributes
    ----------
    content : StudyFile
    model : Model
        With the study's own effects.
    data : OpenedData
    history : History
    """

    def __init__(
        self,
        directory: Path,
        accept_changes: bool = False,
        effects: Sequence[Path] = (),
        draft: study_file.StudyText | None = None,
        near: Mapping[str, Any] = MappingProxyType({}),
    ) -> None:
        self.directory, self._given = directory, near
        if draft is None:
            history.recover(directory)
        self.content = study_file.read_study_file(directory) if draft is None else draft.content
        self.draft = draft
        self.history = history.History(directory)
        self.accepted = self._check_data(accept_changes)
        if self.accepted:
            self.content = self.text().content
        named = [user_effects.read_effect_file(path) for path in effects]
        self.model = self._load_model(named)
        files = self._measured_files().items()
        self.data = together([kind_named(kind).open_data(self.model, wanted) for kind, wanted in files])
        self.model = grouped_by(self.data.model or self.model, self.data.fitted)
        self._assembled = assemble(self.model, self.content, self.data.fitted)
        for file in named:
            user_effects.try_effects(file, self.model, self.data.fitted)
        self._keep(named)

    def __repr__(self) -> str:
        effects = ", ".join(self.model_effects) or "no effects"
        steps = counted(len(self.history.steps), "step")
        return f"<Study: {self.directory}, {self.model.name} with {effects}, {steps}>"

    # --- files ------------------------------------------------------------------------------------

    def _load_model(self, named: Sequence[user_effects.EffectFile]) -> Model:
        """The model with the study's own effects and those of files that the user has just named."""
        replaced = {file.entry.file for file in named}
        known = [entry for entry in self.content.effect_file if entry.file not in replaced]
        content = self.content
        rig = read_rig_file(self.directory / content.rig) if content.rig else {}
        if is_file(content.model):
            model = user_effects.load_own_model(self.directory, content.model, content.model_sha256, rig)
        else:
            model = load_model(content.model, rig)
        model = with_groups(model, content.groups)
        return user_effects.with_own_effects(
            model, user_effects.load_own_effects(self.directory, known), named
        )

    def _keep(self, named: Sequence[user_effects.EffectFile]) -> None:
        """Write what opening the study has changed: accepted data, effect files that were named and work."""
        for file in named:
            file.copy_to(self.directory)
        new = [file.entry for file in named if file.entry not in self.content.effect_file]
        if not new and not self.accepted:
            return
        text = self.text()
        for entry in new:
            if not text.set_hash(entry.file, entry.sha256):
                text.append("effect_file", entry.model_dump())
        self.content = text.content
        if self.draft is None:
            with history.changing(self.directory):
                history.commit(self.directory, text.text, "")

    def text(self) -> study_file.StudyText:
        """The study file with what was accepted on opening; to be changed and handed to another `Study` as draft."""
        text = self.draft.copy() if self.draft else study_file.StudyText(self.directory / study_file.NAME)
        for name in self.accepted:
            text.set_hash(name, study_file.file_hash(self.directory / name))
        return text

    def _check_data(self, accept: bool) -> tuple[str, ...]:
        """Measured files must be those of the last step; returns the changed ones that were accepted."""
        entries = (*self.content.measurement, *self.content.validation)
        changed = [e.file for e in entries if study_file.file_hash(self.directory / e.file) != e.sha256]
        if changed and not accept:
            raise RequestError(
                f"{', '.join(changed)} changed since the study's last step",
                expected="the measured data as they were",
                remedy=f"restore the file, or go on with specan study compare {self.directory} --accept-changes",
            )
        return tuple(changed)

    def _path(self, file: str) -> Path:
        """A measured file as messages should show it: from where the user is, where that is shorter."""
        whole = Path(os.path.normpath(self.directory.resolve() / file))
        here = Path.cwd()
        return whole.relative_to(here) if whole.is_relative_to(here) else whole

    def _measured_files(self) -> dict[str, MeasuredFiles]:
        everything = (*self.content.measurement, *self.content.validation)
        short = [Path(e.file).name for e in everything]
        names = {e.file: s if short.count(s) == 1 else e.file for e, s in zip(everything, short, strict=True)}

        def files(entries: Sequence[study_file.DataEntry], kind: str) -> list[DataFile]:
            columns = self.content.columns
            return [
                DataFile(names[e.file], self._path(e.file), e.estimator, e.conditions, columns, e.sheet)
                for e in entries
                if e.kind == kind
            ]

        aside = [(names.get(h.file, h.file) if h.file else None, h.where) for h in self.content.hold_out]
        calibration = self.directory / self.content.calibration if self.content.calibration else None
        return {
            kind: MeasuredFiles(
                files(self.content.measurement, kind),
                files(self.content.validation, kind),
                aside,
                calibration,
            )
            for kind in dict.fromkeys(e.kind for e in self.content.measurement)
        }

    @property
    def hashes(self) -> dict[str, Any]:
        """Hashes of everything that the numbers rest on."""
        everything = (*self.content.measurement, *self.content.validation)
        return {
            "study": study_file.content_hash(self.content),
            "rig": study_file.rig_hash(self.directory / self.content.rig) if self.content.rig else "",
            "files": {e.file: e.sha256 for e in everything},
            "effect_files": {e.file: e.sha256 for e in self.content.effect_file},
        }

    @property
    def edited(self) -> bool:
        """Whether the study file or the rig was changed since the last step."""
        last, now = self.history.last, self.hashes
        if last is None:
            return True
        own: Any = last.hashes.get("effect_files", {})
        return any(last.hashes.get(k) != now[k] for k in ("study", "rig", "files")) or any(
            own.get(name, sha256) != sha256 for name, sha256 in now["effect_files"].items()
        )

    @cached_property
    def problem(self) -> Problem:
        """The model as the study has it, over the fitted data."""
        if not self._assembled.strategy.linearised_covariance:
            return self._assembled
        starts = self._starts
        return linearised(self._assembled, starts, self._near if starts == [{}] else None)

    @cached_property
    def _before(self) -> tuple[Mapping[str, Any], Sequence[str]]:
        """Values about which covariances are taken and from which fits set out, and the effects that they are of."""
        last = self.history.last
        if self._given or last is None:
            return self._given, self.model_effects
        return last.about or kept_values(self._assembled, last.parameters), last.model_effects

    @cached_property
    def _starts(self) -> list[Mapping[str, Any]]:
        """Values to fit from: those declared, of the step before, and likely ones of what is new."""
        known, effects = self._before
        new = [Use.parse(u) for u in self.model_effects if u not in effects]
        return starting_values(self._assembled, new, known)

    @cached_property
    def _near(self) -> dict[str, Any]:
        """Values where a continuation fit ends that sets out from the declared ones."""
        return continuation_fit(self._assembled)

    # --- numbers ----------------------------------------------------------------------------------

    @property
    def model_effects(self) -> tuple[str, ...]:
        """Effects of the model, instrument errors held by their priors left out."""
        return tuple(str(e.use) for e in self.content.effect if e.role == "model")

    @cached_property
    def kept(self) -> history.KeptResults:
        """Results of the study as it is, of this and of earlier commands."""
        calibration = self.content.calibration
        # Fits of the others do not look at earlier steps.
        looks_back = self._assembled.strategy.linearised_covariance or self.model.rates
        known, effects = self._before if looks_back else ({}, ())
        state = {
            **self.hashes,
            "model": self.content.model_sha256 or "",
            "calibration": study_file.file_hash(self.directory / calibration) if calibration else "",
            "before": [{name: np.asarray(value).tolist() for name, value in known.items()}, [*effects]],
        }
        return history.KeptResults(self.directory, state)

    @cached_property
    def best(self) -> Fit:
        """The fit of the model as it is."""
        return self.kept.made("fit", Fit, self._fitted)

    def _fitted(self) -> Fit:
        look = brought(self.problem.observations, "near_the_data")
        start = look(self.problem) if look else None
        if start and set(start) >= set(self.problem.names):  # the data tell them better than a fit does
            return describe(self.problem, self.problem.start(start))
        found = fit(self.problem, start, starts=STARTS)
        if self.problem.strategy.continuation and found.p_value < PREDICTED:  # another minimum, perhaps
            found = min(found, fit(self.problem, self._near), key=lambda one: one.chi2)
        known = self._starts[1:] if self.model.rates else []  # integrated predictions have many minima
        led = brought(self.problem.observations, "growing")
        if led and (near := led(self.problem, found.values)):
            known = [near, *known]
        for near in known:
            with suppress(ComputationError):
                found = min(found, fit(self.problem, near), key=lambda one: one.chi2)
        return found

    @cached_property
    def shown(self) -> Fit:
        """The fit that a person sees: `best`, unless that bends instruments far beyond their priors.

        A model of resonances that lacks much fits best with absurd instruments, and then fails everywhere a little
        instead of where it fails. It is shown as a continuation fit leaves it, in which priors hold them.
        """
        if not self.problem.strategy.continuation or not _far_from_calibration(self.problem, self.best):
            return self.best
        return self.kept.made("shown", Fit, lambda: describe(self.problem, self.problem.start(self._near)))

    @cached_property
    def errors(self) -> tuple[ObservableError, ...]:
        """Errors on the fitted data."""
        predictions = self.problem.plain(self.shown.theta)
        return tuple(observable_errors(self.problem, self.problem.observations, predictions))

    @cached_property
    def parameters(self) -> dict[str, Any]:
        """Fitted parameters with their intervals."""
        return self.kept.made("parameters", dict, lambda: parameter_table(self.problem, self.shown))

    @cached_property
    def held_out(self) -> HeldOut | None:
        """Errors on the held-out data; None without such."""
        return self._held_out_by(self.problem, self.shown) if self.data.held_out else None

    def _held_out_by(self, problem: Problem, best: Fit) -> HeldOut:
        values = problem.values_at(best.theta)
        unseen = [
            o.about(problem.assembly, problem.seen_by(o, values), seen=False) for o in self.data.held_out
        ]
        if knowing_shifts := brought(problem.observations, "knowing_shifts"):
            unseen = knowing_shifts(problem, unseen)
        return held_out_error(problem, best, unseen)

    @cached_property
    def mistaken_set_up(self) -> MistakenSetUp:
        """What seems to be declared wrongly about the recordings; looked for where the model is far from them."""
        far = self.data.known and self.problem.strategy.continuation and self.best.reduced_chi2 > POOR_FIT
        if not far:
            return MistakenSetUp()
        return self.kept.made("set_up", MistakenSetUp, lambda: mistaken_set_up(self.problem))

    def compare(self) -> Comparison:
        """Fit the parameters that the model has and find where it fails."""
        tell = self.data.known and self.shown.dof > 0  # as many parameters as values tell nothing
        where = localise(self.problem, self.shown) if tell else None
        return Comparison(self, self.shown, self.errors, where, self.parameters)

    def diagnose(self, *, progress: Progress | None = None) -> Diagnosis:
        """Find out which effect the model is missing; computed once for each state of the study, and kept with it.

        Raises
        ------
        RequestError
            The uncertainty of the measurement is unknown.
        """
        self.require_uncertainty("diagnose")
        found = self.kept.find("diagnosis", Diagnosis)
        if found is None:
            from specan.study.diagnose import diagnose

            found = diagnose(
                self.problem, base=self.best, set_up=self.kept.find("set_up", MistakenSetUp), progress=progress
            )  # fmt: skip
            found = replace(
                found,
                model_discrepancy_percent=self.data.discrepancy_percent,
                remarks=(*found.remarks, *self.data.doubts),
            )
            if self.problem.strategy.linearised_covariance:
                found = self._as_shown(found)
            found = self._with_held_out(found)
            self.kept.keep("diagnosis", found)
        return found

    @property
    def diagnosed(self) -> dict[str, Any] | None:
        """What was diagnosed of the study as it is, as ``study diagnose --json`` prints it; None if nothing was."""
        found = self.kept.find("diagnosis", Diagnosis)
        return None if found is None else found.to_dict()

    def _as_shown(self, found: Diagnosis) -> Diagnosis:
        """A diagnosis that says of the base what every verb says: a search has covariances about the field it found."""
        lack, error = found.lack_of_fit, found.error
        if lack is not None:
            lack = replace(lack, reduced_chi2=self.shown.reduced_chi2, p_value=self.shown.p_value)
        if error is not None:
            after = self.errors[0] if error.after == error.before else error.after
            error = replace(error, before=self.errors[0], after=after)
        return replace(found, lack_of_fit=lack, error=error)

    def _with_held_out(self, found: Diagnosis) -> Diagnosis:
        """A diagnosis that names nothing with which held-out data are predicted worse than by the model as it is."""
        before = self.held_out
        named = [row for row in found.ranking if tuple(dict.fromkeys(row.effects)) in found.alternatives]
        if found.verdict not in ("effect", "group") or before is None or not named:
            return found
        worse: list[ObservableError] = []
        for row in named:
            after = self._held_out_with(row, before)
            if after is None:  # one of them is enough
                return found
            worse.append(after)
        error, rises = before.errors[0], min(one.rms for one in worse)
        names = " or ".join(" with ".join(row.names) for row in named)
        reason = (
            f"{names} would fit, but with it the error on the held-out data rises from "
            f"{spoken(error.rms, rises, unit=error.unit)}: another effect is missing there, or its equation is wrong"
        )
        return replace(
            found, verdict="cannot-tell", reason=reason, alternatives=(), at={}, unknown_possible=True
        )

    def _held_out_with(self, row: Ranked, before: HeldOut) -> ObservableError | None:
        """The error on held-out data with a set of effects, where that is worse; else None."""
        problem = self.problem.with_uses(row.names)
        own = kept_values(problem, row.parameters)
        try:
            after = self._held_out_by(problem, fit(problem, {**self.best.values, **own}))
        except ComputationError:  # what cannot be predicted speaks against nothing
            return None
        # A likelihood ratio of 30: of two explanations one is named then.
        worse = after.errors[0].rms > before.errors[0].rms and after.chi2 - before.chi2 > 2 * np.log(30)
        return after.errors[0] if worse else None

    def require_uncertainty(self, verb: str) -> None:
        """Refuse to conclude anything where the uncertainty is unknown."""
        if not self.data.known:
            example = self.model.words.remedy_uncertainty
            also = f", or give for instance {example}" if example else ""
            raise RequestError(
                f"{verb} needs the uncertainty of the measurement, which is not stated",
                expected="repeated conditions (a column 'repeat'), or [uncertainty] in the rig file",
                remedy=f"repeat some conditions, setting them anew{also}",
            )

    def settled(self) -> Study:
        """The study with covariances about its own fit, as it is read after a step."""
        if not self._assembled.strategy.linearised_covariance:
            return self
        return Study(self.directory, draft=self.text(), near=kept_values(self._assembled, self.parameters))

    def step(
        self, action: str, effect: str = "", because: str = "", diagnosis: Mapping[str, Any] | None = None
    ) -> history.Step:
        """The state of the study as a step of its history; `diagnosis` is that of the state before."""
        known, held = self.data.known, self.held_out
        return history.Step(
            step=len(self.history.steps),
            action=action,
            effect=effect,
            because=because,
            model_effects=self.model_effects,
            fit_error=self.errors[0].as_error(),
            held_out_error=held.errors[0].as_error() if held else None,
            errors={
                "fit": tuple(e.as_dict() for e in self.errors),
                "held_out": tuple(e.as_dict() for e in held.errors) if held else (),
            },
            reduced_chi2=self.shown.reduced_chi2 if known else None,
            p_value=self.shown.p_value if known else None,
            held_out_reduced_chi2=held.reduced_chi2 if held and known else None,
            parameters=self.parameters,
            about={n: np.asarray(v).tolist() for n, v in self._given.items()},
            at_bound=self.shown.at_bound,
            model_discrepancy_percent=self.data.discrepancy_percent,
            hashes=self.hashes,
            version=__version__,
            diagnosis=diagnosis,
        )

    def record_changes(self) -> history.Step | None:
        """Keep what somebody did to the study by hand as a step; None if nothing was done."""
        step = self.unrecorded()
        if step is not None:
            with history.changing(self.directory):
                self.keep(step)
        return step

    def keep(self, step: history.Step) -> None:
        """Write a step, and the study as it is then; the caller holds it by `changing`."""
        history.commit(self.directory, self.text().text if self.draft else None, history.line_of(step))
        self.history.steps.append(step)

    def unrecorded(self) -> history.Step | None:
        """What a person changed by hand since the last step, as a step that is not kept yet."""
        if not self.edited:
            return None
        return self.settled().step("data" if self.accepted else "edit", because=", ".join(self.accepted))


def _far_from_calibration(problem: Problem, best: Fit) -> bool:
    """Whether a fit has an instrument more than ten standard uncertainties off its prior."""
    owners = [name.whole for name in best.names]
    held = [(k, *problem.priors[o]) for k, o in enumerate(owners) if o in problem.priors]
    return any(abs(best.theta[k] - mean) > 10 * sd for k, mean, sd in held)


def relative_to(directory: Path, path: Path) -> str:
    """A path as a study keeps it: relative to its directory, with forward slashes, where that is possible."""
    try:
        return Path(os.path.relpath(path.resolve(), directory.resolve())).as_posix()
    except ValueError:  # another drive
        return path.resolve().as_posix()
