"""Samples of a TDMS file, all channels of a block at once.

A block is gathered in windows: pieces of channels that lie close together in the file are read with
one call, and each is converted to float64 while it is still in the processor's cache. No more than
one window is held beside the block itself, however the file is laid out.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from io import FileIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.arrays import Real
from specan.errors import InputError
from specan.io.tdms_headers import TdmsObject, quiet
from specan.io.tdms_layout import Layout, Part, Strip
from specan.io.tdms_scaling import Scaling

# A piece fits the second-level cache together with its result; a window amortises a read call.
_PIECE_BYTES = 128 * 1024
_WINDOW_BYTES = 1024 * 1024
_GAP_BYTES = 4096


@dataclass(frozen=True)
class Feed:
    """What it takes to read one channel."""

    found: TdmsObject
    scaling: Scaling
    line: tuple[float, float] | None = None  # slope and intercept where the scaling is no more than that
    foreign: bool = False  # npTDMS reads it


@dataclass(frozen=True, slots=True)
class _Piece:
    """Samples of a channel on a lattice: (chunks, samples of each)."""

    position: int
    span: int
    row: int
    first: int
    shape: tuple[int, int]
    strides: tuple[int, int]
    dtype: np.dtype[Any]


class TdmsSource:
    """Reads samples of the channels of one file; implements `specan.data.recording.SampleSource`.

    The file is opened for each call, so that nothing is held, locked or shared between threads.
    """

    def __init__(self, path: Path, layout: Layout, feeds: Sequence[Feed]) -> None:
        self.path, self.layout, self.feeds = path, layout, tuple(feeds)

    def read(self, indices: Sequence[int], start: int, stop: int) -> Real:
        """Samples of the chosen channels after the file's own scaling; see SampleSource."""
        out = np.empty((len(indices), stop - start), dtype=np.float64)
        feeds = [self.feeds[i] for i in indices]
        for row, feed in enumerate(feeds):
            if feed.foreign:
                out[row] = self._read_foreign(feed, start, stop)

        def convert(piece: _Piece, raw: NDArray[Any]) -> None:
            feed = feeds[piece.row]
            target = out[piece.row, piece.first : piece.first + raw.size].reshape(raw.shape)
            if feed.line is None:
                target[...] = feed.scaling.apply(raw.reshape(-1)).reshape(raw.shape)
                return
            slope, intercept = feed.line
            target[...] = raw
            if slope != 1.0:
                target *= slope
            if intercept != 0.0:
                target += intercept

        with np.errstate(invalid="ignore"):  # a signalling NaN of a damaged file
            self._gather([(r, f) for r, f in enumerate(feeds) if not f.foreign], start, stop, convert)
        return out

    def raw_reader(self, found: TdmsObject) -> Callable[[int, int], NDArray[Any]]:
        """A function that gives numbers of an object as they are in the file, in the machine's byte order."""
        dtype = self.layout.dtype_of(found.path).newbyteorder("=")

        def read(start: int, stop: int) -> NDArray[Any]:
            out = np.empty(stop - start, dtype=dtype)

            def copy(piece: _Piece, raw: NDArray[Any]) -> None:
                target = out[piece.first : piece.first + raw.size]
                for name in dtype.names or (None,):
                    into, values = (target, raw) if name is None else (target[name], raw[name])
                    into[...] = values.reshape(-1)

            self._gather([(0, Feed(found, Scaling()))], start, stop, copy)
            return out

        return read

    def _gather(
        self,
        feeds: Sequence[tuple[int, Feed]],
        start: int,
        stop: int,
        use: Callable[[_Piece, NDArray[Any]], None],
    ) -> None:
        pieces = [p for row, feed in feeds for p in self._pieces(row, feed.found.path, start, stop)]
        if not pieces:
            return
        pieces.sort(key=lambda p: p.position)
        windows = list(_windows(pieces))
        store = np.empty(max(size for _, size, _ in windows), dtype=np.uint8)
        try:
            with self.path.open("rb", buffering=0) as file:
                for position, size, inside in windows:
                    self._fill(file, position, store[:size])
                    for piece in inside:
                        raw: NDArray[Any] = np.ndarray(
                            piece.shape, piece.dtype, store, piece.position - position, piece.strides
                        )
                        use(piece, raw)
        except OSError as fault:
            raise InputError(
                f"{self.path.name} cannot be read any more ({fault.strerror})",
                remedy="keep the recordings in place while they are analysed",
            ) from None

    def _pieces(self, row: int, path: str, start: int, stop: int) -> Iterator[_Piece]:
        track = self.layout.tracks[path]
        first, last = np.searchsorted(track.starts, [start, stop], side="right") - 1
        for k in range(int(first), min(int(last) + 1, len(track.parts))):
            part, begin = self.layout.parts[track.parts[k]], int(track.starts[k])
            strip, size = part.strips[path], part.chunk_bytes
            low, high = max(start - begin, 0), min(stop, int(track.starts[k + 1])) - begin
            for at, chunks, n in _split(part, strip, low, high):
                chunk, sample = divmod(at, strip.count)
                position = part.position + chunk * size + strip.offset + sample * strip.stride
                span = (chunks - 1) * size + (n - 1) * strip.stride + strip.dtype.itemsize
                shape, strides = (chunks, n), (size, strip.stride)
                yield _Piece(position, span, row, begin + at - start, shape, strides, strip.dtype)

    def _fill(self, file: FileIO, position: int, store: NDArray[np.uint8]) -> None:
        file.seek(position)
        done, view = 0, memoryview(store)  # type: ignore[arg-type]
        while done < len(view):
            got = file.readinto(view[done:])
            if not got:
                raise InputError(
                    f"{self.path.name} ends at byte {position + done}, before the samples that its headers name",
                    remedy="do not change a recording while it is analysed",
                )
            done += got

    def _read_foreign(self, feed: Feed, start: int, stop: int) -> Real:
        from nptdms import TdmsFile

        with self.path.open("rb") as file, quiet():
            values = TdmsFile.open(file)[feed.found.group][feed.found.name][start:stop]
        return np.asarray(values, dtype=np.float64)


