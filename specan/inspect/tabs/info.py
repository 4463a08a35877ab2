"""What is in the file: channels, decisions, properties, notes."""

from __future__ import annotations

from bokeh.models import Div, ScrollBox

from specan.data.recording import Recording
from specan.inspect.look import notice, share
from specan.inspect.tabs.tab import Found, Tab, Tell
from specan.inspect.view import View
from specan.report.contents import sheets
from specan.report.html_page import table

_LONGEST, _MOST = 300, 300  # characters of a cell, and rows of a table that are shown


class InfoTab(Tab):
    """Headers only; nothing is computed, and all of it is shown when the page opens."""

    name, title, verb, tip = "info", "Info", "info", None

    def add_controls(self) -> None:
        """The tables."""
        content = Div(
            text="<hr>".join(map(_of, self.opened.recordings)), sizing_mode="stretch_width", name="info"
        )
        self.body = [ScrollBox(child=content, sizing_mode="stretch_both", styles=share())]

    def compute(self, view: View, tell: Tell) -> Found:
        """Nothing."""
        return []

    def commands(self, view: View) -> list[str]:
        """For each recording."""
        return [self.opened.command(number, self.verb, []) for number in range(len(self.opened.recordings))]


def _of(recording: Recording) -> str:
    """What ``specan info --all`` shows."""
    parts = [f"<h2>{notice(recording.label)}</h2>"]
    parts += [f"<p>{notice(note)}</p>" for note in (*recording.flags, *recording.notes)]
    for one in filter(lambda one: one.rows, sheets(recording, {}, show_all=True)):
        rows = [[str(cell)[:_LONGEST] for cell in row] for row in one.rows[:_MOST]]
        parts += [f"<h3>{notice(one.title)}</h3>", table(one.header, rows)]
    return "".join(parts)
