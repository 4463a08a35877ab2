"""Energy in bands and behind frequency weightings, exact, in one pass over a record of any length."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from specan.arrays import Complex, Real
from specan.dsp import bands
from specan.dsp.bands import OCTAVE_RATIO, REFERENCE_FREQUENCY, Bands
from specan.dsp.multirate import (
    FACTOR,
    LENGTH,
    LOWEST_PART,
    ROWS,
    Decimator,
    Stage,
    fast_length,
    keep_freed_memory,
    stages_of,
    thinned,
)
from specan.dsp.overlapped_blocks import OverlappedBlocks
from specan.dsp.record_edges import CutEnergy, Fade, SlowPart
from specan.dsp.weighting import Weighting, power_weighting
from specan.dsp.windows import falling_step

# 64 to a 1/24 octave: cubic interpolation of |H|^2 between them is good to 0.0005 dB on the steepest skirt.
NODES_PER_OCTAVE = 1536

# Of a place, as computed.
_OF_A_PLACE = 1e-6

# In Hz; what lies below is in no band and behind no weighting.
LOWEST_NODE = 0.1


def node_range(sampling_rate: float) -> tuple[int, int]:
    """Number of the first node, and how many there are up to half the sampling rate.

    Node j lies at 1000 Hz x G^(j / 1536).
    """
    first = math.floor(_place(LOWEST_NODE)) - 2
    last = math.ceil(_place(sampling_rate / 2.0)) + 2
    return first, max(last - first + 1, 0)


@lru_cache(maxsize=8)
def node_frequencies(first: int, count: int) -> Real:
    """Frequencies in Hz of `count` nodes from `first` on; kept for all who ask, not to be written to."""
    found = REFERENCE_FREQUENCY * OCTAVE_RATIO ** ((first + np.arange(count)) / NODES_PER_OCTAVE)
    found.flags.writeable = False
    return np.asarray(found)


@lru_cache(maxsize=16)
def node_weights(first: int, count: int, weighting: Weighting) -> Real:
    """A frequency weighting of mean squares at these nodes; likewise kept."""
    found = power_weighting(node_frequencies(first, count), weighting)
    found.flags.writeable = False
    return found


class Spread:
    """How the lines of an energy spectrum fall to the nodes.

    Each line goes to the four nodes around it with the factors of cubic interpolation: the transpose of
    interpolating a response from the nodes to the lines, so that sums over nodes are sums over lines.

    Parameters
    ----------
    first : int
        Number of the first node.
    share : ndarray, shape (lines,)
        Factor on each line; the lines with a factor are contiguous.
    spacing : float
        Distance of the lines in Hz; the first lies at 0 Hz.
    """

    def __init__(self, first: int, share: Real, spacing: float) -> None:
        used = np.flatnonzero((share > 0.0) & (np.arange(share.size) * spacing >= LOWEST_NODE))
        self._lines = slice(int(used[0]), int(used[-1]) + 1) if used.size else None
        if self._lines is None:
            return
        node, factors = _neighbours(self._lines.start, self._lines.stop, spacing)
        self._factors = factors * share[self._lines]
        self._node, self._first = node - node[0], int(node[0]) - first
        self._count = int(self._node[-1]) + 1

    def add(self, nodes: Real, energy: Real) -> None:
        """Add lines, shape (channels, lines), to the nodes, shape (channels, nodes), in place."""
        if self._lines is None:
            return
        # One row at a time, in memory that is used again: it stays in the cache.
        shared = np.empty(self._node.size)
        for row, lines in zip(nodes, energy[:, self._lines], strict=True):
            for first, factor in enumerate(self._factors, self._first - 1):
                np.multiply(lines, factor, out=shared)
                row[first : first + self._count] += np.bincount(self._node, shared, self._count)


def _neighbours(low: int, high: int, spacing: float) -> tuple[NDArray[np.int64], Real]:
    """The second of the four neighbours of each line, and the factors of all four."""
    place = _place(np.arange(low, high) * spacing)
    node = np.floor(place).astype(np.int64)
    s = place - node
    factors = np.stack(
        [
            -s * (s - 1.0) * (s - 2.0) / 6.0,
            (s + 1.0) * (s - 1.0) * (s - 2.0) / 2.0,
            -(s + 1.0) * s * (s - 2.0) / 2.0,
            (s + 1.0) * s * (s - 1.0) / 6.0,
        ]
    )
    return node, factors


def _place(frequency: ArrayLike) -> Real:
    """Place of a frequency on the grid, in nodes from 1 kHz."""
    return np.asarray(
        NODES_PER_OCTAVE * np.log(np.asarray(frequency) / REFERENCE_FREQUENCY) / math.log(OCTAVE_RATIO)
    )


_UNTOUCHED = 0.75  # of a block: lags up to here keep their full weight


class LagSpectrum:
    """Energy spectrum of consecutive blocks, exact but for what is further apart than a block.

    The autocorrelation r(k) = sum_t x(t) x(t + k) of a record that is split into blocks x_b of L samples
    is, for 0 <= k <= L, a sum over each block and its successor alone; with X_b the transform over 2 L
    samples (Rader, IEEE Trans. Audio Electroacoust. 18 (1970) 439),

        R(f) = sum_b conj(X_b) (X_b + X_{b+1}),    r(k) = irfft(R)(k), 0 <= k <= L.

    No window touches the samples, so a tone does not leak from its band however the blocks fall. r is
    exact up to lag L; it is faded out between 3/4 L and L, and its transform is the energy spectrum
    seen through a kernel of width 1/L whose side lobes vanish. The energy behind a filter |H(f)|^2 is
    sum |H|^2 S: exact, as long as the autocorrelation of H dies out within 3/4 L.

    Parameters
    ----------
    rows : int
        Number of channels.
    length : int
        L, an even number of samples.

    Examples
    --------
    >>> x = np.array([[1.0, 2.0, 0.0, -1.0]])
    >>> spectrum = LagSpectrum(1, 4)
    >>> spectrum.add(np.fft.rfft(x, 8))
    >>> float(spectrum.finish()[0][0, 0].round(9)), float(x.sum()) ** 2
    (4.0, 4.0)
    """

    def __init__(self, rows: int, length: int = LENGTH) -> None:
        self.length, self._sum = length, np.zeros((rows, length + 1), dtype=complex)
        # Transforms of the previous block, and of what a fade takes away from it.
        self._previous: Complex | None = None
        self._end: Complex | None = None

    def add(self, transform: Complex, end: Complex | None = None) -> Real | None:
        """Take the next block; what `finish` is more for a record that is faded here.

        `transform` is that of 2 L samples, shape (rows, L + 1), of which the block fills a half, and `end` that of what
        a fade takes away from it. Successive blocks are in alternate halves of the 2 L samples. That puts X_{b+1} after
        X_b without a factor, since the correlation is circular.
        """
        more = None if self._previous is None else self._correlate(transform, end)
        self._previous, self._end = transform, end
        return more

    def _correlate(
        self, following: Complex | None = None, following_end: Complex | None = None
    ) -> Real | None:
        """Add conj(X_b) (X_b + X_{b+1}); what the same of faded blocks is more."""
        previous, end = self._previous, self._end
        assert previous is not None
        both = previous if following is None else previous + following
        product = np.conjugate(previous) * both
        self._sum += product
        if end is None and following_end is None:
            return None
        own = previous if end is None else previous - end
        both = both - sum(one for one in (end, following_end) if one is not None)
        return self._energy_of(np.conjugate(own) * both - product)

    def finish(self) -> tuple[Real, Real | None]:
        """Energy spectrum, shape (rows, L + 1), at m / (2 L) cycles a sample, and what it is more with the last fade.

        The sum over all 2 L lines, divided by 2 L, is the energy. Call it once, after the last block. Rounding leaves
        some 1e-17 of the energy in every band; where there is nothing else a line may be negative.
        """
        more = self._correlate()
        return self._energy_of(self._sum), more

    def _energy_of(self, cross: Complex) -> Real:
        lags = np.fft.irfft(cross)[:, : self.length + 1]
        lags *= _fade(self.length)
        symmetric = np.concatenate([lags, lags[:, -2:0:-1]], axis=1)
        return np.asarray(np.fft.rfft(symmetric).real)


def transformed(samples: Real, points: int, first: int = 0) -> Complex:
    """Transform of so many points, zero but for samples from the number `first` on (faster than padding by rfft)."""
    padded, stop = np.empty((len(samples), points)), first + samples.shape[1]
    padded[:, :first] = padded[:, stop:] = 0.0
    padded[:, first:stop] = samples
    return np.fft.rfft(padded, out=np.empty((len(samples), points // 2 + 1), dtype=complex))


@lru_cache(maxsize=4)
def _fade(length: int) -> Real:
    fade = falling_step(np.arange(length + 1.0), _UNTOUCHED * length, length)
    fade.flags.writeable = False
    return fade


def total_energy(lines: Real) -> Real:
    """Sum over all 2 L lines, divided by 2 L, of an energy spectrum with L + 1 lines."""
    inner = 2.0 * np.add.reduce(lines[:, 1:-1], axis=1)
    return (inner + lines[:, 0] + lines[:, -1]) / (2 * (lines.shape[1] - 1))


# Thinning divides a transform.
_UNIT = 2 * FACTOR

# Samples of a short record. Beyond, a transform of the whole no longer stays in the cache and blocks cost less.
LONGEST = 4 * LENGTH

# The low-pass filter before thinning falls as a Gauss function of time, to 1e-17 after so many thinned samples: its
# step from 0.40 to 0.50 of the rate is erfc(6 x / 0.05), whose slope has the transform exp(-(pi t 0.05 / 6)^2).
_RINGS = 240
# A response, or a part of a line's energy, below this adds nothing: 200 dB.
_NOTHING = 1e-20
# What lies below these parts of the next stage's rate belongs to the next stage; a smooth cross-over between.
CROSS_OVER = (0.28, 0.38)


@lru_cache(maxsize=8)
def _settling(fraction: int) -> int:
    """Samples of a stage after which its narrowest band has fallen by 180 dB: 10 dB in every 1 / B.

    For whole and third octaves the filter rings less long than the low-pass filter and the cross-over, which come on
    top. For finer bands it is the time of 1/24 octaves: with fewer lines, what cubic interpolation between nodes adds
    to them (1e-6 dB) would be another.
    """
    fraction, rings = (3, FACTOR * _RINGS) if fraction <= 3 else (24, 0)
    lower, upper = bands.band_edges(0, fraction)
    return (
        math.ceil(18.0 / (float(upper - lower) / float(bands.mid_frequencies(0, fraction)) * LOWEST_PART))
        + rings
    )


def share_of_lines(stage: Stage, points: int) -> Real:
    """Factor on each line of a transform of `points`: what belongs to the stage, mirrored lines, the time step."""
    over_rate = np.arange(points // 2 + 1) / points
    share = np.full(over_rate.size, 2.0)
    share[[0, -1]] = 1.0
    share *= float(FACTOR) ** stage.number / points
    if stage.number > 0:
        share *= falling_step(over_rate, *CROSS_OVER)
    if not stage.last:
        share *= 1.0 - falling_step(over_rate * FACTOR, *CROSS_OVER)
    return share


def add_energy(
    nodes: Real,
    samples: Real,
    sampling_rate: float,
    first: int,
    fraction: int = 24,
    factors: Real | None = None,
) -> Real:
    """Add the energy of a record to the nodes of a frequency grid, in place; return its whole energy.

    By Parseval's theorem the energy behind a filter is the sum of |X|^2 |H|^2 over the lines of a transform, if that is
    longer than the record by the time in which the filter dies out. Lower rates take the low frequencies, so that the
    time is that of the highest band which is still too narrow for the rate above.

    Parameters
    ----------
    nodes : ndarray, shape (channels, nodes)
        See `specan.dsp.band_energy`; written to.
    samples : ndarray, shape (channels, n)
        Not more than `LONGEST`.
    sampling_rate : float
        In Hz.
    first : int
        Number of the first node.
    fraction : int
        Bandwidth designator of the narrowest bands that will be read from the nodes.
    factors : ndarray, shape (n,), optional
        The samples are multiplied with these.

    Returns
    -------
    ndarray, shape (channels,)
        Sum of the squared samples, from the transform.
    """
    energy = np.empty(samples.shape[0])
    for top in range(0, samples.shape[0], ROWS):
        rows, stream = slice(top, top + ROWS), samples[top : top + ROWS]
        for stage in stages_of(sampling_rate):
            count = stream.shape[1]
            points = _UNIT * fast_length(-(-(count + _settling(fraction)) // _UNIT))
            faded = stream if factors is None or stage.number > 0 else stream * factors
            transform = transformed(faded, points)
            lines = np.square(transform.real)
            lines += np.square(transform.imag)
            if stage.number == 0:
                energy[rows] = total_energy(lines)
            _spread(stage, points, first).add(nodes[rows], lines)
            if not stage.last:
                # With what the low-pass filter rings: the transform is circular, what rings ahead is at the end.
                low = thinned(transform)
                stream = np.concatenate([low[:, -_RINGS:], low[:, : -(-count // FACTOR) + _RINGS]], axis=1)
    return energy


@lru_cache(maxsize=24)
def _spread(stage: Stage, points: int, first: int) -> Spread:
    share = share_of_lines(stage, points)
    share[share < _NOTHING * share.max()] = 0.0
    return Spread(first, share, stage.rate / points)


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
    inner : ndarray, shape (channels, nodes)
        The same as `nodes` without the two ends of the record; see `between_ends`.
    independent : float
        Samples of a record without a fade whose levels scatter as those of `inner`.
    cut : mapping of str to ndarray, shape (channels,), optional
        What the record's two cuts have in the mean squares behind A, B and C.
    """

    first: int
    nodes: Real
    mean_square: Real
    mean: Real
    n_samples: int
    sampling_rate: float
    inner: Real
    independent: float
    cut: Mapping[Weighting, Real] = field(default_factory=dict)

    def between_ends(self) -> EnergySpectrum:
        """The energy spectrum of the record without what its two ends do to filters.

        Of the record faded in and out (see `specan.dsp.record_edges.Fade`), scaled so that a steady signal keeps its
        level, and that what begins and ends inside the record keeps its energy: by the ratio of the A-weighted mean
        squares without and with the fade (drift has no part in them), but by no more than the time that the fade
        takes away.
        """
        return replace(self, nodes=self.inner)

    @property
    def frequencies(self) -> Real:
        """Frequencies of the nodes in Hz."""
        return node_frequencies(self.first, self.nodes.shape[1])

    def weights(self, weighting: Weighting) -> Real:
        """A frequency weighting of mean squares at the nodes."""
        return node_weights(self.first, self.nodes.shape[1], weighting)

    def weighted(self, weighting: Weighting) -> Real:
        """Mean square behind a frequency weighting, shape (channels,)."""
        whole = np.add.reduce(self.nodes * self.weights(weighting), axis=1)
        # Rounding may leave less than nothing of a record that is all cut.
        return np.maximum(whole - self.cut[weighting], 0.0) if weighting in self.cut else whole

    def band_mean_square(self, division: Bands, weights: Real | None = None) -> Real:
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
        place = _place(division.mid)
        nearest = np.rint(place).astype(np.int64)
        beyond = np.where(np.abs(place - nearest) < _OF_A_PLACE, 0.0, place - nearest)  # 0 for octaves
        for column, (mid, offset) in enumerate(
            zip((nearest - self.first).tolist(), beyond.tolist(), strict=True)
        ):
            centre, response = _tabulated_response(float(division.designator[column]), offset)
            low, high = max(mid - centre, 0), min(mid + centre + 1, nodes.shape[1])
            part = response[low - mid + centre : high - mid + centre]
            result[:, column] = np.add.reduce(nodes[:, low:high] * part, axis=1)
        floor = _ROUNDING * np.add.reduce(np.abs(nodes), axis=1, keepdims=True)
        return np.where(result < floor, 0.0, result)


