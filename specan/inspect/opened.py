"""The files that a page was opened for: read by several threads, watched for changes."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from specan.arrays import Real
from specan.data.channel import Channel
from specan.data.recording import Recording, SampleSource
from specan.errors import InputError
from specan.result import gathered


@dataclass
class WatchedSource:
    """Samples of a file that must be the one that was opened.

    Attributes
    ----------
    source : SampleSource
    path : Path
    stamp : tuple
        Size and time of change when the headers were read.
    """

    source: SampleSource
    path: Path
    stamp: tuple[int, int]

    def read(self, indices: Sequence[int], start: int, stop: int) -> Real:
        """Samples of the chosen channels; see `SampleSource`.

        Raises
        ------
        InputError
            The file has vanished or changed since it was opened.
        """
        if stamp_of(self.path) != self.stamp:
            raise InputError(
                f"{self.path.name} has changed since it was opened",
                expected="the file as it was",
                remedy="start specan inspect again",
            )
        return self.source.read(indices, start, stop)


def stamp_of(path: Path) -> tuple[int, int]:
    """Size and time of change of a file.

    Raises
    ------
    InputError
        It is not there any more.
    """
    try:
        found = path.stat()
    except OSError as fault:
        raise InputError(
            f"{path.name} cannot be reached any more ({fault.strerror or fault})",
            remedy="put it back, or start specan inspect again",
        ) from None
    return found.st_size, found.st_mtime_ns


def watched(recording: Recording, path: Path) -> Recording:
    """The recording with its source watched."""
    return replace(recording, source=WatchedSource(recording.source, path, stamp_of(path)))


@dataclass(frozen=True)
class Chosen:
    """Channels of one recording and one rate."""

    number: int
    recording: Recording
    channels: tuple[Channel, ...]

    @property
    def patterns(self) -> tuple[str, ...]:
        """For the settings of an analysis."""
        return tuple(c.path for c in self.channels)


@dataclass(frozen=True)
class Opened:
    """One recording, or two of which the second is laid over the first.

    Attributes
    ----------
    recordings : tuple of Recording
    arguments : tuple of str
        Options of the command line with which they were opened.
    """

    recordings: tuple[Recording, ...]
    arguments: tuple[str, ...] = ()

    @property
    def keys(self) -> dict[str, tuple[int, Channel]]:
        """Channels that can be shown, by the name that they have in an address."""
        return {
            f"{'2:' if number else ''}{c.path}": (number, c)
            for number, recording in enumerate(self.recordings)
            for c in recording.channels
            if c.sampling_rate > 0 and c.n_samples > 0
        }

    def text(self, number: int, name: str) -> str:
        """A channel's name in a legend: with its file where there are two."""
        return name if len(self.recordings) == 1 else f"{name} · {self.recordings[number].label}"

    def chosen(self, keys: Sequence[str]) -> list[Chosen]:
        """The channels of the keys by recording and sampling rate; unknown keys are ignored."""
        shown = [of for key, of in self.keys.items() if key in keys]
        sorted_out = gathered(((number, channel.sampling_rate), channel) for number, channel in shown)
        return [Chosen(n, self.recordings[n], tuple(found)) for (n, _), found in sorted_out.items()]

    def without_tachos(self, keys: Sequence[str], named: str = "") -> tuple[str, ...]:
        """Keys of channels that are no tachos, nor the channel that is named as one."""
        known = self.keys
        return tuple(
            k for k in keys if k in known and known[k][1].role != "tacho" and known[k][1].label != named
        )

    def command(self, number: int, verb: str, words: Sequence[str]) -> str:
        """A verb for one of the recordings, read as it was here."""
        recording = self.recordings[number]
        path = getattr(recording.source, "path", recording.label)
        return shlex.join(["specan", verb, str(path), *words, *self.arguments])

    @property
    def calibration(self) -> str:
        """Which calibration the channels have."""
        return ", ".join(
            dict.fromkeys(r.calibration_of([c.name for c in r.channels]) for r in self.recordings)
        )

    @property
    def duration_s(self) -> float:
        """Of the longest channel."""
        return max((c.duration_s for _, c in self.keys.values()), default=0.0)
