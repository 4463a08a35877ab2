"""Order analysis: samples at equal angles of a shaft, their spectra, lines and averages per turn."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cached_property

import numpy as np
from pydantic import Field

from specan.analysis.accumulator import READ_BLOCK
from specan.analysis.section import SectionSettings, aligned, of_one_rate, section
from specan.analysis.shaft import DRIFT_PERCENT, steady_shaft, tacho_of, tracked_shaft
from specan.arrays import Real
from specan.data.channel import Channel
from specan.data.orders import OrderLines, OrderSpectrum, TachoReport
from specan.data.recording import Recording
from specan.dsp.envelope import envelope
from specan.dsp.order_lines import (
    BLOCKS,
    PASS,
    AngularResampler,
    Departure,
    Lines,
    common_period,
    departure,
    fit_lines,
    samples_per_turn,
)
from specan.dsp.overlapped_blocks import OverlappedBlocks
from specan.dsp.windows import window
from specan.errors import InputError, RequestError
from specan.result import counted
from specan.units import MOTION, Quantity

HELD = 2e9  # bytes of resampled signal that are held for lines, at most
BLOCK_TURNS = 8
STRONGEST = 2  # lines whose phase is looked at
NEIGHBOURS = 8.0  # orders about such a line that hold no stronger one: pieces of an eighth of a turn see them
VISIBLE = 0.01  # of the power of the strongest line about it, that a line has itself
_HELD_TURNS = 4000  # of the first channel, to see whether a stated speed is constant


class Orders(SectionSettings):
    """Settings of an order analysis.

    Attributes
    ----------
    channels : tuple of str
        Names or patterns; all but the tachos by default.
    tacho : str or None
        Channel; the recording's only tacho by default.
    pulses_per_turn : float or None
        Of the tacho's shaft; its property ``PulsesPerRevolution`` by default.
    ratio : float
        Turns of the tacho's shaft per turn of the reference shaft, to which orders belong.
    speed_hz : float or None
        Known constant speed of the reference shaft, instead of a tacho.
    max_order : float or None
        By default what 1/2.56 of the sampling rate holds at the highest speed.
    turns : int
        Turns of a block of the spectrum: lines lie 1/turns apart.
    average_turns : int
        Turns of the synchronous average: as many as the machine takes to repeat itself.
    orders : tuple of float
        Orders whose complex amplitudes are wanted.
    mesh : float or None
        Order of tooth meshing: its first `harmonics` multiples with `sidebands` orders to either side join `orders`.
    quantity : str or None
        Convert vibration to displacement, velocity or acceleration, by the frequency of each line.
    envelope_hz : pair or None
        Analyse the envelope of this band instead of the signal.
    columns : int
        Columns of the map over speed, at most.

    Examples
    --------
    >>> import numpy as np
    >>> from specan.data.channel import Channel
    >>> from specan.data.recording import ArraySource
    >>> t = np.arange(20000) / 10000
    >>> channel = Channel("Acc 1", unit="m/s^2", sampling_rate=10000.0, n_samples=20000)
    >>> recording = Recording("a.tdms", (channel,), ArraySource([3.0 * np.cos(2 * np.pi * 240 * t)]))
    >>> found = Orders(speed_hz=10.0, orders=(24.0,))(recording)
    >>> np.abs(found.lines.amplitude).round(3).tolist(), float(found.order[np.argmax(found.amplitude[0])])
    ([[3.0]], 24.0)
    """

    tacho: str | None = None
    pulses_per_turn: float | None = Field(default=None, gt=0.0)
    ratio: float = Field(default=1.0, gt=0.0)
    speed_hz: float | None = Field(default=None, gt=0.0)
    max_order: float | None = Field(default=None, gt=0.0)
    turns: int = Field(default=BLOCK_TURNS, ge=1)
    average_turns: int = Field(default=1, ge=1)
    orders: tuple[float, ...] = ()
    mesh: float | None = Field(default=None, gt=0.0)
    harmonics: int = Field(default=3, ge=1)
    sidebands: int = Field(default=0, ge=0)
    quantity: Quantity | None = None
    envelope_hz: tuple[float, float] | None = None
    columns: int = Field(default=200, ge=1)

    @property
    def wanted(self) -> tuple[float, ...]:
        """Orders whose amplitudes are wanted, sorted, each once."""
        found = {float(order) for order in self.orders}
        if self.mesh is not None:
            reach = range(-self.sidebands, self.sidebands + 1)
            found |= {h * self.mesh + k for h in range(1, self.harmonics + 1) for k in reach}
        return tuple(sorted(order for order in found if order > 0))

    def __call__(self, recording: Recording) -> OrderSpectrum:
        """Read the recording once and return what it holds per turn."""
        accumulator = OrderAccumulator(recording, self)
        for samples in accumulator.pieces():
            accumulator.add(samples)
        return accumulator.result()


class OrderAccumulator:
    """Takes the samples of `channels` from `start` to `stop` in pieces of any length.

    Raises
    ------
    RequestError
        No tacho and no speed; an order that the sampling rate does not hold.
    InputError
        The section holds less than one turn.
    """

    def __init__(self, recording: Recording, settings: Orders) -> None:
        others: tuple[str, ...] = ()
        if settings.speed_hz is None:
            lead = tacho_of(recording, settings.tacho)
            recording, others = aligned(recording, [lead, *recording.select(settings.channels)])
        elif settings.tacho is not None:
            raise RequestError("a tacho and a speed are given", remedy="leave one of them out")
        self.recording, self.settings = recording, settings
        chosen, notes = _channels(recording, settings)
        chosen, remarks = _converted(recording, chosen, settings)
        self.notes = (*others, *notes, *remarks)
        self.channels, self.rate = chosen, chosen[0].sampling_rate
        if settings.speed_hz is None:
            how = settings.tacho, settings.pulses_per_turn, settings.ratio
            self.shaft = tracked_shaft(recording, *how, (settings.start_s, settings.stop_s))
        else:
            self.shaft = steady_shaft(settings.speed_hz)
        self.start, self.stop = self._section()
        self.speed_range = self._speeds()
        self.max_order = self._highest_order()
        self.per_turn = samples_per_turn(self.max_order)
        self._lay_out()
        count = len(chosen)
        n_lines = self.block // 2 + 1
        self.order = np.arange(n_lines) / self.block_turns
        self.order = self.order[self.order <= self.max_order * (1 + 1e-12)]
        self._grid = OverlappedBlocks(self.block, max(1, self.block // 2))
        self._number = 0
        self._power = np.zeros((self.n_columns, count, self.order.size))
        self._speed = np.zeros(self.n_columns)
        self._in_column = np.zeros(self.n_columns)
        self._turns_of_average = np.zeros((count, self.period * self.per_turn))
        self._averages, self._sum, self._square, self._seen = 0, np.zeros(count), np.zeros(count), 0
        self._average_grid = OverlappedBlocks(self.period * self.per_turn, self.period * self.per_turn)
        self._kept: list[Real] = []

    # --- what is laid down before the samples come -----------------------------------------------

    def _section(self) -> tuple[int, int]:
        settings = self.settings
        start, stop = section(self.recording, self.channels, settings.start_s, settings.stop_s)
        first = int(np.clip(np.ceil(self.shaft.start_s * self.rate), start, stop))
        last = int(np.clip(np.floor(self.shaft.stop_s * self.rate), start, stop))
        if last - first < 16:
            raise InputError(f"{self.recording.label}: the tacho gives no pulses in the section")
        return first, last

    def _speeds(self) -> tuple[float, float, float]:
        time = np.linspace(self.start, self.stop, 501) / self.rate
        speed = self.shaft.speed(time)
        ends = self.shaft.turns(time[[0, -1]])
        low, high = float(speed.min()), float(speed.max())
        if low <= 0:
            raise InputError(
                f"{self.recording.label}: the shaft stands still or reverses",
                remedy="choose a section in which it turns",
            )
        return low, float((ends[1] - ends[0]) / (time[-1] - time[0])), high

    def _highest_order(self) -> float:
        """The order up to which the spectrum goes."""
        low, _, high = self.speed_range
        holds = self.rate / PASS / high
        wanted = max((*self.settings.wanted, self.settings.max_order or 0.0))
        if wanted and wanted > self.rate / PASS / (low if self.settings.max_order == wanted else high) + 1e-9:
            raise RequestError(
                f"{self.recording.label}: order {wanted:g} of a shaft at {high:g} Hz lies at {wanted * high:.0f} Hz, "
                f"and a sampling rate of {self.rate:g} Hz allows {self.rate / PASS:.0f} Hz",
                expected=f"orders up to {holds:.1f}, or a sampling rate of at least {PASS * wanted * high:.0f} Hz",
                remedy="leave the higher ones out"
                if self.settings.mesh is None
                else "choose fewer harmonics of the mesh, or a higher sampling rate",
            )
        if self.settings.max_order is not None:
            return max(self.settings.max_order, wanted)
        if holds < 1 and not wanted:
            raise RequestError(
                f"{self.recording.label}: a shaft at {high:g} Hz is too fast for a sampling rate of {self.rate:g} Hz",
                expected=f"at most {self.rate / PASS:.0f} Hz, or the wanted orders below one",
            )
        return max(math.floor(holds), wanted)

    def _lay_out(self) -> None:
        """First output sample, whole turns, blocks and columns."""
        begin, end = self.shaft.turns(np.array([self.start, self.stop - 1.0]) / self.rate)
        probe = AngularResampler(self._turns_at, self.per_turn, first_turn=0.0, count=0)
        reach = 1.02 * probe.reach(self.speed_range[2] / self.rate) + 2.0 * self.speed_range[2] / self.rate
        self.first_turn = math.ceil((begin + reach) * self.per_turn) / self.per_turn
        turns = math.floor(end - reach - self.first_turn + 1e-9)
        if turns < 1:
            raise InputError(
                f"{self.recording.label}: the section holds {end - begin:.2f} turns of the shaft",
                expected=f"at least {1 + 2 * reach:.2f}",
                remedy="analyse a longer section, or orders of a faster shaft",
            )
        self.turns, self.period = turns, self.settings.average_turns
        if self.period > turns:
            raise InputError(
                f"{self.recording.label}: an average over {self.period} turns is requested, but there are only {turns}",
                remedy="analyse a longer section, or fewer turns",
            )
        self.block_turns = min(self.settings.turns, turns)
        self.block = self.block_turns * self.per_turn
        count = turns * self.per_turn
        self.n_blocks = (count - self.block) // max(1, self.block // 2) + 1
        self.per_column = -(-self.n_blocks // self.settings.columns)
        self.n_columns = -(-self.n_blocks // self.per_column)
        if self.settings.wanted and 8.0 * count * len(self.channels) > HELD:
            size = 8e-9 * count * len(self.channels)
            raise RequestError(
                f"lines of {len(self.channels)} channels over {turns} turns take {size:.1f} GB",
                remedy="choose fewer channels, a lower highest order or a shorter section",
            )
        self._resampler = AngularResampler(
            self._turns_at, self.per_turn, first_turn=self.first_turn, count=count, start=self.start
        )

    def _turns_at(self, number: Real) -> Real:
        return self.shaft.turns(number / self.rate)

    # --- the pass --------------------------------------------------------------------------------

    def pieces(self):
        """The samples in pieces; the envelope's, where it is wanted."""
        band = self.settings.envelope_hz
        if band is None:
            yield from self.recording.blocks(self.channels, READ_BLOCK, self.start, self.stop)
            return
        samples = np.stack(
            [
                envelope(self.recording.read([c], self.start, self.stop)[0], self.rate, *band)
                for c in self.channels
            ]
        )
        samples -= samples.mean(axis=1, keepdims=True)
        for first in range(0, samples.shape[1], READ_BLOCK):
            yield samples[:, first : first + READ_BLOCK]

    def add(self, samples: Real) -> None:
        """Take the next samples (channels, m) of `channels`."""
        found = self._resampler.add(samples)
        if not found.shape[1]:
            return
        self._sum += found.sum(axis=1)
        self._square += np.einsum("ij,ij->i", found, found)
        self._seen += found.shape[1]
        for block in self._grid.feed(found):
            self._take(block)
        for block in self._average_grid.feed(found):
            self._turns_of_average += block
            self._averages += 1
        if self.settings.wanted:
            self._kept.append(found)
        elif self.shaft.tacho.channel is None and self._seen <= _HELD_TURNS * self.per_turn:
            self._kept.append(found[:1])

    def _take(self, block: Real) -> None:
        """Add the spectrum of one block to its column."""
        if self._number >= self.n_blocks:
            return
        column = self._number // self.per_column
        middle = self.first_turn + (self._number * max(1, self.block // 2) + self.block / 2) / self.per_turn
        speed = float(self.shaft.speed(self._time_of(middle)))
        shape = window("hann", self.block)
        spectra = np.fft.rfft((block - block.mean(axis=1, keepdims=True)) * shape)
        spectra = spectra[:, : self.order.size]
        amplitude = (spectra.real**2 + spectra.imag**2) * (4.0 / shape.sum() ** 2)
        if any(c.derivatives for c in self.channels):
            factors = [c.correction(self.order * speed) for c in self.channels]
            amplitude *= np.abs(np.stack(factors)) ** 2
        self._power[column] += amplitude
        self._speed[column] += speed
        self._in_column[column] += 1
        self._number += 1

    @cached_property
    def _clock(self) -> tuple[Real, Real]:
        time = np.linspace(self.start, self.stop, 2001) / self.rate
        return self.shaft.turns(time), time

    def _time_of(self, turn: float | Real) -> Real:
        """When the shaft has made so many turns."""
        return np.asarray(np.interp(turn, *self._clock))

    # --- the result --------------------------------------------------------------------------------

    def result(self) -> OrderSpectrum:
        """What was found from the samples so far."""
        used = self._in_column > 0
        power = self._power[used] / self._in_column[used, None, None]
        speed = self._speed[used] / self._in_column[used]
        visible = self.order[None, :] * speed[:, None] <= self.rate / PASS * (1 + 1e-9)
        power = np.where(visible[:, None, :], power, np.nan)
        weight = self._in_column[used, None, None] * visible[:, None, :]
        with np.errstate(invalid="ignore", divide="ignore"):
            mean = np.nansum(np.nan_to_num(power) * weight, axis=0) / weight.sum(axis=0)
        average = self._turns_of_average / max(self._averages, 1)
        average = np.roll(average, round(self.first_turn * self.per_turn) % average.shape[1], axis=1)
        centre = self._sum / max(self._seen, 1)
        rms = np.sqrt(np.maximum(self._square / max(self._seen, 1) - centre**2, 0.0))
        tacho = replace(self.shaft.tacho, speed_hz=self.speed_range)
        notes = (*self.notes, *self.shaft.notes, *self._remarks(tacho))
        step = self.per_column * max(1, self.block // 2) / self.per_turn
        first = self.first_turn + self.block_turns / 2 - step / (2 * self.per_column)
        return OrderSpectrum(
            **self.settings.origin(self.recording, self.channels, notes),
            order=self.order,
            amplitude=np.sqrt(mean),
            speed_hz=speed,
            time_s=self._time_of(first + step * (np.arange(power.shape[0]) + 0.5)),
            map=np.sqrt(power),
            average=average,
            average_turns=self.period,
            synchronous_rms=average.std(axis=1),
            rms=rms,
            tacho=tacho,
            turns=self.turns,
            block_turns=self.block_turns,
            n_blocks=self._number,
            lines=self._lines(),
        )

    @cached_property
    def _fitted(self) -> tuple[Lines, int] | None:
        """The wanted lines, and the turns that they are of."""
        wanted = self.settings.wanted
        if not wanted:
            return None
        period, turns = common_period(wanted), self._samples.shape[1] // self.per_turn
        if period is not None and turns >= period:
            turns -= turns % period
        samples = self._samples[:, : turns * self.per_turn]
        return fit_lines(samples, self.per_turn, wanted, first_turn=self.first_turn), turns

    def _lines(self) -> OrderLines | None:
        if self._fitted is None:
            return None
        wanted, (found, turns) = self.settings.wanted, self._fitted
        frequency = np.array(wanted) * self.speed_range[1]
        factor = np.stack([c.correction(frequency) for c in self.channels])
        size, u = np.abs(factor), found.u
        if self._departure is not None:
            u = np.hypot(u, np.abs(found.amplitude) * self._departure.relative_error(wanted))
        return OrderLines(np.array(wanted), found.amplitude * factor, u * size, found.u_scatter * size, turns)

    def _remarks(self, tacho: TachoReport) -> list[str]:
        remarks = []
        if self._number and tacho.drift_percent > DRIFT_PERCENT:
            low, _, high = tacho.speed_hz
            remarks.append(
                f"the speed drifts between {low:.4g} and {high:.4g} Hz ({tacho.drift_percent:.1f} %): orders "
                "follow it, resonances do not"
            )
        remarks += self._departure_said()
        if self.settings.wanted and self.turns < BLOCKS:
            remarks.append(f"{counted(self.turns, 'turn')}: too few for a scatter over blocks")
        return remarks

    @cached_property
    def _departure(self) -> Departure | None:
        """How the phase of the strongest line departs; of the first channel where no lines are wanted."""
        if not self._kept or self.settings.envelope_hz is not None:
            return None
        wanted, power = self.settings.wanted, self._power.sum(axis=0)
        share = power[:, 1:] / np.maximum(power[:, 1:].sum(axis=1, keepdims=True), 1e-300)
        orders = np.array(wanted or (self.order[1 + np.argmax(share[0])],))
        channel = int(np.argmax(share.max(axis=1))) if wanted else 0
        apart = np.abs(self.order[1:] - orders[:, None])
        around = np.where(apart <= NEIGHBOURS, share[channel], 0.0)
        middle = around @ self.order[1:] / np.maximum(around.sum(axis=1), 1e-300)
        own = np.argmin(np.abs(middle - orders[:, None]), axis=0) == np.arange(orders.size)
        sharp = apart.min(axis=0)[np.argmax(around, axis=1)] <= 0.5  # not smeared over orders
        itself = np.where(apart <= 0.25, share[channel], 0.0).max(axis=1)
        sharp &= itself > VISIBLE * around.max(axis=1)  # nor nothing between two strong lines
        weight = np.where(own, around.max(axis=1), 0.0) * orders**2  # of what an error of the angle does
        x = self._samples[channel] - self._samples[channel].mean()
        known: list[tuple[float, complex]] = []
        if self._fitted is not None:
            at_start = self._fitted[0].amplitude[channel] * np.exp(2j * np.pi * orders * self.first_turn)
            strongest = np.abs(at_start).max() or 1.0
            known = [(o, a / strongest) for o, a in zip(orders.tolist(), at_start.tolist()) if a]
        highest, found = float(orders.max() if wanted else self.order[-1]), []
        for k in np.argsort(weight)[-STRONGEST:]:
            if weight[k] and (sharp[k] or self.shaft.tacho.channel is None):
                beside = [line for line in known if abs(line[0] - orders[k]) <= NEIGHBOURS]
                one = departure(x, self.per_turn, float(orders[k]), highest, not wanted, beside)
                found.append((one, sharp[k]))
        told = [one for one, as_it_is in found if one and (as_it_is or not one.steady)]
        return max(told, key=lambda one: one.loss_dB / one.order**2, default=None)

    def _departure_said(self) -> list[str]:
        found, stated = self._departure, self.settings.speed_hz
        if found is None:
            return []
        line = f"the phase of order {found.order:g} departs from it"
        if self.settings.wanted:
            line += (
                f", and this line reads about {found.loss_dB:.2g} dB low, which grows with the order squared"
            )
        if stated is None:
            return [
                f"the angle of {self.shaft.tacho.channel} is not that of the vibration: {line}; a tacho with more "
                "pulses per turn follows faster changes of the speed"
            ]
        if found.steady and self.settings.wanted:
            fits = stated * (1 + found.slope / found.order)
            return [
                f"the speed is not {stated:.8g} Hz: {line}; if that order is right, the shaft turns at {fits:.6g} Hz; "
                "give that, or record a tacho"
            ]
        return [f"the speed is not constant as stated: {line}; record a tacho, or analyse a shorter section"]

    @property
    def _samples(self) -> Real:
        """Samples at equal angles that were held."""
        if len(self._kept) > 1:
            self._kept = [np.concatenate(self._kept, axis=1)]
        return self._kept[0]


def _channels(recording: Recording, settings: Orders) -> tuple[tuple[Channel, ...], tuple[str, ...]]:
    """Channels of one rate; tachos are left out where none is named."""
    chosen, notes = of_one_rate(recording, settings.channels)
    if not settings.channels:
        kept = tuple(c for c in chosen if c.role != "tacho" and settings.tacho not in (c.name, c.path))
        if not kept:
            raise InputError(f"{recording.label} has no channel but tachos")
        return kept, notes
    return chosen, notes


def _converted(
    recording: Recording, channels: tuple[Channel, ...], settings: Orders
) -> tuple[tuple[Channel, ...], tuple[str, ...]]:
    """The channels in the quantity that is asked for, and a note on those that have none."""
    if settings.quantity is None:
        return channels, ()
    if settings.envelope_hz is not None:
        raise RequestError(
            "an envelope cannot be converted to another quantity", remedy="leave one of them out"
        )
    other = [c.label for c in channels if c.unit not in MOTION]
    notes = (f"not converted to {settings.quantity}: {', '.join(other)}",) if other else ()
    return replace(recording, channels=channels).in_quantity(settings.quantity).channels, notes
