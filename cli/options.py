"""Options that several verbs have."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import click

FRACTIONS = [1, 3, 6, 12, 24]  # of an octave


def level_options(what: str) -> Callable[[Any], Any]:
    """The options ``--velocity-reference`` and ``--settling``."""

    def add(command: Callable[..., Any]) -> Any:
        settling = click.option(
            "--settling",
            type=click.Choice(["left-out", "counted"]),
            help=f"The cut at the ends of the section, in {what}.  [default: left-out]",
        )
        reference = click.option(
            "--velocity-reference",
            type=click.Choice(["1 nm/s", "50 nm/s"]),
            help="0 dB of velocity.  [default: 1 nm/s]",
        )
        return reference(settling(command))

    return add


def weighting_option(text: str) -> Callable[[Any], Any]:
    """The option ``--weighting``."""
    kinds = click.Choice(["A", "B", "C", "Z"], case_sensitive=False)
    return click.option("--weighting", type=kinds, metavar="A|B|C|Z", help=text)
