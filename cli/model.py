"""``specan model``: which models there are, and what they are made of."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from specan.errors import RequestError
from specan.result import Sheet
from specan.units import printed_unit, spoken
from specan_cli.options import column_option, json_option, opt
from specan_cli.output import emit_json, show_apart, table

if TYPE_CHECKING:
    from specan.models.model import Model


@click.group("model")
def command() -> None:
    """Show the models: their quantities, effects, parameters and sources.

    \b
    specan model list
    specan model show worm-gear seal-drag
    """


@command.command("list")
@opt("--json as_json", bool, "Print the list as JSON.")
def list_models(as_json: bool) -> None:
    """List the models.

    \b
    specan model list
    """
    from specan.models.catalogue import example_model, model_names, model_summary

    models = {name: example_model(name) for name in model_names()}
    rows = [
        {"name": name, "summary": model_summary(name), "effects": sorted([*model.effects, *model.unsuited])}
        for name, model in models.items()
    ]
    if as_json:
        emit_json(rows)
        return
    cells = [[row["name"], row["summary"], len(row["effects"])] for row in rows]
    table("", ["model", "what it is", "effects"], cells)
    click.echo("\nMore about one of them: specan model show NAME")


@command.command("show")
@click.argument("name")
@click.argument("part", required=False, metavar="[EFFECT|QUANTITY]")
@opt("--rig", Path, "A rig file.  [default: the model's example]")
@opt("--json as_json", bool, "Print everything as JSON.")
def show(name: str, part: str | None, rig: Path | None, as_json: bool) -> None:
    """Show a model, or one of its effects or quantities.

    \b
    specan model show worm-gear --rig sample_data/worm_gear/rig.toml
    specan model show room wall-impedance
    """
    from specan.models.catalogue import load_model
    from specan.models.describe import describe_model, describe_part

    model = load_model(name, rig)
    content = describe_model(model) if part is None else describe_part(model, part)
    if as_json:
        emit_json(content)
    else:
        (_print_model if part is None else _print_part)(content)


@command.command("new")
@click.argument("file", type=click.Path(path_type=Path), metavar="FILE.py")
@opt("--rates", bool, "A differential equation, which is compared with recordings.")
def new(file: Path, rates: bool) -> None:
    """Write an example model to FILE.py, for you to edit.

    A table or recordings to try it on are written beside it.

    \b
    specan model new pump.py
    specan model new oscillator.py --rates
    """
    from specan_cli.demo import copied, sample_place

    if file.suffix != ".py":
        raise RequestError(f"{file} is not a Python file", remedy="give it a name that ends in .py")
    example = "oscillator" if rates else "pump"
    named = {
        source: file.with_name(source.name.replace(example, file.stem, 1))
        for source in sorted((sample_place() / "own_model").glob(f"{example}*"))
    }
    for target in named.values():
        if target.exists():
            raise RequestError(f"{target} exists already", remedy="choose another name")
    for source, target in named.items():
        copied(source, target)
    again, data = file.with_name(f"{file.stem}_again.tdms"), file.with_suffix(".tdms" if rates else ".csv")
    if rates:
        click.echo(f"{file} holds a model, {data} and {again} recordings to try it on.")
    else:
        click.echo(f"{file} holds a model, {data} a table to try it on.")
        click.echo(f"Check it: specan model check {file}")
    validation = f" --validation {again}" if rates else ""
    click.echo(f"Try it: specan study new DIR --model {file} --measurement {data}{validation}")


@command.command("rig")
@click.argument("name")
def rig_template(name: str) -> None:
    """Print a commented rig file for a model.

    It holds limits, uncertainties, and further settings.

    \b
    specan model rig worm-gear > rig.toml
    """
    from specan.models.catalogue import example_model, example_rig
    from specan.models.describe import rig_template

    click.echo(rig_template(example_model(name), example_rig(name)), nl=False)


@command.command("check")
@click.argument("name")
@click.argument("file", type=click.Path(path_type=Path), metavar="[EFFECT.py]", required=False)
@opt("--rig", Path, "A rig file.  [default: the model's example]")
@opt("--measurement", Path, "A recording to check a model of rates with.", "FILE")
@column_option('Name of a channel in the recording: "force=Load cell"; repeatable.')
@json_option
def check(
    name: str,
    file: Path | None,
    rig: Path | None,
    measurement: Path | None,
    columns: dict[str, str],
    as_json: bool,
) -> None:
    """Check a model of your own, or effects for a model.

    Afterwards the studies of this machine may run it.

    Of a model: units, finite values over its limits, parameters that some measurement determines, effects that some
    measurement distinguishes. Of an effect: no change at its neutral values, finite, determined by some measurement.

    \b
    specan model check worm-gear belt_loss.py
    specan model check pump.py
    specan model check oscillator.py --measurement oscillator.tdms
    """
    from specan.models import check_effect, conditions_over_limits
    from specan.models.catalogue import effects_from_file, is_file, load_model

    model = load_model(name, rig)
    for note in model.notes:
        click.echo(note, err=True)
    if file is None and is_file(name):
        recorded = None
        if measurement:
            from specan.study.data.open_time import for_check
            from specan.study.observation import DataFile

            if not model.rates:
                raise RequestError("--measurement is for models of rates", remedy="leave it out")
            data = DataFile(measurement.name, measurement, columns=columns)
            model, recorded = for_check(model, data)
        content, lines = _whole(model, Path(name), recorded)
    else:
        effects = list(model.effects.values()) if file is None else effects_from_file(file)
        conditions = conditions_over_limits(model)
        for effect in effects:
            check_effect(effect, model, conditions)
        content = {"passed": [effect.name for effect in effects]}
        passed = "passes: neutral, finite, determined by some measurement within the limits."
        lines = [f"{effect.name} {passed}" for effect in effects]
    if as_json:
        emit_json(content)
        return
    for line in lines:
        click.echo(line)


def _whole(model: Model, file: Path, recorded: Mapping[str, Any] | None) -> tuple[dict[str, Any], list[str]]:
    """What a model of one's own was found to be, for JSON and in sentences; studies may run it then."""
    from dataclasses import asdict

    from specan.models.check import check_model, without_limits
    from specan.study.user_effects import trust_file

    lacking = without_limits(model)
    if lacking and recorded is None:  # a study takes such a model
        trust_file(file)
        usable, names = f"{model.name} can be used in a study.", ", ".join(lacking)
        lines = [
            f"{usable} Nothing else was checked: no limits of {names}.",
            f'To check it, give them: conditions={{"{lacking[0]}": (UNIT, LOW, HIGH)}}.',
        ]
        if model.rates:
            lines = [
                f"{usable} To check it with a recording:",
                f"specan model check {file} --measurement FILE",
            ]
        return {"passed": [], "without_limits": lacking}, lines
    found = check_model(model, recorded)
    trust_file(file)
    where = "within the limits" if recorded is None else "of such inputs"
    places = "places within its limits" if recorded is None else "samples"
    took = f"one evaluation takes {spoken(1000 * found.seconds, digits=2)} ms"
    lines = [f"{model.name} is finite at {found.rows} {places}; {took}."]
    if found.parameters:
        lines.append(f"Some measurement {where} determines each parameter: {', '.join(found.parameters)}.")
    passed = f"passes: neutral, finite, determined by some measurement {where}."
    lines += [f"{name} {passed}" for name in found.effects]
    same = "Note: the parameters of the base have the same effect as"
    lines += [f"{same} {name}; no measurement {where} can detect it." for name in found.hidden]
    lines += [f"Note: no measurement {where} distinguishes {one} from {other}." for one, other in found.alike]
    if len(found.effects) > 1 and not found.alike and not found.hidden:
        lines.append(f"Some measurement {where} distinguishes each of these effects from the others.")
    lines += [f"Note: {note}." for note in found.notes]
    return {"passed": list(found.effects), **asdict(found)}, lines


