"""What could be missing: candidates in the order of the diagnosis, each to be read about and to be tried."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from html import escape
from typing import Any

from bokeh.layouts import column, row
from bokeh.models import Button, Div

from specan.inspect.look import notice
from specan.models import Use
from specan.models.effect import ParameterName
from specan.report import study_sheets
from specan.report.html_page import bar, table
from specan.study.study import Study
from specan.study.verdict import Diagnosis, Ranked, percent

_WIDTH = 322
_WRAPPED = ".bk-btn { white-space: normal; text-align: left; padding: 4px; }"
Uses = tuple[str, ...]


class Ranking:
    """The list, and the explanation of the candidate that is selected.

    Parameters
    ----------
    try_ : callable
        Called with the uses of a candidate.
    dress : callable
        Gives a new line the style of the page.
    """

    def __init__(self, try_: Callable[[Uses], None], dress: Callable[[Any], Any] = lambda part: part) -> None:
        self._try = try_
        self._study: Study | None = None
        self._dress = dress
        self._now = 0.0  # error of the model as it is
        self._ranked: dict[Uses, Ranked] = {}
        self._lines: dict[Uses, Any] = {}
        self.list = column(Div(text="", width=_WIDTH), name="candidates")  # empty, Bokeh would complain
        self.explanation = Div(text="", name="explanation", sizing_mode="stretch_width")

    def show(
        self, study: Study, uses: Sequence[str], not_testable: Mapping[str, str], found: Diagnosis | None
    ) -> None:
        """Show the candidates of a study; in their order where a diagnosis was made."""
        self._study = study
        ranking = [(uses_of(one), one) for one in found.ranking] if found else []
        self._ranked = dict(ranking)
        self._now = found.error.before.rms if found and found.error else 0.0
        named = len(found.alternatives) if found else 0
        groups: list[tuple[str, list[tuple[Uses, Ranked | None]]]] = [
            ("Supported by the data" + ", not distinguished" * (named > 1), [*ranking[:named]]),
            ("Refitted, less likely", [one for one in ranking[named:] if one[1].plausible]),
            ("Not plausible", [one for one in ranking[named:] if not one[1].plausible]),
            ("Not supported by the data", [((name,), None) for name in uses if (name,) not in self._ranked]),
        ]
        children: list[Any] = []
        for text, members in groups:
            if members and found is not None:
                children.append(
                    _heading(text + ": remaining error, probability" * (members[0][1] is not None))
                )
            children += [self._row(*one) for one in members]
        children += [
            Div(text=notice(f"Not testable: {n} {why}"), width=_WIDTH) for n, why in not_testable.items()
        ]
        self.list.children = children
        self.explanation.text = ""
        if found is not None and found.ranking:
            self.explain(uses_of(found.ranking[0]))

    def explain(self, uses: Uses) -> None:
        """Show what a candidate is, and what the diagnosis found of it."""
        if self._study is None:
            return
        parts = []
        for name in uses:
            effect = self._study.model.effects[Use.parse(name).name]
            parts.append(f"<b>{escape(name)}</b>")
            parts += [f"<p>{escape(part)}</p>" for part in effect.explanation.strip().split("\n\n")]
            if effect.separate_by:
                parts.append(f"<p><i>Distinguished from others by:</i> {escape(effect.separate_by)}</p>")
            if effect.reference:
                parts.append(f"<p><i>Source:</i> {escape(effect.reference)}</p>")
        ranked = self._ranked.get(uses)
        if ranked is not None:
            sheet = study_sheets.parameters(ranked.parameters)
            parts.append(table(sheet.header, [[ParameterName(name).own, *row] for name, *row in sheet.rows]))
        self.explanation.text = "".join(parts)

    def _row(self, uses: Uses, ranked: Ranked | None) -> Any:
        # The same widgets again in another place: those of before would stay in the browser.
        if uses not in self._lines:
            self._lines[uses] = self._new_line(uses)
        line = self._lines[uses]
        line.children[-1].text = "" if ranked is None else self._numbers(ranked)
        line.styles = {"opacity": "0.55"} if ranked is not None and not ranked.plausible else {}
        return line

    def _numbers(self, ranked: Ranked) -> str:
        """The error that is left, as a number and as a part of the error now, and the probability."""
        part = min(ranked.error_after / self._now, 1.0) if self._now else 0.0
        numbers = f"<b>{ranked.error_after:.3g}</b> &nbsp;{percent(ranked.probability)}"
        return f'<small style="white-space:nowrap">{numbers}</small><br>{bar(part)}'

    def _new_line(self, uses: Uses) -> Any:
        name = " with ".join(uses)
        button = Button(
            label="Try", width=44, name=f"try-{name}", html_attributes={"aria-label": f"Try {name}"}
        )
        button.on_click(partial(self._pressed, uses))
        about = Button(
            label=name, button_type="light", width=140, name=f"about-{name}", stylesheets=[_WRAPPED]
        )
        about.on_click(partial(self.explain, uses))
        return self._dress(row(button, about, Div(text="", width=110, name=f"rank-{name}"), margin=0))

    def _pressed(self, uses: Uses) -> None:
        self.explain(uses)
        self._try(uses)


def uses_of(ranked: Ranked) -> Uses:
    """Written forms of the effects of a row, places and copies included: those that its parameters carry."""
    return tuple(dict.fromkeys(ParameterName(name).owner for name in ranked.parameters)) or ranked.effects


def _heading(text: str) -> Div:
    return Div(text=f"<b><small>{escape(text)}</small></b>", width=_WIDTH)
