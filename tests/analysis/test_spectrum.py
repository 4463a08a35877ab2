"""Scalings, levels, averaging and phase of spectra; spectrograms."""

from dataclasses import replace

import numpy as np
import pytest

from specan.analysis.spectrum import FourierSpectrum, SpectrogramSettings
from specan.data.recording import ArraySource, Channel, Recording
from specan.dsp.windows import WINDOWS
from specan.errors import InputError, RequestError

RATE, N = 8000.0, 32000
T = np.arange(N) / RATE
RNG = np.random.default_rng(31)
NOISE = RNG.standard_normal(N)
LINE = RATE / 1024  # with 400 lines


def recording(*samples, units=None, **changes):
    units = units or ["Pa"] * len(samples)
    channels = tuple(
        Channel(f"Ch {k + 1}", unit=unit, sampling_rate=RATE, n_samples=len(x), **changes)
        for k, (x, unit) in enumerate(zip(samples, units))
    )
    return Recording("a.tdms", channels, ArraySource(list(samples)))


def cosine(line, amplitude=1.0, phase=0.0):
    return amplitude * np.cos(2 * np.pi * line * LINE * T + phase)


@pytest.mark.parametrize("window", WINDOWS)
@pytest.mark.parametrize(("scaling", "expected"), [("amplitude", 3.0), ("rms", 3 / np.sqrt(2))])
def test_a_tone_reads_right_in_every_window(window, scaling, expected):
    settings = FourierSpectrum(lines=400, window=window, scaling=scaling)
    found = settings(recording(cosine(100, 3.0)))
    assert found.values[0, 100] == pytest.approx(expected, rel=1e-9)
    assert found.value_units == ("Pa",)
    assert found.level_dB[0, 100] == pytest.approx(20 * np.log10(3 / np.sqrt(2) / 20e-6), abs=1e-6)


@pytest.mark.parametrize("window", WINDOWS)
def test_noise_has_its_density_in_every_window(window):
    found = FourierSpectrum(lines=100, window=window, scaling="psd")(recording(2 * NOISE))
    inside = (found.frequency_hz > 200) & (found.frequency_hz < 3800)
    assert np.mean(found.values[0, inside]) == pytest.approx(4 / (RATE / 2), rel=0.03)
    assert found.value_units == ("Pa^2/Hz",)
    level = 10 * np.log10(np.mean(found.values[0, inside]) / 4e-10)
    assert np.mean(found.level_dB[0, inside]) == pytest.approx(level, abs=0.1)


def test_level_texts():
    found = FourierSpectrum(lines=400, scaling="psd")(recording(NOISE, units=["m/s"]))
    assert found.value_units == ("(m/s)^2/Hz",)
    assert found.scale.level_text("m/s") == "dB re (1 nm/s)^2/Hz"
    assert FourierSpectrum(lines=400)(recording(NOISE)).scale.level_text("Pa") == "dB re 20 uPa"


def test_bandwidth_and_spacing_are_given():
    found = FourierSpectrum(lines=400, window="flat-top")(recording(NOISE))
    assert found.scale.line_spacing_hz == pytest.approx(LINE)
    assert found.scale.enbw_hz == pytest.approx(3.7702 * LINE, rel=1e-4)
    assert found.scale.coherent_gain == pytest.approx(0.21557895)


def test_rms_is_that_of_the_samples():
    found = FourierSpectrum(lines=100)(recording(NOISE))
    assert found.rms[0] == pytest.approx(np.std(NOISE), rel=0.01)
    assert FourierSpectrum(whole=True, window="rectangular")(recording(NOISE)).rms[0] == pytest.approx(
        np.std(NOISE), rel=1e-9
    )


def test_ends_of_the_spectrum_are_not_doubled():
    x = 2.0 + np.cos(np.pi * np.arange(N))
    settings = FourierSpectrum(lines=400, window="rectangular", detrend=False)
    found = settings(recording(x))
    np.testing.assert_allclose(found.values[0, [0, -1]], [2.0, 1.0], rtol=1e-12)
    single = settings.model_copy(update={"averaging": "none"})(recording(x))
    np.testing.assert_allclose(single.values[0, [0, -1]], [2.0, 1.0], rtol=1e-12)


def test_phase_of_a_single_block():
    found = FourierSpectrum(lines=400, averaging="none")(recording(cosine(50, 2.0, 1.0)))
    assert np.radians(found.phase_deg[0, 50]) == pytest.approx(1.0)
    assert found.n_blocks == 1
    assert found.values[0, 50] == pytest.approx(2.0)


