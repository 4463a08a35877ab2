"""The option ``--plot`` of the verbs that draw."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from specan_cli.output_file import OutputFile


def _checked(context: click.Context, option: click.Parameter, path: Path | None) -> Path | None:
    """A name that cannot be written is told before the work is done."""
    if path is not None:
        from specan.report.figure_style import figure_format

        figure_format(path)
    return path


def plot_option(what: str = "") -> Callable[[Any], Any]:
    """The option ``--plot FILE``."""
    text = f"Draw {what} to a .png, .svg or .pdf." if what else "Draw to a .png, .svg or .pdf."
    return click.option("--plot", type=OutputFile(), callback=_checked, metavar="FILE", help=text)
