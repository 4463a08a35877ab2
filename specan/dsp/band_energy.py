"""Energy in bands and behind frequency weightings, exact, in one pass over a record of any length."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache, partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from specan.dsp import bands
from specan.dsp.frequency_nodes import (
    NODES_PER_OCTAVE,
    Spread,
    node_frequencies,
    node_of_band,
    node_range,
    node_weights,
)
from specan.dsp.lag_spectrum import LagSpectrum, total_energy, working_memory
from specan.dsp.multirate import LENGTH, MultirateTransform, PaddedTransform, Stage, few_rows
from specan.dsp.record_ends import Fade, RecordEnds
from specan.dsp.short_record import LONGEST, add_energy, share_of_lines
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
    """

    first: int
    nodes: NDArray[np.float64]
    mean_square: NDArray[np.float64]
    mean: NDArray[np.float64]
    n_samples: int
    sampling_rate: float
    inner: NDArray[np.float64] | None = None
    independent: float = 0.0

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
        self, index: ArrayLike, fraction: int, weights: NDArray[np.float64] | None = None
    ) -> NDArray[np.float64]:
        """Energy at the output of each band filter over the record's length, shape (channels, bands).

        Parameters
        ----------
        index : array_like of int
            Band numbers; see `specan.dsp.bands.mid_frequencies`.
        fraction : int
            1, 3, 6, 12 or 24.
        weights : ndarray, shape (nodes,) or (channels, nodes), optional
            Factors on the mean square at `frequencies`: a frequency weighting.

        Notes
        -----
        What is below 1e-17 of the whole mean square is rounding noise and given as zero.
        """
        index = np.asarray(index)
        nodes = self.nodes if weights is None else self.nodes * weights
        centre, response = _tabulated_response(fraction)
        result = np.empty((nodes.shape[0], index.size))
        for column, mid in enumerate(node_of_band(index, fraction) - self.first):
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
    offset : ndarray, shape (channels,), optional
        A constant part that is taken off.

    Examples
    --------
    >>> t = np.arange(48000) / 48000
    >>> energy = BandEnergyAccumulator(1, 48000.0)
    >>> energy.add(np.sin(2 * np.pi * 1000 * t)[None])
    >>> energy.result().band_mean_square([0], 3).round(3).tolist()
    [[0.5]]
    """

    def __init__(
        self,
        rows: int,
        sampling_rate: float,
        n_samples: int | None = None,
        offset: NDArray[np.float64] | None = None,
    ) -> None:
        self._rate, self._n_samples, self._offset = sampling_rate, n_samples, offset
        self._short: list[NDArray[np.float64]] | None = None
        if n_samples is not None and n_samples <= LONGEST:
            self._short = []
            return
        self._energy = BandEnergy(rows, sampling_rate, n_samples)
        self._transform = MultirateTransform(rows, sampling_rate, self._energy, offset)

    def add(self, samples: NDArray[np.float64]) -> None:
        """Take the next samples, shape (channels, n), n of any size."""
        if self._short is None:
            self._transform.add(samples)
        else:
            self._short.append(samples - (0.0 if self._offset is None else self._offset[:, None]))

    def result(self, fraction: int = 24) -> EnergySpectrum:
        """The energy spectrum for bands of 1/`fraction` octave and wider; call it once, after the last samples."""
        if self._short is None or self._n_samples is None:
            self._transform.finish()
            return self._energy.result()
        samples = self._short[0] if len(self._short) == 1 else np.concatenate(self._short, axis=1)
        self._short = []
        return energy_of_short(samples, self._rate, self._n_samples, fraction)


@lru_cache(maxsize=8)
def _spread(stage: Stage, first: int) -> Spread:
    return Spread(first, share_of_lines(stage, 2 * LENGTH), stage.rate / (2 * LENGTH))


@lru_cache(maxsize=8)
def _tabulated_response(fraction: int) -> tuple[int, NDArray[np.float64]]:
    """|H|^2 at the nodes around a band's own, as far as it exceeds `_NOTHING`, and the centre's place."""
    per_node = math.log(bands.OCTAVE_RATIO) / NODES_PER_OCTAVE
    reach = math.asinh(math.sinh(bands.filter_half_width(fraction)) * _NOTHING ** (-0.5 / bands.FILTER_ORDER))
    centre = math.ceil(reach / per_node)
    return centre, bands.power_response(np.arange(-centre, centre + 1) * per_node, fraction)
