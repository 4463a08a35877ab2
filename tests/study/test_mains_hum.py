"""Hum of the mains in a recording, told from modes that lie on its multiples."""

import numpy as np
import pytest
from scipy.signal import lfilter

from specan.study.data.recordings import _hum

RATE = 1600.0


def response(rng, seconds, modes):
    """A random excitation and what modes of given frequency and bandwidth, Hz, make of it, with a little noise."""
    excitation = rng.standard_normal(int(seconds * RATE))
    heard = 1e-3 * rng.standard_normal(excitation.size)
    for hertz, width in modes:
        pole = np.exp((-np.pi * width + 2j * np.pi * hertz) / RATE)
        heard = heard + lfilter([1 - abs(pole)], [1, -2 * pole.real, abs(pole) ** 2], excitation)
    return excitation, heard


def hum(size, hertz, of):
    t = np.arange(size) / RATE
    return of * sum(a * np.cos(2 * np.pi * k * hertz * t + k) for k, a in ((1, 1.0), (2, 0.4), (3, 0.6)))


@pytest.mark.parametrize("mains", [50, 60])
@pytest.mark.parametrize("off", [0.0, 0.02, -0.05])
def test_hum_far_below_the_response_is_heard(mains, off):
    excitation, heard = response(np.random.default_rng(mains), 10.0, [(191.0, 3.0), (245.0, 3.0)])
    level = 0.01 * np.std(heard)
    assert _hum(heard + hum(heard.size, mains + off, level), excitation, RATE) == [mains]
    assert _hum(heard, excitation, RATE) == []


@pytest.mark.parametrize("width", [0.5, 1.0, 3.0])
@pytest.mark.parametrize("seed", range(6))
def test_modes_at_multiples_of_the_mains_are_no_hum(width, seed):
    modes = [(50.0 * k, width) for k in range(1, 5)]
    excitation, heard = response(np.random.default_rng(seed), 12.0, modes)
    assert _hum(heard, excitation, RATE) == []


def test_hum_of_the_source_is_no_hum_of_the_channel():
    rng = np.random.default_rng(4)
    excitation, _ = response(rng, 10.0, [])
    excitation = excitation + hum(excitation.size, 50.0, 0.3)
    heard = lfilter([0.3], [1, -0.7], excitation) + 1e-4 * rng.standard_normal(excitation.size)
    assert _hum(heard, excitation, RATE) == []
