"""``specan conformance``: the clauses of standards that are tried, expected and found."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import click

from specan_cli.options import EXCEEDED
from specan_cli.output import (
    TABLES,
    OutputFile,
    Verb,
    emit_json,
    is_quiet,
    say,
    say_written,
    table,
    to_standard_output,
)

if TYPE_CHECKING:
    from specan.analysis.conformance import Check


@click.command("conformance", cls=Verb)
@click.option("--sampling-rate", "rate", type=float, default=51200.0, show_default=True,
    metavar="HZ", help="Of the signals that are made for it.")  # fmt: skip
@click.option("-o", "--output", type=OutputFile(*TABLES), help="Write the table.")
@click.option("--json", "as_json", is_flag=True, help="Print the table as JSON.")
def command(rate: float, output: Path | None, as_json: bool) -> int:
    """Try what IEC 61260-1, IEC 61672-1 and IEEE 1057 ask of an analyser.

    Signals are made and analysed as recordings are. The exit code is 5 where a requirement is not met. Microphones
    and converters are not part of this.

    \b
    specan conformance --sampling-rate 48000
    """
    from specan.analysis.conformance import checks

    found = []
    for check in checks(rate):
        found.append(check)
        if not is_quiet() and not check.passed:
            say(f"Not met: {check.standard}, {check.clause}: {check.what}.")
    if output is not None:
        write_text(found, output, rate)
    if as_json:
        emit_json({"sampling_rate_hz": rate, "checks": [{**asdict(c), "passed": c.passed} for c in found]})
    elif not to_standard_output(output):
        show(found)
        say_written(output)
    return 0 if all(check.passed for check in found) else EXCEEDED


def show(found: list[Check]) -> None:
    """A table a standard."""
    for standard in dict.fromkeys(check.standard for check in found):
        rows = [
            [c.clause, c.what, *_numbers(c), c.unit, "" if c.passed else "NOT MET"]
            for c in found
            if c.standard == standard
        ]
        click.echo(standard)
        table("", ["clause", "requirement", "expected", "found", "limits", "", ""], rows)
    met = sum(check.passed for check in found)
    click.echo(f"{met} of {len(found)} requirements are met.")


def write_text(found: list[Check], path: Path, rate: float) -> None:
    """One row a requirement, tab-separated."""
    from specan import __version__
    from specan.io import results_text as text

    columns = {
        "standard": [c.standard for c in found],
        "clause": [c.clause for c in found],
        "requirement": [c.what for c in found],
        **{name: [getattr(c, name) for c in found] for name in ("expected", "found", "lower", "upper")},
        "unit": [c.unit for c in found],
        "met": ["yes" if c.passed else "no" for c in found],
    }
    header = [f"specan {__version__} conformance", f"at {rate:g} Hz"]
    text.write_table(path, header, list(columns), [text.table_lines(columns)])


def _numbers(check: Check) -> tuple[str, str, str]:
    expected = "" if check.expected != check.expected else f"{check.expected:g}"
    limits = f"{check.lower:.4g} to {check.upper:.4g}"
    if check.upper == float("inf"):
        limits = f"from {check.lower:.4g}"
    return expected, f"{check.found:.3f}", limits
