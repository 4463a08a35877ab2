"""Samples as WAV: 32-bit floating point in SI units, so that nothing is scaled or cut off."""

from __future__ import annotations

import struct
from pathlib import Path

from specan.errors import RequestError
from specan.io.export_file import Excerpt
from specan.io.output_file import whole_file

_LARGEST = 2**32 - 256  # bytes; sizes are 32-bit numbers
_IEEE_FLOAT = 3


def write_wav(excerpt: Excerpt, path: Path) -> None:
    """Write all channels interleaved; 1.0 is 1 Pa, 1 m/s, 1 V.

    Raises
    ------
    RequestError
        The sampling rate is no whole number, or the samples need more than the 4 GB that WAV can hold.
    """
    channels, rate = len(excerpt.channels), excerpt.rate
    if rate != round(rate):
        raise RequestError(
            f"{excerpt.recording.label} is sampled at {rate:.9g} Hz",
            expected="a whole number of hertz for WAV",
            remedy="export to Parquet or CSV",
        )
    size = excerpt.n * channels * 4
    if size > _LARGEST:
        raise RequestError(
            f"{channels} channels of {excerpt.n} samples need {size / 1e9:.1f} GB",
            expected="at most 4.3 GB for WAV",
            remedy="choose fewer channels or a shorter section, or export to Parquet",
        )
    form = struct.pack(
        "<HHIIHH", _IEEE_FLOAT, channels, round(rate), round(rate) * channels * 4, channels * 4, 32
    )
    # Other than PCM wants the size of the extension (none) and a fact chunk with the number of samples.
    chunks = b"fmt " + struct.pack("<I", 18) + form + struct.pack("<H", 0)
    chunks += b"fact" + struct.pack("<II", 4, excerpt.n) + b"data" + struct.pack("<I", size)
    with whole_file(path) as half, half.open("wb") as file:
        file.write(b"RIFF" + struct.pack("<I", 4 + len(chunks) + size) + b"WAVE" + chunks)
        for _, samples in excerpt.blocks():
            file.write(samples.T.astype("<f4").tobytes())
