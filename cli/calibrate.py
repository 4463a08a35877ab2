"""``specan calibrate``: sensitivities and phases from recordings of a calibrator."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from specan_cli.options import json_option, opt
from specan_cli.output import note, show_sheets
from specan_cli.verb import Delivery, OutputFile, expand, failures, given, left_out, plot_option, verb

if TYPE_CHECKING:
    from specan.analysis.insertion import CalibrationSettings, Insertion


@verb("calibrate")
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="FILE...")
@opt(
    "-o --output", OutputFile(".toml"), "The calibration to write.",
    default=Path("calibration.toml"), show_default=True,
)  # fmt: skip
@opt(
    "--level level_dB",
    float,
    "Level of the calibrator in dB re 20 uPa.  [default: that of the file, else 94]",
)
@opt(
    "--frequency frequency_hz", float, "Tone of the calibrator in Hz.  [default: that of the file, else searched]"
)  # fmt: skip
@opt("--u-level u_level_dB", float, "Standard uncertainty of the level, dB.", default=0.1, show_default=True)
@opt(
    "--u-insertion", (float, float), "Standard uncertainty by which insertions differ, if the recordings do not "
    "determine it: level in dB, phase between two microphones in degrees.", "DB DEG",
    default=(0.05, 0.12), show_default=True,
)  # fmt: skip
@opt("--windows", int, "Number of measurement windows.", default=20, show_default=True)
@opt("--channel channels", None, "A calibrated channel or a pattern; repeatable.", multiple=True)
@opt(
    "--phase-model", ["delay", "constant"], "Extrapolation of the phase to other frequencies.",
    default="delay", show_default=True,
)  # fmt: skip
@opt("--channel-table", Path, "A channel table for all files.")
@opt("--budget", bool, "Print where each uncertainty comes from.")
@plot_option("sensitivities and phases")
@json_option
def command(
    files: tuple[Path, ...],
    deliver: Delivery,
    u_insertion: tuple[float, float],
    channel_table: Path | None,
    budget: bool,
    **options: Any,
) -> int:
    """Determine sensitivity and phase of every microphone from recordings of a calibrator.

    Name all insertions of one calibration together: those that share a microphone are connected in phase.

    \b
    specan calibrate sample_data/recordings/calibration/insertion_1.tdms -o calibration.toml
    """
    from specan.analysis.calibration import join_insertions
    from specan.analysis.insertion import CalibrationSettings
    from specan.io.calibration_file import write_calibration
    from specan.schema import parse

    insertion = dict(zip(("u_insertion_dB", "u_insertion_deg"), u_insertion))
    settings = parse(CalibrationSettings, given(**options, **insertion), "calibrate")
    output = deliver.output
    assert output is not None  # it has a default
    insertions, faults = _insertions(files, settings, channel_table)
    calibration = join_insertions(insertions, settings)
    write_calibration(calibration, output)
    deliver.draw(calibration)

    def show() -> None:
        show_sheets(calibration.sheets(budget))
        for text in calibration.notes:
            note(f"Note: {text}.")
        note(f"Note: recordings in the directory of {output} use it; others with --calibration {output}.")

    deliver.put_out({**calibration.to_dict(), "failures": failures(faults), "output": str(output)}, show)
    failed = any(c.verdict == "failed" for c in calibration.channels)
    return 1 if faults or failed else 0


def _insertions(
    files: tuple[Path, ...], settings: CalibrationSettings, channel_table: Path | None
) -> tuple[list[Insertion], dict[str, Exception]]:
    """What each file says, and why some say nothing.

    Where files of a directory say that they are of a calibrator, no others in it count.
    """
    from specan.analysis.batch.calibrations import is_calibrator
    from specan.analysis.batch.inputs import Input
    from specan.analysis.insertion import evaluate_insertion
    from specan.errors import InputError
    from specan.io.open import open_recording
    from specan.result import counted

    paths = [found.path for found in expand(files)]
    said = [path for path in paths if is_calibrator(Input(str(path), path.name, "", 0))]
    used = [path for path in paths if not said or path in said or path in files]
    if rest := len(paths) - len(used):
        note(f"Note: {counted(rest, 'recording')} with another excitation not used.")
    common = os.path.commonpath([path.resolve().parent for path in used])
    insertions: list[Insertion] = []
    faults: dict[str, Exception] = {}
    for path in used:
        with left_out(str(path), faults, len(used) > 1):
            label = path.resolve().relative_to(common).as_posix()
            recording = open_recording(path, label=label, channel_table=channel_table)
            insertions.append(evaluate_insertion(recording, settings))
    if not insertions:
        raise InputError("no file could be used for a calibration", remedy="see the reasons above")
    return insertions, faults
