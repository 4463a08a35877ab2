"""Energy in bands and behind frequency weightings, exact, in one pass over a record of any length."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from specan.dsp import bands
from specan.dsp.bands import Bands
from specan.dsp.frequency_nodes import (
    NODES_PER_OCTAVE,
    Spread,
    nearest_nodes,
    node_frequencies,
    node_range,
    node_weights,
)
from specan.dsp.lag_spectrum import LagSpectrum, total_energy, working_memory
from specan.dsp.multirate import LENGTH, MultirateTransform, PaddedTransform, Stage, few_rows
from specan.dsp.record_ends import Fade, RecordEnds
from specan.dsp.record_start import CutEnergy
from specan.dsp.short_record import LONGEST, add_energy, share_of_lines
from specan.dsp.slow_part import SlowPart
from specan.dsp.weighting import Weighting

# A response below this adds nothing: 200 dB.
_NOTHING = 1e-20
# Rounding of the lags leaves this part of the whole mean square in a band, more or less.
_ROUNDING = 1e-17


@dataclass(frozen=True)
class EnergySpectrum:
    """Mean square against frequency, on a logarithmic grid that serves every fraction and weighting.

    Attributes
    ----------
    first : int
        Number of the first node; node j lies at 1000 Hz x G^(j / 1536).
    nodes : ndarray, shape (channels, nodes)
        Mean square that falls to each node. Not a density to look at: a quadrature for smooth weights.
    mean_square : ndarray, shape (channels,)
        Of all samples, the constant part included.
    mean : ndarray, shape (channels,)
        The constant part.
    n_samples, sampling_rate
        Of the record.
    inner : ndarray, shape (channels, nodes), optional
        The same as `nodes` without the two ends of the record; see `between_ends`.
    independent : float
        Samples of a record without a fade whose levels scatter as those of `inner`.
    cut : mapping of str to ndarray, shape (channels,), optional
        What the record's two cuts have in the mean squares behind A, B and C.
    """

    first: int
    nodes: NDArray[np.float64]
    mean_square: NDArray[np.float64]
    mean: NDArray[np.float64]
    n_samples: int
    sampling_rate: float
    inner: NDArray[np.float64] | None = None
    independent: float = 0.0
    cut: Mapping[Weighting, NDArray[np.float64]] = field(default_factory=dict)

    def between_ends(self) -> EnergySpectrum:
        """The energy spectrum of the record without what its two ends do to filters.

        Of the record faded in and out (see `specan.dsp.record_ends.Fade`), scaled so that a steady signal keeps its
        level, and that what begins and ends inside the record keeps its energy: by the ratio of the A-weighted mean
        squares without and with the fade (drift has no part in them), but by no more than the time that the fade
        takes away.
        """
        return self if self.inner is None else replace(self, nodes=self.inner)

    @property
    def frequencies(self) -> NDArray[np.float64]:
        """Frequencies of the nodes in Hz."""
        return node_frequencies(self.first, self.nodes.shape[1])

    def weights(self, weighting: Weighting) -> NDArray[np.float64]:
        """A frequency weighting of mean squares at the nodes."""
        return node_weights(self.first, self.nodes.shape[1], weighting)

    def weighted(self, weighting: Weighting) -> NDArray[np.float64]:
        """Mean square behind a frequency weighting, shape (channels,)."""
        whole = np.add.reduce(self.nodes * self.weights(weighting), axis=1)
        # Rounding may leave less than nothing of a record that is all cut.
        return np.maximum(whole - self.cut[weighting], 0.0) if weighting in self.cut else whole

    @property
    def alternating_mean_square(self) -> NDArray[np.float64]:
        """Mean square about the mean, shape (channels,)."""
        return np.maximum(self.mean_square - np.square(self.mean), 0.0)

    def through(
        self, power_response: Callable[[NDArray[np.float64]], NDArray[np.float64]]
    ) -> NDArray[np.float64]:
        """Mean square of each channel behind a filter of the given |H(f)|^2, f in Hz.

        Exact for responses that are smooth on the scale of a 1/24 octave band.
        """
        return np.add.reduce(self.nodes * power_response(self.frequencies), axis=1)

    def band_mean_square(
        self, division: Bands, weights: NDArray[np.float64] | None = None
    ) -> NDArray[np.float64]:
        """Energy at the output of each band filter over the record's length, shape (channels, bands).

        Parameters
        ----------
        division : Bands
        weights : ndarray, shape (nodes,) or (channels, nodes), optional
            Factors on the mean square at `frequencies`: a frequency weighting.

        Notes
        -----
        What is below 1e-17 of the whole mean square is rounding noise and given as zero.
        """
        nodes = self.nodes if weights is None else self.nodes * weights
        result = np.empty((nodes.shape[0], len(division)))
        places, beyond = nearest_nodes(division.mid)
        for column, (mid, offset) in enumerate(
            zip((places - self.first).tolist(), beyond.tolist(), strict=True)
        ):
            centre, response = _tabulated_response(float(division.designator[column]), offset)
            low, high = max(mid - centre, 0), min(mid + centre + 1, nodes.shape[1])
            part = response[low - mid + centre : high - mid + centre]
            result[:, column] = np.add.reduce(nodes[:, low:high] * part, axis=1)
        floor = _ROUNDING * np.add.reduce(np.abs(nodes), axis=1, keepdims=True)
        return np.where(result < floor, 0.0, result)


class BandEnergy:
    """Collects the energy spectrum of a record from the blocks of a `MultirateTransform`.

    The energy that a filter lets through over a whole record, ring-out included, is by Parseval's theorem
    the sum of |X|^2 |H|^2 over one zero-padded transform of the record. This is that sum from blocks of
    bounded length: see `LagSpectrum`. The stages share the frequencies by a smooth cross-over.

    Parameters
    ----------
    rows : int
        Number of channels.
    sampling_rate : float
        In Hz.
    n_samples : int, optional
        Length of the record; without it there is no spectrum between its ends.
    """

    def __init__(self, rows: int, sampling_rate: float, n_samples: int | None = None) -> None:
        self.sampling_rate = sampling_rate
        self._rows = rows
        self._fade = None if n_samples is None else Fade.of(n_samples, sampling_rate)
        self._ends = None if self._fade is None else RecordEnds(rows, self._fade)
        self._count = 0
        self._sum = np.zeros(rows)
        self._spectra: dict[Stage, LagSpectrum] = {}
        self._buffers, self._padded = working_memory(rows, LENGTH), PaddedTransform(rows)
        self._first, count = node_range(sampling_rate)
        self._nodes, self._energy = np.zeros((rows, count)), np.zeros(rows)
        self._inner = np.zeros_like(self._nodes) if self._fade else None

    def take(
        self,
        stage: Stage,
        rows: slice,
        block: NDArray[np.float64],
        transform: NDArray[np.complex128],
        half: int,
    ) -> None:
        """See some rows of the next block of a stage; see `specan.dsp.multirate.Consumer`."""
        if stage.number == 0:
            self._count += block.shape[1] if rows.start == 0 else 0
            self._sum[rows] += transform[:, 0].real
        if stage not in self._spectra:  # lower rates have few blocks, and what they hold counts as much
            self._spectra[stage] = LagSpectrum(
                self._rows,
                LENGTH,
                self._buffers,
                sparing=stage.number > 0,
                at_ends=partial(self._add_end, stage),
            )
        taken = end = None
        if self._ends is not None:
            taken = self._ends.of(stage, rows, block)
            end = None if taken is None else self._padded(taken, half)
            if not stage.last:
                self._ends.decimate(stage, rows, end, half)
        spectrum = self._spectra[stage]
        spectrum.add(rows, block, transform, half, taken, end)
        if spectrum.closed:
            self._read(stage)

    def _read(self, stage: Stage) -> None:
        """Bring a stage's lines to the nodes, and let go of them: those of all stages together are large."""
        spectrum, place = self._spectra.pop(stage), _spread(stage, self._first)
        for rows in few_rows(self._rows):
            lines = spectrum.energy(rows)
            if stage.number == 0:
                self._energy[rows] = total_energy(lines)
            place.add(self._nodes[rows], lines)
            if self._inner is not None:
                place.add(self._inner[rows], lines)

    def _add_end(self, stage: Stage, rows: slice, energy: NDArray[np.float64]) -> None:
        assert self._inner is not None
        _spread(stage, self._first).add(self._inner[rows], energy)

    def result(self) -> EnergySpectrum:
        """The energy spectrum; call it once, after the transform is finished."""
        for stage in list(self._spectra):
            self._read(stage)
        return _found(
            self._first,
            self._nodes,
            self._inner,
            self._energy,
            self._sum,
            self._count,
            self.sampling_rate,
            self._fade,
        )


