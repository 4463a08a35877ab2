"""Where the samples of a TDMS file lie, worked out from its headers alone.

A file is a sequence of *parts*. In a part every channel lies on a lattice: chunks follow each other
at a constant distance, samples of a chunk at a constant stride. Contiguous, interleaved and DAQmx
data differ only in these numbers; a segment whose last chunk is short becomes two parts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any

import numpy as np
from nptdms.daqmx import DaqmxSegmentObject, DigitalLineScaler, get_buffer_dimensions
from numpy.typing import NDArray

from specan.errors import InputError

# Table of contents of a segment (NI white paper "TDMS File Format Internal Structure").
_INTERLEAVED = 1 << 5
_BIG_ENDIAN = 1 << 6


@dataclass(frozen=True)
class Strip:
    """Samples of one channel in one chunk: `count` of them, `stride` bytes apart."""

    offset: int
    stride: int
    dtype: np.dtype[Any]
    count: int


@dataclass(frozen=True)
class Part:
    """Chunks of one layout that follow each other in the file."""

    position: int
    chunk_bytes: int
    strips: dict[str, Strip]


@dataclass(frozen=True)
class Track:
    """The parts in which a channel has samples, and the index of the first sample of each.

    `starts` has one entry more than `parts`: the length of the channel.
    """

    parts: NDArray[np.int64]
    starts: NDArray[np.int64]

    @property
    def n_samples(self) -> int:
        """Length of the channel."""
        return int(self.starts[-1])


@dataclass(frozen=True)
class Layout:
    """Parts of a file and the track of every channel, by object path.

    Attributes
    ----------
    truncated : bool
        The last segment holds less than its header promises.
    short_midfile : frozenset of str
        Channels of segments that are complete and end in a short chunk, where npTDMS reads
        beyond the segment.
    foreign : mapping
        Channels whose samples lie in a way that this module does not know, and why; npTDMS reads them.
    cut_off : frozenset of str
        Channels without a sample, because the file ends before them.
    """

    parts: Sequence[Part]
    tracks: dict[str, Track]
    truncated: bool = False
    short_midfile: frozenset[str] = frozenset()
    foreign: dict[str, str] = field(default_factory=dict)
    cut_off: frozenset[str] = frozenset()

    def dtype_of(self, path: str) -> np.dtype[Any]:
        """Type of the numbers of a channel."""
        return self.parts[self.tracks[path].parts[0]].strips[path].dtype


def layout_of(segments: Sequence[Any], file_size: int) -> Layout:
    """Layout of a file from the segments that npTDMS found in it.

    Channels of a segment that was cut off get a common length: the samples that all of them have.
    Where that would leave no channel anything, those that are complete are kept.

    Parameters
    ----------
    segments : sequence of nptdms.tdms_segment.TdmsSegment
        Segments of the file, in order.
    file_size : int
        Size of the file in bytes.
    """
    builder = _Builder()
    for segment in segments:
        builder.add(segment)
    end = segments[-1].next_segment_pos if segments else 0
    truncated = builder.truncated or end < file_size
    tracks = builder.tracks()
    cut_off = {path for path in builder.seen if path not in tracks}
    return Layout(
        builder.parts, tracks, truncated, frozenset(builder.short), builder.foreign, frozenset(cut_off)
    )


@dataclass
class _Builder:
    parts: list[Part] = field(default_factory=list)
    pieces: dict[str, list[tuple[int, int]]] = field(default_factory=dict)  # path -> (part, samples)
    seen: set[str] = field(default_factory=set)
    short: set[str] = field(default_factory=set)
    foreign: dict[str, str] = field(default_factory=dict)
    truncated: bool = False
    _known: dict[tuple[Any, ...], tuple[dict[str, Strip], int]] = field(default_factory=dict)
    _longer: dict[tuple[int, int], dict[str, Strip]] = field(default_factory=dict)

    def add(self, segment: Any) -> None:
        """Take over one segment."""
        self.truncated = self.truncated or segment.segment_incomplete
        objects = [o for o in segment.ordered_objects if o.has_data and o.number_values]
        size = segment.next_segment_pos - segment.data_position
        if not objects or size <= 0:
            return
        self.seen.update(o.path for o in objects)
        strips, chunk = self._chunk(segment, objects)
        whole, rest = divmod(size, chunk)
        shapes = {(s.stride, s.stride * s.count) for s in strips.values()}
        if len(shapes) == 1 and shapes.pop()[1] == chunk:
            # Nothing but rows, which follow each other across chunks: the segment is one chunk, however long.
            count = size // next(iter(strips.values())).stride
            self._append(segment.data_position, size, 1, self._long(strips, count))
            if rest and not segment.segment_incomplete:
                self.short.update(strips)
            return
        if whole:
            self._append(segment.data_position, chunk, whole, strips)
        if rest and segment.segment_incomplete:
            kept = _cut(strips, rest, nothing_else=not (whole or self.pieces))
            self._append(segment.data_position + whole * chunk, rest, 1, kept)
        elif rest:
            shared = _shared(strips, chunk, rest, objects)
            self._append(segment.data_position + whole * chunk, rest, 1, shared)

    def _long(self, strips: dict[str, Strip], count: int) -> dict[str, Strip]:
        """Strips of `count` rows; equal segments share them."""
        key = (id(strips), count)
        if key not in self._longer:
            self._longer[key] = {p: replace(s, count=count) for p, s in strips.items()}
        return self._longer[key]

    def _append(self, position: int, chunk_bytes: int, n_chunks: int, strips: dict[str, Strip]) -> None:
        number = len(self.parts)
        self.parts.append(Part(position, chunk_bytes, strips))
        for path, strip in strips.items():
            if strip.count:
                self.pieces.setdefault(path, []).append((number, strip.count * n_chunks))

    def _chunk(self, segment: Any, objects: list[Any]) -> tuple[dict[str, Strip], int]:
        """Strips of a full chunk and its size in bytes; segments of the same structure share them."""
        interleaved = bool(segment.toc_mask & _INTERLEAVED)
        order = ">" if segment.toc_mask & _BIG_ENDIAN else "<"
        daqmx = isinstance(objects[0], DaqmxSegmentObject)
        key: tuple[Any, ...] = (interleaved, order)
        key += tuple((o.path, o.number_values, o.data_size, o.data_type) for o in objects)
        if daqmx:
            key += tuple(_scalers(o) for o in objects)
        if key not in self._known:
            if daqmx:
                self.foreign |= _foreign(objects)
                self._known[key] = _daqmx_chunk(objects, order)
            else:
                self._known[key] = _plain_chunk(objects, order, interleaved)
        return self._known[key]

    def tracks(self) -> dict[str, Track]:
        """Tracks of all channels; equal ones share their arrays."""
        shared: dict[tuple[bytes, bytes], Track] = {}
        tracks = {}
        for path, pieces in self.pieces.items():
            table = np.array(pieces, dtype=np.int64)
            parts = np.ascontiguousarray(table[:, 0])
            starts = np.concatenate([[0], np.cumsum(table[:, 1])])
            key = (parts.tobytes(), starts.tobytes())
            tracks[path] = shared.setdefault(key, Track(parts, starts))
        return tracks


def _plain_chunk(objects: list[Any], order: str, interleaved: bool) -> tuple[dict[str, Strip], int]:
    """All samples of one channel, then all of the next, text stepped over; or one of every channel, then the next."""
    sizes = [o.data_type.size for o in objects]
    row = sum(filter(None, sizes)) if interleaved else 0
    if row and (None in sizes or len({o.number_values for o in objects}) > 1):
        raise InputError(
            "an interleaved segment holds channels of unequal length or of text",
            expected="numbers, as many of each channel",
        )
    strips, offset = {}, 0
    for o, size in zip(objects, sizes, strict=True):
        if size is not None:
            strips[o.path] = Strip(offset, row or size, _dtype(o.data_type, order), int(o.number_values))
        offset += size if row else int(o.data_size)
    return strips, row * int(objects[0].number_values) or offset


def _daqmx_chunk(objects: list[Any], order: str) -> tuple[dict[str, Strip], int]:
    """One buffer a card after the other, each of them rows of its card's channels."""
    buffers = get_buffer_dimensions(objects)
    starts = [0, *np.cumsum([n * width for n, width in buffers]).tolist()]
    strips = {}
    for o in objects:
        scaler = o.daqmx_metadata.scalers[0]
        number = scaler.raw_buffer_index
        strips[o.path] = Strip(
            offset=starts[number] + scaler.byte_offset(),
            stride=buffers[number][1],
            dtype=_dtype(scaler.data_type, order),
            count=int(o.number_values),
        )
    return strips, starts[-1]


