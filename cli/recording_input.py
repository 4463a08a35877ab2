"""What the verbs for one recording share: how it is opened and read, and the options for that."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from specan_cli.output import OutputFile, is_quiet, say

if TYPE_CHECKING:
    from specan.data.recording import Recording
    from specan.units import Quantity


def opening_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Options that say what the file itself does not: channel table, calibration, sampling rate.

    The callback gets them as one dict `opening`.
    """

    @wraps(command)
    def gathered(
        channel_table: Path | None, calibration: Path | None, sampling_rate: float | None, **options: Any
    ) -> Any:
        opening = {"channel_table": channel_table, "calibration": calibration, "sampling_rate": sampling_rate}
        return command(opening=opening, **options)

    options = [
        click.option("--channel-table", type=click.Path(path_type=Path), help="Roles, units, sensitivities."),
        click.option("--calibration", type=click.Path(path_type=Path), help="A calibration.toml to apply."),
        click.option(
            "--sampling-rate", type=float, metavar="HZ", help="Sampling rate, instead of that in the file."
        ),
    ]
    found: Callable[..., Any] = gathered
    for option in reversed(options):
        found = option(found)
    return found


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


def opened(file: Path, opening: dict[str, Any], quantity: Quantity | None = None) -> Recording:
    """The recording; on a terminal it shows how far it has been read."""
    from specan.api.recordings import read
    from specan_cli.progress import Shown

    return Shown.of(read(file, quantity=quantity, **opening))


def say_notes(notes: tuple[str, ...], flags: dict[str, tuple[str, ...]]) -> None:
    """Notes and flags, on standard error."""
    for note in () if is_quiet() else notes:
        say(f"Note: {note}.")
    for name, words in flags.items():
        if words:
            say(f"Warning: {name}: {', '.join(words)}.")


def result_options(what: str = "everything") -> Callable[[Any], Any]:
    """The options ``-o`` and ``--json``, and those of opening a recording, which come as one dict `opening`."""

    def add(command: Callable[..., int]) -> Any:
        made = opening_options(command)
        made = click.option("--json", "as_json", is_flag=True, help=f"Print {what} as JSON.")(made)
        return click.option("-o", "--output", type=OutputFile(), help=f"Write {what} as text.")(made)

    return add
