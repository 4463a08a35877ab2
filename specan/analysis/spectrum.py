"""Magnitude and phase spectra: averaged, held, of a single block, or against time."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Literal, NamedTuple

import numpy as np
import scipy.fft
from pydantic import Field

from specan.analysis.accumulator import READ_BLOCK
from specan.analysis.section import SectionSettings, compared, joined, section, weightable
from specan.arrays import Complex, Real
from specan.data.channel import Channel
from specan.data.frequency_response import lines_between
from specan.data.recording import Recording
from specan.data.spectrum import Scaling, Spectrogram, Spectrum, SpectrumScale
from specan.dsp.motion import convert, lowest_line, rest
from specan.dsp.overlapped_blocks import OverlappedBlocks
from specan.dsp.transfer_function import phase_deg
from specan.dsp.weighting import Weighting, power_weighting
from specan.dsp.welch import CrossSpectra, has_mirror, hop_of
from specan.dsp.windows import WindowName, window, window_properties
from specan.errors import InputError, RequestError
from specan.result import picked

SAMPLES_PER_LINE = 2.56
DEFAULT_LINES, MIN_BLOCK = 3200, 16

SpectrumAveraging = Literal["linear", "exponential", "max", "min", "none"]


class BlockSettings(SectionSettings):
    """What spectra and spectrograms have in common.

    Attributes
    ----------
    channels : tuple of str
        Names or patterns; all by default.
    scaling : {"amplitude", "rms", "psd"}
        Peak amplitude or RMS of a line (for tones), or power spectral density (for noise).
    lines : int or None
        Lines up to rate/2.56; a block has 2.56 times as many samples. All lines up to rate/2 are given. By
        default 3200, or as many as a short section allows.
    window, overlap
        Of the blocks.
    detrend : bool
        Take the mean out of each block.
    fmin, fmax, start_s, stop_s : float
        Range of the lines that are kept, and time section.
    weighting : {"A", "B", "C", "Z"}
        Of the magnitudes (IEC 61672-1:2013, annex E); A, B and C of sound pressure only. Phases stay.
    """

    scaling: Scaling = "amplitude"
    lines: int | None = Field(default=None, ge=8, le=10_000_000)
    window: WindowName = "hann"
    overlap: float = Field(default=0.5, ge=0.0, le=0.95)
    detrend: bool = True
    fmin: float = Field(default=0.0, ge=0.0)
    fmax: float | None = Field(default=None, gt=0.0)
    weighting: Weighting = "Z"

    @property
    def highest_hz(self) -> float:
        """`fmax`; without, no end."""
        return math.inf if self.fmax is None else self.fmax


class FourierSpectrum(BlockSettings):
    """Settings of an FFT analysis; see `BlockSettings` for the others.

    Attributes
    ----------
    whole : bool
        The whole section is one block; `lines` is not used.
    averaging : {"linear", "exponential", "max", "min", "none"}
        "none" analyses the first block only.
    n_exponential : int
        Number of blocks of the exponential average: a new block has the weight 1/n.
    reference : str or None
        Channel over which the phase of an average stands.

    Examples
    --------
    >>> from specan.data.recording import ArraySource
    >>> samples = 2 * np.cos(2 * np.pi * 100 * np.arange(8000) / 8000)
    >>> channel = Channel("Mic 1", unit="Pa", sampling_rate=8000.0, n_samples=8000)
    >>> settings = FourierSpectrum(lines=1000, window="flat-top")
    >>> found = settings(Recording("a.tdms", (channel,), ArraySource([samples])))
    >>> round(float(found.values.max()), 6), found.value_units, round(float(found.rms[0]), 4)
    (2.0, ('Pa',), 1.4142)
    """

    whole: bool = False
    averaging: SpectrumAveraging = "linear"
    n_exponential: int = Field(default=10, ge=2)
    reference: str | None = None

    def __call__(self, recording: Recording) -> Spectrum:
        """Read the recording once and return the spectra."""
        if self.whole or self.averaging == "none":
            parts = list(single_blocks(recording, self))
            return joined(parts, "channels units density phase_deg rms flags")
        cut = chosen(recording, self)
        reference, channels, count = cut.reference, cut.channels, len(cut.shown)
        if reference is not None and self.averaging in ("max", "min"):
            raise RequestError(
                f"a {self.averaging} hold has no phase over a reference", remedy="leave out the reference"
            )
        spectra = CrossSpectra(
            channels[0].sampling_rate,
            cut.block,
            self.window,
            self.overlap,
            n_channels=len(channels),
            references=[] if reference is None else [channels.index(reference)],
            **picked(self, "detrend averaging n_exponential"),
            derivatives=[channel.derivatives for channel in channels],
        )
        for samples in cut.recording.blocks(channels, READ_BLOCK, cut.start, cut.stop):
            spectra.add(samples)
        found = spectra.result()
        f, auto = found.frequency_hz, found.auto[:count]
        correction = np.stack([correction_of_block(c, f) for c in cut.shown])
        phase = None
        if reference is not None:
            over = correction * np.conj(correction_of_block(reference, f))
            phase = np.where(auto > 0, phase_deg(found.cross[0, :count] * over), np.nan)
        density = auto * np.abs(correction) ** 2
        return spectrum_of(cut, self, f, density, phase, (found.n_blocks, found.n_effective))


class Laid(NamedTuple):
    """The run that is meant, its reference, the channels to be shown and to be read, and the samples of a block."""

    recording: Recording
    reference: Channel | None
    shown: tuple[Channel, ...]
    channels: tuple[Channel, ...]
    notes: tuple[str, ...]
    start: int
    stop: int
    block: int


def chosen(recording: Recording, settings: FourierSpectrum) -> Laid:
    """What is analysed.

    Raises
    ------
    InputError
        No usable channel, or fewer samples than a block.
    """
    reference: Channel | None = None
    others: tuple[str, ...] = ()
    if settings.reference is not None:
        recording, others = compared(recording, settings.reference, settings.channels)
        reference = recording.channel(settings.reference)
    shown, notes = weightable(recording, settings.channels, settings.weighting, like=reference)
    channels = shown if reference is None or reference in shown else (*shown, reference)
    start, stop = section(recording, channels, settings.start_s, settings.stop_s)
    block = block_of(recording, settings, stop - start)
    notes = (*others, *notes, *integrated(shown, settings.window, block))
    return Laid(recording, reference, shown, channels, notes, start, stop, block)


def single_blocks(recording: Recording, settings: FourierSpectrum) -> Iterator[Spectrum]:
    """One block, channel by channel: a whole recording is long, and one channel is held at a time.

    Yields
    ------
    Spectrum
        Of one channel.
    """
    cut = chosen(recording, settings)
    block, rate = cut.block, cut.channels[0].sampling_rate
    scale, shape = scale_of(settings, block, rate), window(settings.window, block)
    f: Real = np.arange(block // 2 + 1, dtype=np.float64) * (rate / block)
    mirrored = has_mirror(f.size, block)
    peaks = np.where(mirrored, 2.0, 1.0) / np.sum(shape)

    def spectrum(channel: Channel) -> Complex:
        """Peak values, exp(+j w t)."""
        samples = cut.recording.read([channel], cut.start, cut.start + block)[0]
        if channel.derivatives:
            convert(samples, channel.derivatives)
        if settings.detrend:
            samples -= np.add.reduce(samples) / block
        samples *= shape
        found = scipy.fft.rfft(samples, overwrite_x=True)
        found *= peaks
        if channel.delay_s or channel.phase is not None or channel.derivatives:
            found *= correction_of_block(channel, f)
        return np.asarray(found)

    turn = None if cut.reference is None else np.conj(spectrum(cut.reference))
    for channel in cut.shown:
        found = spectrum(channel)
        density = np.square(np.abs(found)) / np.where(mirrored, 2.0 * scale.enbw_hz, scale.enbw_hz)
        if turn is not None:
            found *= turn
        phase = np.where(found != 0, phase_deg(found), np.nan)
        del found
        yield spectrum_of(cut._replace(shown=(channel,)), settings, f, density[None], phase[None])
        del density, phase  # while the next channel is read


def correction_of_block(channel: Channel, f: Real) -> Complex:
    """Factor on the lines of a block that `convert` has converted."""
    factor = replace(channel, derivatives=0).correction(f)
    return factor * rest(f, channel.sampling_rate, channel.derivatives) if channel.derivatives else factor


def _cut(channels: Sequence[Channel], density: Real, name: WindowName) -> list[bool]:
    """Take away the lines (channels, n) below the lowest that integration leaves right; whether most lay there.

    What lies there reaches into the first lines that stay, as wide as the lobe of the window.
    """
    mostly = []
    for channel, row in zip(channels, density, strict=True):
        lowest = lowest_line(name, channel.derivatives)
        mostly.append(bool(np.sum(row[:lowest]) > np.sum(row[lowest:])))
        row[:lowest] = 0.0
    return mostly


def integrated(channels: Sequence[Channel], name: WindowName, block: int) -> tuple[str, ...]:
    """A note on the lowest frequency of what is integrated."""
    lines = [lowest_line(name, channel.derivatives) for channel in channels]
    lowest = max(lines) * channels[0].sampling_rate / block
    note = f"integrated from {lowest:.3g} Hz up; more lines go lower"
    return (note,) if lowest else ()


def block_of(recording: Recording, settings: BlockSettings, n: int) -> int:
    """Samples of a block in a section of `n` samples.

    Raises
    ------
    InputError
        The section is shorter than the block that was asked for, or hardly there.
    """
    whole = isinstance(settings, FourierSpectrum) and settings.whole
    block = MIN_BLOCK if whole else round((settings.lines or DEFAULT_LINES) * SAMPLES_PER_LINE)
    if (whole and n >= block) or (settings.lines is None and MIN_BLOCK <= n < block):
        return n
    if n < block:
        raise InputError(
            f"{recording.label}: {n} samples are less than one block",
            expected=f"at least {block if settings.lines else MIN_BLOCK} samples",
            remedy="use fewer lines or a longer section",
        )
    return block


def scale_of(settings: BlockSettings, block: int, rate: float) -> SpectrumScale:
    """What the window makes of the lines."""
    properties, spacing = window_properties(settings.window), rate / block
    enbw_hz, gain = properties.enbw_lines * spacing, properties.coherent_gain
    return SpectrumScale(settings.scaling, settings.window, spacing, enbw_hz, gain, settings.weighting)


def spectrum_of(
    cut: Laid,
    settings: FourierSpectrum,
    frequency_hz: Real,
    density: Real,
    phase: Real | None,
    averages: tuple[int, float] = (1, 1.0),
) -> Spectrum:
    """The lines that were asked for, with all that belongs to them; `averages` are all blocks and independent ones."""
    channels, block, notes = cut.shown, cut.block, cut.notes
    kept = lines_between(frequency_hz, settings.fmin, settings.highest_hz)
    rate = channels[0].sampling_rate
    mostly_below = _cut(channels, density, settings.window)
    if phase is not None:
        phase[density == 0] = np.nan
    if not kept.all():  # a copy of all lines of a whole recording is large
        frequency_hz, density = frequency_hz[kept], density[:, kept]
        phase = None if phase is None else phase[:, kept]
    if settings.weighting != "Z":
        density = density * power_weighting(frequency_hz, settings.weighting)
    if settings.averaging in ("linear", "exponential") and phase is None:
        notes = (*notes, "no phase: choose a reference channel to see it")
    return Spectrum(
        **settings.origin(cut.recording, channels, notes),
        frequency_hz=frequency_hz,
        density=density,
        has_mirror=has_mirror(kept.size, block)[kept],
        scale=scale_of(settings, block, rate),
        averaging="none" if settings.whole else settings.averaging,
        n_blocks=averages[0],
        n_effective=averages[1],
        phase_deg=phase,
        phase_reference=settings.reference,
        rms=np.sqrt(np.sum(density, axis=1) * (rate / block)),
        flags=tuple((*cut.recording.flags, *_flags(*of_one)) for of_one in zip(density, mostly_below)),
    )


def _flags(density: Real, mostly_below: bool) -> tuple[str, ...]:
    if not np.all(np.isfinite(density)):
        return ("not-finite",)
    if mostly_below:
        return ("mostly-below-the-lowest-line",)
    return () if np.any(density > 0) else ("dead",)


# Most numbers of a spectrogram: channels times columns times lines, 64 MB.
VALUES = 8_000_000


# Blocks side by side in a section where no number of lines is given, and the fewest lines for that.
BLOCKS, LEAST_LINES = 50, 16


class SpectrogramSettings(BlockSettings):
    """Settings of a spectrogram: those of a spectrum, and how many columns it may have.

    Consecutive blocks are averaged into one column as soon as there are more blocks than `columns`, or than
    `VALUES` leave room for: many channels with many lines have fewer columns, in memory that is bounded.

    Examples
    --------
    >>> from specan.data.channel import Channel
    >>> from specan.data.recording import ArraySource
    >>> t = np.arange(16000) / 8000
    >>> channel = Channel("Mic 1", unit="Pa", sampling_rate=8000.0, n_samples=16000)
    >>> recording = Recording("a.tdms", (channel,), ArraySource([np.cos(2 * np.pi * (500 + 500 * t) * t)]))
    >>> found = SpectrogramSettings(lines=100)(recording)
    >>> strongest = found.frequency_hz[np.argmax(found.density[0], axis=1)]
    >>> float(strongest[0]), float(strongest[-1])
    (531.25, 2468.75)
    """

    columns: int = Field(default=1000, ge=1)

    def __call__(self, recording: Recording) -> Spectrogram:
        """Read the recording once and return the spectrogram."""
        channels, notes = weightable(recording, self.channels, self.weighting)
        start, stop = section(recording, channels, self.start_s, self.stop_s)
        rate, lines = channels[0].sampling_rate, self.lines
        usual = int((stop - start) / SAMPLES_PER_LINE / BLOCKS)
        if lines is None and usual >= LEAST_LINES:  # a short section has fewer: it has to show what changes
            lines = DEFAULT_LINES >> max(math.ceil(math.log2(DEFAULT_LINES / usual)), 0)
        block = block_of(recording, self.model_copy(update={"lines": lines}), stop - start)
        hop = hop_of(block, self.overlap)
        n_blocks = (stop - start - block) // hop + 1
        frequency: Real = np.arange(block // 2 + 1, dtype=np.float64) * (rate / block)
        kept = lines_between(frequency, self.fmin, self.highest_hz)
        room = max(1, VALUES // (len(channels) * int(kept.sum())))
        per_column = -(-n_blocks // min(self.columns, room))
        gain = np.square(np.abs([correction_of_block(c, frequency) for c in channels]))
        gain *= power_weighting(frequency, self.weighting)
        count = n_blocks // per_column  # an incomplete last column is left out
        density = np.zeros((len(channels), count, int(kept.sum())))
        grid, average = OverlappedBlocks(block, hop), CrossSpectra(
            rate, block, self.window, n_channels=len(channels), detrend=self.detrend,
            derivatives=[c.derivatives for c in channels],
        )  # fmt: skip
        pieces = recording.blocks(channels, READ_BLOCK, start, stop)
        for column, auto in zip(range(count), _means(pieces, grid, average, per_column), strict=False):
            auto *= gain
            _cut(channels, auto, self.window)
            density[:, column] = auto[:, kept]
        time: Real = np.arange(count, dtype=np.float64) * (per_column * hop / rate)
        width = ((per_column - 1) * hop + block) / rate
        return Spectrogram(
            **self.origin(recording, channels, (*notes, *integrated(channels, self.window, block))),
            time_s=time + (start / rate + width / 2),
            frequency_hz=frequency[kept],
            density=density,
            has_mirror=has_mirror(len(frequency), block)[kept],
            scale=scale_of(self, block, rate),
            blocks_per_column=per_column,
        )


def _means(
    pieces: Iterable[Real], grid: OverlappedBlocks, average: CrossSpectra, count: int
) -> Iterator[Real]:
    """Power spectra, each a mean of `count` blocks."""
    for samples in pieces:
        for part in grid.feed(samples):
            average.add_block(part)
            if average.n_blocks == count:
                yield average.result().auto
                average.clear()
