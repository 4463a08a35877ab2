import numpy as np
import pytest
import scipy.signal
from hypothesis import given, settings
from hypothesis import strategies as st

from specan.dsp.welch import CrossSpectra, effective_averages, hop_of, power_density

RATE, BLOCK = 1000.0, 128
SAMPLES = np.random.default_rng(5).standard_normal((9, 3000))


def spectra(samples, pieces=(3000,), **options):
    found = CrossSpectra(RATE, BLOCK, n_channels=len(samples), **options)
    at = 0
    for piece in pieces:
        found.add(samples[:, at : at + piece])
        at += piece
    found.add(samples[:, at:])
    return found.result()


@settings(max_examples=30)
@given(st.lists(st.integers(1, 900), max_size=5))
def test_bytes_do_not_depend_on_the_pieces(pieces):
    whole, parts = (spectra(SAMPLES, p, references=[2]) for p in ((3000,), pieces))
    assert whole.auto.tobytes() == parts.auto.tobytes()
    assert whole.cross.tobytes() == parts.cross.tobytes()


@pytest.mark.parametrize("channels", [[0, 1], [0, 5, 8], [0, 3, 1, 7, 2]])
def test_bytes_do_not_depend_on_the_other_channels(channels):
    all_of_them, some = spectra(SAMPLES, references=[0]), spectra(SAMPLES[channels], references=[0])
    assert all_of_them.auto[channels].tobytes() == some.auto.tobytes()
    assert all_of_them.cross[:, channels].tobytes() == some.cross.tobytes()


def test_parseval():
    found = spectra(SAMPLES, window_name="rectangular", overlap=0.0, detrend=False)
    used = SAMPLES[:, : found.n_blocks * BLOCK]
    np.testing.assert_allclose(found.auto.sum(axis=1) * RATE / BLOCK, np.mean(used**2, axis=1), rtol=1e-12)


def test_fewer_lines_are_the_first_of_all():
    few, every = spectra(SAMPLES, lines=50, references=[0]), spectra(SAMPLES, references=[0])
    assert np.array_equal(few.auto, every.auto[:, :51])
    assert np.array_equal(few.frequency_hz, every.frequency_hz[:51])


def densities():
    """Of the single blocks, one after the other."""
    hop = BLOCK // 2
    starts = range(0, SAMPLES.shape[1] - BLOCK + 1, hop)
    return np.array([spectra(SAMPLES[:, s : s + BLOCK]).auto for s in starts])


def test_holds_and_exponential_average():
    single = densities()
    np.testing.assert_allclose(spectra(SAMPLES, averaging="max").auto, single.max(axis=0))
    np.testing.assert_allclose(spectra(SAMPLES, averaging="min").auto, single.min(axis=0))
    np.testing.assert_allclose(spectra(SAMPLES).auto, single.mean(axis=0))
    expected = single[0]
    for k, new in enumerate(single[1:], start=2):
        expected = expected + (new - expected) / min(k, 7)
    found = spectra(SAMPLES, averaging="exponential", n_exponential=7)
    np.testing.assert_allclose(found.auto, expected)


def test_hold_has_no_cross_spectra():
    with pytest.raises(ValueError, match="hold"):
        spectra(SAMPLES, averaging="max", references=[0])


@pytest.mark.parametrize(
    ("name", "overlap"), [("rectangular", 0.0), ("hann", 0.0), ("hann", 0.5), ("hann", 2 / 3), ("hann", 0.75)]
)
def test_effective_averages_give_the_variance(name, overlap):
    rng = np.random.default_rng(8)
    found = spectra(rng.standard_normal((400, 1500)), window_name=name, overlap=overlap)
    density = found.auto[:, 4:-4]  # away from 0 Hz and rate/2, where lines are real
    seen = np.mean(density) ** 2 / np.mean(np.var(density, axis=0))
    assert found.n_effective == pytest.approx(seen, rel=0.05)


@pytest.mark.parametrize("n_blocks", [60, 12, 7])
def test_the_weights_of_an_exponential_average_give_its_independent_blocks(n_blocks):
    """Blocks of independent densities with weights w_k scatter as 1 / sum w_k^2 equal ones do."""
    rng = np.random.default_rng(4)
    one = rng.standard_normal(BLOCK)
    samples = np.zeros((n_blocks, n_blocks * BLOCK))
    for row in range(n_blocks):  # a channel for each block: all others are silent
        samples[row, row * BLOCK : (row + 1) * BLOCK] = one
    options = {"window_name": "rectangular", "overlap": 0.0, "detrend": False}
    found = spectra(samples, averaging="exponential", n_exponential=10, **options)
    alone = spectra(one[None], **options)
    weights = found.auto[:, 5] / alone.auto[0, 5]
    assert weights.sum() == pytest.approx(1.0)
    assert found.n_effective == pytest.approx(1 / np.sum(weights**2), rel=0.01)


def test_overlap_never_loses():
    counts = [effective_averages(1 + int((100 - 1) / hop), "hann", hop) for hop in (1.0, 0.75, 0.5, 0.25)]
    assert counts == sorted(counts)


def test_no_block_is_nothing_known():
    found = spectra(SAMPLES[:, :100], references=[0])
    assert found.n_blocks == 0
    assert np.isnan(found.auto).all()
    assert np.isnan(found.cross).all()


def test_overlap_out_of_range():
    with pytest.raises(ValueError, match="overlap"):
        hop_of(100, 1.0)


@pytest.mark.parametrize(("samples", "block"), [(3000, 128), (3000, 127), (512, 512), (100, 128)])
def test_power_density_is_that_of_scipy(samples, block) -> None:
    signal = SAMPLES[0, :samples] + 3.0
    frequency, density = power_density(signal, RATE, block)
    expected = scipy.signal.welch(signal, RATE, "hann", min(block, samples))
    assert frequency == pytest.approx(expected[0])
    assert density == pytest.approx(expected[1], rel=1e-10, abs=1e-15)