def _print_model(model: Mapping[str, Any]) -> None:
    click.echo(f"{model['name']}: {model['title']}")
    for note in model["notes"]:
        click.echo(f"  {note}")
    rows = {
        "Conditions": [[c["column"] or n, _default(c), c["doc"]] for n, c in model["conditions"].items()],
        "Observables": [[n, printed_unit(o["unit"]), o["doc"]] for n, o in model["observables"].items()],
        "Effects": [[n, _kind(e), _first_sentence(e["explanation"])] for n, e in model["effects"].items()],
        "Quantities": [[n, printed_unit(q["unit"]), q["doc"]] for n, q in model["quantities"].items()],
    }
    headers = {"Conditions": ["column", "default"], "Effects": ["name", ""]}
    for title, cells in rows.items():
        show_apart(Sheet(title, [*headers.get(title, ["name", "unit"]), "what it is"], cells))
    for name, reason in model["unsuited"].items():
        click.echo(f"\nNot for this rig: {name}: {reason}")
    click.echo(f"\nMore about one of them: specan model show {model['name']} NAME")


KINDS = {"base": "part of the base model", "instrument": "an instrument's error", "": "an effect to be found"}


def _kind(effect: Mapping[str, Any]) -> str:
    return "base" if effect["in_base"] else "instrument" if effect["instrument"] else ""


