"""What an averaged transfer function makes of a true one: the model is seen through the same windows.

An H1 of short blocks is not H(f): a mode narrower than a line is smeared. The pressure that a model
predicts is the *recorded* reference, filtered by the model over the whole record, then cut, windowed and
averaged like the measurement. All of that is linear in H, so it is a matrix.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, eye_array, vstack

from specan.arrays import Complex, Real
from specan.dsp.welch import hop_of

REACH = 25  # lines to either side from which a window lets energy through: Hann has fallen by 90 dB
NODES_PER_LINE = 4  # for responses that ring for two blocks: 1e-4 of them is left, with 2 it were 2e-3
_ORDER = 8  # points of the Lagrange interpolation between nodes
_LAGRANGE = np.array([np.prod([i - j for j in range(_ORDER) if j != i]) for i in range(_ORDER)], dtype=float)


@dataclass(frozen=True)
class Folding:
    """The matrix from a transfer function at `nodes` to the estimate at the lines.

    Attributes
    ----------
    nodes : array (m,)
        Frequencies in Hz at which the model has to be evaluated.
    matrix : sparse array (lines, m)
    """

    nodes: Real
    matrix: Any

    def __call__(self, response: Complex) -> Complex:
        """Estimate (channels, lines) that a response (channels, m) would give."""
        return np.asarray((self.matrix @ response.T).T)

    @classmethod
    def none(cls, frequency_hz: Real) -> Folding:
        """No windows: the response at the lines themselves."""
        return cls(frequency_hz, eye_array(len(frequency_hz), format="csr"))


def fold(
    reference: Real,
    rate: float,
    block: int,
    start: int,
    lines: NDArray[np.intp],
    instrument: Real | None = None,
) -> Folding:
    """Matrix of the estimate ``sum_b conj(E_b) P_b / sum_b conj(E_b) V_b`` with ``P = H V``.

    Parameters
    ----------
    reference : array (n,)
        Recorded reference v, from the beginning of the record.
    rate : float
        Sampling rate, Hz.
    block, start : int
        Samples of a block, of which each begins in the middle of the one before, and before the first block. What the
        field still remembers of the time before the record has died out by `start`.
    lines : array of int
        Numbers of the lines ``f = i rate / block``.
    instrument : array (n,), optional
        Recorded instrument e of the three-channel estimator; the reference for H1.
    """
    driver, hop = reference if instrument is None else instrument, hop_of(block, 0.5)
    n = len(reference)
    starts = np.arange(start, n - block + 1, hop)
    window = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(block) / block)
    blocks_e = np.stack([np.fft.rfft(window * driver[s : s + block])[lines] for s in starts])
    blocks_v = np.stack([np.fft.rfft(window * reference[s : s + block])[lines] for s in starts])
    power = np.sum(np.conj(blocks_e) * blocks_v, axis=0)
    spectrum = np.fft.rfft(reference)
    per_line = n / block
    first = max(lines[0] - REACH, 0) * NODES_PER_LINE - _ORDER
    numbers = np.arange(max(first, 1), (lines[-1] + REACH) * NODES_PER_LINE + _ORDER + 1)
    made = []
    for row, line in enumerate(lines):
        low = max(1, int(np.ceil((line - REACH) * per_line)))
        k = np.arange(low, min(int((line + REACH) * per_line) + 1, len(spectrum)))
        off = line - k / per_line  # lines, of the periodic Hann window's transform
        beside = _dirichlet(off - 1, block) + _dirichlet(off + 1, block)
        seen = 0.5 * _dirichlet(off, block) - 0.25 * beside
        turned = _sum_over_blocks(k, starts, hop, n, np.conj(blocks_e[:, row]))
        fine = spectrum[k] * seen * turned / (n * power[row])
        between = _interpolation(k / per_line * NODES_PER_LINE, numbers)
        made.append(csr_array(fine[None, :]) @ between)
    return Folding(numbers * rate / (block * NODES_PER_LINE), csr_array(vstack(made)))


def _sum_over_blocks(
    k: NDArray[np.intp], starts: NDArray[np.intp], hop: int, n: int, factors: Complex
) -> Complex:
    """``sum_b factors_b exp(2 pi j k start_b / n)`` by Horner's rule: memory does not grow with the blocks."""
    step = np.exp(2j * np.pi * (k * hop % n) / n)
    total = np.full(len(k), factors[-1])
    for factor in factors[-2::-1]:
        total *= step
        total += factor
    return total * np.exp(2j * np.pi * (k * int(starts[0]) % n) / n)


def _dirichlet(x: Real, block: int) -> Complex:
    whole = np.abs(np.sin(np.pi * x / block)) < 1e-14
    ratio = np.where(whole, block, np.sin(np.pi * x) / np.where(whole, 1.0, np.sin(np.pi * x / block)))
    return np.asarray(np.exp(-1j * np.pi * x * (block - 1) / block) * ratio)


def _interpolation(at: Real, nodes: NDArray[np.intp]) -> Any:
    """Sparse Lagrange interpolation from values at the integers `nodes` to places `at`.

    A causal response only turns one way with frequency. It is interpolated turned back by its middle, where a
    polynomial follows it twice as far.
    """
    inside = np.flatnonzero((at >= nodes[0]) & (at <= nodes[-1]))
    left = np.clip(np.floor(at[inside]).astype(int) - _ORDER // 2 + 1, nodes[0], nodes[-1] - _ORDER + 1)
    x = at[inside] - left
    factors = x[:, None] - np.arange(_ORDER)
    weights = np.ones((len(inside), _ORDER))
    for i in range(1, _ORDER):  # all factors but the own: those before it, and those behind it
        weights[:, i:] *= factors[:, i - 1 : i]
        weights[:, :-i] *= factors[:, _ORDER - i : _ORDER - i + 1]
    weights = weights / _LAGRANGE
    # 0.35: blocks: between nodes a response turns about as quickly as one that comes so late
    turned = np.exp(-2j * np.pi * 0.35 / NODES_PER_LINE * factors)
    weights = weights * turned
    columns = (left - nodes[0])[:, None] + np.arange(_ORDER)
    rows = np.repeat(inside, _ORDER)
    return csr_array((weights.ravel(), (rows, columns.ravel())), shape=(len(at), len(nodes)))
