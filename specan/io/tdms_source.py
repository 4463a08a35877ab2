"""Samples of a TDMS file, all channels of a block at once.

A block is gathered in windows: pieces of channels that lie close together in the file are read with
one call, and each is converted to float64 while it is still in the processor's cache. No more than
one window is held beside the block itself, however the file is laid out.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

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
class _Run:
    """Channels of one type in consecutive rows of the result, `step` bytes apart in every chunk."""

    row: int
    n_rows: int
    step: int
    strip: Strip  # of the first channel


@dataclass(frozen=True, slots=True)
class _Piece:
    """Samples on a lattice: (channels, chunks, samples of each)."""

    position: int
    span: int
    row: int
    first: int
    shape: tuple[int, int, int]
    strides: tuple[int, int, int]
    dtype: np.dtype[Any]


class TdmsSource:
    """Reads samples of the channels of one file; implements `specan.data.recording.SampleSource`.

    The file is opened for each call, so that nothing is held, locked or shared between threads.
    """

    def __init__(self, path: Path, layout: Layout, feeds: Sequence[Feed]) -> None:
        self.path, self.layout, self.feeds = path, layout, tuple(feeds)

    def read(self, indices: Sequence[int], start: int, stop: int) -> NDArray[np.float64]:
        """Samples of the chosen channels after the file's own scaling; see SampleSource."""
        out = np.empty((len(indices), stop - start), dtype=np.float64)
        feeds = [self.feeds[i] for i in indices]
        for row, feed in enumerate(feeds):
            if feed.foreign:
                out[row] = self._read_foreign(feed, start, stop)

        slopes, intercepts = (
            np.array([f.line[k] if f.line else np.nan for f in feeds])[:, None, None] for k in (0, 1)
        )

        def convert(piece: _Piece, raw: NDArray[Any]) -> None:
            rows = slice(piece.row, piece.row + raw.shape[0])
            n = raw.shape[1] * raw.shape[2]
            target = out[rows, piece.first : piece.first + n].reshape(raw.shape)
            if all(f.line for f in feeds[rows]):
                with np.errstate(invalid="ignore"):  # a signalling NaN of a damaged file
                    target[...] = raw
                if (slopes[rows] != 1.0).any():
                    target *= slopes[rows]
                if (intercepts[rows] != 0.0).any():
                    target += intercepts[rows]
                return
            for into, values, feed in zip(target, raw, feeds[rows], strict=True):
                into[...] = feed.scaling.apply(values.reshape(-1)).reshape(values.shape)

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
        together: dict[int, list[tuple[int, Feed]]] = {}
        for row, feed in feeds:
            together.setdefault(id(feed.found.track), []).append((row, feed))
        pieces = [p for group in together.values() for p in self._pieces(group, start, stop)]
        if not pieces:
            return
        pieces.sort(key=lambda p: p.position)
        windows = list(_windows(pieces))
        store = np.empty(max(size for _, size, _ in windows), dtype=np.uint8)
        with self._open() as file:
            for position, size, inside in windows:
                self._fill(file, position, store[:size])
                for piece in inside:
                    raw: NDArray[Any] = np.ndarray(
                        piece.shape, piece.dtype, store, piece.position - position, piece.strides
                    )
                    use(piece, raw)

    def _pieces(self, feeds: Sequence[tuple[int, Feed]], start: int, stop: int) -> Iterator[_Piece]:
        """Pieces of channels that share a track."""
        track = self.layout.tracks[feeds[0][1].found.path]
        runs_of: dict[int, list[_Run]] = {}  # segments of one structure share their strips
        first, last = np.searchsorted(track.starts, [start, stop], side="right") - 1
        for k in range(int(first), min(int(last) + 1, len(track.parts))):
            part = self.layout.parts[track.parts[k]]
            if id(part.strips) not in runs_of:
                runs_of[id(part.strips)] = list(_runs(part.strips, feeds))
            begin = int(track.starts[k])
            low, high = max(start - begin, 0), min(stop, int(track.starts[k + 1])) - begin
            for run in runs_of[id(part.strips)]:
                for at, chunks, n in _split(part, run.strip, low, high):
                    yield from _cut(part, run, at, chunks, n, begin + at - start)

    def _open(self) -> BinaryIO:
        try:
            return self.path.open("rb", buffering=0)
        except OSError as fault:
            raise InputError(
                f"{self.path.name} cannot be opened any more ({fault.strerror})",
                remedy="keep the recordings in place while they are analysed",
            ) from None

    def _fill(self, file: BinaryIO, position: int, store: NDArray[np.uint8]) -> None:
        file.seek(position)
        done, view = 0, memoryview(store)  # type: ignore[arg-type]
        while done < len(view):
            try:
                got = file.readinto(view[done:])  # type: ignore[attr-defined]
            except OSError as fault:
                raise InputError(f"{self.path.name} cannot be read ({fault.strerror})") from None
            if not got:
                raise InputError(
                    f"{self.path.name} ends at byte {position + done}, before the samples that its headers name",
                    remedy="do not change a recording while it is analysed",
                )
            done += got

    def _read_foreign(self, feed: Feed, start: int, stop: int) -> NDArray[np.float64]:
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


def _runs(strips: dict[str, Strip], feeds: Sequence[tuple[int, Feed]]) -> Iterator[_Run]:
    """Join channels that follow each other at one distance, in the chunk and in the result."""
    run: _Run | None = None
    for row, feed in feeds:
        strip = strips[feed.found.path]
        if run is not None:
            shape = (run.strip.stride, run.strip.count, run.strip.dtype)
            same = row == run.row + run.n_rows and (strip.stride, strip.count, strip.dtype) == shape
            step = (strip.offset - run.strip.offset) // run.n_rows
            regular = strip.offset == run.strip.offset + run.n_rows * step > run.strip.offset
            if same and regular and (run.n_rows == 1 or step == run.step):
                run = _Run(run.row, run.n_rows + 1, step, run.strip)
                continue
            yield run
        run = _Run(row, 1, 0, strip)
    if run is not None:
        yield run


def _cut(part: Part, run: _Run, at: int, chunks: int, n: int, first: int) -> Iterator[_Piece]:
    """The piece of a run, or one for each channel where these lie far apart."""
    strip = run.strip
    chunk, sample = divmod(at, strip.count)
    position = part.position + chunk * part.chunk_bytes + strip.offset + sample * strip.stride
    one = (chunks - 1) * part.chunk_bytes + (n - 1) * strip.stride + strip.dtype.itemsize
    span = (run.n_rows - 1) * run.step + one
    # Far apart: what lies between would be read for nothing.
    apart = span > _WINDOW_BYTES or span > 2 * run.n_rows * chunks * n * strip.dtype.itemsize
    if apart and run.step >= one:
        for k in range(run.n_rows):
            yield _Piece(
                position + k * run.step, one, run.row + k, first,
                (1, chunks, n), (0, part.chunk_bytes, strip.stride), strip.dtype,
            )  # fmt: skip
        return
    yield _Piece(
        position, span, run.row, first,
        (run.n_rows, chunks, n), (run.step, part.chunk_bytes, strip.stride), strip.dtype,
    )  # fmt: skip


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
