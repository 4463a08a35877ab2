"""``specan calibrate``: sensitivities and phases from recordings of a calibrator."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from specan_cli.output import (
    OutputFile,
    Verb,
    draw,
    emit_json,
    plot_option,
    say,
    say_written,
    table,
    to_standard_output,
)
from specan_cli.recording_verb import expand, given

if TYPE_CHECKING:
    from specan.data.calibration import Calibration, ChannelCalibration


@click.command("calibrate", cls=Verb)
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="FILE...")
@click.option(
    "-o",
    "--output",
    type=OutputFile(".toml"),
    default=Path("calibration.toml"),
    show_default=True,
    help="The calibration to write.",
)
@click.option(
    "--level",
    "level_dB",
    type=float,
    help="Level of the calibrator in dB re 20 uPa [default: that of the file, else 94].",
)
@click.option(
    "--frequency",
    "frequency_hz",
    type=float,
    help="Tone of the calibrator in Hz [default: that of the file, else searched].",
)
@click.option(
    "--u-level",
    "u_level_dB",
    type=float,
    default=0.1,
    show_default=True,
    help="Standard uncertainty of the level, dB.",
)
@click.option(
    "--u-insertion",
    type=(float, float),
    default=(0.05, 0.12),
    show_default=True,
    metavar="DB DEG",
    help="Standard uncertainty by which insertions differ, if the recordings do not determine it: level in dB, "
    "phase between two microphones in degrees.",
)
@click.option("--windows", type=int, default=20, show_default=True, help="Number of measurement windows.")
@click.option("--channel", "channels", multiple=True, help="A calibrated channel or a pattern; repeatable.")
@click.option(
    "--phase-model",
    type=click.Choice(["delay", "constant"]),
    default="delay",
    show_default=True,
    help="Extrapolation of the phase to other frequencies.",
)
@click.option("--channel-table", type=click.Path(path_type=Path), help="A channel table for all files.")
@click.option("--budget", is_flag=True, help="Print where each uncertainty comes from.")
@plot_option("sensitivities and phases")
@click.option("--json", "as_json", is_flag=True, help="Print the calibration as JSON.")
def command(
    files: tuple[Path, ...],
    output: Path,
    u_insertion: tuple[float, float],
    channel_table: Path | None,
    budget: bool,
    plot: Path | None,
    as_json: bool,
    **options: Any,
) -> int:
    """Find sensitivity and phase of every microphone from recordings of a calibrator.

    Name all insertions of one calibration together: those that share a microphone are chained in phase.

    \b
    specan calibrate sample_data/recordings/calibration/insertion_1.tdms -o calibration.toml
    """
    from specan.analysis.calibration import join_insertions
    from specan.analysis.calibrator_tone import CalibrationSettings
    from specan.analysis.insertion import evaluate_insertion
    from specan.errors import InputError
    from specan.io.calibration_file import write_calibration
    from specan.io.open import open_recording
    from specan.io.output_file import check_directory
    from specan.schema import parse

    insertion = dict(zip(("u_insertion_dB", "u_insertion_deg"), u_insertion))
    settings = parse(CalibrationSettings, given(**options, **insertion), "calibrate")
    check_directory(output)
    files = tuple(found.path for found in expand(files))
    common = os.path.commonpath([path.resolve().parent for path in files])
    insertions, failures = [], []
    for path in files:
        try:
            label = path.resolve().relative_to(common).as_posix()
            recording = open_recording(path, label=label, channel_table=channel_table)
            insertions.append(evaluate_insertion(recording, settings))
        except InputError as fault:
            if len(files) == 1:
                raise
            failures.append({"file": str(path), "reason": str(fault)})
            say(f"Left out: {fault}")
    if not insertions:
        raise InputError("no file could be used for a calibration", remedy="see the reasons above")
    calibration = join_insertions(insertions, settings)
    write_calibration(calibration, output)
    draw(calibration, plot)
    if as_json:
        emit_json({**calibration.to_json(), "failures": failures, "output": str(output)})
    elif not to_standard_output(output):
        _show(calibration)
        if budget:
            _show_budget(calibration)
        say_written(output)
    failed = any(c.verdict == "failed" for c in calibration.channels)
    return 1 if failures or failed else 0


def _show(calibration: Calibration) -> None:
    tone, level = calibration.calibrator_frequency_hz, calibration.calibrator_level_dB
    title = (
        "Calibration"
        + (f" at {tone:.2f} Hz" if tone else "")
        + (f", {level:g} dB re 20 uPa" if level else "")
    )
    rows = []
    for c in calibration.channels:
        phase, u_phase = (" / ".join(f"{x:.2f}" for x in values) for values in _phases(c))
        sheet = [f"{c.sensitivity:.3f}", f"{c.u_sensitivity_percent:.2f}", phase, u_phase]
        stability = [f"{c.scatter_percent:.3f}", f"{c.drift_percent:.3f}"]
        reference = c.phase.group if c.phase else ""
        rows.append([c.channel, *sheet, reference, *stability, "; ".join([c.verdict, *c.reasons])])
    header = ["channel", "mV/Pa", "u %", "phase deg", "u deg", "re", "scatter %", "drift %", "verdict"]
    table(title, header, rows)
    for line in calibration.calibrator_decided:
        click.echo(f"Calibrator: {line}.")
    for note in calibration.notes:
        say(f"Note: {note}.")


def _show_budget(calibration: Calibration) -> None:
    """The uncertainty budget of each result (GUM, 7.2.7); the share is of the variance."""
    rows = []
    for c in calibration.channels:
        totals: dict[str, float] = {}
        for part in c.budget:
            totals[part.of] = totals.get(part.of, 0.0) + part.u**2
        for part in c.budget:
            share = f"{100 * part.u**2 / totals[part.of]:.0f}" if totals[part.of] else ""
            dof = "" if part.dof is None else str(part.dof)
            rows.append([c.channel, part.of, part.name, part.type, f"{part.u:.4f}", part.unit, dof, share])
    header = ["channel", "result", "contribution", "type", "u", "unit", "dof", "share %"]
    table("Uncertainty budget", header, rows)


def _phases(channel: ChannelCalibration) -> tuple[tuple[float, ...], tuple[float, ...]]:
    return (channel.phase.phase_deg, channel.phase.u_phase_deg) if channel.phase else ((), ())
