"""What ``specan simulate worm-gear`` does: rows of conditions in, a table, a map or a figure out."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from specan.errors import RequestError
from specan_cli.output import emit_json, say, table

if TYPE_CHECKING:
    from specan.models.model import Model
    from specan.models.prediction import Columns
    from specan.models.request import Request

GRID_POINTS = {"worm_speed": 7, "indicated_output_torque": 11, "indicated_oil_temperature": 3}
LOOKUP_POINTS = {"worm_speed": 28, "indicated_output_torque": 21, "indicated_oil_temperature": 12}
LOOKUP_COLUMNS = ("speed_rpm", "output_torque_Nm", "oil_temperature_C", "efficiency", "power_loss_W")
MOST_PRINTED = 60  # rows that a person reads on a terminal


def run(model: Model, options: Mapping[str, Any]) -> None:
    """Carry out the request."""
    from specan.models.request import read_request

    request = read_request(model, options["effects"], options["without"])
    if options["number"] is not None or options["plot"]:
        _draw(request, options)
    if options["lookup"]:
        _look_up(request, options["lookup"])
    if options["number"] is None and (options["output"] or not (options["plot"] or options["lookup"])):
        _simulate(request, options)


def _simulate(request: Request, options: Mapping[str, Any]) -> None:
    from specan.models.prediction import outside_validity
    from specan.models.worm_gear.simulated_table import simulated_table

    if options["noise"] < 0:
        raise RequestError(f"--noise is {options['noise']}", expected="a standard deviation, not below zero")
    columns = _conditions(request, options)
    rows = simulated_table(
        request, columns, noise=options["noise"], repeats=options["repeats"], seed=options["seed"]
    )
    for left in outside_validity(request, columns):
        say(
            f"Warning: {left.rows} rows have {left.quantity} outside {left.low:g} to {left.high:g} {left.unit}, "
            "where the effects' equations hold."
        )
    if options["output"]:
        _write(options["output"], rows)
        say(f"{_length(rows)} rows written to {options['output']}")
    if options["as_json"]:
        emit_json({"effects": [str(use) for use in request.assembly.uses], "rows": _records(rows)})
    elif not options["output"]:
        _print(rows)


def _conditions(request: Request, options: Mapping[str, Any]) -> Columns:
    """Rows of a table, or a grid over the limits with the axes that the user gives."""
    from specan.models.prediction import grid

    model = request.assembly.model
    if options["conditions"]:
        from specan.study.data.table_file import read_table

        given = read_table(options["conditions"]).columns
        known = {c.column for c in model.conditions.values()}
        return {name: values for name, values in given.items() if name in known}
    axes = _limits(model, GRID_POINTS)
    for text in options["grid"]:
        column, _, values = text.partition("=")
        axes[column.strip()] = _values(text, values)
    return grid(model, axes)


def _limits(model: Model, points: Mapping[str, int]) -> dict[str, Sequence[float]]:
    """Values of each condition over what the bench can run, in its column's unit."""
    import numpy as np

    from specan.units import convert

    axes: dict[str, Sequence[float]] = {}
    for name, count in points.items():
        known = model.conditions[name]
        low, high = (convert(end, known.unit, known.column_unit) for end in model.settings["limits"][name])
        axes[known.column] = np.round(np.linspace(low, high, count), 9).tolist()
    return axes


def _values(text: str, values: str) -> list[float]:
    import numpy as np

    try:
        if ":" in values:
            low, high, count = values.split(":")
            return np.linspace(float(low), float(high), int(count)).tolist()
        return [float(value) for value in values.split(",")]
    except ValueError:
        raise RequestError(
            f"--grid {text!r} cannot be read", expected="COLUMN=1,2,3 or COLUMN=FROM:TO:COUNT"
        ) from None


def _look_up(request: Request, path: Path) -> None:
    """A full grid, the temperature running fastest, as look-up tables of simulation programs want it."""
    from specan.models.prediction import grid
    from specan.models.worm_gear.simulated_table import simulated_table

    model = request.assembly.model
    rows = simulated_table(request, grid(model, _limits(model, LOOKUP_POINTS)))
    _write(path, {name: rows[name] for name in LOOKUP_COLUMNS})
    say(f"{_length(rows)} rows written to {path}")


def _draw(request: Request, options: Mapping[str, Any]) -> None:
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
        sheet = figure(number, request, measured)
        save_figure(sheet, path)
        say(f"figure {number} written to {path}")


def _write(path: Path, rows: Columns) -> None:
    from specan.io.output_file import text_file

    with text_file(path) as file:
        sheet = csv.writer(file, lineterminator="\n")
        sheet.writerow(rows)
        sheet.writerows([f"{value:.9g}" for value in row] for row in zip(*rows.values(), strict=True))


def _records(rows: Columns) -> list[dict[str, float]]:
    return [dict(zip(rows, map(float, row), strict=True)) for row in zip(*rows.values(), strict=True)]


def _length(rows: Columns) -> int:
    return len(next(iter(rows.values())))


def _print(rows: Columns) -> None:
    shown = [[f"{value:.5g}" for value in row] for row in zip(*rows.values(), strict=True)]
    table("", list(rows), shown[:MOST_PRINTED])
    if len(shown) > MOST_PRINTED:
        click.echo(f"... and {len(shown) - MOST_PRINTED} more rows; -o FILE writes all of them")
