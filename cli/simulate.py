"""``specan simulate``: what a model predicts, as a table, a recording, a map or a figure.

Each model has a command of its own: the options that all share, and those that its simulator declares.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from importlib.metadata import entry_points
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from specan_cli.options import opt
from specan_cli.output import add_options
from specan_cli.verb import OutputFile, Verb

if TYPE_CHECKING:
    from specan.models.model import Model

    Run = Callable[[Model, Mapping[str, Any]], None]

ENTRY_POINTS = (
    "specan.simulators"  # name of the model = `run(model, options)`, decorated with its own options
)


@click.argument("rig", type=click.Path(path_type=Path), metavar="[RIG.toml]", required=False)
@opt("-o --output", OutputFile(), "File to write: a table, a recording (.tdms), a figure.")
@opt(
    "--effects -e", None,
    "An effect to switch on, with its size, or a parameter of one; repeatable.",
    "NAME[.PARAMETER][=VALUE]", multiple=True,
)  # fmt: skip
@opt("--set settings", None, "Change a value of the rig file; repeatable.", "TABLE.KEY=VALUE", multiple=True)
@opt(
    "--effect-file effect_files", Path, "A Python file with effects of your own; repeatable.",
    multiple=True,
)  # fmt: skip
@opt("--without", None, "A base effect to switch off; repeatable.", "NAME", multiple=True)
@opt(
    "--noise", float, "Standard deviation of the noise of a reading or a channel, in its unit.", "SD",
    default=0.0,
)  # fmt: skip
@opt("--seed", click.IntRange(min=0), "Seed of the noise.", "N", default=0, show_default=True)
@opt("--json as_json", bool, "Print the rows as JSON.")
def _simulate(
    model_name: str,
    run: Run,
    rig: Path | None,
    settings: tuple[str, ...],
    effect_files: tuple[Path, ...],
    **options: Any,
) -> None:
    from specan.errors import RequestError
    from specan.models.catalogue import effects_from_file, example_rig, is_file, load_model, read_rig_file
    from specan.models.chosen_model import override

    if rig is None and not is_file(model_name):
        raise RequestError(
            f"the model {model_name!r} needs a rig file",
            remedy=f"specan model rig {model_name} writes an example",
        )
    said = read_rig_file(rig) if rig else example_rig(model_name)
    model = load_model(model_name, override(said, settings))
    for file in effect_files:
        model = model.with_effect(*effects_from_file(file))
    if not 0 <= options["noise"] <= 1e30:  # far above it single precision overflows
        raise RequestError(f"--noise is {options['noise']}", expected="a standard deviation from 0 to 1e30")
    run(model, options)


class Simulators(click.Group):
    """One command for each model; a model in a file is simulated as a table."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names of the installed models."""
        from specan.models.catalogue import model_names

        return model_names()

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command:
        """The options that all models share, then those of the simulator."""
        from specan_cli import simulate_table

        own = [point.load() for point in entry_points(group=ENTRY_POINTS, name=cmd_name)]
        run: Run = own[0] if own else simulate_table.run
        shared, of_model = (getattr(function, "__click_params__", []) for function in (_simulate, run))
        found = Verb(
            cmd_name,
            params=[*reversed(shared), *reversed(of_model)],
            callback=partial(_simulate, cmd_name, run),
            help=run.__doc__,
        )
        add_options(found)
        return found


@click.command("simulate", cls=Simulators, subcommand_metavar="MODEL [RIG.toml] [OPTIONS]")
def command() -> None:
    """Simulate a measurement with MODEL, by its name or in a file of your own.

    specan simulate MODEL --help lists its options.

    \b
    specan simulate worm-gear sample_data/worm_gear/rig.toml --effects seal-drag -o table.csv
    """