def energy_of_short(
    samples: NDArray[np.float64], sampling_rate: float, n_samples: int, fraction: int = 24
) -> EnergySpectrum:
    """What `BandEnergy` finds in all samples of a record of `n_samples`, at once; see `short_record.add_energy`."""
    first, count = node_range(sampling_rate)
    fade = Fade.of(n_samples, sampling_rate)
    rows, n = samples.shape
    nodes = np.zeros((2 * rows, count))
    energy = add_energy(nodes[:rows], samples, sampling_rate, first, fraction)
    add_energy(nodes[rows:], samples, sampling_rate, first, fraction, fade.weights(0, n))
    total = np.add.reduce(samples, axis=1)
    return _found(first, nodes[:rows], nodes[rows:], energy, total, n, sampling_rate, fade)


def _found(
    first: int,
    nodes: NDArray[np.float64],
    inner: NDArray[np.float64] | None,
    energy: NDArray[np.float64],
    total: NDArray[np.float64],
    count: int,
    sampling_rate: float,
    fade: Fade | None,
) -> EnergySpectrum:
    """Sums over a record as means, the record between its ends scaled."""
    n = max(count, 1)
    found = EnergySpectrum(first, nodes / n, energy / n, total / n, count, sampling_rate)
    if inner is None or fade is None:
        return found
    inner *= (_scale(nodes, inner, found.weights("A"), fade) / n)[:, None]
    return replace(found, inner=inner, independent=fade.independent)


