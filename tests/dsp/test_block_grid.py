"""Blocks come out on the absolute grid, whatever came in."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from specan.dsp.overlapped_blocks import BlockGrid


@given(st.lists(st.integers(0, 30), max_size=20), st.integers(1, 12))
def test_the_grid_does_not_depend_on_what_is_delivered(lengths: list[int], size: int) -> None:
    samples = np.arange(2.0 * sum(lengths)).reshape(2, -1)
    grid, blocks, first = BlockGrid(2, size), [], 0
    for length in lengths:
        blocks += [block.copy() for block in grid.add(samples[:, first : first + length])]
        first += length
    assert all(block.shape == (2, size) for block in blocks)
    assert grid.rest().shape[1] < size
    np.testing.assert_array_equal(np.concatenate([*blocks, grid.rest()], axis=1), samples)
