"""Options that several verbs have."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import click

FRACTIONS = [1, 3, 6, 12, 24]  # of an octave


def weighting_option(text: str) -> Callable[[Any], Any]:
    """The option ``--weighting``."""
    kinds = click.Choice(["A", "B", "C", "Z"], case_sensitive=False)
    return click.option("--weighting", type=kinds, metavar="A|B|C|Z", help=text)
