"""Spectra and H1 are those of scipy.signal.welch and csd, to rounding."""

import numpy as np
import pytest
from scipy import signal

from specan.dsp.transfer_function import estimate
from specan.dsp.welch import CrossSpectra

RATE = 51200.0


@pytest.mark.parametrize("block", [8192, 1000, 1001])
@pytest.mark.parametrize("overlap", [0.5, 0.75])
def test_h1_h2_and_coherence(block, overlap):
    rng = np.random.default_rng(1)
    x = rng.standard_normal(60000) + 3.0
    y = signal.lfilter([0.3, 0.2], [1, -0.6], x) + 0.3 * rng.standard_normal(60000)
    spectra = CrossSpectra(RATE, block, "hann", overlap, n_channels=2, references=[0])
    spectra.add(np.stack([x, y]))
    found = spectra.result()
    options = {"fs": RATE, "window": "hann", "nperseg": block, "noverlap": block - spectra.hop}
    f, xx = signal.welch(x, **options)
    yy, xy = signal.welch(y, **options)[1], signal.csd(x, y, **options)[1]
    inside = slice(1, None)  # the line at 0 Hz holds what is left of the mean
    np.testing.assert_allclose(found.frequency_hz, f, rtol=1e-14)
    np.testing.assert_allclose(found.auto[:, inside], np.stack([xx, yy])[:, inside], rtol=1e-12)
    h = estimate("H1", found.auto[0], found.auto[1], found.cross[0, 1], found.n_effective)
    np.testing.assert_allclose(h.response[inside], (xy / xx)[inside], rtol=1e-12)
    h2 = estimate("H2", found.auto[0], found.auto[1], found.cross[0, 1], found.n_effective).response
    np.testing.assert_allclose(h2[inside], (yy / np.conj(xy))[inside], rtol=1e-12)
    coherence = signal.coherence(x, y, **options)[1]
    np.testing.assert_allclose(h.coherence[inside], coherence[inside], rtol=1e-12)
