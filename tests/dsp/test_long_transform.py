"""Long blocks have the transform of numpy, and a tone has its line."""

import numpy as np
import pytest

from specan.dsp.fft import real_transform


@pytest.mark.parametrize(
    "n", [1 << 18, 3_072_00 * 2, 2 * 3 * 5 * 7 * 11 * 13 * 17, 262_144 + 2, 300_001, 2 * 262_147]
)
def test_it_is_the_transform_of_numpy(n: int) -> None:
    samples = np.random.default_rng(n).standard_normal(n)
    expected = np.fft.rfft(samples)
    found = real_transform(samples.copy())
    assert found.shape == expected.shape
    assert np.abs(found - expected).max() < 1e-14 * np.abs(expected).max() * np.log2(n)


def test_a_tone_has_one_line_and_180_db_beside_it() -> None:
    n, line = 600_000, 12_345
    found = np.abs(real_transform(np.cos(2 * np.pi * line * np.arange(n) / n + 1.0)))
    assert found[line] == pytest.approx(n / 2, rel=1e-12)
    found[line] = 0.0
    assert found.max() < 1e-9 * n / 2
