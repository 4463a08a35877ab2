"""Samples at equal steps of angle, and complex amplitudes of given orders with their uncertainty."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from specan.arrays import Complex, Real
from specan.dsp.windows import window
from specan.errors import InputError

# Line widths 1/turns between orders from which on a Hann window keeps them from each other; a little less than two,
# since orders are rounded.
APART = 2.0 - 1e-6
# Bins about a given order that are not noise; first and number of those that are.
_NEAR, _NEAREST, _LINES = 2.0, 3, 24
MOST_TURNS = 60  # longest common period that is looked for
LOSS_DB = 0.1  # of a line, from which on it is told: twice what a good tacho leaves
MOST_LOSS_DB = 60.0  # that is reckoned with
FEWEST = 8  # pieces of a record that tell how a phase goes
OTHERS = 0.03  # part of a line's lost power that may show in its size: of noise and other lines it is a half
BLOCKS = 8  # blocks of turns from which on their scatter is given


@dataclass(frozen=True)
class Lines:
    """Amplitudes A of ``x(u) = sum Re(A exp(2j pi o u))``, u in turns.

    Attributes
    ----------
    amplitude : complex array (channels, orders)
        Peak amplitudes.
    u : array (channels, orders)
        Standard uncertainty of the real and of the imaginary part, from the lines about each order; NaN where all of
        those are given orders themselves.
    u_scatter : array (channels, orders)
        The same from the scatter of blocks of `period` turns; NaN with fewer than eight blocks.
    period : int or None
        Least number of turns in which every given order is whole.
    """

    amplitude: Complex
    u: Real
    u_scatter: Real
    period: int | None


def common_period(orders: Sequence[float]) -> int | None:
    """Least whole number of turns in which all orders make whole numbers of cycles.

    Examples
    --------
    >>> common_period([66.0, 63.25, 66 + 66 / 21]), common_period([np.pi])
    (28, None)
    """
    given = np.asarray(orders, dtype=float)
    for turns in range(1, MOST_TURNS + 1):
        if np.all(np.abs(given * turns - np.rint(given * turns)) < 1e-6 * turns):
            return turns
    return None


def fit_lines(samples: Real, per_turn: int, orders: Sequence[float], *, first_turn: float = 0.0) -> Lines:
    """Amplitudes of the given orders by weighted least squares.

    The weight is a Hann window over the whole record where the orders lie two line widths or more apart, so that other
    lines do not leak in; otherwise all samples weigh the same. The noise of a line is the median of the power in
    the nearest lines of the record's spectrum, under the same weight, that belong to no given order, over ln 2 (power
    of gaussian noise is exponentially distributed).

    Parameters
    ----------
    samples : array (channels, n)
        A whole number of turns.
    per_turn : int
        Samples a turn.
    orders : sequence of float
        Positive, below half of `per_turn`.
    first_turn : float
        Turn at which the record begins: phases are those at turn zero.

    Raises
    ------
    InputError
        The record is too short to tell two of the orders apart.

    Examples
    --------
    >>> u = np.arange(64 * 40) / 64
    >>> x = 2 * np.cos(2 * np.pi * 3 * u) + np.sin(2 * np.pi * 3.5 * u)
    >>> found = fit_lines(x[None, :], 64, [3.0, 3.5])
    >>> np.abs(found.amplitude).round(6).tolist(), np.degrees(np.angle(found.amplitude)).round(3).tolist()
    ([[2.0, 1.0]], [[0.0, -90.0]])
    """
    given = np.asarray(orders, dtype=float)
    turns = samples.shape[1] // per_turn
    x = np.asarray(samples[:, : turns * per_turn], dtype=float)
    nearest = _check_spacing(given, turns)
    smooth = nearest * turns >= APART
    x = x - x.mean(axis=1, keepdims=True)
    whole = _by_turn(x * window("hann", x.shape[1]) if smooth else x, per_turn, given).sum(axis=1)
    gram = _gram(given, x.shape[1], per_turn, smooth)
    parts = np.linalg.solve(gram, np.concatenate([whole.real, -whole.imag], axis=1).T)
    found = (parts[: given.size] - 1j * parts[given.size :]).T
    noise = _noise(x, found, given, per_turn, smooth)
    period = common_period(given.tolist())
    scatter = _scatter(x, per_turn, given, period)
    turned = np.exp(-2j * np.pi * given * first_turn)
    gain = _spread(gram, given.size)
    return Lines(found * turned, noise * gain, scatter, period)


@dataclass(frozen=True)
class Departure:
    """How the phase of a line departs from the angle that it should follow.

    Attributes
    ----------
    order : float
    loss_dB : float
        By which the line reads low.
    slope : float
        Mean change of the phase, cycles a turn.
    steady : bool
        Whether the slope makes the loss, most of it at least: the angle is right but for a factor.
    """

    order: float
    loss_dB: float
    slope: float
    steady: bool

    def relative_error(self, orders: ArrayLike) -> Real:
        """Part of their reading that lines of other orders lack: the loss in dB goes with the order squared."""
        loss_dB = np.minimum(self.loss_dB * (np.asarray(orders) / self.order) ** 2, MOST_LOSS_DB)
        return np.asarray(10 ** (loss_dB / 20) - 1)


def departure(
    x: Real,
    per_turn: int,
    order: float,
    highest: float,
    sloped: bool = False,
    beside: Sequence[tuple[float, complex]] = (),
) -> Departure | None:
    """Whether a line keeps its phase; None where it does, or where nothing can be told.

    The line's complex amplitude z in pieces of a turn, of half a turn and so on: an angle that is wrong turns its phase
    and leaves its size, mean |z| > |mean z|. Noise and other lines nearby change the size as well: of their power half
    is seen in the size, of the angle's nothing. Lines nearby that are known are taken together with it: the same angle
    turns them all.

    Parameters
    ----------
    x : array (n,)
        Samples at equal angles.
    highest : float
        Order whose loss would be told; it grows with the order squared.
    sloped : bool
        The order is not exactly known: a constant change of its phase is none.
    beside : sequence of (order, complex amplitude)
        Known lines nearby, the line itself included, of which the strongest has an amplitude of about one.

    Examples
    --------
    >>> u = np.arange(64 * 100) / 64
    >>> found = departure(np.cos(2 * np.pi * 10 * 1.0002 * u), 64, 10.0, 10.0)
    >>> round(found.loss_dB, 2), round(found.slope, 6), found.steady
    (0.58, 0.002, True)
    >>> departure(np.cos(2 * np.pi * 10 * u), 64, 10.0, 10.0)
    """
    ways = ([(order, 1.0)], beside) if len(beside) > 1 else ([(order, 1.0)],)
    every = [one for lines in ways for one in _departures(lines, x, per_turn, order, sloped)]
    told = (one for one in every if one.loss_dB > LOSS_DB * (order / highest) ** 2)
    return max(told, key=lambda one: one.loss_dB, default=None)


def _departures(
    lines: Sequence[tuple[float, complex]], x: Real, per_turn: int, order: float, sloped: bool
) -> Iterator[Departure]:
    """By pieces of each length, of lines whose amplitudes have known ratios: given as that of one of them."""
    orders, amplitudes = np.array([o for o, _ in lines]), np.array([a for _, a in lines])
    of_turn = np.exp(2j * np.pi * np.outer(orders, np.arange(-(-x.size // per_turn))))
    in_turn = np.exp(2j * np.pi * np.outer(orders, np.arange(per_turn) / per_turn))
    shape = ((amplitudes[:, None] * of_turn).T @ in_turn).ravel()[: x.size]
    turned, weight = x * np.conj(shape), np.abs(shape) ** 2
    middle = np.sqrt(np.average(orders**2, weights=np.abs(amplitudes) ** 2))
    as_one = (order / middle) ** 2  # the loss in dB goes with the order squared
    for part in (1, 2, 4, 8):
        q = _pieces(weight, per_turn // part)
        if order < part or q.size < FEWEST:
            break
        q /= q.mean()
        z = _pieces(turned, per_turn // part)
        number = np.arange(z.size)
        slope, start = np.polyfit(number, np.unwrap(np.angle(z)), 1)
        level = z * np.exp(-1j * (slope * number + start))
        power, size = np.mean(np.abs(z) ** 2 / np.maximum(q, 1e-12)), np.mean(np.abs(z)) ** 2
        left, levelled = np.abs(z.mean()) ** 2, np.abs(level.mean()) ** 2
        left = max(left, levelled) if sloped else left
        loss_dB = float(as_one * 10 * np.log10(size / max(left, 1e-30 * size))) if size else 0.0
        if loss_dB > 0 and power - size < OTHERS * (power - left):  # it is of the angle
            steady = size < levelled * min(10 ** (LOSS_DB / 10), np.sqrt(size / left))
            cycles = slope / (2 * np.pi) * part * order / middle
            yield Departure(order, loss_dB, float(cycles), bool(steady))


def _pieces(x: NDArray, length: int) -> NDArray:
    """Mean of pieces of so many samples."""
    count = x.size // length
    return x[: count * length].reshape(count, length).mean(axis=1)


def _check_spacing(orders: Real, turns: int) -> float:
    """Least distance of two orders, the mirror image of the lowest about zero included."""
    ordered = np.sort(orders)
    gaps = np.diff(np.concatenate([[0.0], ordered]))
    nearest = float(gaps.min())
    if nearest * turns < 1.0 - 1e-9:
        at = int(np.argmin(gaps))
        low, high = (0.0, *ordered)[at], ordered[at]
        raise InputError(
            f"the orders {low:g} and {high:g} cannot be distinguished in {turns} turns",
            expected=f"at least {1.0 / nearest if nearest else np.inf:.0f} turns",
            remedy="analyse a longer section, or leave one out",
        )
    return nearest


def _by_turn(x: Real, per_turn: int, orders: Real) -> Complex:
    """Sum of x exp(-2j pi o u) over each turn, (channels, turns, orders)."""
    channels, turns = x.shape[0], x.shape[1] // per_turn
    angle = 2 * np.pi * np.outer(np.arange(per_turn) / per_turn, orders)
    cut = x.reshape(channels * turns, per_turn)
    inside = cut @ np.cos(angle) - 1j * (cut @ np.sin(angle))
    late = np.exp(-2j * np.pi * np.outer(np.arange(turns), orders))
    return inside.reshape(channels, turns, -1) * late


def _kernel(order: Real, n: int, per_turn: int, smooth: bool) -> Complex:
    """Sum of w exp(2j pi o u) over the record, for any o."""
    if not smooth:
        return _dirichlet(order / per_turn, n)
    one = 1.0 / n
    f = order / per_turn
    return 0.5 * _dirichlet(f, n) - 0.25 * (_dirichlet(f + one, n) + _dirichlet(f - one, n))


def _dirichlet(f: Real, n: int) -> Complex:
    """Sum of exp(2j pi f k) for k from 0 to n - 1."""
    f = f - np.rint(f)
    near = np.abs(f) < 1e-14
    safe = np.where(near, 0.5, f)
    return np.where(
        near, n, np.exp(1j * np.pi * safe * (n - 1)) * np.sin(np.pi * safe * n) / np.sin(np.pi * safe)
    )


def _gram(orders: Real, n: int, per_turn: int, smooth: bool) -> Real:
    """Products of cosines and sines of the orders under the weight."""
    lesser = _kernel(orders[:, None] - orders[None, :], n, per_turn, smooth)
    larger = _kernel(orders[:, None] + orders[None, :], n, per_turn, smooth)
    cc, ss = 0.5 * (lesser + larger).real, 0.5 * (lesser - larger).real
    cs = 0.5 * (larger - lesser).imag  # sum w cos(i) sin(j)
    return np.block([[cc, cs], [cs.T, ss]])


def _spread(gram: Real, count: int) -> Real:
    """By what the lack of orthogonality of the orders raises the uncertainty."""
    alone = 1.0 / np.diag(gram)
    factor = np.sqrt(np.maximum(np.diag(np.linalg.inv(gram)) / alone, 1.0))
    return np.maximum(factor[:count], factor[count:])


def _noise(x: Real, amplitude: Complex, orders: Real, per_turn: int, smooth: bool) -> Real:
    """Standard deviation of one component of a line's amplitude, (channels, orders)."""
    n = x.shape[1]
    turns = n // per_turn
    spectra = np.fft.rfft(x * window("hann", n) if smooth else x)
    weight = n / 2 if smooth else n
    last = spectra.shape[1] - 1
    found = np.full(amplitude.shape, np.nan)
    for k, order in enumerate(orders):
        bins = _quiet_bins(order, orders, turns, last)
        if bins.size < 6:
            continue
        b = bins / turns
        lines = 0.5 * amplitude @ _kernel(orders[:, None] - b[None, :], n, per_turn, smooth)
        images = 0.5 * amplitude.conj() @ _kernel(-orders[:, None] - b[None, :], n, per_turn, smooth)
        power = np.median(np.abs(spectra[:, bins] - lines - images) ** 2, axis=1) / np.log(2.0)
        # amplitude = 2 Y / sum(w); half of the power lies in each component
        found[:, k] = np.sqrt(0.5 * power) * 2.0 / weight
    return found