def _scalers(o: Any) -> tuple[Any, ...]:
    return tuple(
        (s.scale_id, s.data_type, s.raw_buffer_index, s.byte_offset()) for s in o.daqmx_metadata.scalers
    ) + tuple(o.daqmx_metadata.raw_data_widths)


def _foreign(objects: list[Any]) -> dict[str, str]:
    """DAQmx channels that are more than one number a sample."""
    foreign = {}
    for o in objects:
        scalers = o.daqmx_metadata.scalers
        if len(scalers) != 1:
            foreign[o.path] = f"a sum of {len(scalers)} DAQmx scalers"
        elif isinstance(scalers[0], DigitalLineScaler):
            foreign[o.path] = "a digital line"
    return foreign


def _cut(strips: dict[str, Strip], rest: int, *, nothing_else: bool) -> dict[str, Strip]:
    """Strips of a chunk of which only `rest` bytes were written: the samples that all channels have."""
    there = {
        path: min(max((rest - s.offset - s.dtype.itemsize) // s.stride + 1, 0), s.count)
        for path, s in strips.items()
    }
    share = min((Fraction(there[path], s.count) for path, s in strips.items()), default=Fraction(0))
    if not share and nothing_else:
        return {path: s for path, s in strips.items() if there[path] == s.count}
    return {path: replace(s, count=int(s.count * share)) for path, s in strips.items()}


def _shared(strips: dict[str, Strip], chunk: int, rest: int, objects: list[Any]) -> dict[str, Strip]:
    """Strips of the short last chunk of a complete segment: every channel has its share of it."""
    if isinstance(objects[0], DaqmxSegmentObject):
        raise InputError(
            "a complete segment of several DAQmx buffers ends in a short chunk",
            expected="whole chunks, since the file does not say how the buffers share the rest",
        )
    if any(o.data_type.size is None for o in objects):
        return {}  # where text ends cannot be known without reading it
    short, offset = {}, 0
    for path, strip in strips.items():
        count = strip.count * rest // chunk
        short[path] = replace(strip, offset=offset, count=count)
        offset += count * strip.stride
    return short


def _dtype(data_type: Any, order: str) -> np.dtype[Any]:
    """Type of a sample in the file; a time stamp is a pair of integers, in the order of its bytes."""
    if data_type.nptype is not None:
        return np.dtype(data_type.nptype).newbyteorder(order)
    fields = [("second_fractions", f"{order}u8"), ("seconds", f"{order}i8")]
    return np.dtype(fields if order == "<" else fields[::-1])
