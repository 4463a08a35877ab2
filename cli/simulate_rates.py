"""What ``specan simulate`` does for a model of rates: a recording of its inputs in, one of what it answers out."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from specan_cli.output import SAMPLES, OutputFile, note

if TYPE_CHECKING:
    from specan.models.model import Model


def run(model: Model, options: Mapping[str, Any]) -> None:
    """Write or show inputs and answers over the time of a recording."""
    import numpy as np

    from specan.data.recording import Recording
    from specan.errors import RequestError
    from specan.io.export_file import Excerpt, write_excerpt
    from specan.models.chosen_model import choose_model, simulated_table
    from specan.study.data.open_time import inputs_of
    from specan.study.observation import DataFile
    from specan_cli.simulate_recording import show_channels

    file: Path | None = options["conditions"]
    if file is None:
        raise RequestError(
            f"{model.name} needs a recorded input", remedy="name a recording with --conditions FILE"
        )
    model, conditions, rate = inputs_of(model, DataFile(file.name, file, columns=options["columns"]))
    chosen = choose_model(model, options["effects"], options["without"])
    given = {model.conditions[name].column: values for name, values in conditions.items()}
    rows = simulated_table(chosen, given, noise=options["noise"], seed=options["seed"])
    time = model.conditions["time"].column
    samples = {name: np.asarray(values) for name, values in rows.items() if name != time}
    units = {one.column: one.column_unit for one in model.conditions.values()}
    units |= {one.header: one.column_unit for one in model.observables.values()}
    made = Recording.from_arrays(samples, rate, units={n: units[n] for n in samples}, label="simulated")
    if not np.all(np.isfinite(list(samples.values()))):
        raise RequestError(
            "the states grow without bound", remedy="choose other values with --effects, or correct the model"
        )
    if options["output"]:
        OutputFile(*SAMPLES).check_ending(options["output"])
        write_excerpt(
            Excerpt(made, made.channels, 0, conditions["time"].size), options["output"], options["decimal"]
        )
        note(f"{conditions['time'].size} samples written to {options['output']}")
    show_channels(
        [(c.name, c.unit, made.read([c])[0]) for c in made.channels], options["as_json"],
        effects=[str(use) for use in chosen.assembly.uses],
    )  # fmt: skip