def test_phase_of_an_average_needs_a_reference():
    late = np.roll(NOISE, 3)
    plain = FourierSpectrum(lines=400)(recording(NOISE, late))
    assert plain.phase_deg is None
    assert any("reference" in note for note in plain.notes)
    found = FourierSpectrum(lines=400, reference="Ch 1")(recording(NOISE, late))
    inside = found.frequency_hz < 1000
    expected = -360 * found.frequency_hz * 3 / RATE
    np.testing.assert_allclose(found.phase_deg[1, inside], expected[inside], atol=1.0)
    np.testing.assert_allclose(found.phase_deg[0], 0, atol=1e-9)


def test_reference_outside_the_shown_channels_and_in_a_single_block():
    settings = FourierSpectrum(lines=400, reference="Ch 1", channels=("Ch 2",))
    source = recording(cosine(20), cosine(20, 1.0, -0.5))
    for averaging in ("linear", "exponential", "none"):
        found = settings.model_copy(update={"averaging": averaging})(source)
        assert found.channels == ("Ch 2",)
        assert np.radians(found.phase_deg[0, 20]) == pytest.approx(-0.5)


@pytest.mark.parametrize("averaging", ["linear", "none"])
def test_phase_over_a_reference_that_is_late(averaging):
    late = 2e-3
    source = recording(cosine(20, 1.0, 0.3), cosine(20, 1.0, -0.5))
    first = replace(source.channels[0], delay_s=late)
    source = replace(source, channels=(first, source.channels[1]))
    found = FourierSpectrum(lines=400, reference="Ch 1", averaging=averaging)(source)
    expected = -0.8 - 2 * np.pi * 20 * LINE * late
    assert np.exp(1j * np.radians(found.phase_deg[1, 20])) == pytest.approx(np.exp(1j * expected))
    assert found.phase_deg[0, 20] == pytest.approx(0, abs=1e-9)


def test_holds():
    loud = np.where(T < 2, 1.0, 0.1) * cosine(100)
    read = {
        averaging: FourierSpectrum(lines=400, averaging=averaging)(recording(loud)).values[0, 100]
        for averaging in ("max", "min", "linear")
    }
    assert read["max"] == pytest.approx(1.0)
    assert read["min"] == pytest.approx(0.1)
    assert read["min"] < read["linear"] < read["max"]
    recent = FourierSpectrum(lines=400, averaging="exponential", n_exponential=3)(recording(loud))
    assert recent.values[0, 100] == pytest.approx(0.1, rel=0.01)


def test_range_section_and_channels():
    settings = FourierSpectrum(lines=400, fmin=100, fmax=200, start_s=2.0, channels=("Ch 2",))
    found = settings(recording(NOISE, np.where(T < 2, 0.0, cosine(20))))
    assert found.frequency_hz.min() >= 100
    assert found.frequency_hz.max() <= 200
    assert found.values.max() == pytest.approx(1.0)
    assert found.channels == ("Ch 2",)


def test_whole_section_is_one_block():
    found = FourierSpectrum(whole=True, start_s=1.0, stop_s=3.0)(recording(NOISE))
    assert found.scale.line_spacing_hz == pytest.approx(0.5)
    assert (found.averaging, found.n_blocks) == ("none", 1)


def test_a_short_section_is_one_block_unless_lines_are_asked_for():
    found = FourierSpectrum(stop_s=0.5)(recording(NOISE))
    assert (found.n_blocks, found.scale.line_spacing_hz) == (1, pytest.approx(2.0))
    with pytest.raises(InputError, match="less than one block"):
        FourierSpectrum(stop_s=0.5, lines=3200)(recording(NOISE))
    with pytest.raises(InputError, match="at least 16"):
        FourierSpectrum(stop_s=10 / RATE)(recording(NOISE))


@pytest.mark.parametrize("averaging", ["linear", "none"])
def test_displacement_becomes_velocity(averaging):
    found = FourierSpectrum(lines=400, averaging=averaging)(
        recording(cosine(100), units=["m"], derivatives=1)
    )
    assert found.values[0, 100] == pytest.approx(2 * np.pi * 100 * LINE, rel=1e-6)
    assert found.value_units == ("m/s",)


def test_uncertainty_of_a_line_of_noise():
    found = FourierSpectrum(lines=100, scaling="psd")(recording(NOISE))
    inside = (found.frequency_hz > 200) & (found.frequency_hz < 3800)
    assert np.std(found.level_dB[0, inside]) == pytest.approx(found.u_dB, rel=0.2)


