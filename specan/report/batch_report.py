"""A batch as a report for others: what was measured and how, the list of recordings, a page for each."""

from __future__ import annotations

import datetime
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from specan import __version__
from specan.analysis.batch.inputs import Input
from specan.analysis.batch.one_file import open_calibrated
from specan.analysis.batch.result import FileResult
from specan.analysis.batch.run import BatchReport
from specan.analysis.batch.settings import BatchSettings
from specan.analysis.levels import Levels
from specan.data.band_levels import BandLevels
from specan.data.calibration import stated
from specan.data.levels import SignalLevels
from specan.data.recording import Recording
from specan.errors import SpecanError, reason_of
from specan.report.figures import figure_of
from specan.report.html_page import page, picture, shown, table
from specan.result import counted, first_of, gathered

MOST_PAGES = 100  # of recordings; the others are in the list only
FEW = 6  # channels whose bands are in a table
_SHEETS = 2  # of levels; percentiles are in the tables
# a row of the list of recordings, and what is below it on a page of its own
Page = tuple[list[Any], list[str]]


def batch_report(report: BatchReport, settings: BatchSettings) -> str:
    """The page as HTML. Recordings are read once more, with the calibrations of the batch.

    Parameters
    ----------
    report : BatchReport
        As `run_batch` gives it.
    settings : BatchSettings
        Those of the batch.
    """
    entries = {entry.label: entry for entry in report.inputs}
    done = [result for result in report.of_kind("done") if result.label in entries]
    seen = [_Measured(entries[result.label], result, settings) for result in done[:MOST_PAGES]]
    roots = sorted({entry.root for entry in report.inputs})
    title = f"Measurements: {', '.join(Path(root).name for root in roots)}"
    named = ["recording", "excitation", "duration / s", *_HEADS]
    parts = [
        f"<h1>{escape(title)}</h1>",
        table([], _facts(roots, [one.recording for one in seen], report)),
        "<h2>Recordings</h2>",
        table(named, [one.row(number) for number, one in enumerate(seen, 1)]),
        *([f"<p>{len(done) - MOST_PAGES} more are in the tables.</p>"] if len(done) > MOST_PAGES else []),
        *_skipped(report),
        *(part for number, one in enumerate(seen, 1) for part in one.page(number)),
        f"<p>specan {escape(__version__)}, settings {escape(settings.fingerprint)}; the headers of "
        f"{escape(', '.join(path.name for path in report.tables))} have all of them.</p>",
    ]
    return page(title, parts)


def _facts(roots: Sequence[str], recordings: Sequence[Recording], report: BatchReport) -> list[list[str]]:
    """Date, place, rig and calibration."""
    paths = [Path(entry.path) for entry in report.inputs]
    begun = sorted({day for recording in recordings if (day := _day(recording))})
    modified = sorted({datetime.date.fromtimestamp(path.stat().st_mtime) for path in paths if path.exists()})
    what, days = ("Recorded", begun) if begun else ("Files of", modified)
    rigs = Counter(_rig(recording) for recording in recordings)
    return [
        ["Report of", f"{datetime.date.today():%Y-%m-%d}"],
        *([[what, " to ".join(f"{day:%Y-%m-%d}" for day in dict.fromkeys((days[0], days[-1])))]] if days else []),
        ["Directory", ", ".join(roots)],
        *_under("Rig", [f"{rig} ({counted(n, 'recording')})" for rig, n in rigs.most_common()]),
        *_under("Calibration", report.calibration),
        ["Result", f"{report.summary().partition(';')[0]}"],
    ]  # fmt: skip


def _under(name: str, lines: Sequence[str]) -> list[list[str]]:
    return [[name if k == 0 else "", line] for k, line in enumerate(lines)]


def _day(recording: Recording) -> datetime.date | None:
    """When a recording begins, as its file says it."""
    for properties in (*(c.properties for c in recording.channels), recording.properties):
        begun = properties.get("wf_start_time", properties.get("DateTime"))
        if begun is not None:
            stamp = pd.to_datetime(str(begun), format="ISO8601", errors="coerce")
            # the clock of TDMS that was never set begins there
            return stamp.date() if stamp.year > 1904 else None
    return None


def _rig(recording: Recording) -> str:
    """What measured: channels by their roles, and rates."""
    roles = Counter(channel.role for channel in recording.channels)
    rates = sorted({channel.sampling_rate for channel in recording.channels})
    parts = [counted(n, "other channel" if role == "other" else role) for role, n in roles.items()]
    return f"{', '.join(parts)}, {' and '.join(f'{rate:g}' for rate in rates)} Hz"


