"""``specan model``: which models there are, and what they are made of."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from specan_cli.options import json_option, opt
from specan_cli.output import emit_json, table

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
    from specan.models.catalogue import model_effects, model_names, model_summary

    rows = [
        {
            "name": name,
            "summary": model_summary(name),
            "effects": list(model_effects(name)),
        }
        for name in model_names()
    ]
    if as_json:
        emit_json(rows)
        return
    table(
        "", ["model", "what it is", "effects"], [[r["name"], r["summary"], len(r["effects"])] for r in rows]
    )
    click.echo("\nMore about one of them: specan model show NAME")


@command.command("show")
@click.argument("name")
@click.argument("part", required=False, metavar="[EFFECT|QUANTITY]")
@opt("--rig", Path, "A rig file [default: the model's example].")
@opt("--json as_json", bool, "Print everything as JSON.")
def show(name: str, part: str | None, rig: Path | None, as_json: bool) -> None:
    """Show a model, or one of its effects or quantities.

    \b
    specan model show worm-gear --rig sample_data/worm_gear/rig.toml
    specan model show room wall-impedance
    """
    from specan.models.describe import describe_effect, describe_model, describe_quantity, find_part
    from specan.models.effect import Effect

    model = _model(name, rig)
    if part is None:
        content = describe_model(model)
        emit_json(content) if as_json else _print_model(content)
        return
    found = find_part(model, part)
    if isinstance(found, Effect):
        content = describe_effect(model, found)
        emit_json(content) if as_json else _print_effect(content)
    else:
        content = describe_quantity(model, found)
        emit_json(content) if as_json else _print_quantity(content)


@command.command("new")
@click.argument("file", type=click.Path(path_type=Path), metavar="FILE.py")
@opt("--rates", bool, "A differential equation, which is compared with recordings.")
def new(file: Path, rates: bool) -> None:
    """Write a small model of your own into FILE.py, to be changed, and a table or recordings to try it on beside it.

    \b
    specan model new pump.py
    specan model new oscillator.py --rates
    """
    from specan.errors import RequestError
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
    """Print a commented rig file for a model: limits, uncertainties, and further settings.

    \b
    specan model rig worm-gear > rig.toml
    """
    from specan.models.catalogue import example_model, example_rig
    from specan.models.describe import rig_template

    click.echo(rig_template(example_model(name), example_rig(name)), nl=False)


@command.command("check")
@click.argument("name")
@click.argument("file", type=click.Path(path_type=Path), metavar="[EFFECT.py]", required=False)
@opt("--rig", Path, "A rig file [default: the model's example].")
@json_option
def check(name: str, file: Path | None, rig: Path | None, as_json: bool) -> None:
    """Check a model of your own, or effects: neutral, finite, determined by some measurement.

    A model of your own is checked whole: its units, that it is finite over its limits, that some measurement
    determines each parameter, and which effects none could distinguish. It may then be run by studies on this machine.

    \b
    specan model check worm-gear belt_loss.py
    specan model check pump.py
    """
    from specan.models import check_effect, conditions_over_limits
    from specan.models.catalogue import effects_from_file, is_file

    model = _model(name, rig)
    for note in model.notes:
        click.echo(note, err=True)
    if file is None and is_file(name):
        _check_whole(model, Path(name), as_json)
        return
    effects = list(model.effects.values()) if file is None else effects_from_file(file)
    conditions = conditions_over_limits(model)
    for effect in effects:
        check_effect(effect, model, conditions)
    if as_json:
        emit_json({"passed": [effect.name for effect in effects]})
        return
    for effect in effects:
        click.echo(
            f"{effect.name} passes: neutral, finite, determined by some measurement within the limits."
        )


def _check_whole(model: Model, file: Path, as_json: bool) -> None:
    from dataclasses import asdict

    from specan.models.check import check_model, without_limits
    from specan.study.user_effects import trust_file

    lacking = without_limits(model)
    if lacking:  # a study takes such a model
        trust_file(file)
        if as_json:
            emit_json({"passed": [], "without_limits": lacking})
            return
        click.echo(
            f"{model.name} can be used in a study. Nothing else was checked: no limits of {', '.join(lacking)}."
        )
        click.echo(f'To check it, give them: conditions={{"{lacking[0]}": (UNIT, LOW, HIGH)}}.')
        return
    found = check_model(model)
    trust_file(file)
    if as_json:
        emit_json({"passed": list(found.effects), **asdict(found)})
        return
    click.echo(
        f"{model.name} is finite at {found.rows} places within its limits; one evaluation takes "
        f"{1000 * found.seconds:.2g} ms."
    )
    if found.parameters:
        click.echo(
            f"Some measurement within the limits determines each parameter: {', '.join(found.parameters)}."
        )
    for name in found.effects:
        click.echo(f"{name} passes: neutral, finite, determined by some measurement within the limits.")
    for name in found.hidden:
        click.echo(f"Note: the parameters of the base do the same as {name}; no measurement can detect it.")
    for one, other in found.alike:
        click.echo(f"Note: no measurement within the limits distinguishes {one} from {other}.")
    if len(found.effects) > 1 and not found.alike and not found.hidden:
        click.echo("Some measurement within the limits distinguishes each of these effects from the others.")
    for note in found.notes:
        click.echo(f"Note: {note}.")


def _model(name: str, rig: Path | None) -> Model:
    from specan.api.models import load_model

    return load_model(name, rig)


def _print_model(model: Mapping[str, Any]) -> None:
    click.echo(f"{model['name']}: {model['title']}")
    for note in model["notes"]:
        click.echo(f"  {note}")
    rows = {
        "Conditions": [[c["column"] or n, _default(c), c["doc"]] for n, c in model["conditions"].items()],
        "Observables": [[n, o["unit"], o["doc"]] for n, o in model["observables"].items()],
        "Effects": [[n, _kind(e), _first_sentence(e["explanation"])] for n, e in model["effects"].items()],
        "Quantities": [[n, q["unit"], q["doc"]] for n, q in model["quantities"].items()],
    }
    headers = {"Conditions": ["column", "default"], "Effects": ["name", ""]}
    for title, cells in rows.items():
        click.echo()
        table(title, [*headers.get(title, ["name", "unit"]), "what it is"], cells)
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
    return f"{default:g} {condition['column_unit']}"


def _print_effect(effect: Mapping[str, Any]) -> None:
    click.echo(f"{effect['name']}: {KINDS[_kind(effect)]}\n")
    click.echo(click.wrap_text(effect["explanation"], width=100) + "\n")
    _print_parameters(effect["parameters"])
    click.echo()
    lines = {
        "Adds to": ", ".join(effect["adds_to"]),
        "Scales": ", ".join(effect["scales"]),
        "Joins": ", ".join(effect["joins"]),
        "Reads": ", ".join(effect["reads"]),
        "Acts at one": effect["at"],
        "Holds for": "; ".join(
            f"{name} {v['low']:g} to {v['high']:g} {v['unit']}" for name, v in effect["valid"].items()
        ),
        "Needs": ", ".join(effect["needs"]),
        "Looks like": ", ".join(effect["aliases"]),
        "Distinguished by": effect["separate_by"],
        "Reference": effect["reference"],
    }
    _print_lines(lines)


def _print_quantity(quantity: Mapping[str, Any]) -> None:
    click.echo(f"{quantity['name']} [{quantity['unit']}]\n")
    click.echo(quantity["doc"] + "\n")
    if quantity["parameters"]:
        _print_parameters(quantity["parameters"])
        click.echo()
    _print_lines(
        {
            "Reads": ", ".join(quantity["reads"]),
            "Changed by": ", ".join(quantity["changed_by"]),
            "One for each": ", ".join(quantity["axes"]),
            "Reference": quantity["reference"],
        }
    )


def _print_parameters(parameters: Mapping[str, Any]) -> None:
    rows = []
    for name, p in parameters.items():
        marks = [
            "" if p["neutral"] is None else f"neutral at {p['neutral']:g}",
            "fixed" if p["fixed"] else "",
            f"one per {p['per']}" if p["per"] else "",
            f"held unless {', '.join(p['needs'])} varies" if p["needs"] else "",
        ]
        rows.append(
            [name, f"{p['default']:g}", p["unit"], _span(p["plausible"]), _span(p["domain"]), p["doc"],
             ", ".join(mark for mark in marks if mark)]
        )  # fmt: skip
    table("Parameters", ["name", "default", "unit", "plausible", "domain", "what it is", ""], rows)


def _span(ends: list[float]) -> str:
    return f"{ends[0]:g} to {ends[1]:g}"


def _print_lines(lines: Mapping[str, str]) -> None:
    for title, text in lines.items():
        if text:
            click.echo(click.wrap_text(f"{title}: {text}", width=100, subsequent_indent="    "))
