"""Statistics of lines against those of numpy."""

import numpy as np
import pytest

from specan.dsp.statistics import median


@pytest.mark.parametrize("count", [1, 2, 7, 3200])
def test_the_median_is_that_of_numpy(count: int) -> None:
    values = np.random.default_rng(count).standard_normal(count)
    assert median(values) == np.median(values)
    assert median(values > 0.3) == np.median(values > 0.3)
    values[count // 2] = np.nan
    assert np.isnan(median(values))
