"""WAV recordings of every width, in blocks, with and without a channel table."""

import wave

import numpy as np
import pytest
from scipy.io import wavfile

from specan.errors import InputError
from specan.io.open import open_recording

rng = np.random.default_rng(1)


def write_24(path, data):
    """Integers of 24 bits, which scipy does not write."""
    with wave.open(str(path), "wb") as file:
        file.setnchannels(data.shape[1])
        file.setsampwidth(3)
        file.setframerate(48000)
        file.writeframes(data.astype("<i4").view(np.uint8).reshape(-1, 4)[:, :3].tobytes())


def read(path):
    recording = open_recording(path)
    return recording.read(recording.channels)


@pytest.mark.parametrize("kind", ["uint8", "int16", "int24", "int32", "float32", "float64"])
@pytest.mark.parametrize("channels", [1, 3])
def test_every_width(tmp_path, kind, channels):
    path = tmp_path / "a.wav"
    n = 70_001
    if kind.startswith("float"):
        data = rng.uniform(-1, 1, (n, channels)).astype(kind)
        expected = data.astype(np.float64)
    elif kind == "int24":
        data = rng.integers(-(2**23), 2**23, (n, channels))
        expected = data / 2**23
    else:
        limits = np.iinfo(kind)
        data = rng.integers(limits.min, limits.max, (n, channels), endpoint=True).astype(kind)
        middle = 128 if kind == "uint8" else 0
        expected = (data.astype(np.float64) - middle) / 2 ** (limits.bits - 1)
    if kind == "int24":
        write_24(path, data)
    else:
        wavfile.write(path, 48000, data[:, 0] if channels == 1 else data)
    recording = open_recording(path)
    assert [c.name for c in recording.channels] == [f"Channel {k + 1}" for k in range(channels)]
    assert {(c.sampling_rate, c.n_samples, c.unit) for c in recording.channels} == {(48000.0, n, "1")}
    np.testing.assert_array_equal(recording.read(recording.channels), expected.T)
    last = recording.channels[-1:]
    np.testing.assert_array_equal(recording.read(last, 5, 70_000)[0], expected[5:70_000, -1])
    blocks = np.hstack(list(recording.blocks(recording.channels, 10_007)))
    np.testing.assert_array_equal(blocks, expected.T)
    full = recording.channels[0].full_scale
    assert full is None if kind.startswith("float") else 0.99 <= full < 1.0


def test_a_channel_table_makes_a_pressure(tmp_path):
    wavfile.write(tmp_path / "a.wav", 48000, np.full(10, 2**14, dtype=np.int16))
    row = '[[channel]]\nchannel = "Channel 1"\nrole = "microphone"\nsensitivity = 50.0\nsensitivity_unit = "mV/Pa"\n'
    (tmp_path / "channels.toml").write_text(row)
    with pytest.raises(InputError, match="full_scale beside it"):
        open_recording(tmp_path / "a.wav")
    (tmp_path / "channels.toml").write_text(row + "full_scale = 10.0\n")
    recording = open_recording(tmp_path / "a.wav")
    channel = recording.channels[0]
    assert (channel.role, channel.unit, channel.raw_unit) == ("microphone", "Pa", "V")
    assert recording.read([channel])[0, 0] == pytest.approx(0.5 * 10 / 0.05)
    assert channel.full_scale == pytest.approx(10 / 0.05, rel=1e-4)


def test_the_user_s_rate(tmp_path):
    wavfile.write(tmp_path / "a.wav", 48000, np.zeros(10, dtype=np.int16))
    assert open_recording(tmp_path / "a.wav", sampling_rate=8000).channels[0].sampling_rate == 8000.0


@pytest.mark.parametrize("cut", [8, 14, 30, 43, 100, 3000])
@pytest.mark.parametrize("kind", ["int16", "int24"])
def test_a_damaged_file_is_one_sentence(tmp_path, cut, kind):
    path = tmp_path / "a.wav"
    if kind == "int24":
        write_24(path, np.zeros((2000, 1), dtype=np.int32))
    else:
        wavfile.write(path, 48000, np.zeros(2000, dtype=np.int16))
    path.write_bytes(path.read_bytes()[:cut])
    with pytest.raises(InputError, match=r"a\.wav"):
        read(path)


def test_a_file_without_samples(tmp_path):
    wavfile.write(tmp_path / "a.wav", 48000, np.zeros(0, dtype=np.int16))
    with pytest.raises(InputError, match=r"a\.wav"):
        open_recording(tmp_path / "a.wav")
