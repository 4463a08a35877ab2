"""``specan simulate``: what a model predicts, as a table, a recording, a map or a figure."""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from specan.errors import RequestError
from specan_cli.output import OutputFile, Verb

if TYPE_CHECKING:
    from specan.models.model import Model

ENTRY_POINTS = "specan.simulators"  # of installed packages: name of the model = `run(model, options)`


def simulator_of(model: Model) -> Callable[[Model, Mapping[str, Any]], None]:
    """The function that carries out ``specan simulate`` for a model.

    Raises
    ------
    RequestError
        None is known, and its measurements are no tables.
    """
    from importlib.metadata import entry_points

    own = f"specan_cli.simulate_{model.name.replace('-', '_')}"  # of a model that comes with specan
    if not model.is_own and importlib.util.find_spec(own):
        run: Callable[[Model, Mapping[str, Any]], None] = importlib.import_module(own).run
        return run
    for point in entry_points(group=ENTRY_POINTS):
        if point.name == model.name:
            run = point.load()
            return run
    if "table" in model.kinds:
        run = importlib.import_module("specan_cli.simulate_table").run
        return run
    raise RequestError(f"the model {model.name!r} cannot be simulated from the command line")


@click.command("simulate", cls=Verb)
@click.argument("model_name", metavar="MODEL")
@click.argument("rig", type=click.Path(path_type=Path), metavar="[RIG.toml]", required=False)
@click.option(
    "-o",
    "--output",
    type=OutputFile(),
    help="File to write: a table, a recording (.tdms), a figure.",
)
@click.option(
    "--effects",
    "-e",
    multiple=True,
    metavar="NAME[.PARAMETER][=VALUE]",
    help="An effect to switch on, or a parameter of one: seal-drag=0.2, churning.exponent=1.6; repeatable.",
)
@click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="TABLE.KEY=VALUE",
    help="Change a value of the rig file: model.mesh=article, oil.viscosity_40C_mm2_s=320.",
)
@click.option(
    "--effect-file",
    "effect_files",
    type=click.Path(path_type=Path),
    multiple=True,
    help="A Python file with effects of your own; repeatable.",
)
@click.option(
    "--without", multiple=True, metavar="NAME", help="An effect of the base to switch off; repeatable."
)
@click.option(
    "--grid",
    multiple=True,
    metavar="COLUMN=VALUES",
    help="Values of a condition: speed_rpm=1200,1500 or speed_rpm=300:3000:10 (ten values); repeatable.",
)
@click.option(
    "--conditions", type=click.Path(path_type=Path), help="Use the conditions of the rows of a table."
)
@click.option(
    "--noise",
    type=float,
    default=0.0,
    metavar="SD",
    help="Standard deviation of one reading, N*m; of what a microphone adds, Pa.",
)
@click.option(
    "--duration",
    type=float,
    default=10.0,
    show_default=True,
    metavar="S",
    help="Length of the recording.",
)
@click.option(
    "--frequency", type=float, metavar="HZ", help="Room: a sine instead of noise; the frequency of --field."
)
@click.option(
    "--field",
    "plane",
    metavar="AXIS=M",
    help="Room: level and phase on a plane, z=0.35, as .csv or as a figure.",
)
@click.option("--repeats", type=click.IntRange(min=1), default=1, help="Readings of each condition.")
@click.option("--seed", type=int, default=0, show_default=True, help="Seed of the noise.")
@click.option(
    "--table",
    "lookup",
    type=OutputFile(),
    help="Write a look-up table: speed, torque, temperature -> efficiency, loss.",
)
@click.option("--plot", type=OutputFile(), help="Draw the efficiency map into this file.")
@click.option("--figure", "number", type=int, help="Draw a figure of the model's article into -o.")
@click.option(
    "--measurement",
    type=click.Path(path_type=Path),
    help="A measured table, drawn over the figure as points.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the rows as JSON.")
def command(model_name: str, rig: Path | None, **options: Any) -> None:
    """Predict what would be measured if the rig were as MODEL says.

    Any model of tables: without --grid or --conditions the conditions run over the limits. A model in a file of your
    own needs no rig file.

    Worm gear: without --grid or --conditions the conditions run over the limits of the rig file. --figure 4, 5, 6, 7
    or 11.

    Planetary gear: a recording of forces, torques, accelerations and tachos (-o run.tdms), or order lines
    (-o lines.csv). --figure 3 or 4 of a pair, 7 to 12 of a set.

    Room: a recording of microphones, vibrometer and generator (-o recording.tdms), or with --field the sound field on a
    plane.

    \b
    specan simulate worm-gear sample_data/worm_gear/rig.toml --effects seal-drag -o table.csv
    """
    from specan.errors import RequestError
    from specan.models.catalogue import effects_from_file, example_rig, is_file, load_model, read_rig_file
    from specan.models.chosen_model import override

    if rig is None and not is_file(model_name):
        raise RequestError(
            f"the model {model_name!r} needs a rig file",
            remedy=f"specan model rig {model_name} writes one to begin with",
        )
    said = read_rig_file(rig) if rig else example_rig(model_name)
    model = load_model(model_name, override(said, options["settings"]))
    for file in options["effect_files"]:
        model = model.with_effect(*effects_from_file(file))
    simulator_of(model)(model, options)
