"""Vibration against the angle of a shaft: order spectra, lines, synchronous averages."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from specan.arrays import Complex, Real
from specan.data.levels import rms_level
from specan.data.spectrum import highest
from specan.result import RecordingResult, Sheet, cell, counted, picked, records


@dataclass(frozen=True)
class TachoReport:
    """What a tacho gave.

    Attributes
    ----------
    channel : str or None
        None where the speed was stated.
    pulses, missing, double : int
        Pulses used; pulses that were missing; pulses taken away.
    jitter_s : float
        Standard deviation of what smoothing took off the pulses' instants.
    speed_hz : tuple
        Least, mean and greatest speed of the reference shaft.
    """

    channel: str | None = None
    pulses: int = 0
    missing: int = 0
    double: int = 0
    jitter_s: float = 0.0
    speed_hz: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def mean_hz(self) -> float:
        """Mean speed of the reference shaft."""
        return self.speed_hz[1]

    @property
    def drift_percent(self) -> float:
        """Range of the speed over its mean."""
        low, mean, high = self.speed_hz
        return 100.0 * (high - low) / mean


@dataclass(frozen=True)
class OrderLines:
    """Complex amplitudes of given orders, ``x(u) = sum Re(A exp(2j pi o u))`` with u in turns of the shaft.

    Attributes
    ----------
    order : array (lines,)
    amplitude : complex array (channels, lines)
        Peak amplitudes; phases are those at the first pulse of the tacho.
    u, u_scatter : arrays (channels, lines)
        Standard uncertainty of one component: from the noise about the line, and from the scatter of blocks.
    turns : int
        Turns of the record that was used.
    """

    order: Real
    amplitude: Complex
    u: Real
    u_scatter: Real
    turns: int

    @property
    def phase_deg(self) -> Real:
        """Phase in (-180, 180]."""
        return np.degrees(np.angle(self.amplitude))

    def rows(self) -> list[list[dict[str, Any]]]:
        """The lines of each channel, one mapping each."""
        parts = zip(abs(self.amplitude), self.phase_deg, self.u, self.u_scatter, strict=True)
        return [
            records(order=self.order, amplitude=size, phase_deg=phase, u=u, u_scatter=scatter)
            for size, phase, u, scatter in parts
        ]


@dataclass(frozen=True, repr=False)
class OrderSpectrum(RecordingResult):
    """What a recording holds per turn of a shaft.

    Attributes
    ----------
    order : array (lines,)
    amplitude : array (channels, lines)
        Peak amplitude of a sine there (energy mean over the blocks).
    speed_hz, time_s : arrays (columns,)
        Mean speed and middle of the blocks of each column.
    map : array (columns, channels, lines)
        Amplitudes against speed; NaN above 1/2.56 of the sampling rate.
    average : array (channels, samples)
        Synchronous average over `average_turns` turns, from turn zero on.
    synchronous_rms, rms : arrays (channels,)
        RMS of the average and of all that was resampled, both without the mean.
    lines : OrderLines or None
    """

    verb = "orders"

    order: Real
    amplitude: Real
    speed_hz: Real
    time_s: Real
    map: Real
    average: Real
    average_turns: int
    synchronous_rms: Real
    rms: Real
    tacho: TachoReport
    turns: int
    block_turns: int
    n_blocks: int
    lines: OrderLines | None = None

    dimensions: ClassVar[tuple[str, ...]] = ("channel", "order")
    title = "orders"
    over = "amplitude level_dB"

    def summary(self) -> str:
        """What it is, on one line."""
        low, _, high = self.tacho.speed_hz
        return (
            f"{self.label}, {counted(len(self.channels), 'channel')}, {self.order.size} orders up to "
            f"{self.order[-1]:.4g}, {counted(self.turns, 'turn')}, {low:.4g} Hz to {high:.4g} Hz"
        )

    def about(self) -> list[str]:
        """Lines above the table in a text file."""
        return [
            f"{self.title} of {self.label}",
            ", ".join(f"{name} in {unit}" for name, unit in zip(self.channels, self.units)),
            f"speed {self.tacho.mean_hz:.6g} Hz, {self.turns} turns, blocks of {self.block_turns}",
        ]

    def tables(self) -> Iterable[dict[str, Any]]:
        """The requested lines, or the spectrum."""
        silent = dict.fromkeys(("phase_deg", "u", "u_blocks"), "")
        for row, channel in enumerate(self.channels):
            if (lines := self.lines) is None:
                yield {"channel": channel, "order": self.order, "amplitude": self.amplitude[row], **silent}
            else:
                yield {
                    "channel": channel, "order": lines.order, "amplitude": abs(lines.amplitude[row]),
                    "phase_deg": lines.phase_deg[row], "u": lines.u[row], "u_blocks": lines.u_scatter[row],
                }  # fmt: skip

    def facts(self) -> dict[str, Any]:
        """What `content` says of all channels."""
        return {
            "tacho": picked(self.tacho, "channel pulses missing double jitter_s"),
            "speed_hz": dict(zip(("least", "mean", "greatest"), self.tacho.speed_hz)),
            **picked(self, "turns block_turns n_blocks average_turns"),
            "line_turns": None if self.lines is None else self.lines.turns,
            "order": self.order,
            "columns": None,
        }

    def of_channels(self) -> dict[str, Any]:
        """What `content` says of each channel."""
        found = picked(self, "unit=units rms synchronous_rms amplitude average")
        return found if self.lines is None else {**found, "lines": self.lines.rows()}

    def sheets(self, peaks: int = 3, kurtosis: Mapping[str, Any] | None = None) -> list[Sheet]:
        """RMS, synchronous part and highest lines of every channel; the given lines, kurtosis in bands."""
        tacho = self.tacho
        low, mean, high = tacho.speed_hz
        source = (
            "stated"
            if tacho.channel is None
            else f"{tacho.channel}, {tacho.pulses} pulses, {tacho.missing} missing, {tacho.double} double, "
            f"jitter {1e6 * tacho.jitter_s:.3g} us"
        )
        rows = [
            [
                *(["", "", ""] if rank else [name, f"{self.rms[row]:.5g} {unit}", f"{self.synchronous_rms[row]:.5g}"]),
                f"{self.order[k + 1]:.6g}", f"{self.amplitude[row, k + 1]:.5g} {unit}",
                f"{self.level_dB[row, k + 1]:.2f}",
            ]
            for row, (name, unit) in enumerate(zip(self.channels, self.units))
            for rank, k in enumerate(highest(self.amplitude[row, 1:], peaks))
        ]  # fmt: skip
        speed = f"speed {mean:.6g} Hz ({low:.6g} to {high:.6g}; {source})"
        header = ["channel", "RMS", "synchronous", "order", "amplitude", "dB"]
        found = [Sheet(f"{self.label}: {counted(self.turns, 'turn')}, {speed}", header, rows)]
        if (lines := self.lines) is not None:
            rows = [
                [
                    "" if k else name, f"{order:.6g}", f"{abs(lines.amplitude[row, k]):.5g} {unit}",
                    cell(lines.u[row, k], ".2g"), cell(lines.u_scatter[row, k], ".2g"),
                    cell(lines.phase_deg[row, k]),
                ]
                for row, (name, unit) in enumerate(zip(self.channels, self.units))
                for k, order in enumerate(lines.order)
            ]  # fmt: skip
            about = "u: one component, from the noise about the line, from blocks"
            header = ["channel", "order", "amplitude", "u", "u blocks", "phase deg"]
            found.append(Sheet(f"Lines over {counted(lines.turns, 'turn')}; {about}", header, rows))
        if kurtosis:
            header = ["kurtosis", *(f"{low:.0f}-{high:.0f} Hz" for low, high in kurtosis["bands_hz"])]
            rows = [[name, *map(cell, values)] for name, values in kurtosis["channels"].items()]
            found.append(Sheet("", header, rows))
        return found

    @property
    def level_dB(self) -> Real:
        """RMS levels of the lines."""
        return rms_level(self.amplitude / np.sqrt(2), self.units)

    @property
    def map_level_dB(self) -> Real:
        """RMS levels of the map, (columns, channels, lines)."""
        return rms_level(self.map.swapaxes(0, 1) / np.sqrt(2), self.units).swapaxes(0, 1)


class OrderMap(OrderSpectrum):
    """The same, of which the amplitudes over the speed are written."""

    dimensions = ("channel", "speed_hz", "order")
    title = "map of orders"

    def values_over(self) -> dict[str, Any]:
        """Arrays over `dimensions`."""
        return {"amplitude": self.map.swapaxes(0, 1)}

    def tables(self) -> Iterable[dict[str, Any]]:
        """One row for each channel, speed and order."""
        return RecordingResult.tables(self)

    def facts(self) -> dict[str, Any]:
        """The columns of the map as well."""
        return {**super().facts(), "columns": picked(self, "time_s speed_hz")}

    def of_channels(self) -> dict[str, Any]:
        """The amplitudes over the columns as well."""
        return {**super().of_channels(), "map": self.map.swapaxes(0, 1)}
