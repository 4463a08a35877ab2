"""``specan study report``: one self-contained page."""

from __future__ import annotations

from pathlib import Path

import click

from specan_cli.study_output import open_study, study_options


@click.command("report")
@study_options
@click.option("-o", "--output", required=True, type=click.Path(path_type=Path), help="HTML file to write.")
def command(directory: Path, effects: tuple[Path, ...], as_json: bool, output: Path) -> None:
    """Write everything about DIR on one page: figures, verdict, history, what it rests on.

    The page needs no network and no other file.

    \b
    specan study report my_study -o report.html
    """
    from specan.errors import RequestError
    from specan.report.study_report import study_report
    from specan_cli.output import emit_json

    if not output.absolute().parent.is_dir():
        raise RequestError(f"the directory of {output} does not exist", remedy="make it, or choose another")
    page = study_report(open_study(directory, effects))
    try:
        output.write_text(page, encoding="utf-8", newline="\n")
    except OSError as fault:
        raise RequestError(
            f"{output} cannot be written ({fault.strerror or fault})", remedy="choose another place"
        ) from None
    if as_json:
        emit_json({"report": str(output)})
    else:
        click.echo(f"Written: {output}")
