"""Bias of a transfer function whose response outlasts the block: how large it is, line by line.

See docs/decisions/leakage.md.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from specan.arrays import Complex, Real
from specan.dsp.windows import WindowName, window_correlation

# Lines of a section whose lags are looked at together, per line of the block that is judged: 1/64 of a block
# is the finest lag that is distinguished, where a Hann window costs 0.16 %.
SECTION_LINES = 64
# Lags before and after the aligned arrival, in blocks of the spectrum at hand; a response has hardly anything
# before its arrival.
_BEFORE = 0.25
# Below this value of the window's correlation a lag is lost in rounding and noise.
_LEAST_CORRELATION = 0.15
# Times the noise that the mean of about five lags and sections must exceed: chance does so in 2 of 100 cases
# (chi-square of 10 degrees of freedom).
_ABOVE_NOISE = 3.0
# The same for longer blocks: their noise is that of fewer averages and, at lags beyond a short block, counts
# wholly. What chance brings is then up to ten times as large as the noise of the short blocks lets it be; it
# is one to two orders of magnitude rarer at 4 than at 3.
_ABOVE_NOISE_OF_LONGER = 4.0


def leakage_bias(response: Complex, variance: Real, window_name: WindowName, ratio: int = 1) -> Complex:
    """What blocks take from each line of a transfer function: its expectation minus the response, negated.

    White noise through a response h, cut into blocks with a window of the correlation rho, gives

        E H1(f) = sum over lags of rho(lag / block) h(lag) exp(-j 2 pi f lag)

    (Bendat and Piersol, Random Data, section 11.2; the sum over lags of the cross correlation). H1 is thus smoothed
    over lines: a reverberant tail, an echo and the peak of a resonance are lost in part. What is lost,
    the sum of (1 - rho) h, follows from the estimate itself where rho is not too small: the spectrum is cut into
    overlapping sections of lines, each is transformed to lags, what does not rise above the noise is left out, the
    rest is weighted by (1 - rho) / rho and transformed back.

    Parameters
    ----------
    response : complex array (..., n)
        Estimate on consecutive lines, aligned: its arrival is at lag zero. Lines that are not finite count as zero.
    variance : array (..., n)
        Mean square of the random error of each line, both components together.
    window_name : str
    ratio : int
        How many of the blocks that are judged the block of `response` holds. With 1 the estimate is judged from
        itself, and what is later than 0.6 of a block is hardly seen.

    Returns
    -------
    complex array (..., n)
        To be added to an estimate with the shorter blocks, on the lines of `response`.

    Examples
    --------
    An echo of 0.5, 0.3 of a block late, is seen with rho(0.3) = 0.546 of its strength:

    >>> late = np.exp(-2j * np.pi * np.arange(400) * 0.3)
    >>> lost = leakage_bias(1 + 0.5 * 0.546 * late, np.full(400, 1e-8), "hann")
    >>> float(np.round(np.median(abs(lost)), 2)), round(0.5 * (1 - 0.546), 2)
    (0.23, 0.23)
    """
    n = response.shape[-1]
    size = min(SECTION_LINES * ratio, 1 << (n.bit_length() - 1))
    hop, bell = size // 2, 0.5 - 0.5 * np.cos(2 * np.pi * (np.arange(size) + 0.5) / size)
    lost = _lost_of_seen(size, ratio, window_name)
    count = -(-n // hop) + 1  # each line lies in two sections
    sections = _cut(_finite(response), size, hop, count)
    noise = _cut(_finite(variance), size, hop, count)
    lags = np.fft.ifft(sections * bell, axis=-1)
    floor = np.mean(noise * bell**2, axis=-1, keepdims=True) / size
    energy = _neighbours(_neighbours(lags.real**2 + lags.imag**2, -1, circular=True), -2, circular=False)
    threshold = _ABOVE_NOISE if ratio == 1 else _ABOVE_NOISE_OF_LONGER
    with np.errstate(divide="ignore", invalid="ignore"):
        above = np.sqrt(np.nan_to_num(np.maximum(1 - threshold * floor / energy, 0.0)))
    back = np.fft.fft(lags * above * lost, axis=-1)
    found = np.zeros((*response.shape[:-1], count + 1, hop), dtype=complex)
    found[..., :-1, :] = back[..., :hop]
    found[..., 1:, :] += back[..., hop:]
    return found.reshape(*response.shape[:-1], -1)[..., hop : hop + n]


def _finite(values: NDArray) -> NDArray:
    finite = np.isfinite(values)
    return values if finite.all() else np.where(finite, values, 0.0)


@lru_cache(maxsize=16)
def _lost_of_seen(size: int, ratio: int, window_name: WindowName) -> Real:
    """(1 - rho) / rho of each lag: what the judged blocks lose, over what is seen of it."""
    lag = np.arange(size) / size
    lag = np.where(lag < 1 - _BEFORE, lag, lag - 1)
    seen = np.maximum(window_correlation(window_name, lag), _LEAST_CORRELATION)
    return np.asarray((1 - window_correlation(window_name, lag * ratio)) / seen)


def _cut(values: NDArray, size: int, hop: int, count: int) -> NDArray:
    """Sections (..., count, size), the first and the last half beyond the ends.

    Below line 1 stand the conjugates of the lines above: the response is real. Beyond the last line the same is done,
    turned so that it goes on from there: a conjugate mirror image keeps the lags.
    """
    n = values.shape[-1]
    below = np.conj(values[..., : hop - 1][..., ::-1])
    past = (count + 1) * hop - hop - n
    phase = np.exp(2j * np.angle(values[..., -1:])) if np.iscomplexobj(values) else 1.0
    above = np.conj(values[..., n - 1 - past : n - 1][..., ::-1]) * phase
    extended = np.concatenate([below, np.real(values[..., :1]), values, above], axis=-1)
    index = hop * np.arange(count)[:, None] + np.arange(size)
    return extended[..., index]


def _neighbours(values: Real, axis: int, *, circular: bool) -> Real:
    """Means over a value (half) and its two neighbours (a quarter each)."""
    along = np.moveaxis(values, axis, -1)
    ends = (-1, 0) if circular else (0, -1)
    before, after = (along[..., end, None] for end in ends)
    wide = np.concatenate([before, along, after], axis=-1)
    return np.moveaxis((2 * along + wide[..., :-2] + wide[..., 2:]) / 4, -1, axis)
