"""TDMS segments byte by byte, after NI's white paper "TDMS File Format Internal Structure".

npTDMS writes contiguous data only; what rigs write besides (interleaved, DAQmx, cut off, wrong) is made here.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter

META, RAW, NEW_LIST, INTERLEAVED, BIG_ENDIAN, DAQMX = 2, 8, 4, 32, 64, 128
TYPES = {
    "i1": 1, "i2": 2, "i4": 3, "i8": 4, "u1": 5, "u2": 6, "u4": 7, "u8": 8, "f4": 9, "f8": 10,
    "?": 0x21, "c8": 0x08000C, "c16": 0x10000D,
}  # fmt: skip
DAQMX_TYPES = {"u1": 0, "i1": 1, "u2": 2, "i2": 3, "u4": 4, "i4": 5}
NO_DATA, SAME_AS_BEFORE = b"\xff\xff\xff\xff", b"\0\0\0\0"


def text(value: str, e: str = "<") -> bytes:
    coded = value.encode()
    return struct.pack(f"{e}I", len(coded)) + coded


def prop(name: str, value: Any, e: str = "<") -> bytes:
    head = text(name, e)
    if isinstance(value, bool):
        return head + struct.pack(f"{e}Ib", 0x21, value)
    if isinstance(value, int):
        return head + struct.pack(f"{e}Ii" if value < 2**31 else f"{e}II", 3 if value < 2**31 else 7, value)
    if isinstance(value, float):
        return head + struct.pack(f"{e}Id", 10, value)
    return head + struct.pack(f"{e}I", 0x20) + text(value, e)


def path(*names: str) -> str:
    return "/" + "/".join("'" + n.replace("'", "''") + "'" for n in names)


def plain(kind: str, n: int, e: str = "<") -> bytes:
    """Raw data index of `n` numbers of a numpy type such as "i4"."""
    return struct.pack(f"{e}IIIQ", 20, TYPES[kind], 1, n)


def strings(values: Sequence[str]) -> tuple[bytes, bytes]:
    """Raw data index and raw data of text."""
    coded = [v.encode() for v in values]
    ends = np.cumsum([len(c) for c in coded]).astype("<u4").tobytes()
    raw = ends + b"".join(coded)
    return struct.pack("<IIIQQ", 28, 0x20, 1, len(values), len(raw)), raw


def daqmx(
    n: int,
    scalers: Sequence[tuple[str, int, int, int]],
    widths: Sequence[int],
    *,
    digital: bool = False,
    e: str = "<",
) -> bytes:
    """Raw data index of DAQmx counts: scalers of (type, buffer, byte or bit offset, identifier)."""
    index = struct.pack(f"{e}IIIQI", 0x126A if digital else 0x1269, 0xFFFFFFFF, 1, n, len(scalers))
    for kind, buffer, offset, number in scalers:
        layout = f"{e}IIIBI" if digital else f"{e}IIIII"
        index += struct.pack(layout, DAQMX_TYPES[kind], buffer, offset, 0, number)
    return index + struct.pack(f"{e}I{len(widths)}I", len(widths), *widths)


def segment(
    objects: Sequence[tuple[str, bytes, Mapping[str, Any]]],
    raw: bytes = b"",
    *,
    flags: int = META | NEW_LIST,
    unfinished: bool = False,
) -> bytes:
    """One segment; `objects` are (path, raw data index, properties). `unfinished`: as after a crash."""
    e = ">" if flags & BIG_ENDIAN else "<"
    meta = b""
    if flags & META:
        meta = struct.pack(f"{e}I", len(objects))
        for name, index, properties in objects:
            meta += text(name, e) + index + struct.pack(f"{e}I", len(properties))
            meta += b"".join(prop(k, v, e) for k, v in properties.items())
    flags |= RAW if raw else 0
    after = 0xFFFFFFFFFFFFFFFF if unfinished else len(meta) + len(raw)
    return b"TDSm" + struct.pack("<I", flags) + struct.pack(f"{e}IQQ", 4713, after, len(meta)) + meta + raw


def linear(
    slope: float, intercept: float = 0.0, *, number: int = 0, source: int = 0xFFFFFFFF
) -> dict[str, Any]:
    """Properties of a linear scale."""
    scale = f"NI_Scale[{number}]"
    return {
        "NI_Scaling_Status": "unscaled",
        "NI_Number_Of_Scales": number + 1,
        f"{scale}_Scale_Type": "Linear",
        f"{scale}_Linear_Slope": slope,
        f"{scale}_Linear_Y_Intercept": intercept,
        f"{scale}_Linear_Input_Source": source,
    }


def wave(rate: float, unit: str = "V", **more: Any) -> dict[str, Any]:
    """Waveform properties of a channel."""
    return {"wf_increment": 1.0 / rate, "wf_start_offset": 0.0, "unit_string": unit, **more}


def write(path, channels, *, root=None, group=None, name="g"):
    """A file by npTDMS: channels are (name, data, properties)."""
    with TdmsWriter(path) as writer:
        objects = [ChannelObject(name, n, np.asarray(d), p) for n, d, p in channels]
        writer.write_segment([RootObject(root or {}), GroupObject(name, group or {}), *objects])
    return path
