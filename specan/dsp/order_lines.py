"""Complex amplitudes of given orders in a record at equal steps of angle, with their uncertainty."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from specan.errors import InputError

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

APART = 4.0  # line widths 1/turns between orders from which on a Hann window keeps them from each other
_NEAR, _NEAREST, _LINES = (
    2.0,
    3,
    24,
)  # bins about a given order that are not noise; first and number of those that are
MOST_TURNS = 60  # longest common period that is looked for
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

    The weight is a Hann window over the whole record where the orders lie four line widths or more apart, so that other
    lines do not leak in; otherwise all samples weigh the same. The noise of a line is the median of the power in
    the nearest lines of the record's Hann spectrum that belong to no given order, over ln 2 (power of gaussian noise is
    exponentially distributed).

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
    whole = _transform(x * _hann(x.shape[1]) if smooth else x, per_turn, given)
    gram = _gram(given, x.shape[1], per_turn, smooth)
    parts = np.linalg.solve(gram, np.concatenate([whole.real, -whole.imag], axis=1).T)
    found = (parts[: given.size] - 1j * parts[given.size :]).T
    noise = _noise(x, found, given, per_turn)
    period = common_period(given.tolist())
    scatter = _scatter(x, per_turn, given, period)
    turned = np.exp(-2j * np.pi * given * first_turn)
    gain = _spread(gram, given.size)
    return Lines(found * turned, noise * gain, scatter, period)


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


def _hann(n: int) -> Real:
    return 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(n) / n)


def _transform(x: Real, per_turn: int, orders: Real) -> Complex:
    """Sum of x exp(-2j pi o u) over the record, (channels, orders)."""
    return _by_turn(x, per_turn, orders).sum(axis=1)


def _by_turn(x: Real, per_turn: int, orders: Real) -> Complex:
    """The same for each turn, (channels, turns, orders)."""
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


def _noise(x: Real, amplitude: Complex, orders: Real, per_turn: int) -> Real:
    """Standard deviation of one component of a line's amplitude, (channels, orders)."""
    n = x.shape[1]
    turns = n // per_turn
    spectra = np.fft.rfft(x * _hann(n))
    last = spectra.shape[1] - 1
    found = np.full(amplitude.shape, np.nan)
    for k, order in enumerate(orders):
        bins = _quiet_bins(order, orders, turns, last)
        if bins.size < 6:
            continue
        b = bins / turns
        lines = 0.5 * amplitude @ _kernel(orders[:, None] - b[None, :], n, per_turn, True)
        images = 0.5 * amplitude.conj() @ _kernel(-orders[:, None] - b[None, :], n, per_turn, True)
        power = np.median(np.abs(spectra[:, bins] - lines - images) ** 2, axis=1) / np.log(2.0)
        # amplitude = 2 Y / sum(w), sum(w) = n / 2; half of the power lies in each component
        found[:, k] = np.sqrt(0.5 * power) * 4.0 / n
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