_HEADS = ["LAeq / dB, mean", "highest LAeq / dB", "highest LAFmax / dB"]


@dataclass
class _Measured:
    """One recording of the report; one that can no longer be analysed says why."""

    entry: Input
    result: FileResult
    settings: BatchSettings

    def __post_init__(self) -> None:
        self.recording = open_calibrated(self.entry)
        spoken = self.recording.by_role("microphone") or self.recording.channels
        rate = spoken[0].sampling_rate
        names = tuple(channel.label for channel in spoken if channel.sampling_rate == rate)
        self.levels: SignalLevels | None = None
        self.bands: BandLevels | None = None
        self.fault = ""
        try:
            self.levels = stated(Levels(channels=names)(self.recording), self.recording)
            octave = self.settings.octave.model_copy(update={"channels": names})
            self.bands = stated(octave(self.recording), self.recording)
        except Exception as fault:  # one recording costs no other its page
            self.fault = reason_of(fault)

    @property
    def excitation(self) -> str:
        """What drove it, as the batch has recognised it."""
        said = next(
            (line for line in self.result.about if line.startswith("excitation ")), "excitation unknown"
        )
        return said.removeprefix("excitation ").partition(" (")[0]

    def row(self, number: int) -> list[Any]:
        """Its line in the list of recordings."""
        duration = max(channel.duration_s for channel in self.recording.channels)
        name = f"{number}\N{NO-BREAK SPACE}{self.entry.label}"
        return [name, self.excitation, f"{duration:.4g}", *self._loudest()]

    def _loudest(self) -> list[str]:
        found = self.levels
        if (
            found is None
            or not np.isfinite(equivalent := found.equivalent_dB.get("A", np.array(np.nan))).any()
        ):
            return ["", "", ""]

        def highest(values: Any) -> str:
            place = int(np.nanargmax(values)) if np.isfinite(values).any() else None
            return "" if place is None else f"{values[place]:.1f} ({found.channels[place]})"

        mean = 10 * np.log10(np.nanmean(10 ** (equivalent / 10)))
        largest = np.where(np.isfinite(equivalent), found.max_dB, np.nan)
        return [f"{mean:.1f}", highest(equivalent), highest(largest)]

    def page(self, number: int) -> list[str]:
        """Its page: what it is, levels, bands, pictures."""
        described = [line for line in self.result.about if line.startswith("Description: ")]
        names = [channel.label for channel in self.recording.channels]
        facts = [
            *(line.removeprefix("Description: ") for line in described),
            f"{_rig(self.recording)}. Calibration: {self.recording.calibration_of(names)}.",
            *([f"No levels: {self.fault}."] if self.fault else []),
        ]
        parts = [f'<h2 class="sheet">{number}  {escape(self.entry.label)}</h2>']
        parts += [f"<p>{escape(fact)}</p>" for fact in facts]
        for one in [] if self.levels is None else self.levels.sheets()[:_SHEETS]:
            parts += [f"<h3>{escape(one.title)}</h3>", shown(one)]
        if self.bands is not None:
            bands = self.bands.sheets()[0]
            parts += [f"<h3>{escape(bands.title)}</h3>"]
            parts += [picture(figure_of(self.bands), f"band levels of {self.entry.label}")]
            parts += [shown(bands)] if len(self.bands.channels) <= FEW else []
        if self.excitation.startswith(("noise", "sweep")):
            parts += self._transfer()
        return parts

    def _transfer(self) -> list[str]:
        try:
            found = self.settings.completed().transfer_function(self.recording)
        except SpecanError:
            return []  # no reference: skipped.txt says it
        figure = figure_of(stated(found, self.recording))
        return ["<h3>Transfer functions</h3>", picture(figure, f"transfer functions of {self.entry.label}")]


def _skipped(report: BatchReport) -> list[str]:
    rows = [[r.label, r.reason] for r in report.results if r.kind == "failed"]
    ignored = gathered(((r.label, why), name) for r in report.results for name, why in r.set_aside if name)
    rows += [[f"{label}, {first_of(names, 3)}", why] for (label, why), names in ignored.items()]
    parts = ["<h2>Not analysed</h2>", table(["file", "reason"], rows)] if rows else []
    aside = gathered((result.reason, result.label) for result in report.of_kind("aside"))
    lines = [f"Skipped, {why}: {', '.join(files)}." for why, files in aside.items()]
    return [*parts, *(f"<p>{escape(line)}</p>" for line in lines)]
