"""Order spectra against a tacho or a stated speed, and the map of a run-up."""

from __future__ import annotations

from functools import partial
from typing import Any

from specan.analysis.orders import Orders
from specan.inspect.opened import Opened
from specan.inspect.plots import HeatMap, PanelPlot, Plots
from specan.inspect.tabs.tab import Change, Found, Tab, nearest_line
from specan.inspect.view import View
from specan.inspect.work import Tell
from specan.report.figures_spectra import figure_order_map, figure_orders
from specan.report.panels import Drawing


class OrdersTab(Tab):
    """Levels over the order of a shaft; a cursor in hertz stands at its order at the mean speed."""

    name, title = "orders", "Orders"

    def __init__(self, opened: Opened, view: View, change: Change) -> None:
        super().__init__(opened, view, change)
        names = list(dict.fromkeys(c.label for _, c in sorted(opened.keys.values(), key=_tachos_first)))
        self.choice(view, "tacho", "Tacho", [("", "the only one"), *((n, n) for n in names)], 170)
        self.number(view, "pulses", "Pulses per revolution")
        self.number(view, "ratio", "Ratio", 70)
        self.number(view, "speed", "or speed / Hz")
        self.number(view, "max_order", "Highest order")
        self.number(view, "turns", "Turns", 70, mode="int")
        self.choice(view, "order_map", "Show", [("False", "spectrum"), ("True", "with the map")], 120)
        self._speed_hz = 1.0
        self.levels = Plots(lambda plot: self.add_figure(_AtSpeed(plot, self)), tip=("order", "dB"))
        self.map = HeatMap(3, "order_picture", self.levels.first.sheet.x_range)
        self.body = [self.levels.body]

    @property
    def speed_hz(self) -> float:
        """Mean speed of the shaft in the first recording on screen."""
        return self._speed_hz

    def compute(self, view: View, tell: Tell) -> Found:
        """Of the channels on screen that are no tachos."""
        view = view.but(channel=self.opened.without_tachos(view.channel, view.tacho))
        return self.of_each(
            view,
            tell,
            lambda chosen, recording: self.settings(view, chosen, Orders)(recording),
            "a channel that is no tacho",
        )

    def drawing(self, result: Any, view: View) -> Drawing:
        """Levels over order."""
        return figure_orders(result)

    def draw(self, found: Found, view: View) -> None:
        """Levels of all channels, and the map of the first one where it is wanted."""
        number, first = found[0]
        self._speed_hz, self.figure_view = first.tacho.mean_hz, "map" if view.order_map else ""
        self.levels.draw(self.drawn(found, view))
        if view.order_map:
            self.map.draw(figure_order_map(first).named(partial(self.opened.text, number)))
        self.body = [self.levels.body, *([self.map.sheet] if view.order_map else [])]

    def at(self, found: Found, frequency: float) -> list[tuple[str, str, str]]:
        """The nearest line of each channel, at the mean speed of its recording."""
        rows = []
        for number, r in found:
            line = nearest_line(r.order, frequency / self._speed_hz)
            for row, name in enumerate(r.channels):
                text = f"order {r.order[line]:.6g}: {r.amplitude[row, line]:.5g} {r.units[row]}, "
                text += f"{r.level_dB[row, line]:.2f} dB"
                hertz = f"{r.order[line] * r.tacho.mean_hz:.6g}"
                rows.append((self.opened.text(number, name), hertz, text))
        return rows


class _AtSpeed:
    """A figure over orders whose cursor is given in hertz."""

    def __init__(self, plot: PanelPlot, tab: OrdersTab) -> None:
        self._plot, self._tab, self.sheet = plot, tab, plot.sheet

    def cursor(self, frequency: float | None, harmonics: bool) -> None:
        """Show the cursor at its order."""
        self._plot.cursor(None if frequency is None else frequency / self._tab.speed_hz, harmonics)

    def frequency_at(self, event: Any) -> float:
        """Of a click: its order at the mean speed; left of zero there is none."""
        return max(self._plot.frequency_at(event), 1e-6) * self._tab.speed_hz


def _tachos_first(entry: tuple[int, Any]) -> bool:
    return bool(entry[1].role != "tacho")
