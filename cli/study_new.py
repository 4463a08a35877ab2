"""``specan study new``: begin a study."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from specan_cli.options import column_option, json_option, opt
from specan_cli.output import emit_json, show_apart
from specan_cli.verb import Verb

if TYPE_CHECKING:
    from specan.study.create import Begun

FILE = click.Path(path_type=Path)


@click.command("new", cls=Verb)
@click.argument("directory", type=FILE, metavar="DIR")
@opt(
    "--model model_name", None, "A model (see specan model list), or a Python file with one of your own.",
    "NAME|FILE.py|FILE.fmu", required=True,
)  # fmt: skip
@opt("--rig", Path, "Rig file: description of the set-up (TOML).")
@opt(
    "--measurement measurements", Path, "Measured data to fit; repeatable.", "FILE", multiple=True,
    required=True,
)  # fmt: skip
@opt("--sheet", None, "Sheet of a workbook.  [default: the first with a table]", "NAME", default="")
@column_option(
    'Header of a column of the model in the table, with its unit: "speed_rpm=n [1/min]"; or name of a channel. '
    "Repeatable; unknown columns are ignored then."
)
@opt(
    "--group groups", None,
    "A column of names, such as specimen, by which parameters may differ; repeatable.", "NAME",
    multiple=True,
)  # fmt: skip
@opt(
    "--validation validations", Path, "Measured data that are predicted and never fitted; repeatable.",
    "FILE", multiple=True,
)  # fmt: skip
@opt(
    "--hold-out", None, "Conditions to hold out of the fit: torque=60, speed_rpm=2000..2400; repeatable.",
    "KEY=V,V...", multiple=True,
)  # fmt: skip
@opt("--calibration", Path, "A calibration.toml for recordings.")
@opt(
    "--effects", None, "Initial effects.  [default: those of the model's base; none: without effects]",
    "NAME,NAME...|none",
)  # fmt: skip
@json_option
def command(
    directory: Path,
    columns: dict[str, str],
    effects: str | None,
    measurements: tuple[Path, ...],
    as_json: bool,
    **options: Any,
) -> None:
    """Create a study in DIR and list the assumptions.

    Measured files stay where they are; the study keeps their hash and notices when they change.

    \b
    specan study new my_study --model worm-gear --rig sample_data/worm_gear/rig.toml \\
      --measurement sample_data/worm_gear/table_8_loaded.csv --hold-out torque=60
    """
    from specan.study.create import begin

    chosen = (
        None if effects is None else [e.strip() for e in effects.split(",") if e.strip() not in ("", "none")]
    )
    begun = begin(
        directory,
        options.pop("model_name"),
        options.pop("rig"),
        measurements,
        effects=chosen,
        columns=columns,
        **options,
    )
    content = _content(begun)
    if as_json:
        emit_json(content)
    else:
        _print(begun, content)


def _content(begun: Begun) -> dict[str, Any]:
    """What ``--json`` prints."""
    from specan.study.build_problem import calibration_priors, held_for_want_of_variation

    study = begun.study
    return {
        "directory": str(study.directory),
        "model_effects": list(study.model_effects),
        "notes": list(study.model.notes),
        "fitted_values": sum(o.n for o in study.data.fitted),
        "held_out_values": sum(o.n for o in study.data.held_out),
        "uncertainty_known": study.data.known,
        "model_discrepancy_percent": study.data.discrepancy_percent,
        "assumptions": list(study.data.statements),
        "certificates": {
            name: {"standard_uncertainty": sd, "unit": unit}
            for name, (sd, unit) in calibration_priors(study.problem).items()
        },
        "rig_defaults_used": study.model.rig.defaults_used,
        "parameters_held": [*held_for_want_of_variation(study.problem), *begun.held],
        "fit_error": begun.step.fit_error,
        "mistaken_set_up": study.mistaken_set_up.text,
    }


def _print(begun: Begun, content: Mapping[str, Any]) -> None:
    from specan.report import study_sheets
    from specan.result import counted

    study, errors = begun.study, begun.study.errors
    each = f" ({', '.join(f'{e.n} of {e.observable}' for e in errors)})" if len(errors) > 1 else ""
    fitted = counted(content["fitted_values"], "value")
    click.echo(
        f"{study.directory}: {study.model.title}, {fitted} to fit{each}, {content['held_out_values']} held out"
    )
    for note in study.model.notes:
        click.echo(f"  {note}")
    click.echo("Effects: " + (", ".join(study.model_effects) or f"none, {study.model.words.ideal}"))
    click.echo("\nWhat was found and assumed about the measurement:")
    for text in (*study.data.statements, *_assumed(begun, content)):
        click.echo(f"  {text}")
    show_apart(study_sheets.errors(errors, "Error of the fitted model"))
    if not study.data.known:
        click.echo(
            "\nThe uncertainty of the measurement is unknown: compare shows errors; diagnose needs it."
        )
    if study.mistaken_set_up.text:
        click.echo(f"\nCheck the set-up: {study.mistaken_set_up.sentence}.")
    step = ", ".join(f"{e['metric']} {study_sheets.amount(e)}" for e in begun.step.of_each("fit").values())
    click.echo(f"\nStep 0 is kept ({step}). ", nl=False)
    click.echo(f"Next: specan study compare {study.directory}")


def _assumed(begun: Begun, content: Mapping[str, Any]) -> Iterator[str]:
    """Certificates, parameters that are held, defaults of the rig."""
    from specan.study.build_problem import held_for_want_of_variation
    from specan.units import spoken

    study = begun.study
    for name, certificate in content["certificates"].items():
        sd, unit = certificate["standard_uncertainty"], certificate["unit"]
        per = study.problem.assembly.parameters[name].per
        size = f"{100 * sd:.3g} %" if unit == "1" and not per else spoken(sd, unit=unit)
        of = f"an error of each {per}" if per else "an error common to all readings"
        yield f"{name}: {of}, standard uncertainty {size}"
    for name, needed in held_for_want_of_variation(study.problem).items():
        columns = ", ".join(study.model.conditions[n].column for n in needed if n in study.model.conditions)
        yield f"{name} is held at its default: {columns or ', '.join(needed)} does not vary"
    if begun.units:
        yield f"{begun.units}; the numbers are taken as they are (specan model check refuses this)"
    for name in begun.held:
        yield f"{name} is held: these data do not determine it (fixed = true in study.toml)"
    if content["rig_defaults_used"]:
        yield "Defaults, not stated in the rig file:"
        yield from (f"  {key} = {value}" for key, value in content["rig_defaults_used"].items())