def _quiet_bins(order: float, orders: Real, turns: int, last: int) -> NDArray[np.intp]:
    """Lines of the record's spectrum nearest to an order that belong to no given order."""
    middle = round(order * turns)
    reach = np.arange(_NEAREST, _NEAREST + 8 * _LINES)
    bins = np.stack([middle - reach, middle + reach], axis=1).ravel()
    bins = bins[(bins > 1) & (bins < last)]
    apart = np.abs(bins[:, None] - orders[None, :] * turns).min(axis=1, initial=np.inf)
    return bins[apart > _NEAR][:_LINES]


def _scatter(x: Real, per_turn: int, orders: Real, period: int | None) -> Real:
    """Standard error of one component of the mean over blocks of turns."""
    turns = x.shape[1] // per_turn
    nothing = np.full((x.shape[0], orders.size), np.nan)
    if period is None or turns // period < BLOCKS:
        return nothing
    count = turns // period
    each = _by_turn(x[:, : count * period * per_turn], per_turn, orders)
    blocks = each.reshape(x.shape[0], count, period, -1).sum(axis=2) * 2.0 / (period * per_turn)
    deviation = blocks - blocks.mean(axis=1, keepdims=True)
    return np.sqrt(np.sum(np.abs(deviation) ** 2, axis=1) / (2 * (count - 1)) / count)


