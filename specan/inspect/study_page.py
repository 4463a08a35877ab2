"""The page of a study: measured beside model, where it fails, effects to try and to accept, the history."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from bokeh.layouts import column, row
from bokeh.models import Button, Div, ScrollBox, TextInput

from specan.errors import RequestError
from specan.inspect.browser_link import BrowserLink
from specan.inspect.busy import Busy
from specan.inspect.kept_study import KeptStudy
from specan.inspect.sheets import notice, sheet
from specan.inspect.study_views.agreement import agreement_of
from specan.inspect.study_views.failing import FailingMap
from specan.inspect.study_views.ranking import Ranking, Uses
from specan.inspect.study_views.staircase import Staircase
from specan.inspect.study_views.transfer import TransferAgreement
from specan.inspect.superseded import Tell
from specan.inspect.trial import Trial, candidates_of, try_effects
from specan.inspect.view import StudyView
from specan.inspect.work import Work
from specan.report.verdict_words import headline
from specan.study.edit import Change, add_effect
from specan.study.verdict import Diagnosis

if TYPE_CHECKING:
    from bokeh.document import Document

_SIDE = 350  # px


class StudyPage:
    """Everything on the page of one browser window; accepting writes the study, as ``specan study add`` does.

    Fits run beside the page, the diagnosis beside both.
    """

    def __init__(self, document: Document, kept: KeptStudy) -> None:
        self.document, self.kept = document, kept
        self.study = kept.current()
        self.work = Work(document, lambda part: None, self._failed)
        self.diagnosing = Work(document, lambda part: None, self._not_diagnosed)
        self.status = Busy(document, "status", styles={"min-height": "20px"}, sizing_mode="stretch_width")
        self.progress = Busy(document, "diagnosis", width=_SIDE)
        self.trial = Div(text="", name="trial", sizing_mode="stretch_width")
        self.history = Div(text="", name="history", sizing_mode="stretch_width")
        self.heading = Div(text="", name="model", width=_SIDE)
        self.verdict = Div(text="", name="verdict", width=_SIDE)
        self.reason = TextInput(title="Because", placeholder="for the history", width=_SIDE, name="because")
        self.accept = Button(label="Accept", button_type="primary", disabled=True, width=_SIDE, name="accept")
        self.accept.on_click(self._accept)
        self.again = Button(label="Show the model as it is", disabled=True, width=_SIDE, name="as-it-is")
        self.again.on_click(self._as_it_is)
        self.tried: Trial | None = None
        self.now: Trial | None = None
        self.adding = self.due = False
        self.ranking = Ranking(self._try)
        self.agreement = agreement_of(self.study)
        self.link = BrowserLink()
        self.view, refused = self._first_view()
        self._follow_microphones()
        self.map = FailingMap(self.study)
        self.staircase = Staircase()
        self._lay_out()
        document.on_session_destroyed(self._closed)
        self._show_study()
        self._begin(refused, self.view.tried)

    def _first_view(self) -> tuple[StudyView, str]:
        """What the address asks for, and why it cannot be had."""
        context = self.document.session_context
        arguments = context.request.arguments if context is not None and context.request else {}
        try:
            return StudyView.from_arguments(arguments), ""
        except RequestError as fault:
            return StudyView(), str(fault)

    def _follow_microphones(self) -> None:
        for part in self.agreement:
            if isinstance(part, TransferAgreement):
                part.choose(self.view.microphone)
                part.changed = lambda chosen: self._write_address(microphone=chosen)

    def _write_address(self, **changes: tuple[str, ...]) -> None:
        self.view = self.view.model_copy(update=changes)
        self.link.address(self.view.query)

    def _closed(self, context: Any) -> None:
        self.work.close()
        self.diagnosing.close()

    def _lay_out(self) -> None:
        title = self.kept.directory.resolve().name
        left = column(
            Div(text=f"<b>{notice(title)}</b>", width=_SIDE), self.heading, self.verdict, self.progress.div,
            Div(text="<b>What could be missing</b>", width=_SIDE),
            ScrollBox(child=self.ranking.list, width=_SIDE + 10, height=380),
            ScrollBox(child=self.ranking.explanation, width=_SIDE + 10, height=230),
            self.reason, self.accept, self.again, width=_SIDE + 20,
        )  # fmt: skip
        right = column(
            self.status.div,
            *(part.body for part in self.agreement),
            self.trial,
            row(*self.map.body, self.staircase.body, sizing_mode="stretch_width"),
            self.history,
            sizing_mode="stretch_width",
        )
        self.document.add_root(
            column(
                row(left, right, sizing_mode="stretch_width"), *self.link.widgets, sizing_mode="stretch_width"
            )
        )
        self.document.title = f"{title} - specan"

    # --- showing ----------------------------------------------------------------------------------

    def _show(self, trial: Trial) -> None:
        for part in self.agreement:
            part.show(trial)
        self.map.show(trial)
        before = {} if self.now is None or not trial.uses else {e.observable: e for e in self.now.errors}
        rows = [
            [
                e.observable, e.n, f"{e.rms:.4g} {'' if e.unit == '1' else e.unit}", f"{e.relative_rms:.2f} %",
                f"{before[e.observable].rms:.4g}" if e.observable in before else "",
            ]
            for e in trial.errors
        ]  # fmt: skip
        self.trial.text = sheet(["Observable", "values", "RMS error", "relative", "before"], rows) + sheet(
            ["Parameter", "value", "95 %", "unit", ""], trial.parameters
        )

    def _show_study(self) -> None:
        effects = ", ".join(self.study.model_effects) or f"none, {self.study.model.words.ideal}"
        self.heading.text = notice(f"{self.study.model.title}. Effects: {effects}")
        steps = self.study.history.steps
        self.staircase.show(steps)
        rows = [
            [s.step, f"{s.action} {s.effect}".strip(), s.because, f"{s.fit_error['value']:.4g}",
             "" if s.held_out_error is None else f"{s.held_out_error['value']:.4g}"]
            for s in steps
        ]  # fmt: skip
        self.history.text = sheet(["Step", "what", "because", "fitted", "held out"], rows)

    def _show_candidates(self, found: Diagnosis | None) -> None:
        known, not_testable = candidates_of(self.study)
        self.ranking.show(self.study, [str(c.use) for c in known], not_testable, found)
        self.verdict.text = ""
        if found is not None:
            reason = f"{found.reason[:1].upper()}{found.reason[1:]}."
            self.verdict.text = f"<b>{notice(headline(found))}</b><p>{notice(reason)}</p>"

    def _begin(self, done: str = "", tried: Uses = ()) -> None:
        """Fit the model as it is, try what was asked for, find out what is missing; `done` stays to be read."""
        self.status.begin("Fitting the model")

        def show(trial: Trial) -> None:
            self.now = trial
            self._show(trial)
            self._show_candidates(None)
            self.status.end(done)
            if tried:
                self.due = True  # after the trial: what a person asked for comes first
                self._try(tried)
            else:
                self._diagnose()

        self.work.ask(lambda tell: self.kept.now(), show)

    def _diagnose_if_due(self) -> None:
        if self.due:
            self._diagnose()

    def _diagnose(self) -> None:
        self.due = False
        if not self.study.data.known:
            self.progress.end(
                "Nothing tells how uncertain the measurement is: there is no order of likelihood."
            )
            return
        self.progress.begin("Looking for what is missing")

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
        name, study, now = " with ".join(uses), self.study, self.now
        self.status.begin(f"Fitting with {name}")
        self.accept.disabled = True

        def show(trial: Trial) -> None:
            self.tried = trial
            self._show(trial)
            self._write_address(tried=uses)
            self.status.end(f"{name} is tried, not accepted.")
            self._diagnose_if_due()
            self.accept.update(label=f"Accept {name}", disabled=False)
            self.again.disabled = False

        self.work.ask(lambda tell: try_effects(study, now.fit, uses), show)

    def _as_it_is(self) -> None:
        if self.adding or self.now is None:
            return
        self.tried = None
        self._write_address(tried=())
        self._show(self.now)
        self.status.end()
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
                self.kept.changed_to(study)
            return changes

        def show(changes: Sequence[Change]) -> None:
            self.study, self.adding = changes[-1].study, False
            self.tried = self.now = None
            self.reason.value = ""
            self._write_address(tried=())
            self.accept.update(label="Accept", disabled=True)
            remarks = [remark for change in changes for remark in change.remarks]
            self._show_study()
            self._begin("; ".join([f"{name} is in the model now", *remarks]) + ".")

        self.work.ask(add, show)

    def _failed(self, message: str) -> None:
        self.adding = False
        self._diagnose_if_due()
        self.accept.disabled = self.tried is None
        self.status.end(message, "error")

    def _not_diagnosed(self, message: str) -> None:
        self.progress.end(message, "error")
