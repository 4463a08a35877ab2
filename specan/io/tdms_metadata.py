"""The metadata of a TDMS file as bytes, without their meaning."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

_LEAD_IN, _BIG_ENDIAN, _NOT_CLOSED = 28, 1 << 6, 0xFFFFFFFFFFFFFFFF
_PIECE = 1 << 20


def metadata_of(path: Path) -> Iterator[bytes]:
    """Lead-in and metadata of every segment, in the order of the file and in pieces of at most 1 MiB.

    Ends without an error where a segment does not begin as it should: what the bytes mean is for
    `read_headers` to say.
    """
    with path.open("rb") as file:
        size = file.seek(0, 2)
        position = 0
        while position + _LEAD_IN <= size:
            file.seek(position)
            lead_in = file.read(_LEAD_IN)
            if lead_in[:4] != b"TDSm" or len(lead_in) < _LEAD_IN:
                return
            big = struct.unpack_from("<I", lead_in, 4)[0] & _BIG_ENDIAN
            following, samples = struct.unpack_from(">QQ" if big else "<QQ", lead_in, 12)
            position += _LEAD_IN
            # Both numbers may be damaged: nothing lies beyond the end of the file.
            end = min(position + samples, size) if samples != _NOT_CLOSED else position
            yield lead_in + file.read(min(end - position, _PIECE))
            while (left := end - file.tell()) > 0:
                yield file.read(min(left, _PIECE))
            if following > size - position:
                return
            position += following
