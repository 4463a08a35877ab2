"""The metadata of a TDMS file as bytes, without their meaning."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

_LEAD_IN, _BIG_ENDIAN, _NOT_CLOSED = 28, 1 << 6, 0xFFFFFFFFFFFFFFFF


def metadata_of(path: Path) -> Iterator[bytes]:
    """Lead-in and metadata of every segment, in the order of the file.

    Ends without an error where a segment does not begin as it should: what the bytes mean is for
    `read_headers` to say.
    """
    with path.open("rb") as file:
        position = 0
        while len(lead_in := file.read(_LEAD_IN)) == _LEAD_IN and lead_in[:4] == b"TDSm":
            big = struct.unpack_from("<I", lead_in, 4)[0] & _BIG_ENDIAN
            following, samples = struct.unpack_from(">QQ" if big else "<QQ", lead_in, 12)
            yield lead_in + (file.read(samples) if samples != _NOT_CLOSED else b"")
            if following == _NOT_CLOSED:
                return
            position += _LEAD_IN + following
            file.seek(position)