class _AtRate:
    """Some channels of a long record at one of its rates.

    Attributes
    ----------
    gone : list of ndarray, shape (channels, LENGTH / 8), or None
        What a fade takes away from the next samples; None where it is nothing.
    """

    def __init__(self, rows: int, stage: Stage, first: int) -> None:
        self.blocks, self.half = OverlappedBlocks(LENGTH), 0
        self.lags: LagSpectrum | None = LagSpectrum(rows)
        self.place = _spread(stage, 2 * LENGTH, first)
        self.gone: list[Real | None] = []
        self.thinned = None if stage.last else (Decimator(), Decimator())

    def taken(self, count: int) -> Real | None:
        """What is taken away from the next block."""
        size = LENGTH // FACTOR
        mine, self.gone = self.gone[: count // size], self.gone[count // size :]
        some = next((piece for piece in mine if piece is not None), None)
        if some is None:
            return None
        return np.concatenate([np.zeros_like(some) if piece is None else piece for piece in mine], axis=1)


class BandEnergy:
    """Collects the energy spectrum of a few channels of a long record.

    The energy that a filter lets through over a whole record, ring-out included, is by Parseval's theorem
    the sum of |X|^2 |H|^2 over one zero-padded transform of the record. This is that sum from blocks of
    bounded length: see `LagSpectrum`. Lower rates take the low frequencies, with a smooth cross-over; what a fade takes
    away goes the same way, where it is not zero.

    Parameters
    ----------
    sampling_rate : float
        In Hz.
    fade : Fade
        Of the record.
    first : int
        Number of the first node.
    nodes, inner : ndarray, shape (channels, nodes)
        Where the energy of the record goes, and that of the faded record.
    """

    def __init__(
        self,
        sampling_rate: float,
        fade: Fade,
        first: int,
        nodes: Real,
        inner: Real,
    ) -> None:
        self._fade, self._nodes, self._inner = fade, nodes, inner
        self._rates = [_AtRate(len(nodes), stage, first) for stage in stages_of(sampling_rate)]
        self._position = 0
        self.energy, self.total = np.zeros((2, len(nodes)))

    def add(self, samples: Real, number: int = 0) -> None:
        """Take the next samples of a rate, shape (channels, n), n of any size."""
        for block in self._rates[number].blocks.feed(samples):
            self._take(number, block)

    def finish(self) -> None:
        """Take what is left after the last samples, at every rate."""
        for number, at in enumerate(self._rates):
            rest = at.blocks.rest
            if rest is None:
                return
            if rest.shape[1]:
                self._take(number, rest)
            if at.thinned is not None:
                self._pass_on(number + 1, *(thinned.rest for thinned in at.thinned))
            self._read(number)

    def _pass_on(self, number: int, samples: Real | None, gone: Real | None) -> None:
        assert samples is not None
        self._rates[number].gone.append(gone)
        self.add(samples, number)

    def _take(self, number: int, block: Real) -> None:
        at, count = self._rates[number], block.shape[1]
        taken = at.taken(count) if number else None
        if number == 0 and self._fade.touches(self._position, count):
            taken = block * (1.0 - self._fade.weights(self._position, count))
        half, at.half = at.half, 1 - at.half
        place = 2 * LENGTH, half * LENGTH
        lines = transformed(block, *place)
        end = None if taken is None else transformed(taken, *place)
        if number == 0:
            self._position += count
            self.total += lines[:, 0].real
        assert at.lags is not None
        if (more := at.lags.add(lines, end)) is not None:
            at.place.add(self._inner, more)
        if at.thinned is not None:
            self._pass_on(number + 1, at.thinned[0].add(lines, half), at.thinned[1].add(end, half))

    def _read(self, number: int) -> None:
        """Bring the lines of a rate to the nodes, and let go of them: those of all rates together are large."""
        at = self._rates[number]
        assert at.lags is not None
        (lines, more), at.lags = at.lags.finish(), None
        if number == 0:
            self.energy[...] = total_energy(lines)
        at.place.add(self._nodes, lines)
        for part in (lines, more):
            if part is not None:
                at.place.add(self._inner, part)


def _scale(nodes: Real, faded: Real, sound: Real, fade: Fade) -> Real:
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
    n_samples : int
        Length of the record.
    slow : SlowPart, optional
        A constant part that is taken off, and a drift that no band has.
    weighted : sequence of bool
        Of which channels the mean squares behind A, B and C are wanted without what the cuts of the record have in
        them.

    Examples
    --------
    >>> t = np.arange(48000) / 48000
    >>> energy = BandEnergyAccumulator(1, 48000.0, 48000)
    >>> energy.add(np.sin(2 * np.pi * 1000 * t)[None])
    >>> energy.result().band_mean_square(Bands.between(3, 1000.0, 1000.0)).round(3).tolist()
    [[0.5]]
    """

    def __init__(
        self,
        rows: int,
        sampling_rate: float,
        n_samples: int,
        slow: SlowPart | None = None,
        *,
        weighted: Sequence[bool] = (),
    ) -> None:
        self._rate, self._fade = sampling_rate, Fade.of(n_samples, sampling_rate)
        self._slow, self._taken = slow, 0
        self._weighted = np.array(weighted, dtype=np.bool_)
        self._cut = CutEnergy(int(self._weighted.sum()), sampling_rate) if self._weighted.any() else None
        self._first, count = node_range(sampling_rate)
        self._nodes, self._inner = np.zeros((2, rows, count))
        self._short: list[Real] | None = [] if n_samples <= LONGEST else None
        # A few channels at a time: enough to share the twiddle factors, few enough to stay in the cache.
        tops = [] if n_samples <= LONGEST else range(0, rows, ROWS)
        self._groups = [
            (
                group,
                BandEnergy(sampling_rate, self._fade, self._first, self._nodes[group], self._inner[group]),
            )
            for group in (slice(top, top + ROWS) for top in tops)
        ]
        keep_freed_memory()

    def add(self, samples: Real) -> None:
        """Take the next samples, shape (channels, n), n of any size."""
        if self._slow is not None:
            samples = self._slow.off(samples, self._taken)
        self._taken += samples.shape[1]
        if self._cut is not None:
            self._cut.add(samples[self._weighted])
        if self._short is not None:
            self._short.append(samples)
        for group, energy in self._groups:
            energy.add(samples[group])

    def result(self, fraction: int = 24) -> EnergySpectrum:
        """The energy spectrum for bands of 1/`fraction` octave and wider; call it once, after the last samples."""
        nodes, inner, n = self._nodes, self._inner, max(self._taken, 1)
        energy, total = np.zeros((2, len(nodes)))
        if self._short:
            samples = self._short[0] if len(self._short) == 1 else np.concatenate(self._short, axis=1)
            self._short, total = [], np.add.reduce(samples, axis=1)
            energy = add_energy(nodes, samples, self._rate, self._first, fraction)
            factors = self._fade.weights(0, samples.shape[1])
            add_energy(inner, samples, self._rate, self._first, fraction, factors)
        for group, found in self._groups:
            found.finish()
            energy[group], total[group] = found.energy, found.total
        inner *= (_scale(nodes, inner, node_weights(self._first, nodes.shape[1], "A"), self._fade) / n)[
            :, None
        ]
        mean_square, mean = energy / n, total / n
        if self._slow is not None:  # a drift is in no band, but in the mean square of all
            mean_square, mean = mean_square + self._slow.square / n, mean + self._slow.total / n
        cut = {}
        for name, behind in {} if self._cut is None else self._cut.result().items():
            cut[name] = np.zeros(self._weighted.size)
            cut[name][self._weighted] = behind / n
        return EnergySpectrum(
            self._first,
            nodes / n,
            mean_square,
            mean,
            self._taken,
            self._rate,
            inner,
            self._fade.independent,
            cut,
        )


@lru_cache(maxsize=64)
def _tabulated_response(fraction: float, beyond: float) -> tuple[int, Real]:
    """|H|^2 at the nodes around the one nearest to a band's middle, as far as it exceeds `_NOTHING`, and its place."""
    per_node = math.log(bands.OCTAVE_RATIO) / NODES_PER_OCTAVE
    reach = math.asinh(math.sinh(bands.filter_half_width(fraction)) * _NOTHING ** (-0.5 / bands.FILTER_ORDER))
    centre = math.ceil(reach / per_node)
    return centre, bands.power_response((np.arange(-centre, centre + 1) - beyond) * per_node, fraction)
