"""What the figures show, read back from their artists."""

from pathlib import Path

import numpy as np
import pytest

from specan.analysis.spectrum import FourierSpectrum, SpectrogramSettings
from specan.analysis.tone import Tone
from specan.analysis.transfer_function import TransferFunction
from specan.data.recording import ArraySource, Channel, Recording
from specan.errors import RequestError
from specan.report.figure_style import COLOURS, figure_format, save_figure, style_of
from specan.report.figures import figure_of

RATE, N = 8000.0, 16000
NOISE = np.random.default_rng(6).standard_normal((12, N))


def recording(channels=3):
    roles = ["vibrometer"] + ["microphone"] * (channels - 1)
    samples = [NOISE[0], *(np.roll(NOISE[0], 8) + 0.3 * NOISE[1:channels])]
    return Recording(
        "a.tdms",
        tuple(
            Channel(f"Ch {k}", role=role, unit="Pa", sampling_rate=RATE, n_samples=N)
            for k, role in enumerate(roles)
        ),
        ArraySource(samples),
    )


def test_transfer_function_with_coherence_strip_and_bands():
    found = TransferFunction(lines=200)(recording())
    magnitude, phase, coherence = figure_of(found).axes
    assert [line.get_label() for line in magnitude.lines] == ["Ch 1", "Ch 2"]
    np.testing.assert_allclose(magnitude.lines[0].get_ydata(), found.level_dB[0])
    assert coherence.get_ylabel() == "Coherence"
    assert phase.get_ylim() == (-190, 190)
    path = magnitude.collections[0].get_paths()[0].vertices
    at = path[np.isclose(path[:, 0], found.frequency_hz[50]), 1]
    relative = 2 * found.u_magnitude_percent[0, 50] / 100
    expected = found.level_dB[0, 50] + 20 * np.log10([1 - relative, 1 + relative])
    np.testing.assert_allclose([at.min(), at.max()], expected, rtol=1e-6)


def test_frequency_axis_is_logarithmic_with_octaves():
    axes = figure_of(TransferFunction(lines=200)(recording())).axes[-1]
    assert axes.get_xscale() == "log"
    assert [t.get_text() for t in axes.get_xticklabels()] == [
        "16",
        "31.5",
        "63",
        "125",
        "250",
        "500",
        "1k",
        "2k",
    ]


def test_wrapped_phase_has_gaps_and_unwrapped_has_none():
    found = TransferFunction(lines=200)(recording())
    wrapped = figure_of(found).axes[1].lines[0].get_ydata()
    assert np.isnan(wrapped).any()
    straight = figure_of(found, unwrapped=True).axes[1].lines[0].get_ydata()
    assert np.isfinite(straight).all()
    assert straight.min() < -360


def test_many_channels_have_their_legend_outside():
    figure = figure_of(TransferFunction(lines=100)(recording(12)))
    assert len(figure.legends) == 1
    texts = [text.get_text() for text in figure.legends[0].get_texts()]
    assert texts[:2] == ["range of 11 channels", "median"]
    assert len(texts) == 5


def test_harmonics_of_a_tone_over_its_fundamental():
    turn = 2 * np.pi * 125 * np.arange(N) / RATE
    samples = [np.sin(turn) + 0.1 * np.sin(2 * turn) + 0.001 * np.sin(3 * turn), np.zeros(N)]
    channels = tuple(Channel(name, unit="Pa", sampling_rate=RATE, n_samples=N) for name in ("Mic 1", "Mic 2"))
    found = Tone(frequency_hz=125.0, harmonics=3)(Recording("a.tdms", channels, ArraySource(samples)))
    (axes,) = figure_of(found).axes
    np.testing.assert_allclose(axes.lines[0].get_xdata(), [1, 2, 3])
    np.testing.assert_allclose(axes.lines[0].get_ydata(), [0, -20, -60], atol=0.01)


def test_spectrum_with_and_without_phase():
    plain = figure_of(FourierSpectrum(lines=100)(recording()))
    assert len(plain.axes) == 1
    assert plain.axes[0].get_ylabel() == "Level / dB re 20 µPa"
    with_phase = figure_of(FourierSpectrum(lines=100, reference="Ch 0")(recording()))
    assert "over Ch 0" in with_phase.axes[1].get_ylabel()


def test_spectrogram_has_a_panel_a_channel():
    found = SpectrogramSettings(lines=100, channels=("Ch 1", "Ch 2"))(recording())
    figure = figure_of(found)
    assert sum("Frequency" in axes.get_ylabel() for axes in figure.axes) == 2


def test_styles_do_not_repeat_within_24_channels():
    seen = [tuple(style_of(number).items()) for number in range(24)]
    assert len(set(seen)) == 24
    assert len(COLOURS) >= 6


def test_places_are_checked(tmp_path):
    with pytest.raises(RequestError, match="png"):
        figure_format(Path("figure.jpg"))
    (tmp_path / "taken.png").mkdir()
    figure = figure_of(FourierSpectrum(lines=100)(recording()))
    with pytest.raises(RequestError, match="No such file"):
        save_figure(figure, tmp_path / "nowhere" / "figure.png")
    with pytest.raises(RequestError, match="cannot be written"):
        save_figure(figure, tmp_path / "taken.png")