def test_flags_and_refusals():
    nan = NOISE.copy()
    nan[7] = np.nan
    assert FourierSpectrum(lines=400)(recording(0 * NOISE, nan)).flags == (("dead",), ("not-finite",))
    with pytest.raises(RequestError, match="hold"):
        FourierSpectrum(lines=400, averaging="max", reference="Ch 1")(recording(NOISE))
    with pytest.raises(InputError, match="block"):
        FourierSpectrum(lines=100_000)(recording(NOISE))
    with pytest.raises(RequestError, match="no line"):
        FourierSpectrum(lines=400, fmin=5000)(recording(NOISE))


def test_spectrogram_shows_when():
    x = np.where(T < 2, cosine(50), cosine(150))
    found = SpectrogramSettings(lines=400, scaling="rms")(recording(x))
    strongest = found.frequency_hz[np.argmax(found.values[0], axis=1)]
    assert set(np.round(strongest / LINE)) == {50, 150}
    assert found.time_s[np.argmax(strongest > 100 * LINE)] == pytest.approx(2.0, abs=0.1)
    assert found.values.max() == pytest.approx(np.sqrt(0.5), rel=1e-6)


def test_spectrogram_is_the_spectrum_in_pieces():
    found = SpectrogramSettings(lines=100, columns=7)(recording(NOISE))
    columns = len(found.time_s)
    assert columns in (6, 7)  # an incomplete last one is left out
    whole = FourierSpectrum(lines=100, stop_s=(found.blocks_per_column * columns * 128 + 128) / RATE)(
        recording(NOISE)
    )
    np.testing.assert_allclose(found.density.mean(axis=1), whole.density, rtol=1e-12)


@pytest.mark.parametrize(
    ("weighting", "expected"),
    # IEC 61672-1:2013, table 3, at the exact frequency of the nominal 63 Hz and 8 kHz; B: ANSI S1.4-1983.
    [("A", (-26.2, -1.1)), ("C", (-0.8, -3.0)), ("B", (-9.3, -2.9)), ("Z", (0.0, 0.0))],
)
def test_weighted_lines_have_the_levels_of_the_standard(
    weighting: str, expected: tuple[float, float]
) -> None:
    rate, n = 51200.0, 51200
    t = np.arange(n) / rate
    tones = [63.096, 7943.3]
    samples = sum(np.sqrt(2) * np.cos(2 * np.pi * f * t) for f in tones)
    channels = tuple(
        Channel(name, unit=unit, sampling_rate=rate, n_samples=n)
        for name, unit in (("Mic", "Pa"), ("Vib", "m/s"))
    )
    recording = Recording("a.tdms", channels, ArraySource([samples, samples]))
    for settings in (
        FourierSpectrum(lines=20000, window="flat-top", weighting=weighting),
        FourierSpectrum(whole=True, window="flat-top", weighting=weighting),
    ):
        found = settings(recording)
        for frequency, weight in zip(tones, expected):
            near = np.argmin(np.abs(found.frequency_hz - frequency))
            assert found.level_dB[0, near] == pytest.approx(93.98 + weight, abs=0.08)
    assert found.channels == (("Mic", "Vib") if weighting == "Z" else ("Mic",))
    assert found.scale.level_text("Pa") == (
        "dB re 20 uPa" if weighting == "Z" else f"dB({weighting}) re 20 uPa"
    )
    columns = SpectrogramSettings(lines=20000, window="flat-top", weighting=weighting)(recording)
    near = np.argmin(np.abs(columns.frequency_hz - tones[0]))
    assert columns.level_dB[0][0][near] == pytest.approx(93.98 + expected[0], abs=0.08)
    if weighting != "Z":
        with pytest.raises(RequestError, match="Vib is in m/s"):
            FourierSpectrum(weighting=weighting, channels=("Vib",))(recording)


@pytest.mark.parametrize(("length", "seen"), [(499, ("a",)), (500, ("a", "b"))])
def test_a_channel_of_less_than_half_the_length_of_others_does_not_shorten_them(length, seen) -> None:
    samples = np.random.default_rng(1).standard_normal(1000)
    recording = Recording.from_arrays({"a": samples, "b": samples[:length]}, 1000.0)
    found = FourierSpectrum(whole=True)(recording)
    assert found.channels == seen
    assert found.scale.line_spacing_hz == pytest.approx(1.0 if len(seen) == 1 else 2.0)
    (note,) = found.notes
    assert note == (
        "b is left out: it lasts 0.499 s, others 1 s; choose it alone"
        if len(seen) == 1
        else "all channels are analysed up to 0.5 s, where b ends"
    )
