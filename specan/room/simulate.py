"""What ``specan simulate room`` does: a recording that the model predicts, or the sound field on a plane."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from specan.errors import RequestError
from specan_cli.output import emit_json, say, table

if TYPE_CHECKING:
    from specan.models.chosen_model import ChosenModel
    from specan.models.model import Model
    from specan.room.model.simulated_recording import SimulatedRecording


@click.option(
    "--duration", type=float, default=10.0, show_default=True, metavar="S", help="Length of the recording."
)
@click.option(
    "--frequency", type=float, metavar="HZ", help="A sine instead of noise; the frequency of --field."
)
@click.option(
    "--field", "plane", metavar="AXIS=M", help="Level and phase on a plane, z=0.35, as .csv or as a figure."
)
def run(model: Model, options: Mapping[str, Any]) -> None:
    """A recording of microphones, vibrometer and generator (-o recording.tdms), or with --field the sound field.

    --noise is what a microphone adds, Pa.

    \b
    specan simulate room cabin.toml -o recording.tdms --duration 1
    """
    from specan.models.chosen_model import choose_model

    if not options["output"]:
        raise RequestError(
            "a simulated room has nowhere to go",
            remedy="name a file with -o: recording.tdms, or field.csv or field.png with --field",
        )
    chosen = choose_model(model, options["effects"], options["without"])
    if options["plane"]:
        _map(chosen, options)
    else:
        _record(chosen, options)


# --- a recording -----------------------------------------------------------------------------------------


def _record(chosen: ChosenModel, options: Mapping[str, Any]) -> None:
    from specan.room.model.simulated_recording import simulated_recording

    path = _checked(options["output"], (".tdms",))
    made = simulated_recording(
        chosen,
        duration_s=options["duration"],
        frequency_hz=options["frequency"],
        noise=options["noise"],
        seed=options["seed"],
    )
    _write_tdms(path, made, chosen.assembly.model.settings["rig"])
    say(
        f"{len(made.names)} channels of {made.quantities.shape[1] / made.sampling_rate:g} s at "
        f"{made.sampling_rate:g} samples a second written to {path}"
    )
    rows = [
        {"channel": name, "unit": unit, "rms": float((signal**2).mean() ** 0.5)}
        for name, unit, signal in zip(made.names, _units(made), made.quantities, strict=True)
    ]
    if options["as_json"]:
        effects = [str(use) for use in chosen.assembly.uses]
        emit_json({"effects": effects, "sampling_rate_hz": made.sampling_rate, "channels": rows})
    else:
        table(
            "", ["channel", "rms", "unit"], [[r["channel"], f"{r['rms']:.4g}", str(r["unit"])] for r in rows]
        )


def _units(made: SimulatedRecording) -> list[str]:
    return ["Pa"] * (len(made.names) - 2) + ["m/s", "V"]


def _write_tdms(path: Path, made: SimulatedRecording, given: Mapping[str, Any]) -> None:
    """As the laboratory's acquisition program would: volts of 24 bits, nominal sensitivities beside them."""
    import numpy as np

    from specan.io.output_file import whole_file
    from specan.io.write_tdms import write_tdms

    count = len(made.names) - 2
    microphone = {
        "QuantityUnit": "Pa",
        "Sensitivity": given["mics"]["nominal_sensitivity_mV_per_Pa"],
        "SensitivityUnit": "mV/Pa",
    }
    velocity = given["vibrometer"]["sensitivity_mm_s_per_V"] / 1000.0
    vibrometer = {"QuantityUnit": "m/s", "Sensitivity": velocity, "SensitivityUnit": "(m/s)/V"}
    gain = np.array([microphone["Sensitivity"] / 1000.0] * count + [1.0 / velocity, 1.0])
    group: dict[str, object] = {"Excitation": "gaussian noise", "SamplingRate": made.sampling_rate}
    if made.frequency_hz is not None:
        group |= {"Excitation": "sine", "ExcitationFrequency_Hz": made.frequency_hz}
    with whole_file(path) as half:
        write_tdms(
            half,
            made.names,
            made.quantities * gain[:, None],
            made.sampling_rate,
            channels=[*([microphone] * count), vibrometer, {"QuantityUnit": "V"}],
            group=group | {"Description": "simulated"},
        )


# --- the field on a plane ----------------------------------------------------------------------------------


def _map(chosen: ChosenModel, options: Mapping[str, Any]) -> None:
    from specan.io.output_file import write_csv
    from specan.room.model.field_map import COLUMNS, field_map, read_plane

    path = _checked(options["output"], (".csv", ".png", ".svg", ".pdf"))
    if options["frequency"] is None:
        raise RequestError("--field needs a frequency", remedy="give one with --frequency HZ")
    left_out = [
        str(use)
        for use in chosen.assembly.uses
        if chosen.assembly.model.effects[use.name].at in ("microphone", "place", "card")
    ]
    if left_out:
        say(f"Errors of microphones do not change the field: {', '.join(left_out)}.")
    found = field_map(chosen, read_plane(options["plane"]), options["frequency"])
    if path.suffix.lower() == ".csv":
        write_csv(path, COLUMNS, ([f"{value:.9g}" for value in row] for row in found.rows()))
    else:
        from specan.report.figure_style import save_figure
        from specan.room.figures import field_figure

        save_figure(field_figure(found), path)
    level = found.level_dB()
    say(f"the field on {found.axis} = {found.at_m:g} m at {found.frequency_hz:g} Hz written to {path}")
    if options["as_json"]:
        emit_json(
            {
                "plane": {found.axis: found.at_m},
                "frequency_hz": found.frequency_hz,
                "points": int(level.size),
                "level_dB": {"least": float(level.min()), "most": float(level.max())},
                "reference": "20 uPa, diaphragm at 1 mm/s RMS",
            }
        )


def _checked(path: Path, suffixes: tuple[str, ...]) -> Path:
    """A path whose suffix says what is to be written, in a directory that exists."""
    from specan.io.output_file import check_directory

    if path.suffix.lower() not in suffixes:
        raise RequestError(
            f"{path.name} cannot be written here", expected="a name that ends in " + " or ".join(suffixes)
        )
    check_directory(path)
    return path
