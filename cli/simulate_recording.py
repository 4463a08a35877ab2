"""Write a simulated recording as an acquisition program would: volts, with units and sensitivities beside them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from specan.errors import RequestError
from specan.io.output_file import whole_file
from specan.io.write_tdms import write_tdms
from specan.models.chosen_model import SimulatedChannel
from specan_cli.output import emit_json, note, table
from specan_cli.verb import SAMPLES, OutputFile

if TYPE_CHECKING:
    from specan.models.model import Model


def output_path(path: Path | None, *suffixes: str) -> Path:
    """A path whose suffix says what is to be written, in a directory that exists."""

    if path is None or path.suffix.lower() not in suffixes:
        raise RequestError(
            f"{path.name} cannot be written here" if path else "the simulated run has no output file",
            expected="-o with a name that ends in " + " or ".join(suffixes),
        )
    return path


def write_recording(
    path: Path,
    channels: Sequence[SimulatedChannel],
    rate: float,
    group: Mapping[str, object],
    *,
    samples: Literal["int32", "float32"] = "float32",
    noise: tuple[float, int] = (0.0, 0),
) -> None:
    """Write channels into a TDMS file; `noise` is the standard deviation that sensors add in V, and its seed."""

    random = np.random.default_rng(noise[1])
    volts = [
        c.volts + (noise[0] * random.standard_normal(c.samples.size) if noise[0] and c.unit != "V" else 0.0)
        for c in channels
    ]
    described = [
        {
            "QuantityUnit": c.unit,
            **(
                {"Sensitivity": c.sensitivity, "SensitivityUnit": c.sensitivity_unit} if c.unit != "V" else {}
            ),
            **c.properties,
        }
        for c in channels
    ]
    about = {"SamplingRate": rate, "Description": "simulated", **group}
    with whole_file(path) as half:
        names = [c.name for c in channels]
        write_tdms(half, names, np.stack(volts), rate, channels=described, group=about, samples=samples)


def show_recording(channels: Sequence[SimulatedChannel], as_json: bool, **facts: Any) -> None:
    """Print mean and scatter of every channel, or, with what else is known, JSON."""
    found = [(c.name, c.unit, float(c.samples.mean()), float(c.samples.std())) for c in channels]
    if as_json:
        rows = [dict(zip(("channel", "unit", "mean", "rms"), one, strict=True)) for one in found]
        emit_json({**facts, "channels": rows})
        return
    # Beyond fifteen places is what rounding makes of a sum.
    cells = [[name, f"{round(mean, 15):z.4g}", f"{rms:.4g}", unit] for name, unit, mean, rms in found]
    table("", ["channel", "mean", "RMS about the mean", "unit"], cells)


def answer_inputs(model: Model, options: Mapping[str, Any]) -> None:
    """Of a model of rates: write or show inputs and answers over the time of a recording."""
    from specan.data.recording import Recording
    from specan.io.export_file import Excerpt, write_excerpt
    from specan.models.chosen_model import choose_model, simulated_table
    from specan.study.data.open_time import inputs_of
    from specan.study.observation import DataFile

    file: Path | None = options["conditions"]
    if file is None:
        raise RequestError(
            f"{model.name} needs a recorded input", remedy="name a recording with --conditions FILE"
        )
    model, conditions, rate = inputs_of(model, DataFile(file.name, file, columns=options["columns"]))
    chosen = choose_model(model, options["effects"], options["without"])
    given = {model.conditions[name].column: values for name, values in conditions.items()}
    rows = simulated_table(chosen, given, noise=options["noise"], seed=options["seed"])
    units = {one.column: one.column_unit for one in model.conditions.values()}
    units |= {one.header: one.column_unit for one in model.observables.values()}
    channels = [SimulatedChannel(n, units[n], np.asarray(v)) for n, v in rows.items() if n != "time"]
    if not np.all(np.isfinite([c.samples for c in channels])):
        raise RequestError(
            "the states grow without bound", remedy="choose other values with --effects, or correct the model"
        )
    if options["output"]:
        OutputFile(*SAMPLES).check_ending(options["output"])
        arrays, size = {c.name: c.samples for c in channels}, conditions["time"].size
        made = Recording.from_arrays(
            arrays, rate, units={c.name: c.unit for c in channels}, label="simulated"
        )
        write_excerpt(Excerpt(made, made.channels, 0, size), options["output"], options["decimal"])
        note(f"{size} samples written to {options['output']}")
    show_recording(channels, options["as_json"], effects=[str(use) for use in chosen.assembly.uses])
