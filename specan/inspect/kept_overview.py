"""Overviews of long channels, kept for the next time that the same file is opened.

They lie in the user's configuration directory: recordings are often where nothing may be written. A file is known by
its size, its time, its metadata and samples all over it, a channel by its first samples as they are read now, so that
another calibration has another overview. What is damaged is as if it were not there.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from specan.analysis.batch.identity import Identity, identify
from specan.data.channel import Channel
from specan.data.recording import Recording
from specan.inspect.opened import WatchedSource
from specan.study.user_effects import trust_record

LEAST = 20_000_000  # samples; fewer are read within a second
MOST_FILES = 104  # of four recordings with all their channels; the oldest go
_DIGEST = hashlib.sha256().digest_size

Real = NDArray[np.float64]


def folder() -> Path:
    """Where they lie."""
    return trust_record().parent / "overviews"


def place_of(recording: Recording, channel: Channel, step: int) -> Path | None:
    """The file of a channel's overview; None for what is short, or is not a file."""
    source = recording.source
    if channel.n_samples < LEAST or not isinstance(source, WatchedSource):
        return None
    with contextlib.suppress(OSError):
        known = _identity(str(source.path), source.stamp)
        about = (known.digest, known.mtime_ns, channel.group, channel.name, channel.n_samples, step)
        digest = hashlib.sha256(repr(about).encode())
        digest.update(np.ascontiguousarray(recording.read([channel], 0, step)).tobytes())
        return folder() / digest.hexdigest()
    return None


@lru_cache(maxsize=4)
def _identity(path: str, stamp: tuple[int, int]) -> Identity:
    return identify(path)


def load(place: Path, count: int) -> tuple[Real, Real] | None:
    """Lowest and highest samples of `count` steps; None where they are not kept, or not whole."""
    with contextlib.suppress(OSError):
        content = place.read_bytes()
        pairs = content[_DIGEST:]
        if len(pairs) == 16 * count and hashlib.sha256(pairs).digest() == content[:_DIGEST]:
            low, high = np.frombuffer(pairs, dtype="<f8").reshape(2, count).astype(np.float64)
            return low, high
    return None


def keep(place: Path, low: Real, high: Real) -> None:
    """Keep an overview; where nothing can be written nothing is kept."""
    pairs = np.stack([low, high]).astype("<f8").tobytes()
    part = place.with_name(f"{place.name}.{os.getpid()}.part")
    with contextlib.suppress(OSError):
        place.parent.mkdir(parents=True, exist_ok=True)
        part.write_bytes(hashlib.sha256(pairs).digest() + pairs)
        part.replace(place)
        for old in sorted(place.parent.iterdir(), key=lambda p: p.stat().st_mtime)[:-MOST_FILES]:
            old.unlink()
