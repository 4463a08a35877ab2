"""What the figures of band levels show, read back from their artists."""

import numpy as np
import pytest
from scipy.signal import lfilter

import specan
from specan.analysis.octave import Octave
from specan.data.recording import ArraySource, Channel, Recording
from specan.errors import RequestError
from specan.report.figures_bands import figure_band_levels, figure_level_history
from specan.report.panels import figure_of_panels

RATE, N = 8000.0, 16000
NOISE = np.random.default_rng(6).standard_normal((11, N))


def recording(*units: str) -> Recording:
    return Recording(
        "a.tdms",
        tuple(Channel(f"Ch {k}", unit=u, sampling_rate=RATE, n_samples=N) for k, u in enumerate(units)),
        ArraySource(list(NOISE)),
    )


def test_each_level_reference_has_its_axes(heading_text):
    found = Octave()(recording("Pa", "Pa", "Pa", "m/s"))
    figure = figure_band_levels(found)
    bands = figure.axes[::2]
    assert [axes.get_ylabel() for axes in bands] == ["Level / dB re 20 µPa", "Level / dB re 1 nm/s"]
    assert [patch.get_label() for patch in bands[0].patches] == ["Ch 0", "Ch 1", "Ch 2"]
    values, edges, _ = bands[1].patches[0].get_data()
    np.testing.assert_array_equal(values, found.level_dB[3])
    np.testing.assert_array_equal(edges, [*found.lower_hz, found.upper_hz[-1]])
    assert [t.get_text() for t in bands[1].get_xticklabels()][:3] == ["31.5", "63", "125"]
    totals = figure.axes[3]
    assert totals.texts[0].get_text() == f"{found.overall_dB['Z'][3]:.1f}"
    assert "1/3 octave, Z weighting, linear averaging, 0 s to 2 s" in heading_text(figure)


def test_of_many_channels_the_range_and_those_furthest_from_the_median():
    one = recording(*["Pa"] * 11)
    found = Octave()(one)
    figure = figure_band_levels(found)
    texts = [text.get_text() for text in figure.legends[0].get_texts()]
    assert texts[:2] == ["range of 11 channels", "median"]
    off = np.abs(found.level_dB - np.median(found.level_dB, axis=0)).mean(axis=1)
    assert texts[2:] == [found.channels[k] for k in np.argsort(-off)[:3]]
    high, _, low = figure.axes[0].patches[0].get_data()
    assert figure.axes[0].get_legend() is None
    np.testing.assert_allclose(high, found.level_dB.max(axis=0))
    np.testing.assert_allclose(low, found.level_dB.min(axis=0))


def test_a_history_against_time():
    found = Octave(averaging="fast", fraction=1)(recording("Pa", "m/s"))
    above, below, *_ = figure_of_panels(figure_level_history(found, 1)).axes
    assert found.history is not None
    highest = float(found.history.overall_max_dB["Z"][1])
    assert [steps.get_label() for steps in above.patches] == [f"LZ, max {highest:.1f} dB"]
    mesh = below.collections[0]
    np.testing.assert_array_equal(np.asarray(mesh.get_array()), found.history.level_dB[1])
    with pytest.raises(RequestError, match="no history"):
        figure_level_history(Octave()(recording("Pa")))


def test_a_knock_is_drawn_in_the_interval_in_which_it_was():
    """The largest Fast level, by a filter of the squares sample by sample, lies under the highest step."""
    knock = specan.read("sample_data/recordings/knock.tdms")
    channel = knock.channels[0]
    squares = knock.read([channel], 0, channel.n_samples)[0] ** 2
    decay = np.exp(-1 / 0.125 / channel.sampling_rate)
    at = np.argmax(lfilter([1 - decay], [1, -decay], squares)) / channel.sampling_rate
    drawing = figure_level_history(Octave(averaging="fast", fraction=1)(knock), 0)
    above, below, *_ = figure_of_panels(drawing).axes
    levels, edges, _ = next(p for p in above.patches if p.get_label().startswith("LZ")).get_data()
    highest = int(np.argmax(levels))
    assert edges[highest] < at < edges[highest + 1]
    assert (edges[0], edges[-1]) == (0.0, 1.0)
    np.testing.assert_array_equal(below.collections[0].get_coordinates()[0, :, 0], edges)
