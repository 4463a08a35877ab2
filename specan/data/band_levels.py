"""Levels in fractional-octave bands, with everything that is needed to read them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.arrays import Flags, Real
from specan.data.limits import Kept, LimitCurve
from specan.divisions import division_name
from specan.result import RecordingResult, Sheet, cell, counted, explained, picked
from specan.units import LevelReference

# 18.9 degrees of freedom of bandwidth times time: a level that scatters by more than 1 dB.
LOW_BT_DB = 1.0
_FEW = 4  # channels that stand side by side; of more, each has a row

# By how much the cut at the ends of a section changes a level that is flagged ``edges``.
EDGES_DB = 0.5


@dataclass(frozen=True)
class OtherSettling:
    """The same levels, had the cut at the section's ends been treated otherwise.

    Attributes
    ----------
    name : {"left-out", "counted"}
        How, in the bands.
    level_dB : array (channels, bands)
    overall_dB : mapping of str to array (channels,)
        With the cut counted: totals behind A, B and C leave it out.
    """

    name: str
    level_dB: Real
    overall_dB: Mapping[str, Real]


@dataclass(frozen=True, repr=False)
class BandLevels(RecordingResult):
    """Band levels of several channels of one recording, and their overall levels.

    Attributes
    ----------
    units : tuple of str
        After the differentiations that a channel's quantity needs (a vibrometer's velocity).
    references : tuple of LevelReference
        What 0 dB is, for each channel.
    fraction : int or str
        1/`fraction` octave, or the name of a table of bands.
    weighting : str
        Frequency weighting of the band levels: "A", "B", "C" or "Z".
    averaging : str
        "linear", "fast", "slow", "impulse", or the time constant: "0.5 s".
    hold : str or None
        "max" or "min" of the time-weighted level; None for the reading at the end of the section.
    exact_hz, nominal_hz, lower_hz, upper_hz : arrays (bands,)
        Mid-band frequencies (IEC 61260-1:2014), and the edges of the bands.
    level_dB : array (channels, bands)
        Minus infinity where there is no energy, NaN where there is no result.
    u_dB : array (bands,)
        Standard deviation that the level of stationary noise has for its limited duration.
    overall_dB : mapping of str to array (channels,)
        "Z", "A", "B", "C": level of the whole signal, its constant part left out; A, B and C of sound
        pressure only (NaN otherwise).
    start_s, duration_s : float
        Time section, from the beginning of the recording.
    sampling_rate : float
    settling : str
        What was done with the filters' settling, in a sentence.
    flags : tuple of tuples of str
        Words for each channel.
    history : LevelHistory or None
        Time-weighted levels against time.
    unsettled : array (bands,) or None
        Bands whose filter and time weighting take longer to settle than the section lasts.
    low_snr : array (channels, bands) or None
        Where the signal does not stand out of a background that was subtracted.
    other : OtherSettling or None
        The levels with the ends of the section counted if they are left out, and the other way round.
    percentile_dB : mapping of float to array (channels, bands), or None
        N: time-weighted level that is exceeded during N % of the time; 0 is the maximum, 100 the minimum. NaN where
        the section ends before a band has settled.
    percentile_overall_dB : mapping of float to mapping of str to array (channels,), or None
        The same of the overall levels.
    """

    verb = "octave"

    references: tuple[LevelReference, ...]
    fraction: int | str
    weighting: str
    averaging: str
    hold: str | None
    exact_hz: Real
    nominal_hz: Real
    lower_hz: Real
    upper_hz: Real
    level_dB: Real
    u_dB: Real
    overall_dB: Mapping[str, Real]
    start_s: float
    duration_s: float
    sampling_rate: float
    settling: str
    history: LevelHistory | None = None
    unsettled: Flags | None = None
    low_snr: Flags | None = None
    other: OtherSettling | None = None
    percentile_dB: Mapping[float, Real] | None = None
    percentile_overall_dB: Mapping[float, Mapping[str, Real]] | None = None

    dimensions = ("channel", "nominal_hz")

    def summary(self) -> str:
        """What it is, on one line."""
        held = f", {self.hold} hold" if self.hold else ""
        return (
            f"{self.label}, {counted(len(self.channels), 'channel')}, {self.exact_hz.size} bands of "
            f"{division_name(self.fraction, width=True)}, weighting {self.weighting}, averaging {self.averaging}{held}"
        )

    def values_over(self) -> dict[str, Any]:
        """Arrays over `dimensions`."""
        shape = self.level_dB.shape
        references = np.array([[r.text] for r in self.references])
        return {
            "exact_hz": np.broadcast_to(self.exact_hz, shape),
            "level_dB": self.level_dB,
            "u_dB": np.broadcast_to(self.u_dB, shape),
            **{f"{percentile_name(n)}_dB": values for n, values in (self.percentile_dB or {}).items()},
            "level_reference": np.broadcast_to(references, shape),
            "flags": flag_words(self),
        }

    def about(self) -> list[str]:
        """Lines above the table in a text file."""
        units = zip(self.channels, self.units, self.references)
        kind = f"{self.weighting} weighting, {self.averaging} averaging"
        exceeded = "LN_dB: level exceeded during N % of the time; max_dB, min_dB: largest and smallest"
        return [
            f"{division_name(self.fraction)} levels of {self.label}, {kind}",
            "level_dB: " + ", ".join(f"{n} in dB re {r.text} ({u})" for n, u, r in units),
            "u_dB: standard deviation of stationary noise",
            f"settling: {self.settling}",
            *([exceeded] if self.percentile_dB else []),
        ]

    def tables(self) -> Iterable[dict[str, Any]]:
        """One row for each band, and below for each overall level."""
        all_totals = self.percentile_overall_dB or {}
        for row, (channel, flags) in enumerate(zip(self.channels, all_flags(self))):
            totals = {w: v[row] for w, v in self.overall_dB.items() if v[row] == v[row] or w == "Z"}
            yield {
                "channel": channel,
                "band_hz": [*(f"{f:g}" for f in self.nominal_hz), *(f"total-{w}" for w in totals)],
                "level_dB": [*self.level_dB[row], *totals.values()],
                "u_dB": [*self.u_dB, *[np.nan] * len(totals)],
                **{
                    f"{percentile_name(n)}_dB": [*values[row], *(all_totals[n][w][row] for w in totals)]
                    for n, values in (self.percentile_dB or {}).items()
                },
                "flags": [*flags, *(self.overall_flags(row, w) for w in totals)],
            }

    def facts(self) -> dict[str, Any]:
        """What `content` says of all channels."""
        return {
            **picked(self, "fraction weighting averaging hold start_s duration_s"),
            **picked(self, "sampling_rate_hz=sampling_rate settling"),
            "other_settling": self.other and self.other.name,
            **picked(self, "nominal_hz exact_hz lower_hz upper_hz u_dB"),
            "history_interval_s": self.history and self.history.interval_s,
            "history_time_s": self.history and self.history.time_s,
        }

    def of_channels(self) -> dict[str, Any]:
        """What `content` says of each channel."""
        rows = range(len(self.channels))
        found = {
            **picked(self, "group=groups unit=units"),
            "level_reference": [reference.text for reference in self.references],
            **picked(self, "level_dB overall_dB flags"),
            "overall_flags": {w: [self.overall_flags(row, w) for row in rows] for w in self.overall_dB},
            "band_flags": all_flags(self),
        }
        if self.other is not None:
            other = picked(self.other, "other_settling_dB=level_dB other_settling_overall_dB=overall_dB")
            found |= {"edges": self.edges, **other}
        if self.percentile_dB is not None:
            found |= picked(self, "percentile_dB percentile_overall_dB")
        if self.history is not None:
            levels = "history_dB=level_dB overall_history_dB=overall_dB"
            highest = "history_max_dB=max_dB overall_history_max_dB=overall_max_dB"
            found |= picked(self.history, f"{levels} {highest}")
        return found

    def sheets(self) -> list[Sheet]:
        """Levels of bands and overall levels: a column for each of a few channels, a row for each of many."""
        texts = [reference.text for reference in self.references]
        many = [text for text in dict.fromkeys(texts) if texts.count(text) > _FEW]
        found = [self._wide(text, [r for r, other in enumerate(texts) if other == text]) for text in many]
        if rest := [r for r, text in enumerate(texts) if text not in many]:
            header = [f"{self.channels[r]}\ndB re {texts[r]}" for r in rest]
            found.append(Sheet("", ["Hz", *header, "u dB", ""], self._lines(rest)))
        found[0] = found[0]._replace(
            title=f"{self.label}: {division_name(self.fraction)} levels, {self.how}\n{found[0].title}".rstrip()
        )
        found += [self._percentiles(row) for row in range(len(self.channels)) if self.percentile_dB]
        exceeded = "LN: level exceeded during N % of the time after settling.\n"
        meanings = {
            "low-BT": f"narrow band, short section: the level of noise scatters by {LOW_BT_DB:g} dB or more",
            "unsettled": "the filter and the time weighting take longer to settle than the section lasts",
        }
        if self.other is not None:
            way = "with" if self.other.name == "counted" else "without"
            where = self.other.name if len(self.channels) == 1 else "--json, -o"
            meanings["edges"] = f"the ends of the section change the level ({where}: the level {way} them)"
        below = "u: standard deviation of noise." + explained(meanings, found)
        if self.settings.get("settling") == "left-out":
            below += f" Settling: {self.settling}."
        found[-1] = found[-1]._replace(below=(exceeded if self.percentile_dB else "") + below)
        return found

    def _wide(self, reference: str, rows: Sequence[int]) -> Sheet:
        """A row for each of many channels."""
        names = [self.channels[r] for r in rows]
        header, *columns = zip(["Hz", *names, "u dB", ""], *self._lines(rows, "\n"), strict=True)
        return Sheet(f"dB re {reference}", list(header), [list(column) for column in columns if any(column)])

    def _lines(self, rows: Sequence[int], breaks: str = " ") -> list[list[str]]:
        """A line for each band and overall level: its name, levels of some channels, uncertainty, common flags."""
        own = [self.flags[r] for r in rows]
        return [
            [
                f"{nominal:g}", *(cell(self.level_dB[r, band]) for r in rows), f"{self.u_dB[band]:.2f}",
                _common_words([self.band_flags(r, band) for r in rows], own, breaks),
            ]
            for band, nominal in enumerate(self.nominal_hz)
        ] + [
            [
                f"overall {weighting}", *(cell(levels[r]) for r in rows), "",
                _common_words([self.overall_flags(r, weighting) for r in rows], own, breaks),
            ]
            for weighting, levels in self.overall_dB.items()
            if np.isfinite(levels[list(rows)]).any()
        ]  # fmt: skip

    @property
    def how(self) -> str:
        """Weighting, averaging and section, as titles say them."""
        held = f", {self.hold} hold" if self.hold else ""
        stop = self.start_s + self.duration_s
        return (
            f"{self.weighting} weighting, {self.averaging} averaging{held}, {self.start_s:g} s to {stop:g} s"
        )

    def _percentiles(self, row: int) -> Sheet:
        """A row a band and a column a percentage, of one channel."""
        names = [percentile_name(n) for n in self.percentile_dB or {}]
        own = list(self.tables())[row]
        columns = zip(own["band_hz"], *(map(cell, own[f"{name}_dB"]) for name in names), strict=True)
        lines = [[band.replace("total-", "overall "), *levels] for band, *levels in columns]
        title = f"{self.channels[row]} / dB re {self.references[row].text}"
        return Sheet(title, ["Hz", *names], lines)

    def keeps(self, limits: LimitCurve) -> list[Kept]:
        """How each channel keeps to limits."""
        return [
            limits.of_bands(
                name, self.nominal_hz, self.level_dB[row], {w: float(v[row]) for w, v in self.overall_dB.items()}
            )
            for row, name in enumerate(self.channels)
        ]  # fmt: skip

    @property
    def edges(self) -> Flags:
        """Bands (channels, bands) whose level hangs on the cut at the ends of the section."""
        if self.other is None:
            return np.zeros(self.level_dB.shape, dtype=bool)
        return apart(self.level_dB, self.other.level_dB)

    def band_flags(self, channel: int, band: int) -> tuple[str, ...]:
        """Words for one band of one channel: the channel's, ``low-BT``, ``unsettled``, ``low-snr``, ``edges``.

        After ``edges`` follows the level with the other settling, as in ``counted=61.234``.
        """
        known = {
            "low-BT": self.u_dB[band] > LOW_BT_DB,
            "unsettled": self.unsettled is not None and self.unsettled[band],
            "low-snr": self.low_snr is not None and self.low_snr[channel, band],
        }
        words = [*self.flags[channel], *(word for word, holds in known.items() if holds)]
        if self.other is not None:
            words += _edges(self.other.name, self.level_dB[channel, band], self.other.level_dB[channel, band])
        return tuple(words)

    def overall_flags(self, channel: int, weighting: str) -> tuple[str, ...]:
        """Words for one overall level of one channel: the channel's, ``edges``."""
        words = list(self.flags[channel])
        if self.other is not None:
            levels_dB = (found.overall_dB[weighting][channel] for found in (self, self.other))
            words += _edges("counted", *levels_dB)
        return tuple(words)


