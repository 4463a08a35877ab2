"""Lines with different units, one under the other: every unit has a figure of its own."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from bokeh.layouts import column

from specan.inspect.plots import Band, Curve, Lines


class GroupedLines:
    """Figures over one horizontal axis, one for each unit that is on screen.

    Parameters
    ----------
    x_label : str
    made : callable
        Called with each figure that is made, also with those that a new unit needs later.
    **options
        Of `Lines`.
    """

    def __init__(
        self,
        x_label: str,
        made: Callable[[Lines], None] = lambda lines: None,
        **options: Any,
    ) -> None:
        self._x_label, self._options, self._made = x_label, options, made
        self.panels: list[Lines] = []
        self.body = column(sizing_mode="stretch_both", styles={"flex": "3 1 0", "min-height": "0"})
        self._panel(0)
        self.body.children = [self.panels[0].sheet]

    def _panel(self, number: int) -> Lines:
        if number == len(self.panels):
            like = self.panels[0] if self.panels else self._options.get("like")
            lines = Lines(self._x_label, "", **{**self._options, "like": like})
            self.panels.append(lines)
            self._made(lines)
        return self.panels[number]

    @property
    def first(self) -> Lines:
        """The figure on top, whose horizontal axis the others share."""
        return self.panels[0]

    def draw(
        self, groups: Mapping[str, Sequence[Curve]], bands: Mapping[str, Sequence[Band]] | None = None
    ) -> None:
        """Exchange everything.

        Parameters
        ----------
        groups : mapping
            Label of a vertical axis: its lines.
        bands : mapping, optional
            Bands behind them.
        """
        shown: list[Any] = []
        coloured = 0  # lines further up: no two lines of different figures look alike
        for number, (label, curves) in enumerate(groups.items()):
            panel = self._panel(number)
            coloured += panel.draw(curves, (bands or {}).get(label, ()), first=coloured)
            panel.label(label)
            panel.sheet.xaxis[0].axis_label = self._x_label if number == len(groups) - 1 else ""
            last = number == len(groups) - 1 and self._options.get("named", True)
            panel.sheet.xaxis[0].major_label_text_font_size = "11px" if last else "0px"
            shown.append(panel.sheet)
        if shown and self.body.children != shown:
            self.body.children = shown

    def title(self, text: str) -> None:
        """Text above the first figure."""
        self.first.sheet.title.text = text

    def span(self, low: float, high: float) -> None:
        """Show this part of the horizontal axis."""
        self.first.span(low, high)
