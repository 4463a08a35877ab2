"""What could be missing: candidates in the order of the diagnosis, each to be read about and to be tried."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from html import escape
from typing import Any

from bokeh.layouts import column, row
from bokeh.models import Button, Div, Select

from specan.inspect.look import notice
from specan.inspect.plots import plain
from specan.models import Use
from specan.models.effect import ParameterName
from specan.report import study_sheets
from specan.report.html_page import bar, table
from specan.study.study import Study
from specan.study.verdict import Diagnosis, Ranked, percent

MOST_ROWS = 24  # candidates with a line of their own; the others are in a list to choose from
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
        self._others: dict[str, Uses] = {}
        self._choice = Select(value="", width=200, name="others")
        self._choice.on_change("value", lambda a, old, new: self.explain(self._others[new]) if new else None)
        button = Button(
            label="Try", width=50, name="try-other", html_attributes={"aria-label": "Try another"}
        )
        button.on_click(
            lambda: self._pressed(self._others[self._choice.value]) if self._choice.value else None
        )
        self._choose = row(button, self._choice)
        self.list = column(Div(text="", width=_WIDTH), name="candidates")  # empty, Bokeh would complain
        self.explanation = Div(text="", name="explanation", width=_WIDTH)

    def show(
        self, study: Study, uses: Sequence[str], not_testable: Mapping[str, str], found: Diagnosis | None
    ) -> None:
        """Show the candidates of a study; in their order where a diagnosis was made."""
        self._study = study
        self._ranked = {uses_of(r): r for r in found.ranking} if found else {}
        self._now = found.error.before.rms if found and found.error else 0.0
        children: list[Any] = []
        if found is not None:
            children += self._groups(found)
        left = [(name,) for name in uses if (name,) not in self._ranked]
        if left:
            if found is not None:
                children.append(_heading("Not supported by the data"))
            children += self._plain(left)
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

    # --- parts of the list ------------------------------------------------------------------------

    def _groups(self, found: Diagnosis) -> list[Any]:
        asked = found.ranking[: len(found.alternatives)]
        others = found.ranking[len(found.alternatives) :]
        likely = [r for r in others if r.plausible]
        unlikely = [r for r in others if not r.plausible]
        alone = "Supported by the data" if len(asked) == 1 else "Supported by the data, not distinguished"
        children: list[Any] = []
        for text, ranked in ((alone, asked), ("Refitted, less likely", likely), ("Not plausible", unlikely)):
            if ranked:
                children.append(_heading(f"{text}: remaining error, probability"))
                children += [self._row(uses_of(r), r) for r in ranked[:MOST_ROWS]]
        return children

    def _plain(self, left: Sequence[Uses]) -> list[Any]:
        if len(left) <= MOST_ROWS:
            return [self._row(uses, None) for uses in left]
        self._others = {" with ".join(uses): uses for uses in left}
        self._choice.update(options=[("", "choose"), *((n, plain(n)) for n in self._others)], value="")
        return [self._choose]

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
