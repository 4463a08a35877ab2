"""What ``specan simulate worm-gear`` does beside a table: a look-up table, a map, the figures of the article."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from specan.errors import RequestError
from specan_cli.output import say

if TYPE_CHECKING:
    from specan.models.chosen_model import ChosenModel
    from specan.models.model import Model

GRID_POINTS = {"worm_speed": 7, "indicated_output_torque": 11, "indicated_oil_temperature": 3}
LOOKUP_POINTS = {"worm_speed": 28, "indicated_output_torque": 21, "indicated_oil_temperature": 12}
LOOKUP_COLUMNS = ("speed_rpm", "output_torque_Nm", "oil_temperature_C", "efficiency", "power_loss_W")


def run(model: Model, options: Mapping[str, Any]) -> None:
    """Carry out the chosen."""
    from specan.models.chosen_model import choose_model
    from specan.models.worm_gear.simulated_table import simulated_table
    from specan_cli.simulate_table import simulate

    chosen = choose_model(model, options["effects"], options["without"])
    if options["number"] is not None or options["plot"]:
        _draw(chosen, options)
    if options["lookup"]:
        _look_up(chosen, options["lookup"])
    if options["number"] is None and (options["output"] or not (options["plot"] or options["lookup"])):
        simulate(chosen, options, simulated_table, GRID_POINTS)


def _look_up(chosen: ChosenModel, path: Path) -> None:
    """A full grid, the temperature running fastest, as look-up tables of simulation programs want it."""
    from specan.models.chosen_model import grid
    from specan.models.worm_gear.simulated_table import simulated_table
    from specan_cli.simulate_table import length, over_limits, write

    model = chosen.assembly.model
    rows = simulated_table(chosen, grid(model, over_limits(model, LOOKUP_POINTS)))
    write(path, {name: rows[name] for name in LOOKUP_COLUMNS})
    say(f"{length(rows)} rows written to {path}")


def _draw(chosen: ChosenModel, options: Mapping[str, Any]) -> None:
    from specan.report.figure_style import save_figure
    from specan.report.figures_worm_gear import figure

    if options["number"] is not None and not options["output"]:
        raise RequestError("--figure has nowhere to go", remedy="name a file with -o, for example figure.png")
    measured = None
    if options["measurement"]:
        from specan.study.data.table_file import read_table

        measured = read_table(options["measurement"]).columns
    wanted = [(11, options["plot"])] if options["plot"] else []
    if options["number"] is not None:
        wanted.append((options["number"], options["output"]))
    for number, path in wanted:
        sheet = figure(number, chosen, measured)
        save_figure(sheet, path)
        say(f"figure {number} written to {path}")