PASS = 2.56  # samples a turn over the highest order: what lies above it may be aliased, up to it nothing is
ATTENUATION_DB = 100.0  # of what would be aliased into the orders up to the highest one
_FINE = 4096  # steps of the kernel's table between two output samples


def samples_per_turn(max_order: float) -> int:
    """Samples a turn that hold orders up to `max_order`; an even number.

    Examples
    --------
    >>> samples_per_turn(200.0)
    512
    """
    return 2 * math.ceil(PASS * max_order / 2)


def _low_pass() -> tuple[int, Real]:
    """Half length in output samples, and a table of the low-pass kernel from its middle on.

    A sinc under a Kaiser window (Kaiser 1974: beta and length from attenuation and transition width). It passes up to
    1/2.56 of the output rate, and stops what would fold back below that, from 1 - 1/2.56 on.
    """
    edge = 1.0 / PASS
    width = 2 * np.pi * (1.0 - 2.0 * edge)
    length = (ATTENUATION_DB - 8.0) / (2.285 * width)
    half = math.ceil(length / 2)
    beta = 0.1102 * (ATTENUATION_DB - 8.7)
    at = np.arange(half * _FINE + 2) / _FINE
    shape = np.i0(beta * np.sqrt(np.clip(1.0 - (at / half) ** 2, 0.0, 1.0))) / np.i0(beta)
    shape[at >= half] = 0.0
    return half, np.sinc(at) * shape


