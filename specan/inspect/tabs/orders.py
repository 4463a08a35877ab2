"""Order spectra against a tacho or a stated speed, and the map of a run-up."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.analysis.orders import Orders
from specan.data.orders import OrderSpectrum
from specan.inspect.grouped_lines import GroupedLines
from specan.inspect.opened import Opened
from specan.inspect.plots import Curve, HeatMap, Lines, plain
from specan.inspect.tabs.tab import Change, Found, Tab, Tell, nearest_line
from specan.inspect.view import View
from specan.report.figure_style import level_label
from specan.result import counted
from specan.units import level_reference

_ROWS, _COLUMNS = 200, 800  # of the picture, at most
_DYNAMICS_DB = 90.0


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
        self.levels = GroupedLines(
            "Order of the shaft",
            lambda lines: self.add_figure(_AtSpeed(lines, self)),
            tip=("order", "dB"),
            dynamics=_DYNAMICS_DB,
        )
        self.map = HeatMap(
            3, _DYNAMICS_DB, "order_picture", x_range=self.levels.first.sheet.x_range,
            x_axis_label="Order of the shaft", y_axis_label="Speed / Hz", min_border_left=88,
        )  # fmt: skip
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

    def draw(self, found: Found, view: View) -> None:
        """Levels of all channels, and the map of the first one where it is wanted."""
        first = found[0][1]
        self._speed_hz, self.figure_view = first.tacho.mean_hz, "map" if view.order_map else ""
        groups: dict[str, list[Curve]] = {}
        for number, r in found:
            for row, name in enumerate(r.channels):
                label = level_label(level_reference(r.units[row]).text)
                curve = Curve(self.opened.text(number, name), r.order[1:], r.level_dB[row, 1:])
                groups.setdefault(label, []).append(curve)
        self.levels.draw(groups)
        self.levels.span(0.0, max(float(r.order[-1]) for _, r in found))
        self.levels.title(_facts(first))
        if view.order_map:
            self._draw_map(first, self.opened.text(found[0][0], first.channels[0]))
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

    def _draw_map(self, r: OrderSpectrum, name: str) -> None:
        low, high = float(r.speed_hz.min()), float(r.speed_hz.max())
        margin = 0.005 * high if high - low < 0.01 * high else 0.0  # a constant speed is a strip
        low, high = low - margin, high + margin
        step = float(r.order[1])
        self.map.draw(
            picture_of_map(r, low, high), (step / 2, step * (r.order.size - 0.5)), (low, high),
            level_label(level_reference(r.units[0]).text), f"{name}: orders against speed",
        )  # fmt: skip


class _AtSpeed:
    """A figure over orders whose cursor is given in hertz."""

    def __init__(self, lines: Lines, tab: OrdersTab) -> None:
        self._lines, self._tab, self.sheet = lines, tab, lines.sheet

    def cursor(self, frequency: float | None, harmonics: bool) -> None:
        """Show the cursor at its order."""
        self._lines.cursor(None if frequency is None else frequency / self._tab.speed_hz, harmonics)

    def frequency_at(self, event: Any) -> float:
        """Of a click: its order at the mean speed; left of zero there is none."""
        return max(self._lines.frequency_at(event), 1e-6) * self._tab.speed_hz


def picture_of_map(r: OrderSpectrum, low: float, high: float) -> NDArray[np.float64]:
    """Levels of the first channel at even steps of speed, (speeds, orders); each speed has its nearest column.

    Of more orders than the picture has columns, the highest of its neighbours is shown: a line is never lost.
    """
    place = np.argsort(r.speed_hz, kind="stable")
    speeds = r.speed_hz[place]
    level = r.map_level_dB[place, 0, 1:]
    wanted = low + (high - low) * (np.arange(_ROWS) + 0.5) / _ROWS
    rows = level[np.searchsorted((speeds[1:] + speeds[:-1]) / 2, wanted)]
    together = -(-rows.shape[1] // _COLUMNS)
    short = -rows.shape[1] % together
    padded = np.pad(rows, ((0, 0), (0, short)), constant_values=np.nan)
    return np.asarray(np.fmax.reduce(padded.reshape(_ROWS, -1, together), axis=2))


def _facts(r: OrderSpectrum) -> str:
    low, mean, high = r.tacho.speed_hz
    speed = f"{mean:.4g} Hz" if high - low < 0.01 * mean else f"{low:.4g} to {high:.4g} Hz"
    source = f"by {r.tacho.channel}" if r.tacho.channel else "as stated"
    return plain(
        f"Shaft at {speed} {source}, {counted(r.turns, 'turn')}, blocks of {counted(r.block_turns, 'turn')}"
    )


def _tachos_first(entry: tuple[int, Any]) -> bool:
    return bool(entry[1].role != "tacho")
