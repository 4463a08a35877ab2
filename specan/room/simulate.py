"""What ``specan simulate room`` does: a recording that the model predicts, or the sound field on a plane."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from specan.errors import RequestError
from specan_cli.options import opt
from specan_cli.output import emit_json, note, say
from specan_cli.simulate_recording import output_path, show_recording, write_recording
from specan_cli.simulate_table import write

if TYPE_CHECKING:
    from specan.models.chosen_model import ChosenModel
    from specan.models.model import Model


@opt("--duration", float, "Length of the recording.", "S", default=10.0, show_default=True)
@opt("--frequency", float, "A sine instead of noise; the frequency of --field.", "HZ")
@opt("--field plane", None, "Level and phase on a plane, z=0.35, as .csv or as a figure.", "AXIS=M")
def run(model: Model, options: Mapping[str, Any]) -> None:
    """A recording (-o run.tdms), or the sound field (--field).

    The recording has microphones, vibrometer and generator.

    --noise is the standard deviation of the noise of a microphone, Pa.

    \b
    specan simulate room cabin.toml -o recording.tdms --duration 1
    """
    from specan.models.chosen_model import choose_model

    chosen = choose_model(model, options["effects"], options["without"])
    if options["plane"]:
        _map(chosen, options)
    else:
        _record(chosen, options)


# --- a recording -----------------------------------------------------------------------------------------


def _record(chosen: ChosenModel, options: Mapping[str, Any]) -> None:
    from specan.room.model.simulated_recording import simulated_recording

    path = output_path(options["output"], ".tdms")
    frequency = options["frequency"]
    channels, rate = simulated_recording(
        chosen,
        duration_s=options["duration"],
        frequency_hz=frequency,
        noise=options["noise"],
        seed=options["seed"],
    )
    group: dict[str, object] = {"Excitation": "gaussian noise" if frequency is None else "sine"}
    if frequency is not None:
        group["ExcitationFrequency_Hz"] = frequency
    # 24 bits, as the laboratory's program writes
    write_recording(path, channels, rate, group, samples="int32")
    length = channels[0].samples.size / rate
    note(f"{len(channels)} channels of {length:g} s at {rate:g} samples per second written to {path}")
    effects = [str(use) for use in chosen.assembly.uses]
    show_recording(channels, options["as_json"], effects=effects, sampling_rate_hz=rate)


# --- the field on a plane ----------------------------------------------------------------------------------


def _map(chosen: ChosenModel, options: Mapping[str, Any]) -> None:
    from specan.room.model.field_map import field_map, of_microphones, read_plane

    path = output_path(options["output"], ".csv", ".png", ".svg", ".pdf")
    if options["frequency"] is None:
        raise RequestError("--field needs a frequency", remedy="give one with --frequency HZ")
    if left_out := [str(use) for use in of_microphones(chosen)]:
        say(f"Errors of microphones do not change the field: {', '.join(left_out)}.")
    found = field_map(chosen, read_plane(options["plane"]), options["frequency"])
    if path.suffix.lower() == ".csv":
        write(path, found.columns())
    else:
        from specan.report.figure_style import save_figure
        from specan.room.figures import field_figure

        save_figure(field_figure(found), path)
    level = found.level_dB
    note(f"the field on {found.axis} = {found.at_m:g} m at {found.frequency_hz:g} Hz written to {path}")
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
