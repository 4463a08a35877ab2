"""Estimators and their uncertainty, against many simulated measurements."""

import numpy as np
import pytest

from specan.dsp.transfer_function import (
    U_PHASE_UNKNOWN_DEG,
    Instrument,
    arrivals,
    estimate,
    phase_deg,
    smoothed_noise,
    u_phase_deg,
)
from specan.dsp.welch import CrossSpectra

RATE, BLOCK, RUNS = 1000.0, 128, 150
TRUE = 2.0 * np.exp(0.7j)


def filtered(noise):
    """Response of the system H = TRUE at every frequency: gain and phase rotation."""
    spectrum = np.fft.rfft(noise, axis=-1) * TRUE
    spectrum[..., [0, -1]] = 0
    return np.fft.irfft(spectrum, noise.shape[-1], axis=-1)


def simulated(estimator, overlap, noise_in, noise_out, colour=False):
    """Estimates of many independent measurements: relative errors (runs, lines) and stated uncertainties."""
    rng = np.random.default_rng(21)
    n = 30 * BLOCK
    error, stated = [], []
    for _ in range(RUNS):
        drive, m, o = rng.standard_normal((3, n))
        if colour:
            o = np.cumsum(o) * 0.2
        x, y = drive + noise_in * m, filtered(drive) + noise_out * o
        spectra = CrossSpectra(RATE, BLOCK, "hann", overlap, n_channels=3, references=[0, 2])
        spectra.add(np.stack([x, y, drive]))
        s = spectra.result()
        found = estimate(
            estimator,
            s.auto[0],
            s.auto[1:2],
            s.cross[0, 1:2],
            s.n_effective,
            instrument=Instrument(s.auto[2], s.cross[1, 0], s.cross[1, 1:2]),
        )
        middle = slice(16, -16)  # the system jumps by 80 degrees at 0 Hz and rate/2
        error.append(found.response[0, middle] / TRUE - 1)
        stated.append(found.u_relative[0, middle])
    return np.array(error), np.array(stated)


def ratio(error, stated):
    """True scatter over stated uncertainty, for magnitude and phase."""
    scatter = (np.std(error.real, axis=0), np.std(error.imag, axis=0))
    return tuple(float(np.sqrt(np.mean(s**2) / np.mean(stated**2))) for s in scatter)


@pytest.mark.parametrize("overlap", [0.0, 0.5, 0.75])
@pytest.mark.parametrize("noise_out", [0.2, 2.0])
def test_h1_scatters_as_stated(overlap, noise_out):
    error, stated = simulated("H1", overlap, 0.0, noise_out)
    assert ratio(error, stated) == (pytest.approx(1, abs=0.05), pytest.approx(1, abs=0.05))
    assert abs(error.mean()) < 0.01


def test_h1_with_coloured_noise_line_by_line():
    error, stated = simulated("H1", 0.5, 0.0, 1.0, colour=True)
    lines = np.sqrt(np.var(error.imag, axis=0) / np.mean(stated**2, axis=0))
    assert np.all((lines > 0.85) & (lines < 1.15))  # noise falls by 13 dB from the first to the last


@pytest.mark.parametrize(
    ("noise_in", "noise_out"), [(0.0, 1.0), (0.5, 0.0), (0.7, 1.5)], ids=["output", "input", "both"]
)
def test_three_channels_scatter_as_stated_and_are_unbiased(noise_in, noise_out):
    error, stated = simulated("H3c", 0.5, noise_in, noise_out)
    assert ratio(error, stated) == (pytest.approx(1, abs=0.06), pytest.approx(1, abs=0.06))
    assert abs(error.mean()) < 0.01


def test_noise_in_the_reference_pulls_h1_down_and_not_h2():
    error, _ = simulated("H1", 0.5, 0.5, 0.0)
    assert error.real.mean() == pytest.approx(1 / 1.25 - 1, abs=0.01)
    error, stated = simulated("H2", 0.5, 0.5, 0.0)
    assert abs(error.mean()) < 0.01
    assert ratio(error, stated)[1] == pytest.approx(1, abs=0.06)


def test_hv_is_the_geometric_mean():
    rng = np.random.default_rng(3)
    x, y, xy = (
        rng.uniform(1, 2, 9),
        rng.uniform(1, 2, 9),
        rng.uniform(0.1, 1, 9) * np.exp(1j * rng.uniform(0, 6, 9)),
    )
    h1, h2, hv = (estimate(name, x, y, xy, 50).response for name in ("H1", "H2", "Hv"))
    np.testing.assert_allclose(np.abs(hv), np.sqrt(np.abs(h1 * h2)))
    np.testing.assert_allclose(np.angle(hv), np.angle(xy))
    np.testing.assert_allclose(np.angle(h2), np.angle(xy))


def test_hv_scatters_no_more_than_stated():
    error, stated = simulated("Hv", 0.5, 0.0, 0.3)
    magnitude, phase = ratio(error, stated)
    assert phase == pytest.approx(1, abs=0.06)
    assert magnitude <= 1.05


def test_dead_channels_are_nan_and_silent():
    zero = np.zeros(20)
    found = estimate("H1", zero, zero, zero + 0j, 10)
    assert np.isnan(found.response).all()
    assert np.isnan(found.coherence).all()


def test_one_block_knows_no_uncertainty():
    one = np.ones(20)
    assert np.isnan(estimate("H1", one, one, one + 0j, 1).u_relative).all()


def test_three_channels_need_an_instrument():
    one = np.ones(3)
    with pytest.raises(ValueError, match="instrument"):
        estimate("H3c", one, one, one + 0j, 10)


def test_noise_is_smoothed_without_bias():
    rng = np.random.default_rng(4)
    freedom = 6
    noise = 3.0 * rng.gamma(freedom, 1 / freedom, (200, 60))
    smooth = smoothed_noise(noise, freedom)
    assert smooth.mean() == pytest.approx(3.0, rel=0.02)
    assert smooth[:, 20].std() < 0.4 * noise[:, 20].std()


def test_steep_noise_stays_steep():
    noise = np.arange(1.0, 200.0) ** -2
    np.testing.assert_allclose(smoothed_noise(noise, 1e9)[20:180], noise[20:180], rtol=0.05)


def test_hum_keeps_its_line_and_leaves_its_neighbours():
    noise = np.ones(60)
    noise[30] = 1e4
    smooth = smoothed_noise(noise, 1e6)
    assert smooth[30] == 1e4
    assert smooth[29] < 2


def test_phase_of_a_half_turn_and_the_bound():
    assert phase_deg(np.array([-1 - 0j])).tolist() == [180.0]
    assert u_phase_deg(np.array([10.0])).tolist() == [U_PHASE_UNKNOWN_DEG]


@pytest.mark.parametrize("late", [0, 5, -9])
def test_arrival_of_a_pure_delay(late):
    f = np.arange(65) * RATE / BLOCK
    impulse = np.abs(np.fft.irfft(np.exp(-2j * np.pi * f * late / RATE), BLOCK))
    assert arrivals(impulse) == late
