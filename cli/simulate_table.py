"""What ``specan simulate`` does for a model whose measurements are tables: conditions in, a table out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from specan.errors import RequestError
from specan_cli.output import emit_json, say
from specan_cli.output import table as print_table

if TYPE_CHECKING:
    from specan.models.chosen_model import ChosenModel, Columns
    from specan.models.model import Model

POINTS = 7  # of each condition over the limits
MOST_PRINTED = 60  # rows that a person reads on a terminal


def run(model: Model, options: Mapping[str, Any]) -> None:
    """Carry out the chosen for any model of tables."""
    from specan.models.chosen_model import choose_model, simulated_table

    chosen = choose_model(model, options["effects"], options["without"])
    simulate(chosen, options, simulated_table, dict.fromkeys(model.rig.limits, POINTS))


def simulate(
    chosen: ChosenModel, options: Mapping[str, Any], make: Callable[..., Columns], points: Mapping[str, int]
) -> None:
    """Write or print what `make` predicts over the conditions that were asked for."""
    from specan.models.chosen_model import outside_validity
    from specan.result import records

    if options["noise"] < 0:
        raise RequestError(f"--noise is {options['noise']}", expected="a standard deviation, not below zero")
    columns = _conditions(chosen, options, points)
    rows = make(chosen, columns, noise=options["noise"], repeats=options["repeats"], seed=options["seed"])
    for left in outside_validity(chosen, columns):
        say(
            f"Warning: {left.rows} rows have {left.quantity} outside {left.low:g} to {left.high:g} {left.unit}, "
            "where the effects' equations hold."
        )
    if options["output"]:
        write(options["output"], rows)
        say(f"{length(rows)} rows written to {options['output']}")
    if options["as_json"]:
        emit_json({"effects": [str(use) for use in chosen.assembly.uses], "rows": records(**rows)})
    elif not options["output"]:
        _print(rows)


def _conditions(chosen: ChosenModel, options: Mapping[str, Any], points: Mapping[str, int]) -> Columns:
    """Rows of a table, or a grid over the limits with the axes that the user gives."""
    from specan.models.chosen_model import grid

    model = chosen.assembly.model
    if options["conditions"]:
        from specan.study.data.table_file import read_table
        from specan.study.data.table_reader import ColumnNames

        names = ColumnNames(options["conditions"], model, lenient=True)
        table = read_table(options["conditions"], choose=names.choose)
        names.convert(table)
        given = table.columns
        known = {c.column for c in model.conditions.values()}
        return {name: values for name, values in given.items() if name in known}
    axes = over_limits(model, points)
    if not axes and not options["grid"]:
        raise RequestError(
            f"the rig of {model.name} states no limits to run over", remedy="name conditions with --grid"
        )
    for text in options["grid"]:
        column, _, values = text.partition("=")
        axes[column.strip()] = _values(text, values)
    return grid(model, axes)


def over_limits(model: Model, points: Mapping[str, int]) -> dict[str, Sequence[float]]:
    """Values of each condition over what the rig can run, in its column's unit."""
    import numpy as np

    from specan.units import convert

    axes: dict[str, Sequence[float]] = {}
    for name, count in points.items():
        known = model.conditions[name]
        low, high = (convert(end, known.unit, known.column_unit) for end in model.rig.limits[name])
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


def write(path: Path, rows: Columns) -> None:
    """Write a table."""
    from specan.io.output_file import write_csv

    write_csv(path, rows, ([f"{value:.9g}" for value in row] for row in zip(*rows.values(), strict=True)))


def length(rows: Columns) -> int:
    """Number of rows."""
    return len(next(iter(rows.values())))


def _print(rows: Columns) -> None:
    shown = [[f"{value:.5g}" for value in row] for row in zip(*rows.values(), strict=True)]
    print_table("", list(rows), shown[:MOST_PRINTED])
    if len(shown) > MOST_PRINTED:
        click.echo(f"... and {len(shown) - MOST_PRINTED} more rows; -o FILE writes all of them")