def _scale(
    nodes: NDArray[np.float64], faded: NDArray[np.float64], sound: NDArray[np.float64], fade: Fade
) -> NDArray[np.float64]:
    """Factors on the energy spectrum of the faded record; see `EnergySpectrum.between_ends`.

    `sound` is the A weighting of the nodes.
    """
    most = fade.n_samples / fade.averaged
    whole, inside = (np.add.reduce(each * sound, axis=1) for each in (nodes, faded))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(whole > 0.0, np.clip(whole / inside, 1.0, most), most)


class BandEnergyAccumulator:
    """Takes a record in consecutive blocks and gives the energy in any band and behind any weighting.

    No result depends on the size of the blocks given, or on how many channels are done at once.

    Parameters
    ----------
    rows : int
        Number of channels.
    sampling_rate : float
        In Hz.
    n_samples : int, optional
        Length of the record; without it there is no spectrum between its ends.
    slow : SlowPart, optional
        A constant part that is taken off, and a drift that no band has.
    weighted : sequence of bool
        Of which channels the mean squares behind A, B and C are wanted without what the cuts of the record have in
        them.

    Examples
    --------
    >>> t = np.arange(48000) / 48000
    >>> energy = BandEnergyAccumulator(1, 48000.0)
    >>> energy.add(np.sin(2 * np.pi * 1000 * t)[None])
    >>> energy.result().band_mean_square(Bands.between(3, 1000.0, 1000.0)).round(3).tolist()
    [[0.5]]
    """

    def __init__(
        self,
        rows: int,
        sampling_rate: float,
        n_samples: int | None = None,
        slow: SlowPart | None = None,
        *,
        weighted: Sequence[bool] = (),
    ) -> None:
        self._rate, self._n_samples = sampling_rate, n_samples
        self._slow, self._taken = slow, 0
        self._weighted = np.array(weighted, dtype=np.bool_)
        self._cut = CutEnergy(sampling_rate) if self._weighted.any() else None
        self._short: list[NDArray[np.float64]] | None = None
        if n_samples is not None and n_samples <= LONGEST:
            self._short = []
            return
        self._energy = BandEnergy(rows, sampling_rate, n_samples)
        self._transform = MultirateTransform(rows, sampling_rate, self._energy)

    def add(self, samples: NDArray[np.float64]) -> None:
        """Take the next samples, shape (channels, n), n of any size."""
        if self._slow is not None:
            samples = samples - self._slow.constant[:, None]
            drift = self._slow.drift(self._taken, samples.shape[1])
            samples = samples if drift is None else samples - drift
            self._taken += samples.shape[1]
        if self._cut is not None:
            self._cut.add(samples[self._weighted])
        if self._short is None:
            self._transform.add(samples)
        else:
            self._short.append(samples)

    def result(self, fraction: int = 24) -> EnergySpectrum:
        """The energy spectrum for bands of 1/`fraction` octave and wider; call it once, after the last samples."""
        if self._short is None or self._n_samples is None:
            self._transform.finish()
            found = self._energy.result()
        else:
            samples = self._short[0] if len(self._short) == 1 else np.concatenate(self._short, axis=1)
            self._short = []
            found = energy_of_short(samples, self._rate, self._n_samples, fraction)
        n = max(found.n_samples, 1)
        if self._slow is not None:  # a drift is in no band, but in the mean square of all
            found = replace(
                found,
                mean_square=found.mean_square + self._slow.square / n,
                mean=found.mean + self._slow.total / n,
            )
        cut = {}
        for name, energy in {} if self._cut is None else self._cut.result().items():
            cut[name] = np.zeros(self._weighted.size)
            cut[name][self._weighted] = energy / n
        return replace(found, cut=cut)


@lru_cache(maxsize=8)
def _spread(stage: Stage, first: int) -> Spread:
    return Spread(first, share_of_lines(stage, 2 * LENGTH), stage.rate / (2 * LENGTH))


@lru_cache(maxsize=64)
def _tabulated_response(fraction: float, beyond: float) -> tuple[int, NDArray[np.float64]]:
    """|H|^2 at the nodes around the one nearest to a band's middle, as far as it exceeds `_NOTHING`, and its place."""
    per_node = math.log(bands.OCTAVE_RATIO) / NODES_PER_OCTAVE
    reach = math.asinh(math.sinh(bands.filter_half_width(fraction)) * _NOTHING ** (-0.5 / bands.FILTER_ORDER))
    centre = math.ceil(reach / per_node)
    return centre, bands.power_response((np.arange(-centre, centre + 1) - beyond) * per_node, fraction)