def _common_words(flags: Sequence[tuple[str, ...]], known: Sequence[tuple[str, ...]], breaks: str) -> str:
    """Words for one line of several channels, beside those known of a channel; a level of one channel alone."""
    found = [word for words, mine in zip(flags, known) for word in words if word not in mine]
    return breaks.join(dict.fromkeys(word for word in found if len(flags) == 1 or "=" not in word))


def all_flags(found: Any) -> list[list[tuple[str, ...]]]:
    """Flags of each channel in each band, of a result with bands."""
    bands = range(found.exact_hz.size)
    return [[found.band_flags(row, band) for band in bands] for row in range(len(found.channels))]


def flag_words(found: Any) -> NDArray[np.object_]:
    """The same, each as one text."""
    return np.array([[" ".join(flags) for flags in row] for row in all_flags(found)], dtype=object)


def percentile_name(percent: float) -> str:
    """What the level exceeded during `percent` of the time is called.

    Examples
    --------
    >>> [percentile_name(n) for n in (0.0, 10.0, 99.5, 100.0)]
    ['max', 'L10', 'L99.5', 'min']
    """
    return {0.0: "max", 100.0: "min"}.get(percent, f"L{percent:g}")


def apart(one: Real | float, other: Real | float, least_dB: Real | float = EDGES_DB) -> Flags:
    """Where two levels, of which each stands for a treatment of the cut, differ by more than 0.5 dB."""
    with np.errstate(invalid="ignore"):  # of nothing with nothing: not apart
        return np.asarray(np.abs(one - other) > least_dB)


def _edges(name: str, shown_dB: float, other_dB: float) -> list[str]:
    return ["edges", f"{name}={other_dB:.3f}"] if apart(shown_dB, other_dB) else []


@dataclass(frozen=True)
class LevelHistory:
    """Time-weighted levels against time.

    Attributes
    ----------
    time_s : array (times,)
        From the beginning of the recording.
    level_dB : array (channels, bands, times)
    overall_dB : mapping of str to array (channels, times)
    interval_s : float
        Distance of the readings.
    max_dB : array (channels, bands)
        Largest level at any time, between the readings as well.
    overall_max_dB : mapping of str to array (channels,)
    """

    time_s: Real
    level_dB: Real
    overall_dB: Mapping[str, Real]
    interval_s: float
    max_dB: Real
    overall_max_dB: Mapping[str, Real]
