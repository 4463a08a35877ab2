"""The waveform above the tabs: any length pans and zooms."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass
from threading import Lock
from typing import Any

import numpy as np
from bokeh.events import Reset, SelectionGeometry
from bokeh.models import BoxAnnotation, BoxSelectTool
from numpy.typing import NDArray

from specan.data.channel import Channel
from specan.data.recording import Recording
from specan.dsp.statistics import low_and_high
from specan.inspect.look import COLOURS
from specan.inspect.opened import Opened
from specan.inspect.plots import PanelPlot
from specan.inspect.view import View
from specan.report.panels import Curve, Panel

COLUMNS = 1500  # of the screen


class WaveformView:
    """Figure and kept waveforms.

    Parameters
    ----------
    moved : callable
        Called with the new visible times.
    chosen : callable
        Called with the ends of a new section.
    """

    def __init__(
        self,
        opened: Opened,
        view: View,
        moved: Callable[[float, float], None],
        chosen: Callable[[float, float], None],
    ) -> None:
        self._opened = opened
        self._waveforms: dict[str, Waveform] = {}
        self._end = max(opened.duration_s, 1e-3)
        self.plot = PanelPlot(height=150, tip=("s", "value"))
        self.sheet = self.plot.sheet
        select = BoxSelectTool(dimensions="width", description="Choose the time section")
        self.sheet.add_tools(select)
        self.sheet.toolbar.active_drag = select
        self._section = BoxAnnotation(fill_alpha=0.10, fill_color="#0072B2", line_color="#0072B2")
        self.sheet.add_layout(self._section)
        low = 0.0 if view.low is None else view.low
        high = self._end if view.high is None else view.high
        self.sheet.x_range.update(start=low, end=high, reset_start=0.0, reset_end=self._end)

        def ranged(attribute: str, old: Any, new: Any) -> None:
            moved(float(self.sheet.x_range.start), float(self.sheet.x_range.end))

        self.sheet.x_range.on_change("start", ranged)
        self.sheet.x_range.on_change("end", ranged)

        def taken(event: SelectionGeometry) -> None:
            if event.final and event.geometry.get("type") == "rect":
                ends = sorted((event.geometry["x0"], event.geometry["x1"]))
                chosen(max(ends[0], 0.0), min(ends[1], self._end))

        self.sheet.on_event(SelectionGeometry, taken)
        self.sheet.on_event(Reset, lambda event: chosen(0.0, self._end))

    @property
    def visible(self) -> tuple[float, float]:
        """Times on screen."""
        return float(self.sheet.x_range.start), float(self.sheet.x_range.end)

    def waveforms(self, view: View) -> list[tuple[str, Waveform]]:
        """Names and waveforms of the channels on screen."""
        found = []
        known = self._opened.keys
        for key in view.channel:
            if key in known:
                number, channel = known[key]
                if key not in self._waveforms:
                    self._waveforms[key] = Waveform(self._opened.recordings[number], channel)
                found.append((self._text(number, channel), self._waveforms[key]))
        return found

    def curves(self, view: View, start_s: float, stop_s: float) -> Panel:
        """What is to be drawn; reads from the file, so call it beside the page.

        Of many samples the extremes of each column, of few the samples. Channels with different units are drawn as a
        part of the largest magnitude of their unit.
        """
        parts = [
            (name, w.channel.unit, *w.part(start_s, stop_s, COLUMNS)) for name, w in self.waveforms(view)
        ]
        reach: dict[str, float] = {}
        for _, unit, _, y in parts:
            reach[unit] = max(reach.get(unit, 0.0), float(np.nanmax(np.abs(y), initial=0.0)))
        scales = {unit: end or 1.0 if len(reach) > 1 else 1.0 for unit, end in reach.items()}
        label = "\n".join(f"{end:.3g} {unit}" for unit, end in reach.items())
        return Panel(
            f"1 = {label}" if len(reach) > 1 else next(iter(reach), ""),
            tuple(Curve(name, x, y / scales[unit]) for name, unit, x, y in parts),
            leads=False,
        )

    def draw(self, shown: Panel) -> None:
        """Exchange the lines."""
        self.plot.draw(shown, {c.name: (k % len(COLOURS), 0) for k, c in enumerate(shown.curves)}, 0.7)

    def show_section(self, view: View) -> None:
        """Mark the time section."""
        self._section.update(left=view.start, right=self._end if view.stop is None else view.stop)

    def _text(self, number: int, channel: Channel) -> str:
        return self._opened.text(number, channel.label)


STEP = 1024  # samples behind one pair of the overview
PIECE = STEP * 512
DIRECT = 2_000_000  # samples that are read for a view; above that the overview serves
# Places at which a long channel is looked at before it is read: half the columns of a wide screen.
LOOKS = 750


@dataclass
class Overview:
    """Lowest and highest sample of every `STEP` samples of one channel, as far as they were read."""

    recording: Recording
    channel: Channel

    def __post_init__(self) -> None:
        count = -(-self.channel.n_samples // STEP)
        self.low, self.high = np.full(count, np.nan), np.full(count, np.nan)
        self.read_to = 0
        self._lock = Lock()

    @property
    def finished(self) -> bool:
        """Whether the whole channel was read."""
        return self.read_to >= self.channel.n_samples

    @property
    def looked_at(self) -> bool:
        """Whether there is something for every part of the channel."""
        return self.read_to > 0 or bool(np.isfinite(self.low[-1:]).all())

    def look(self, parts: list[NDArray[np.float64]]) -> None:
        """Take samples in the middle of equal parts of the channel for the whole of each, until it is read."""
        edges = np.linspace(0, self.low.size, len(parts) + 1).astype(int)
        with self._lock:
            for first, last, samples in zip(edges, edges[1:], parts, strict=False):
                self.low[first:last] = np.fmin.reduce(samples)
                self.high[first:last] = np.fmax.reduce(samples)

    def read_on(self) -> None:
        """Read the next piece."""
        with self._lock:
            start, stop = self.read_to, min(self.read_to + PIECE, self.channel.n_samples)
            if start >= stop:
                return
            samples = self.recording.read([self.channel], start, stop)[0]
            edges = np.arange(0, samples.size, STEP)
            pairs = slice(start // STEP, start // STEP + edges.size)
            self.low[pairs] = np.fmin.reduceat(samples, edges)
            self.high[pairs] = np.fmax.reduceat(samples, edges)
            self.read_to = stop


class Waveform:
    """Draws parts of one channel; short parts are read from the file, long ones from the overview."""

    def __init__(self, recording: Recording, channel: Channel) -> None:
        self.recording, self.channel = recording, channel
        self.overview = Overview(recording, channel)

    def needs_overview(self, start_s: float, stop_s: float) -> bool:
        """Whether a part is longer than what is read for a view."""
        first, last = self._samples(start_s, stop_s)
        return last - first > DIRECT and not self.overview.finished

    def part(
        self, start_s: float, stop_s: float, columns: int
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Times and samples to draw a line through: all of them where they are few, else two a column."""
        first, last = self._samples(start_s, stop_s)
        rate = self.channel.sampling_rate
        if last - first <= 2 * columns:
            samples = self.recording.read([self.channel], first, last)[0]
            return np.arange(first, last) / rate, samples
        if last - first <= DIRECT:
            low, high = low_and_high(self.recording.read([self.channel], first, last)[0], columns)
        else:
            pairs = slice(first // STEP, -(-last // STEP))
            low, high = self.overview.low[pairs], self.overview.high[pairs]
            first, last = pairs.start * STEP, pairs.stop * STEP
            if low.size > columns:
                low, high = low_and_high(low, columns)[0], low_and_high(high, columns)[1]
        width = (last - first) / low.size
        times = (first + (np.arange(low.size) + 0.5) * width) / rate
        return np.repeat(times, 2), np.stack([low, high], axis=1).ravel()

    def _samples(self, start_s: float, stop_s: float) -> tuple[int, int]:
        rate, length = self.channel.sampling_rate, self.channel.n_samples
        first = min(max(int(np.floor(start_s * rate)), 0), length)
        return first, min(max(int(np.ceil(stop_s * rate)) + 1, first), length)


def look(waveforms: list[Waveform]) -> None:
    """A first picture of long channels from few samples: what lies between them is not seen yet."""
    together: dict[tuple[int, int], list[Waveform]] = defaultdict(list)
    for waveform in waveforms:
        if not waveform.overview.looked_at and waveform.channel.n_samples > LOOKS * PIECE // 16:
            together[id(waveform.recording), waveform.channel.n_samples].append(waveform)
    for (_, length), alike in together.items():
        recording, channels = alike[0].recording, [w.channel for w in alike]
        middles = ((np.arange(LOOKS) + 0.5) * (length - STEP) / LOOKS).astype(int)
        read = [recording.read(channels, m, m + STEP) for m in middles.tolist()]
        for row, waveform in enumerate(alike):
            waveform.overview.look([samples[row] for samples in read])


def read_overviews(waveforms: list[Waveform], tell: Callable[[float], bool]) -> None:
    """Read what the overviews lack, piece by piece; `tell` hears the part done and says whether to go on.

    It hears 0 when there is a first picture of channels that take long to read.
    """
    total = max(sum(w.channel.n_samples for w in waveforms), 1)
    look(waveforms)
    if not tell(sum(w.overview.read_to for w in waveforms) / total):
        return
    while waiting := [w for w in waveforms if not w.overview.finished]:
        for waveform in waiting:
            waveform.overview.read_on()
        if not tell(sum(w.overview.read_to for w in waveforms) / total):
            return