def _first_sentence(text: str) -> str:
    return re.split(r"[.:] ", text, maxsplit=1)[0].rstrip(".") + "."


def _default(condition: Mapping[str, Any]) -> str:
    default = condition["default"]
    if default is None:
        return "needed"
    if default != default:  # not known unless the data have it
        return "unknown"
    return f"{default:g} {printed_unit(condition['column_unit'])}"


# What is said of an effect and of a quantity below its parameters.
LINES = {
    "adds_to": "Adds to", "scales": "Scales", "joins": "Joins", "reads": "Reads", "changed_by": "Changed by",
    "at": "Acts at one", "axes": "One for each", "valid": "Holds for", "needs": "Needs", "aliases": "Looks like",
    "separate_by": "Distinguished by", "reference": "Reference",
}  # fmt: skip


def _print_part(part: Mapping[str, Any]) -> None:
    """An effect or a quantity."""
    is_effect = "explanation" in part
    kind = KINDS[_kind(part)] if is_effect else printed_unit(part["unit"]) or "a number"
    click.echo(f"{part['name']}: {kind}\n")
    click.echo(click.wrap_text(part["explanation" if is_effect else "doc"], width=100) + "\n")
    if part["parameters"]:
        _print_parameters(part["parameters"])
        click.echo()
    for key, title in LINES.items():
        said = part.get(key)
        if isinstance(said, Mapping):
            said = [
                f"{name} {v['low']:g} to {v['high']:g} {printed_unit(v['unit'])}" for name, v in said.items()
            ]
        if said:
            text = said if isinstance(said, str) else ", ".join(said)
            click.echo(click.wrap_text(f"{title}: {text}", width=100, subsequent_indent="    "))


def _print_parameters(parameters: Mapping[str, Any]) -> None:
    rows = []
    for name, p in parameters.items():
        marks = [
            "" if p["neutral"] is None else f"neutral at {p['neutral']:g}",
            "fixed" if p["fixed"] else "",
            f"one per {p['per']}" if p["per"] else "",
            f"held unless {', '.join(p['needs'])} varies" if p["needs"] else "",
        ]
        spans = (f"{low:g} to {high:g}" for low, high in (p["plausible"], p["domain"]))
        rows.append(
            [
                name,
                f"{p['default']:g}",
                printed_unit(p["unit"]),
                *spans,
                p["doc"],
                ", ".join(filter(None, marks)),
            ]
        )
    table("Parameters", ["name", "default", "unit", "plausible", "domain", "what it is", ""], rows)
