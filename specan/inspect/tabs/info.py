"""What is in the file: channels, decisions, properties, notes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from bokeh.models import Div

from specan.data.recording import Recording
from specan.inspect.opened import Opened
from specan.inspect.sheets import notice, sheet
from specan.inspect.tabs.tab import Change, Found, Tab, Tell
from specan.inspect.view import View

_LONGEST = 300  # characters of a property that are shown
_MOST = 300  # properties


class InfoTab(Tab):
    """Headers only; nothing is computed."""

    name, title = "info", "Info"

    def __init__(self, opened: Opened, view: View, change: Change) -> None:
        super().__init__(opened, view, change)
        self.body = [
            Div(text="<hr>".join(map(_of, opened.recordings)), sizing_mode="stretch_width", name="info")
        ]

    def compute(self, view: View, tell: Tell) -> Found:
        """Nothing."""
        return []

    def draw(self, found: Found, view: View) -> None:
        """All of it was shown when the page opened."""


def _of(recording: Recording) -> str:
    rows = [
        [c.group, c.name, c.role, c.unit, f"{c.sampling_rate:g} Hz", c.n_samples, f"{c.duration_s:.4g} s",
         "; ".join(f"{what}: {why}" for what, why in c.decisions.items())]
        for c in recording.channels
    ]  # fmt: skip
    parts = [f"<h3>{notice(recording.label)}</h3>"]
    parts += [f"<p>{notice(note)}</p>" for note in (*recording.flags, *recording.notes)]
    parts.append(sheet(["Group", "Channel", "Role", "Unit", "Rate", "Samples", "Length", "Decided"], rows))
    if recording.set_aside:
        parts += ["<h4>Set aside</h4>", sheet(["Channel", "Why"], recording.set_aside.items())]
    properties = [("", *pair) for pair in _shown(recording.properties)]
    for group, own in recording.group_properties.items():
        properties += [(group, *pair) for pair in _shown(own)]
    if properties:
        parts += ["<h4>Properties</h4>", sheet(["Group", "Name", "Value"], properties[:_MOST])]
    return "".join(parts)


def _shown(properties: Mapping[str, Any]) -> list[tuple[str, str]]:
    texts = {name: str(value) for name, value in properties.items()}
    return [(n, t if len(t) <= _LONGEST else t[:_LONGEST] + " ...") for n, t in texts.items()]
