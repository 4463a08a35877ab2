"""What ``specan simulate`` does for a model of rates: a recording of its inputs in, one of what it answers out."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from specan_cli.output import note
from specan_cli.verb import SAMPLES, OutputFile

if TYPE_CHECKING:
    from specan.models.model import Model


def run(model: Model, options: Mapping[str, Any]) -> None:
    """Write or show inputs and answers over the time of a recording."""
    import numpy as np

    from specan.data.recording import Recording
    from specan.errors import RequestError
    from specan.io.export_file import Excerpt, write_excerpt
    from specan.models.chosen_model import choose_model, simulated_table
    from specan.models.simulated_channel import SimulatedChannel
    from specan.study.data.open_time import inputs_of
    from specan.study.observation import DataFile
    from specan_cli.simulate_recording import show_recording

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
