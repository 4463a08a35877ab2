"""A recording that shows how far it has been read."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence

import click

from specan.arrays import Real
from specan.data.channel import Channel
from specan.data.recording import Recording, Watched
from specan_cli.output import asked, say

_LONG_SAMPLES = 50_000_000  # some seconds of work


def shown(recording: Recording) -> Recording:
    """The same, with a bar on a terminal where reading takes some time, and a line under ``--verbose``."""
    said = set[str]()

    def watch(blocks: Iterator[Real], channels: Sequence[Channel], length: int) -> Iterator[Real]:
        rate = channels[0].sampling_rate if channels else 0.0
        text = f"Reading {recording.label}: {len(channels)} channels, {length} samples at {rate:g} Hz."
        if asked("verbose") and text not in said:
            say(text)
            said.add(text)
        hidden = length * len(channels) < _LONG_SAMPLES or asked("quiet") or not sys.stderr.isatty()
        with click.progressbar(length=length, file=sys.stderr, label=recording.label, hidden=hidden) as bar:
            for samples in blocks:
                yield samples
                bar.update(samples.shape[1])

    return Watched(**vars(recording), watch=watch)
