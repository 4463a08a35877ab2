"""The overview of a long channel is read once, and believed only while the file is what it was."""

import os
import wave
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from specan.inspect import waveform_view
from specan.inspect.opened import watched
from specan.inspect.waveform_view import MOST_FILES, PIECE, STEP, Overview, folder, keep
from specan.io.open import open_recording

N = 2 * PIECE + 777


@pytest.fixture
def path(tmp_path, monkeypatch) -> Path:
    monkeypatch.setenv("SPECAN_CONFIG_DIR", str(tmp_path / "settings"))
    monkeypatch.setattr(waveform_view, "LEAST", N)
    file = tmp_path / "long.wav"
    samples = np.random.default_rng(1).integers(-30000, 30000, N).astype("<i2")
    with wave.open(str(file), "wb") as stream:
        stream.setnchannels(1)
        stream.setsampwidth(2)
        stream.setframerate(8000)
        stream.writeframes(samples.tobytes())
    return file


def overview(path: Path, gain: float = 1.0) -> Overview:
    recording = watched(open_recording(path), path)
    return Overview(recording, replace(recording.channels[0], gain=gain))  # as a calibration changes it


def read(one: Overview) -> Overview:
    while not one.finished:
        one.read_on()
    return one


def test_the_second_time_nothing_is_read(path, monkeypatch):
    first = read(overview(path))
    samples = first.recording.read([first.channel], 0, N)[0]
    monkeypatch.setattr(waveform_view, "PIECE", None)
    second = overview(path)
    assert second.finished
    np.testing.assert_array_equal(
        second.low, [part.min() for part in np.split(samples, range(STEP, N, STEP))]
    )
    np.testing.assert_array_equal(second.high, first.high)


def touched(path: Path) -> None:
    os.utime(path, ns=(1, 1))


def another_sample(path: Path) -> None:
    now = path.stat()
    content = bytearray(path.read_bytes())
    content[-1] ^= 1
    path.write_bytes(bytes(content))
    os.utime(path, ns=(now.st_atime_ns, now.st_mtime_ns))


def damaged(path: Path) -> None:
    (kept,) = folder().iterdir()
    content = bytearray(kept.read_bytes())
    content[100] ^= 1
    kept.write_bytes(bytes(content))


def cut_off(path: Path) -> None:
    (kept,) = folder().iterdir()
    kept.write_bytes(kept.read_bytes()[:-16])


@pytest.mark.parametrize("change", [touched, another_sample, damaged, cut_off])
def test_what_was_changed_is_not_believed(path, change):
    read(overview(path))
    change(path)
    waveform_view._identity.cache_clear()
    assert not overview(path).finished


def test_another_calibration_has_another_overview(path):
    read(overview(path))
    assert not overview(path, gain=1.01).finished


def test_short_channels_are_not_kept(path, monkeypatch):
    monkeypatch.setattr(waveform_view, "LEAST", N + 1)
    read(overview(path))
    assert not folder().exists()


def test_the_oldest_go(tmp_path):
    for number in range(MOST_FILES + 3):
        keep(tmp_path / "kept" / str(number), np.zeros(2), np.ones(2))
    assert len(list((tmp_path / "kept").iterdir())) == MOST_FILES
