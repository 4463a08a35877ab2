"""Impulse responses from sweeps, sequences, noise: the response that was built in comes back."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import chirp, fftconvolve, max_len_seq

from specan.analysis.decay import ImpulseResponse
from specan.api.recordings import decay
from specan.data.recording import ArraySource, Channel, Recording
from specan.errors import InputError, RequestError

RATE = 8000.0
RNG = np.random.default_rng(7)
ROOM = np.append(np.zeros(24), RNG.standard_normal(3200) * 10 ** (-3 * np.arange(3200) / RATE / 0.35))


def exponential_sweep() -> np.ndarray:
    t = np.arange(int(4 * RATE)) / RATE
    return chirp(t, 50.0, 4.0, 3900.0, method="logarithmic") * np.minimum(1, np.minimum(t, 4 - t) / 0.02)


def recorded(driven: np.ndarray, silence_s: float = 0.6, noise: float = 0.0) -> Recording:
    driven = np.append(driven, np.zeros(int(silence_s * RATE)))
    heard = fftconvolve(driven, ROOM)[: driven.size] + noise * RNG.standard_normal(driven.size)
    channels = (
        Channel("Out", role="generator", unit="V", sampling_rate=RATE, n_samples=driven.size),
        Channel("Mic 1", role="microphone", unit="Pa", sampling_rate=RATE, n_samples=driven.size),
    )
    return Recording("room.tdms", channels, ArraySource([driven, heard]))


def in_band(response: np.ndarray) -> np.ndarray:
    spectrum = np.fft.rfft(response[: ROOM.size], 8192)
    f = np.arange(spectrum.size) * RATE / 8192
    return spectrum[(f > 150) & (f < 2500)]


@pytest.mark.parametrize(
    "driven",
    [exponential_sweep(), 2.0 * max_len_seq(14)[0] - 1.0, np.append(1.0, np.zeros(4000))],
    ids=["sweep", "sequence", "impulse"],
)
def test_deconvolution_gives_the_response_that_was_there(driven: np.ndarray) -> None:
    found = ImpulseResponse(method="deconvolution")(recorded(driven))
    assert found.samples.shape[1] >= 0.6 * RATE
    difference = in_band(found.samples[0]) - in_band(ROOM)
    assert np.sqrt(np.mean(np.abs(difference) ** 2) / np.mean(np.abs(in_band(ROOM)) ** 2)) < 0.01


def test_a_sweep_is_recognised_and_its_decay_is_that_of_the_room() -> None:
    sweep = recorded(exponential_sweep(), noise=0.002)
    found = decay(sweep, fmin=500, fmax=2000)
    assert any("deconvolution" in note for note in found.notes)
    assert np.all(np.abs(found.t20_s[0] - 0.35) < 3 * found.u_t20_s[0])


def test_a_channel_that_ends_early_is_told_once() -> None:
    whole = recorded(RNG.standard_normal(int(16 * RATE)), silence_s=0.0)
    driven, heard = whole.source.read([0, 1], 0, int(16 * RATE))
    channels = (whole.channels[0], replace(whole.channels[1], n_samples=heard.size // 2))
    noise = Recording("room.tdms", channels, ArraySource([driven, heard[: heard.size // 2]]))
    for found in (decay(noise, fmin=500, fmax=1000), ImpulseResponse()(noise)):
        told = [note for note in found.notes if "where Mic 1 ends" in note]
        assert told == ["all channels are analysed up to 8 s, where Mic 1 ends"]


def test_noise_is_averaged_and_its_decay_is_that_of_the_room() -> None:
    noise = recorded(RNG.standard_normal(int(40 * RATE)), silence_s=0.0)
    found = decay(noise, fmin=500, fmax=1000)
    assert any("H1" in note for note in found.notes)
    assert np.all(np.abs(found.edt_s[0] - 0.35) < 0.08)


def test_bands_above_what_noise_shows_are_left_out() -> None:
    noise = recorded(RNG.standard_normal(int(40 * RATE)), silence_s=0.0)
    assert (
        decay(noise, fraction=3).nominal_hz[-1] == 2000.0
    )  # 2812 Hz are left, the upper edge of 2500 Hz is 2818
    with pytest.raises(RequestError, match="responses up to 2812"):
        decay(noise, fmax=3000)


def test_what_cannot_be_measured_is_refused() -> None:
    with pytest.raises(InputError, match="has no generator or vibrometer channel"):
        ImpulseResponse()(
            recorded(exponential_sweep()).__class__("a", recorded(exponential_sweep()).channels[1:], None)
        )
    silent = recorded(np.zeros(8000))
    with pytest.raises(InputError, match="holds no signal"):
        ImpulseResponse(method="deconvolution")(silent)
    for method in ("deconvolution", "H1"):
        for length in (60.0, 1e-9):
            with pytest.raises(RequestError, match="do not fit a section"):
                ImpulseResponse(method=method, length_s=length)(recorded(exponential_sweep()))
