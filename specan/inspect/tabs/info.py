"""What is in the file: channels, decisions, properties, notes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from bokeh.models import Div, ScrollBox

from specan.data.recording import Recording
from specan.inspect.look import notice, sheet
from specan.inspect.opened import Opened
from specan.inspect.tabs.tab import Change, Found, Tab, Tell
from specan.inspect.view import View

_LONGEST = 300  # characters of a property that are shown
_MOST = 300  # properties


class InfoTab(Tab):
    """Headers only; nothing is computed."""

    name, title = "info", "Info"

    def __init__(self, opened: Opened, view: View, change: Change) -> None:
        super().__init__(opened, view, change)
        content = Div(text="<hr>".join(map(_of, opened.recordings)), sizing_mode="stretch_width", name="info")
        self.body = [
            ScrollBox(child=content, sizing_mode="stretch_both", styles={"flex": "1 1 0", "min-height": "0"})
        ]

    def compute(self, view: View, tell: Tell) -> Found:
        """Nothing."""
        return []

    def draw(self, found: Found, view: View) -> None:
        """All of it was shown when the page opened."""


def _of(recording: Recording) -> str:
    alike: dict[tuple[str, ...], list[str]] = {}
    for c in recording.channels:
        decided = "; ".join(f"{what}: {why}" for what, why in c.decisions.items())
        row = (
            c.group,
            c.role,
            c.unit,
            f"{c.sampling_rate:g} Hz",
            str(c.n_samples),
            f"{c.duration_s:.4g} s",
            decided,
        )
        alike.setdefault(row, []).append(c.name)
    rows = [[group, _together(names), *rest] for (group, *rest), names in alike.items()]
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


def _together(names: list[str]) -> str:
    """Channels that have everything else in common."""
    return ", ".join(names) if len(names) < 4 else f"{names[0]} to {names[-1]} ({len(names)} channels)"
