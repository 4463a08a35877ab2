"""Options that several verbs have, and what `--limit` says: pass or fail, in words and in the exit code."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from specan.data.limits import Kept

FRACTIONS = [1, 2, 3, 6, 12, 24, "bark"]  # of an octave, or critical bands


def velocity_option() -> Callable[[Any], Any]:
    """The option ``--velocity-reference``."""
    return click.option(
        "--velocity-reference",
        type=click.Choice(["1 nm/s", "50 nm/s"]),
        help="0 dB of velocity.  [default: 1 nm/s]",
    )


def weighting_option(text: str) -> Callable[[Any], Any]:
    """The option ``--weighting``."""
    kinds = click.Choice(["A", "B", "C", "Z"], case_sensitive=False)
    return click.option("--weighting", type=kinds, metavar="A|B|C|Z", help=text)


EXCEEDED = 5  # exit code


def limit_option() -> Callable[[Any], Any]:
    """The option ``--limit FILE``."""
    return click.option(
        "--limit",
        type=click.Path(path_type=Path),
        metavar="FILE",
        help="Compare the levels with limits (CSV: band_hz, upper_dB, lower_dB); exit code 5 beyond one.",
    )


def limit_content(kept: Sequence[Kept]) -> dict[str, Any]:
    """For JSON; nothing where nothing was compared."""
    names = ("channel", "passed", "excess_dB", "place", "compared")
    return {"limits": [{name: getattr(one, name) for name in names} for one in kept]} if kept else {}


def show_limit(limit: Path | None, kept: Sequence[Kept]) -> None:
    """A line for each channel."""
    label = "" if limit is None else limit.name
    for one in kept:
        if one.passed:
            text = f"passed, {-one.excess_dB:.2f} dB below the limit at {one.place}"
        else:
            text = f"FAILED, {one.excess_dB:.2f} dB beyond the limit at {one.place}"
        click.echo(f"Limits {label}: {one.channel}: {text} ({one.compared} compared)")


def limit_code(kept: Sequence[Kept]) -> int:
    """The exit code."""
    return 0 if all(one.passed for one in kept) else EXCEEDED
