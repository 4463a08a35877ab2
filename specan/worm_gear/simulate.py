"""What ``specan simulate worm-gear`` does beside a table: a look-up table and a map."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from specan_cli.options import opt
from specan_cli.output import note
from specan_cli.simulate_table import length, over_limits, simulate, table_options, write
from specan_cli.verb import OutputFile

if TYPE_CHECKING:
    from specan.models.model import Model

GRID_POINTS = {"worm_speed": 7, "indicated_output_torque": 11, "indicated_oil_temperature": 3}
LOOKUP_POINTS = {"worm_speed": 28, "indicated_output_torque": 21, "indicated_oil_temperature": 12}
LOOKUP_COLUMNS = ("speed_rpm", "output_torque_Nm", "oil_temperature_C", "efficiency", "power_loss_W")


@table_options
@opt("--table lookup", OutputFile(), "Write a look-up table: speed, torque, temperature -> efficiency, loss.")
@opt("--plot", OutputFile(), "Draw the efficiency map into this file.")
def run(model: Model, options: Mapping[str, Any]) -> None:
    """A table, a look-up table, or an efficiency map.

    The table covers the limits of the rig unless --grid or --conditions say otherwise.

    --noise is the standard deviation of one reading, N*m.

    \b
    specan simulate worm-gear sample_data/worm_gear/rig.toml --effects seal-drag -o table.csv
    """
    from specan.models.chosen_model import choose_model, grid
    from specan.worm_gear.model.simulated_table import simulated_table

    chosen = choose_model(model, options["effects"], options["without"])
    if options["plot"]:
        from specan.report.figure_style import save_figure
        from specan.worm_gear.figures import efficiency_map

        save_figure(efficiency_map(chosen), options["plot"])
        note(f"efficiency map written to {options['plot']}")
    if options["lookup"]:  # the temperature runs fastest, as simulation programs want it
        rows = simulated_table(chosen, grid(model, over_limits(model, LOOKUP_POINTS)))
        write(options["lookup"], {name: rows[name] for name in LOOKUP_COLUMNS})
        note(f"{length(rows)} rows written to {options['lookup']}")
    if options["output"] or not (options["plot"] or options["lookup"]):
        simulate(model, options, simulated_table, GRID_POINTS)
