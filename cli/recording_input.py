"""What the verbs for one recording share: how it is opened and read, and the options for that."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

import click

from specan_cli.output import say
from specan_cli.verbosity import is_quiet, is_verbose

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from specan.data.recording import Channel, Recording

Found = TypeVar("Found", covariant=True)
_LONG_SAMPLES = 50_000_000  # some seconds of work


def opening_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Options that say what the file itself does not: channel table, calibration, sampling rate."""
    options = [
        click.option("--channel-table", type=click.Path(path_type=Path), help="Roles, units, sensitivities."),
        click.option("--calibration", type=click.Path(path_type=Path), help="A calibration.toml to apply."),
        click.option(
            "--sampling-rate", type=float, metavar="HZ", help="Sampling rate, instead of that in the file."
        ),
    ]
    for option in reversed(options):
        command = option(command)
    return command


def section_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Options for a time section and the channels."""
    options = [
        click.option("--channel", "channels", multiple=True, help="A channel or a pattern; repeatable."),
        click.option(
            "--start", "start_s", type=float, default=0.0, metavar="S", help="Start of the section."
        ),
        click.option("--stop", "stop_s", type=float, metavar="S", help="End of the section."),
    ]
    for option in reversed(options):
        command = option(command)
    return command


def quantity_option(command: Callable[..., Any]) -> Callable[..., Any]:
    """The option ``--quantity``."""
    return click.option(
        "--quantity",
        type=click.Choice(["displacement", "velocity", "acceleration"]),
        help="Of channels of motion: integrated or differentiated.  [default: as measured, a vibrometer's velocity]",
    )(command)


def given(**options: Any) -> dict[str, Any]:
    """Options that were given; the settings' own defaults hold for the others."""
    return {name: value for name, value in options.items() if value is not None and value != ()}


class Accumulator(Protocol):
    """An analysis that takes its samples in pieces."""

    channels: tuple[Channel, ...]
    start: int
    stop: int

    def add(self, samples: NDArray[np.float64]) -> None:
        """Take the next samples."""
        ...


class Analysis(Accumulator, Protocol[Found]):
    """One that has a result."""

    def result(self) -> Found:
        """What was found."""
        ...


def feed(accumulator: Accumulator, recording: Recording, piece: int = 1 << 16) -> None:
    """Read the section once; a bar on a terminal where it takes some time."""
    total = accumulator.stop - accumulator.start
    if is_verbose():
        rate = accumulator.channels[0].sampling_rate if accumulator.channels else 0.0
        say(
            f"Reading {recording.label}: {len(accumulator.channels)} channels, {total} samples at {rate:g} Hz."
        )
    hidden = is_quiet() or not sys.stderr.isatty() or total * len(accumulator.channels) < _LONG_SAMPLES
    with click.progressbar(length=total, file=sys.stderr, label=recording.label, hidden=hidden) as bar:
        for samples in recording.blocks(accumulator.channels, piece, accumulator.start, accumulator.stop):
            accumulator.add(samples)
            bar.update(samples.shape[1])


def fed(accumulator: Analysis[Found], recording: Recording) -> Found:
    """The result of an analysis that `feed` has given the section."""
    feed(accumulator, recording)
    return accumulator.result()


def say_notes(notes: tuple[str, ...], flags: dict[str, tuple[str, ...]]) -> None:
    """Notes and flags, on standard error."""
    for note in () if is_quiet() else notes:
        say(f"Note: {note}.")
    for name, words in flags.items():
        if words:
            say(f"Warning: {name}: {', '.join(words)}.")
