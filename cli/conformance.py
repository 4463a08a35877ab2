"""``specan conformance``: the clauses of standards that are tried, expected and found."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING

import click

from specan_cli.options import EXCEEDED, json_option, opt
from specan_cli.output import table
from specan_cli.verb import TABLES, Delivery, OutputFile, decimal_option, verb

if TYPE_CHECKING:
    from specan.analysis.conformance import Check


@verb("conformance")
@opt(
    "--sampling-rate rate", float, "Sampling rate of the test signals.", "HZ", default=51200.0, show_default=True
)  # fmt: skip
@opt("-o --output", OutputFile(*TABLES), "Write the table.")
@decimal_option()
@json_option
def command(rate: float, deliver: Delivery) -> int:
    """Test specan against IEC 61260-1, IEC 61672-1 and IEEE 1057.

    Test signals are generated and analysed like recordings. The exit code is 5 if a requirement is not met.
    Microphones and converters are not tested.

    \b
    specan conformance --sampling-rate 48000
    """
    from specan.analysis.conformance import checks
    from specan.result import cell

    found = list(checks(rate))
    if deliver.output is not None:
        import pandas as pd

        from specan.io.export_file import write_frame

        rows = [{**asdict(check), "met": "yes" if check.passed else "no"} for check in found]
        write_frame(
            pd.DataFrame(rows).rename(columns={"what": "requirement"}),
            deliver.output,
            ["conformance", f"at {rate:g} Hz"],
            deliver.decimal,
        )

    def show() -> None:
        for standard in dict.fromkeys(check.standard for check in found):
            header = ["clause", "requirement", "expected", "found", "limits", "", ""]
            table(standard, header, [_row(c, cell(c.found, ".3f")) for c in found if c.standard == standard])
        click.echo(f"{sum(check.passed for check in found)} of {len(found)} requirements are met.")

    checked = [{**asdict(c), "passed": c.passed} for c in found]
    deliver.put_out({"sampling_rate_hz": rate, "checks": checked}, show)
    return 0 if all(check.passed for check in found) else EXCEEDED


def _row(check: Check, found: str) -> list[str]:
    limits = f"{check.lower:.4g} to {check.upper:.4g}"
    if check.upper == float("inf"):
        limits = f"from {check.lower:.4g}"
    expected = "" if check.expected != check.expected else f"{check.expected:g}"
    met = "" if check.passed else "NOT MET"
    return [check.clause, check.what, expected, found, limits, check.unit, met]