class AngularResampler:
    """Takes samples at equal steps of time in pieces and gives them at equal steps of angle.

    Output sample k is at the turn ``first_turn + k / per_turn``. It is the sum of the input about it under a
    low-pass kernel that is as wide as the output steps are there (or the input steps, where those are wider), so that
    at low speed nothing is aliased. Up to 1/2.56 of the output rate the band is kept to 0.01 dB.

    Parameters
    ----------
    turns_at : callable
        Turns of the shaft at sample numbers (floats), rising.
    per_turn : int
        Output samples a turn.
    first_turn : float
        Turn of the first output sample.
    count : int
        Output samples in all.
    start : int
        Number of the first input sample.

    Examples
    --------
    >>> speed = 0.01  # turns a sample
    >>> resampler = AngularResampler(lambda n: speed * n, 16, first_turn=5.0, count=160, start=0)
    >>> x = np.cos(2 * np.pi * 3 * speed * np.arange(4000))
    >>> y = np.concatenate([resampler.add(x[None, :2500]), resampler.add(x[None, 2500:])], axis=1)
    >>> truth = np.cos(2 * np.pi * 3 * np.arange(160) / 16)
    >>> y.shape, bool(np.abs(y - truth).max() < 1e-3)
    ((1, 160), True)
    """

    def __init__(
        self,
        turns_at: Callable[[Real], Real],
        per_turn: int,
        *,
        first_turn: float,
        count: int,
        start: int = 0,
    ) -> None:
        self._turns_at, self._per_turn = turns_at, per_turn
        self._first, self._count, self._given = first_turn, count, 0
        self._half, self._table = _low_pass()
        self._turns: Real = np.empty(0)
        self._held: Real | None = None
        self._next = start

    def add(self, samples: Real) -> Real:
        """Take the next samples (channels, m); return what has become ready, (channels, k)."""
        n = samples.shape[1]
        turns = self._turns_at(self._next + np.arange(n, dtype=float))
        self._next += n
        columns = np.ascontiguousarray(samples.T)
        self._held = columns if self._held is None else np.concatenate([self._held, columns])
        self._turns = np.concatenate([self._turns, turns])
        if self._turns.size < 3:
            return np.empty((samples.shape[0], 0))
        step = np.gradient(self._turns)
        ready = self._ready(step)
        if ready <= self._given:
            return np.empty((samples.shape[0], 0))
        found = self._weights(ready, step) @ self._held
        self._given = ready
        self._drop(step)
        return np.ascontiguousarray(found.T)

    def reach(self, speed_per_sample: float) -> float:
        """Turns to either side of an output sample that it is made from."""
        return self._half * max(1.0 / self._per_turn, speed_per_sample)

    def _ready(self, step: Real) -> int:
        """Output samples whose input is complete."""
        last = self._turns[-1] - 1.01 * self.reach(float(step[-64:].max()))
        return int(np.clip(math.floor((last - self._first) * self._per_turn), 0, self._count))

    def _weights(self, ready: int, step: Real):
        from scipy.sparse import csr_array

        at = self._first + np.arange(self._given, ready) / self._per_turn
        place = np.clip(np.searchsorted(self._turns, at), 0, self._turns.size - 1)
        # Width of the kernel's unit in turns: the output step, or the input step where that is wider.
        unit = np.maximum(1.0 / self._per_turn, step[place])
        low = np.searchsorted(self._turns, at - self._half * unit)
        high = np.searchsorted(self._turns, at + self._half * unit)
        counts = high - low
        rows = np.concatenate([[0], np.cumsum(counts)])
        index = np.arange(rows[-1]) - np.repeat(rows[:-1] - low, counts)
        distance = np.abs(self._turns[index] - np.repeat(at, counts)) * np.repeat(_FINE / unit, counts)
        np.minimum(distance, self._half * _FINE, out=distance)
        cell = distance.astype(np.int32)
        part = distance - cell
        values = self._table[cell]
        values += part * (self._table[cell + 1] - values)
        values *= step[index]
        # The kernel's sum is one but for its ripple; a constant stays exactly what it is.
        total = np.add.reduceat(values, np.minimum(rows[:-1], max(values.size - 1, 0)))
        values /= np.repeat(np.where(counts > 0, total, 1.0), counts)
        return csr_array((values, index, rows), shape=(at.size, self._turns.size))

    def _drop(self, step: Real) -> None:
        """Forget the input that no later output needs."""
        at = self._first + self._given / self._per_turn
        keep = int(np.searchsorted(self._turns, at - 1.5 * self.reach(float(step.max()))))
        keep = max(0, min(keep - 2, self._turns.size - 3))
        if keep > 0 and self._held is not None:
            self._turns, self._held = self._turns[keep:], self._held[keep:]
