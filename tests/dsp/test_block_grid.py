"""Blocks come out on the absolute grid, whatever came in."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from specan.dsp.overlapped_blocks import OverlappedBlocks


@given(st.lists(st.integers(0, 30), max_size=20), st.integers(1, 12))
def test_the_grid_does_not_depend_on_what_is_delivered(lengths: list[int], size: int) -> None:
    samples = np.arange(2.0 * sum(lengths)).reshape(2, -1)
    grid, blocks, first = OverlappedBlocks(size), [], 0
    for length in lengths:
        blocks += [block.copy() for block in grid.feed(samples[:, first : first + length])]
        first += length
    assert all(block.shape == (2, size) for block in blocks)
    rest = np.empty((2, 0)) if grid.rest is None else grid.rest
    assert rest.shape[1] < size
    np.testing.assert_array_equal(np.concatenate([*blocks, rest], axis=1), samples)
