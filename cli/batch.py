"""``specan batch``: everything in a directory, as text tables."""

from __future__ import annotations

import sys
from collections.abc import Callable
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from specan.divisions import DIVISIONS
from specan_cli.options import Grouped, opt, weighting_option
from specan_cli.output import asked, emit_json, note, say, table
from specan_cli.verb import decimal_option

if TYPE_CHECKING:
    from specan.analysis.batch.run import BatchReport
    from specan.analysis.batch.settings import BatchSettings


REPORT = "report.html"
SHOWN = 20  # failures named on the screen


@click.command("batch", cls=Grouped)
@click.argument("directories", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="DIR...")
@opt("-o --output", Path, "Directory for the tables.", required=True)
@opt("--settings", Path, "Settings of the analyses, a TOML file.")
@opt("--calibration", Path, "For all files, instead of the directory's.")
@opt("--reference", None, "Reference channel, such as 'Mic 1'.  [default: the vibrometer]", "CH")
@opt("--excitation", ["sine", "noise", "sweep"], "Excitation of all files.  [default: recognised]")
@opt("--channel-table", Path, "Roles, units, sensitivities of all files.")
@opt("--sampling-rate", float, "Sampling rate of all files, instead of those in the files.", "HZ")
@opt("--lines", int, "Lines of a transfer function up to fs/2.56.  [default: 3200]")
@opt("--fraction", [*DIVISIONS], "1/N octave, or critical bands.  [default: 3]")
@weighting_option("Weighting of the band levels of sound pressure.  [default: Z]")
@decimal_option("the tables")
@opt("--jobs", int, "Number of processes.  [default: chosen from the amount of data]")
@opt("--cluster", None, "Work on a dask cluster: tcp://host:8786.", "ADDRESS")
@opt("--report with_report", bool, "Write report.html to print: a list, and a page for each recording.")
@opt("--json as_json", bool, "Print a summary as JSON.")
def command(
    directories: tuple[Path, ...],
    output: Path,
    settings: Path | None,
    with_report: bool,
    as_json: bool,
    **how: Any,
) -> int:
    """Analyse every recording below DIR and write sine.txt, noise.txt and the other tables.

    Calibrations that lie in DIR are applied: a calibration.toml, or recordings of a calibrator.

    Repeat the command to resume a batch that was interrupted.

    \b
    specan batch sample_data/recordings/sine -o results --report
    """
    from specan.analysis.batch.inputs import check_own
    from specan.analysis.batch.run import STORE, run_batch
    from specan.analysis.batch.settings import read_settings

    names = ("reference", "excitation", "sampling_rate", "decimal")
    given = {name: how.pop(name) for name in names}
    given["transfer_function"] = {"lines": how.pop("lines")}
    given["octave"] = {name: how.pop(name) for name in ("fraction", "weighting")}
    chosen = read_settings(settings, given)
    if with_report:
        check_own(output / REPORT, output / STORE)
    try:
        report = run_batch(directories, output, chosen, **how, progress=progress_line(), warn=say)
    except KeyboardInterrupt:
        say("Finished results are kept; repeat the command to resume.")
        raise
    page = _write_report(report, chosen, output) if with_report else None
    return _say(report, page, chosen if as_json else None, output)


def _say(report: BatchReport, page: Path | None, settings: BatchSettings | None, output: Path) -> int:
    """What was done, as JSON where there are settings; the exit code."""
    if report.resumed:
        note(f"{report.resumed} results of an earlier run are unchanged and were reused.")
    failed = report.of_kind("failed")
    for result in failed[:SHOWN]:
        say(f"Failed: {result.label}: {result.reason}")
    if len(failed) > SHOWN:
        say(f"Failed: {len(failed) - SHOWN} more; all of them are in skipped.txt.")
    done, aside = len(report.of_kind("done")), len(report.of_kind("aside"))
    if settings is not None:
        emit_json(
            {
                "done": done,
                "aside": aside,
                "failed": {result.label: result.reason for result in failed},
                "calibration": report.calibration,
                "tables": [str(path) for path in report.tables],
                "report": None if page is None else str(page),
                "settings": settings.model_dump(mode="json"),
                "settings_hash": settings.fingerprint,
            }
        )
    else:
        click.echo(f"{done} analysed, {aside} skipped, {len(failed)} failed.")
        for line in report.calibration:
            click.echo(f"Calibration: {line}.")
        table("", ["table", "rows"], [[p.name, n] for p, n in zip(report.tables, report.rows, strict=True)])
        click.echo(f"Written to {output}." if page is None else f"Written to {output}; the page is {page}.")
    return 0 if not failed else 1 if done or aside else 3


def _write_report(report: BatchReport, settings: BatchSettings, output: Path) -> Path:
    from specan.analysis.batch.inputs import check_own, remember_own
    from specan.analysis.batch.run import STORE
    from specan.io.output_file import text_file
    from specan.report.batch_report import batch_report

    page = output / REPORT
    content = batch_report(report, settings)
    check_own(page, output / STORE)
    with text_file(page) as file:
        file.write(content)
    remember_own(page, output / STORE)
    return page


def progress_line() -> Callable[[int, int, float], None] | None:
    """Shows files done and the time that remains, on a terminal only."""
    if asked("quiet") or not sys.stderr.isatty():
        return None

    def show(count: int, total: int, remaining_s: float) -> None:
        left = timedelta(seconds=round(remaining_s))
        click.echo(f"\r{count}/{total} files, about {left} left   ", err=True, nl=count == total)

    return show
