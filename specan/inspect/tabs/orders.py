"""Order spectra against a tacho or a stated speed, and the map of a run-up."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, ClassVar

from specan.inspect.tabs.tab import Found, Tab
from specan.inspect.view import View
from specan.report.figures_spectra import figure_order_map, figure_orders
from specan.report.panels import Drawing


class OrdersTab(Tab):
    """Levels over the order of a shaft; a cursor in hertz stands at its order at the mean speed."""

    name, title, verb = "orders", "Orders", "orders"
    needs, tip, hertz = "a channel that is not a tacho", ("order", "dB"), False
    readings: ClassVar = {"order": "order {:.6g}", "amplitude": "{:.5g} {unit}", "level_dB": "{:.2f} dB"}

    def add_controls(self) -> None:
        """Tacho or speed, orders, the map."""
        self.channel_choice("tacho", "Tacho", "automatic")
        self.number("pulses_per_turn", "Pulses per revolution", 140)
        self.number("ratio", "Ratio", 70)
        self.number("speed_hz", "Speed / Hz")
        self.number("max_order", "Highest order")
        self.number("turns", "Turns", 70, mode="int")
        self.choice("map", "Show", [("false", "spectrum"), ("true", "with the map")], 140)

    def keys(self, view: View) -> Sequence[str]:
        """Of the channels on screen that are no tachos."""
        return self.opened.without_tachos(view.channel, view.settings.get("tacho", ""))

    def per_hertz(self, result: Any) -> float:
        """Orders, at the mean speed of the shaft."""
        return 1 / float(result.tacho.mean_hz)

    def drawing(self, result: Any, view: View) -> Drawing:
        """Levels over order, and the map of the first channel where it is wanted."""
        pictures = figure_order_map(result).pictures[:1] if view.settings.get("map") else ()
        return replace(figure_orders(result), pictures=pictures)

    def draw(self, found: Found, view: View) -> None:
        """The cursor stands at the mean speed of the first recording."""
        self.figure_view = "map" if view.settings.get("map") else ""
        super().draw(found, view)
        for figure in self.figures:
            figure.per_hertz = self.per_hertz(found[0][1])
