"""The page of a study: measured beside model, where it fails, effects to try and to accept, the history."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from html import escape
from typing import Any

from bokeh.document import Document
from bokeh.layouts import column, row
from bokeh.models import Button, Div, ScrollBox, TextInput

from specan.errors import RequestError
from specan.inspect.look import GROWS, PANEL, Busy, folded, notice, share
from specan.inspect.page import Page
from specan.inspect.study_views.agreement import TransferAgreement, agreement_of
from specan.inspect.study_views.ranking import Ranking, Uses
from specan.inspect.trial import KeptStudy, Trial, try_effects
from specan.inspect.view import StudyView
from specan.inspect.work import Tell
from specan.report import study_sheets
from specan.report.figure_style import image
from specan.report.figures import figure_of
from specan.report.html_page import shown
from specan.report.residual_map import failing_map
from specan.study.edit import Change, add_effect
from specan.study.selection.candidates import candidates
from specan.study.verdict import Diagnosis, headline, reason

_SIDE = 350  # px
_AS_IT_IS = 112  # px: what the words "Discard trial" take


class StudyPage(Page):
    """Everything on the page of a study; accepting writes the study, as ``specan study add`` does.

    Fits run beside the page, the diagnosis beside both.
    """

    kind = "study"

    def __init__(self, document: Document, kept: KeptStudy) -> None:
        super().__init__(document, kept.directory.resolve().name, StudyView, folds=True)
        self.kept = kept
        self.study = kept.current()
        self.diagnosing = self.worker(lambda message: self.progress.end(message, "error"))
        self.progress = Busy(document, "diagnosis", folds=True, sizing_mode="stretch_width")
        self.trial, self.history, self.heading, self.verdict, self.map = (
            Div(text="", name=name, sizing_mode="stretch_width")
            for name in ("trial", "history", "model", "verdict", "map")
        )
        self.reason = TextInput(title="because (for the history)", width=_SIDE - 14, name="because")
        self.accept = Button(
            label="Accept", button_type="primary", disabled=True, name="accept", width=_SIDE - _AS_IT_IS - 24
        )
        self.accept.on_click(self._accept)
        self.again = Button(label="Discard trial", disabled=True, name="as-it-is", width=_AS_IT_IS)
        self.again.on_click(self._as_it_is)
        self.tried: Trial | None = None
        self.now: Trial | None = None
        self.adding = False
        self.ranking = Ranking(self._try, self.dressed)
        self.agreement = agreement_of(self.study, kept.current)
        for part in self.agreement:
            if isinstance(part, TransferAgreement):  # the address keeps the chosen receivers
                part.choose(self.view.microphone)
                part.changed = lambda chosen: self._write_address(microphone=chosen)
        self._lay_out()
        self._show_study()
        self._begin(self.refused, self.view.tried)

    def _write_address(self, **changes: tuple[str, ...]) -> None:
        self.view = self.view.model_copy(update=changes)
        self.link.address(self.view.query)

    def _lay_out(self) -> None:
        story = column(
            self.verdict, self.progress.div, self.status.div, sizing_mode="stretch_width",
            styles={**PANEL, "border-left": "4px solid var(--accent)"},
        )  # fmt: skip
        top = [
            ScrollBox(child=part, sizing_mode="stretch_both", styles=share(), css_classes=["whole"])
            for part in (self.history, self.map)
        ]
        self._bottom = self._side_by_side([part.body for part in self.agreement], 5, "figures")
        self._middle = column(
            story, self._side_by_side(top, 3, **{"max-height": "max-content"}), sizing_mode="stretch_both",
            styles={**GROWS, "gap": "4px"}, css_classes=["whole"],
        )  # fmt: skip
        main = row(
            self._left(), self._middle, sizing_mode="stretch_width",
            styles={"height": "calc(100vh - 84px)", "gap": "8px"}, css_classes=["stacked"],
        )  # fmt: skip
        self.show_page(main, self.trial)
        self.dressed(self._bottom)

    def _left(self) -> Any:
        """The candidates, what one of them is, and the buttons."""
        explanation = ScrollBox(
            child=self.ranking.explanation, width=_SIDE, sizing_mode="stretch_height",
            styles=share(2, **{"border-top": "1px solid var(--line)"}),
        )  # fmt: skip
        return column(
            self.heading,
            ScrollBox(child=self.ranking.list, width=_SIDE, sizing_mode="stretch_height", styles=share(3)),
            explanation, self.reason, row(self.accept, self.again), width=_SIDE + 12, sizing_mode="stretch_height",
            styles=PANEL, css_classes=["whole", "candidates"],
        )  # fmt: skip

    @staticmethod
    def _side_by_side(parts: Sequence[Any], weight: int, *classes: str, **styles: str) -> Any:
        """Parts in a row; under each other where the window is narrow."""
        return row(
            *parts,
            sizing_mode="stretch_both",
            styles=share(weight, **styles),
            css_classes=["stacked", *classes],
        )

    def _save(self, kind: str) -> None:
        """The figure that ``specan study compare --plot`` draws, of the model as it is."""
        name, study = self.kept.directory.resolve().name, self.kept.current()
        self.status.begin("Drawing the figure")

        def show(content: bytes) -> None:
            self.link.save(f"{name}_compare.{kind}", content)
            self.status.end("The figure shows the model as it is, without the trial.")

        self.work.ask(lambda tell: image(figure_of(study.compare()), kind), show)

    def _numbers(self) -> str:
        trial = self.tried or self.now
        if trial is None:
            raise RequestError("there are no numbers yet", remedy="wait for the fit")
        lines = [
            "\t".join(map(str, line))
            for one in (trial.parameters, study_sheets.errors(trial.errors))
            for line in (one.header, *one.rows)
        ]
        return "\n".join(lines) + "\n"

    def _command(self) -> str:
        place = str(self.kept.directory)
        tried = self.tried.uses if self.tried else ()
        lines = [shlex.join(["specan", "study", "add", place, use]) for use in tried]
        return "\n".join(lines or [shlex.join(["specan", "study", "compare", place])])

    # --- showing ----------------------------------------------------------------------------------

    def _show(self, trial: Trial) -> None:
        for part in self.agreement:
            part.show(trial)
        if self._bottom not in self._middle.children:  # there is something to show now
            self._middle.children = [*self._middle.children, self._bottom]
        self.map.text = failing_map(trial.where, self.study.data.known)
        self._show_history(trial)
        tables = shown(study_sheets.errors(trial.errors)) + shown(trial.parameters)
        self.trial.text = folded("Parameters and errors", tables)

    def _show_study(self) -> None:
        effects = ", ".join(self.study.model_effects) or f"none, {self.study.model.words.ideal}"
        self.heading.text = f"<b>{notice(self.study.model.title)}</b><br>{notice(f'Effects: {effects}')}"
        self._show_history()

    def _show_history(self, tried: Trial | None = None) -> None:
        sheet = study_sheets.history(self.study.history.steps)
        if tried is not None and tried.uses:
            error = ", ".join(study_sheets.amount(one.as_error()) for one in tried.errors)
            sheet.rows.append(["", f"try {tried.name}", error, f"{tried.fit.reduced_chi2:.2f}", "", ""])
        self.history.text = shown(sheet)

    def _show_candidates(self, found: Diagnosis | None) -> None:
        known, not_testable = candidates(self.study.problem)
        self.ranking.show(self.study, [str(c.use) for c in known], not_testable, found)
        if self.tried is not None:
            self.ranking.explain(self.tried.uses)
        self.verdict.text = ""
        if found is not None:
            because = reason(found.to_dict())
            fall = "" if found.error is None else " ".join(["", *found.error.sentences])
            self.verdict.text = (
                f'<span style="font-size:17px;font-weight:650">{escape(headline(found))}</span>'
                f"<div>{escape(because + fall)}</div>"
            )

    def _begin(self, done: str = "", tried: Uses = ()) -> None:
        """Fit the model as it is, try what was asked for, find out what is missing; `done` stays to be read."""
        self.status.begin("Fitting the model")

        def show(trial: Trial) -> None:
            self.now = trial
            self._show(trial)
            self._show_candidates(None)
            self.status.end(done)
            if tried:
                self._try(tried)
            self._diagnose()

        self.work.ask(lambda tell: self.kept.now(), show)

    def _diagnose(self) -> None:
        if not self.study.data.known:
            self.progress.end(
                "The uncertainty of the measurement is unknown, so the candidates cannot be ranked."
            )
            return
        self.progress.begin("Searching for the missing effect")

        def say(text: str) -> None:
            self.diagnosing.later(lambda: self.progress.go_on(text[:1].upper() + text[1:]))

        def show(found: Diagnosis) -> None:
            self.progress.end()
            self._show_candidates(found)

        self.diagnosing.ask(lambda tell: self.kept.diagnosis(tell, say), show)

    # --- what a person does -----------------------------------------------------------------------

    def _try(self, uses: Uses) -> None:
        if self.adding or self.now is None:
            return
        name, study = " with ".join(uses), self.study
        self.status.begin(f"Fitting with {name}")
        self.accept.disabled = True

        def show(trial: Trial) -> None:
            self.tried = trial
            self._show(trial)
            self._write_address(tried=uses)
            self.status.end(f"Trial: {name} (not accepted).")
            self.accept.update(
                label=f"Accept {name}", disabled=False, html_attributes={"title": f"Accept {name}"}
            )
            self.again.disabled = False

        self.work.ask(lambda tell: try_effects(study, uses), show)

    def _as_it_is(self) -> None:
        if self.adding or self.now is None:
            return
        self._forget_trial()
        self._show(self.now)
        self.status.end()

    def _forget_trial(self) -> None:
        self.tried = None
        self._write_address(tried=())
        self.accept.update(label="Accept", disabled=True)
        self.again.disabled = True

    def _accept(self) -> None:
        if self.tried is None or self.adding:
            return
        uses, because = self.tried.uses, self.reason.value
        name = self.tried.name
        self.status.begin(f"Adding {name}")
        self.accept.disabled = self.again.disabled = self.adding = True

        def add(tell: Tell) -> Sequence[Change]:
            # As it stands now: another window or the command may have changed it meanwhile.
            study, changes = self.kept.current(), []
            for use in uses:
                changes.append(add_effect(study, use, because))
                study = changes[-1].study
                self.kept.take(study)
            return changes

        def show(changes: Sequence[Change]) -> None:
            self.study, self.adding = changes[-1].study, False
            self.now = None
            self.reason.value = ""
            self._forget_trial()
            remarks = [remark for change in changes for remark in change.remarks]
            self._show_study()
            self._begin("; ".join([f"{name} is in the model now", *remarks]) + ".")

        self.work.ask(add, show)

    def _failed(self, message: str) -> None:
        self.adding = False
        self.accept.disabled = self.tried is None
        super()._failed(message)
