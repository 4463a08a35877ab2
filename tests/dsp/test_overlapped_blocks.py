import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from specan.dsp.overlapped_blocks import OverlappedBlocks


@given(
    block=st.integers(1, 12),
    hop=st.integers(1, 12),
    pieces=st.lists(st.integers(0, 30), max_size=8),
    shifts=st.none() | st.lists(st.integers(-7, 7), min_size=2, max_size=2),
)
def test_blocks_do_not_depend_on_the_pieces(block, hop, pieces, shifts):
    hop = min(hop, block)
    samples = np.arange(2.0 * sum(pieces)).reshape(2, -1)
    grid, found, at = OverlappedBlocks(block, hop, shifts), [], 0
    for piece in pieces:
        found += [b.copy() for b in grid.feed(samples[:, at : at + piece])]
        at += piece
    lag = [0, 0] if shifts is None else [s - min(shifts) for s in shifts]
    expected = [
        np.stack([row[start + s : start + s + block] for row, s in zip(samples, lag)])
        for start in range(0, samples.shape[1] - block - max(lag) + 1, hop)
    ]
    assert len(found) == len(expected)
    assert all(np.array_equal(a, b) for a, b in zip(found, expected))


@pytest.mark.parametrize("hop", [0, 5])
def test_hop_has_to_fit(hop):
    with pytest.raises(ValueError, match="hop"):
        OverlappedBlocks(4, hop)
