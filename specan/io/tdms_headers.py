"""Headers of a TDMS file: objects, properties and the layout of the samples. No sample is read."""

from __future__ import annotations

import logging
import os
import struct
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from nptdms.common import ObjectPath
from nptdms.log import log_manager
from nptdms.reader import TdmsReader
from nptdms.timestamp import TdmsTimestamp
from nptdms.types import DaqMxRawData

from specan.errors import InputError
from specan.io.tdms_layout import Layout, Track, layout_of


@dataclass(frozen=True)
class TdmsObject:
    """A channel as it is in the file.

    Attributes
    ----------
    path : str
        Path of the object, ``/'group'/'channel'``.
    type_name : str
        Type of its samples as npTDMS calls it ("Int32", "String"); empty where there is none.
    scalers : tuple of int
        Identifiers of its DAQmx scalers.
    track : Track, optional
        Where its samples are; None where it has none.
    """

    path: str
    group: str
    name: str
    type_name: str
    properties: Mapping[str, Any]
    scalers: tuple[int, ...] = ()
    track: Track | None = None

    @property
    def n_samples(self) -> int:
        """Its length."""
        return self.track.n_samples if self.track else 0


@dataclass(frozen=True)
class Headers:
    """What the headers of a TDMS file say."""

    path: Path
    properties: Mapping[str, Any]
    groups: Mapping[str, Mapping[str, Any]]
    channels: tuple[TdmsObject, ...]
    layout: Layout


def read_headers(path: Path) -> Headers:
    """Read the headers of a TDMS file.

    An index file beside it is never used: it may belong to another file, and it says nothing that
    the headers do not say.

    Raises
    ------
    InputError
        The headers are damaged.
    """
    with path.open("rb") as file, quiet():
        size = file.seek(0, 2)
        file.seek(0)
        try:
            reader = TdmsReader(file)
            reader.read_metadata()
            # The list of segments is the one thing that npTDMS keeps to itself and that reading in
            # blocks cannot do without.
            layout = layout_of(reader._segments, size)
            properties, groups, channels = _objects(reader.object_metadata)
        except InputError as fault:
            raise fault.within(path.name) from None
        except Exception as fault:  # a damaged length field can end in any error of Python
            raise InputError(
                f"the TDMS headers of {path.name} are damaged ({type(fault).__name__}: {fault})",
                expected="a file as LabVIEW or DAQmx writes it",
                remedy="copy or record it again",
            ) from None
    return Headers(
        path, properties, groups, tuple(replace(c, track=layout.tracks.get(c.path)) for c in channels), layout
    )


def _objects(
    found: Mapping[str, Any],
) -> tuple[dict[str, Any], dict[str, dict[str, Any]], list[TdmsObject]]:
    """Properties of the file and of its groups, and the channels."""
    properties: dict[str, Any] = {}
    groups: dict[str, dict[str, Any]] = {}
    channels: list[TdmsObject] = []
    for text, about in found.items():
        place = ObjectPath.from_string(text)
        values = {
            str(k): v.as_datetime64() if isinstance(v, TdmsTimestamp) else v
            for k, v in about.properties.items()
        }
        if place.is_root:
            properties = values
        elif place.is_group:
            groups[place.group] = values
        else:
            groups.setdefault(place.group, {})
            kind = about.data_type.__name__ if about.data_type else ""
            scalers = tuple(about.scaler_data_types or ()) if about.data_type is DaqMxRawData else ()
            channels.append(TdmsObject(text, place.group, place.channel, kind, values, scalers))
    return properties, groups, channels


@contextmanager
def quiet() -> Iterator[None]:
    """Keep npTDMS from logging: what it warns about, the recording says itself."""
    before = log_manager.log_level
    log_manager.set_level(logging.CRITICAL)
    try:
        yield
    finally:
        log_manager.set_level(before)


_LEAD_IN, _BIG_ENDIAN, _NOT_CLOSED = 28, 1 << 6, 0xFFFFFFFFFFFFFFFF
_PIECE = 1 << 20


def metadata_of(path: Path | str) -> Iterator[bytes]:
    """Lead-in and metadata of every segment, in the order of the file and in pieces of at most 1 MiB.

    Ends without an error where a segment does not begin as it should: what the bytes mean is for
    `read_headers` to say.
    """
    with open(path, "rb") as file:
        size = os.fstat(file.fileno()).st_size
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