def _split(part: Part, strip: Strip, low: int, high: int) -> Iterator[tuple[int, int, int]]:
    """Cut samples `low` to `high` of a part into (first sample, chunks, samples of each)."""
    # Rows of very many channels are cut less finely: a call has a price of its own.
    per_piece = max(_PIECE_BYTES // strip.stride, 4096)
    # Small whole chunks are taken together; large ones one by one, and in pieces.
    together = max(_PIECE_BYTES // part.chunk_bytes, 1)
    while low < high:
        inside = low % strip.count
        whole = (high - low) // strip.count
        if inside == 0 and whole > 1 and together > 1:
            rows = min(whole, together)
            yield low, rows, strip.count
            low += rows * strip.count
        else:
            # Pieces begin at multiples of their size, so that channels that share rows are cut alike.
            n = min(strip.count - inside, high - low, per_piece)
            yield low, 1, n
            low += n


def _windows(pieces: Sequence[_Piece]) -> Iterator[tuple[int, int, list[_Piece]]]:
    """Join pieces that lie close together: (position, size, pieces)."""
    inside: list[_Piece] = []
    begin = end = 0
    for piece in pieces:
        reach = max(end, piece.position + piece.span)
        # Pieces that overlap (rows, small chunks) always share a window: they are read once.
        apart = piece.position > end + _GAP_BYTES
        if inside and (apart or (piece.position >= end and reach - begin > _WINDOW_BYTES)):
            yield begin, end - begin, inside
            inside = []
        if not inside:
            begin, reach = piece.position, piece.position + piece.span
        inside.append(piece)
        end = reach
    if inside:
        yield begin, end - begin, inside
