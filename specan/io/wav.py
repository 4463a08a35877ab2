"""WAV recordings; samples stay in the file until they are asked for."""

from __future__ import annotations

import warnings
import wave
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from specan.arrays import Real
from specan.data.recording import Recording
from specan.errors import InputError
from specan.io.sampling_rate import Rate
from specan.io.signals import Opening, Signal

SUFFIXES = (".wav",)

_BLOCK = 1 << 16


@dataclass(frozen=True)
class WavSource:
    """The frames of a file; implements `specan.data.recording.SampleSource`.

    Attributes
    ----------
    top : float, optional
        Largest fraction that the converter can give.
    block : callable
        Fractions of full scale from one frame to another, shape (frames, channels).
    """

    rate: int
    n_frames: int
    n_channels: int
    text: str
    top: float | None
    block: Callable[[int, int], Real]

    def read(self, indices: Sequence[int], start: int, stop: int) -> Real:
        """See `specan.data.recording.SampleSource`."""
        out = np.empty((len(indices), stop - start))
        for first in range(start, stop, _BLOCK):
            last = min(first + _BLOCK, stop)
            out[:, first - start : last - start] = self.block(first, last).T[list(indices)]
        return out


def recognises(start: bytes) -> bool:
    """Whether a file that begins so is WAV."""
    return start[:4] in (b"RIFF", b"RIFX", b"RF64") and start[8:12] == b"WAVE"


def open_recording(path: Path, opening: Opening) -> Recording:
    """Open a WAV file: integers as fractions of full scale, floating-point numbers as they are.

    Channels are called "Channel 1" and so on. A sensitivity in the channel table is in volts: it needs the voltage at
    full scale beside it.

    Raises
    ------
    InputError
        The file is damaged, of a kind that is not read, or holds no sample.
    """
    source = _frames(path)
    if not source.n_frames:
        raise InputError(f"{opening.label} holds no sample", remedy="record it again")
    signals = [
        Signal(
            name,
            source.n_frames,
            rate=Rate(float(source.rate), "the header of the file"),
            known=_in_volts(opening, name),
            decisions={"unit": "fractions of full scale", "scaling": source.text},
        )
        for name in (f"Channel {place}" for place in range(1, source.n_channels + 1))
    ]
    found = opening.recording(signals, source)
    top = source.top
    channels = (replace(c, full_scale=None if top is None else top * abs(c.gain)) for c in found.channels)
    return replace(found, channels=tuple(channels))


def _in_volts(opening: Opening, name: str) -> dict[str, object]:
    """What turns fractions of full scale into volts, where a channel table gives a sensitivity."""
    table = opening.channel_table
    row = table.find("", name) if table else None
    if table is None or row is None or row.sensitivity is None:
        return {}
    if row.full_scale is None:
        raise InputError(
            f"{opening.label}: the samples of {name!r} are fractions of full scale, and {table.source} gives "
            f"{row.sensitivity:g} {row.sensitivity_unit}",
            expected="full_scale beside it, in volts",
            remedy="add it, or give a gain and a unit",
        )
    return {"raw_unit": "V", "raw_scale": row.full_scale}


def _frames(path: Path) -> WavSource:
    """Frames as scipy maps them; 24 bits, which it does not map, through the standard library."""
    from scipy.io import wavfile

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", wavfile.WavFileWarning)  # chunks of notes that are stepped over
            rate, data = wavfile.read(path, mmap=True)
    except Exception as fault:  # the headers of a damaged file end in many errors
        said = str(fault) if isinstance(fault, ValueError) else f"{type(fault).__name__}: {fault}"
        if isinstance(fault, ValueError) and ("24-bit" in said or "mmap" in said):
            return _frames_24(path, said)
        raise InputError(
            f"{path.name} is a damaged WAV file ({said})", remedy="copy or record it again"
        ) from None
    n_channels = 1 if data.ndim == 1 else data.shape[1]
    scale, middle, text, top = _scale(data.dtype)
    where, dtype, n_frames = data.offset, data.dtype, data.shape[0]

    def read(start: int, stop: int) -> Real:
        # Mapped for this block only: pages of a mapping count as memory as long as it lives.
        offset = where + start * n_channels * dtype.itemsize
        with path.open("rb") as file:
            part = np.memmap(file, dtype=dtype, mode="r", offset=offset, shape=(stop - start, n_channels))
        return (part.astype(np.float64) - middle) * scale

    return WavSource(int(rate), n_frames, n_channels, text, top, read)


def _frames_24(path: Path, said: str) -> WavSource:
    try:
        with wave.open(str(path), "rb") as file:
            rate, n_frames = file.getframerate(), file.getnframes()
            n_channels, width = file.getnchannels(), file.getsampwidth()
    except (wave.Error, EOFError) as fault:
        raise InputError(
            f"{path.name} is a WAV file that is not read ({said}; {fault})",
            expected="integers of 8, 16, 24 or 32 bits, or floating point",
            remedy="convert it",
        ) from None
    if width != 3:
        raise InputError(f"{path.name} is a WAV file of {8 * width} bits ({said})", remedy="convert it")
    if n_frames * n_channels * width > path.stat().st_size:
        raise InputError(f"{path.name} is cut off", remedy="copy or record it again")

    def read(start: int, stop: int) -> Real:
        with wave.open(str(path), "rb") as file:
            file.setpos(start)
            raw = np.frombuffer(file.readframes(stop - start), dtype=np.uint8)
        if raw.size != (stop - start) * n_channels * 3:
            raise InputError(f"{path.name} is cut off", remedy="copy or record it again")
        # Three bytes become the upper three of an integer of four.
        wide = np.zeros((raw.size // 3, 4), dtype=np.uint8)
        wide[:, 1:] = raw.reshape(-1, 3)
        return wide.view("<i4").reshape(-1, n_channels) / 2.0**31

    return WavSource(rate, n_frames, n_channels, "24-bit integers, full scale = 1", 1.0 - 2.0**-23, read)


def _scale(dtype: np.dtype[Any]) -> tuple[float, float, str, float | None]:
    """Factor to full scale, middle value, words, and the largest fraction."""
    if dtype.kind == "f":
        return 1.0, 0.0, f"{8 * dtype.itemsize}-bit floating point", None
    bits = 8 * dtype.itemsize
    middle = 2.0 ** (bits - 1) if dtype.kind == "u" else 0.0
    return 2.0 ** (1 - bits), middle, f"{bits}-bit integers, full scale = 1", 1.0 - 2.0 ** (1 - bits)
