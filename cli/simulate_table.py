"""What ``specan simulate`` does for a model whose measurements are tables: conditions in, a table out."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import click
import numpy as np

from specan.errors import RequestError
from specan.io.export_file import write_frame
from specan.io.output_file import write_csv
from specan.models.chosen_model import Columns, choose_model, grid, outside_validity, simulated_table, span
from specan.models.groups import grouped
from specan.models.model import Model
from specan.result import records
from specan_cli.options import column_option, opt, together
from specan_cli.output import emit_json, note, say
from specan_cli.output import table as print_table
from specan_cli.verb import TABLES, OutputFile, decimal_option

POINTS = 7  # of each condition over the limits
MOST_PRINTED = 60  # rows that a person reads on a terminal


# Options of a simulator that writes a table: its conditions, and how often each is read.
table_options = together(
    opt(
        "--grid", None,
        "Values of a condition: speed_rpm=1200,1500 or speed_rpm=300:3000:10 (ten values); repeatable.",
        "COLUMN=VALUES", multiple=True,
    ),
    decimal_option(),
    opt("--conditions", Path, "Use the conditions of the rows of a table, or the inputs of a recording."),
    opt("--repeats", click.IntRange(1, 10_000), "Readings of each condition.", "N", default=1),
)  # fmt: skip


@column_option("Name of a channel of --conditions, for a model of rates; repeatable.")
@table_options
def run(model: Model, options: Mapping[str, Any]) -> None:
    """A table of what the model predicts, over the limits of its rig unless --grid or --conditions say otherwise.

    A model of rates answers to the inputs of a recording (--conditions FILE), and -o writes a recording.
    """
    if model.rates:
        from specan_cli.simulate_recording import answer_inputs

        answer_inputs(model, options)
        return
    if "table" not in model.kinds:
        raise RequestError(f"the model {model.name!r} cannot be simulated from the command line")
    simulate(model, options, simulated_table, dict.fromkeys(model.rig.limits, POINTS))


def simulate(
    model: Model, options: Mapping[str, Any], make: Callable[..., Columns], points: Mapping[str, int]
) -> None:
    """Write or print what `make` predicts over the conditions that were asked for."""

    columns, names = _conditions(model, options, points)
    chosen = choose_model(grouped(model, names), options["effects"], options["without"])
    rows = make(chosen, columns, noise=options["noise"], repeats=options["repeats"], seed=options["seed"])
    for left in outside_validity(chosen, columns):
        say(f"Warning: {left}")
    for axis, words in names.items():
        rows[axis] = np.array(words, dtype=object)[rows[axis].astype(int)]
    if options["output"]:
        write(options["output"], rows, options["decimal"])
        note(f"{length(rows)} rows written to {options['output']}")
    if options["as_json"]:
        emit_json({"effects": [str(use) for use in chosen.assembly.uses], "rows": records(**rows)})
    elif not options["output"]:
        _print(rows)


def _conditions(
    model: Model, options: Mapping[str, Any], points: Mapping[str, int]
) -> tuple[Columns, dict[str, tuple[str, ...]]]:
    """Rows of a table, or a grid over the limits with the axes that the user gives; and the names in columns of names.

    In the rows stands the number of a name.
    """

    if options["conditions"]:
        from specan.study.data.table_file import read_table
        from specan.study.data.table_reader import ColumnNames

        columns = ColumnNames(options["conditions"], model, lenient=True)
        table = read_table(options["conditions"], choose=columns.choose, texts=model.groups)
        columns.convert(table)
        known = {c.column for c in model.conditions.values()}
        given = {name: table.frame[name].to_numpy() for name in table.frame if name in known}
        if not given:
            raise RequestError(f"{options['conditions']} has no column {' or '.join(sorted(known))}")
        names = {axis: tuple(dict.fromkeys(given[axis])) for axis in model.groups if axis in given}
        return given | {axis: _numbered(given[axis], said) for axis, said in names.items()}, names
    axes = over_limits(model, points)
    if not axes and not options["grid"]:
        raise RequestError(
            f"the rig of {model.name} states no limits to run over", remedy="name conditions with --grid"
        )
    names = {}
    for text in options["grid"]:
        column, _, values = text.partition("=")
        column = column.strip()
        if column in model.groups:
            said = [word.strip() for word in values.split(",")]
            names[column] = tuple(dict.fromkeys(said))
            axes[column] = _numbered(said, names[column]).tolist()
        else:
            axes[column] = _values(text, values)
    return grid(model, axes), names


def _numbered(words: Sequence[str], names: Sequence[str]) -> Any:
    return np.array([names.index(word) for word in words], dtype=float)


def over_limits(model: Model, points: Mapping[str, int]) -> dict[str, Sequence[float]]:
    """Values of each condition over what the rig can run, in its column's unit."""

    return {
        model.conditions[name].column: np.round(np.linspace(*span(model, name), count), 9).tolist()
        for name, count in points.items()
    }


def _values(text: str, values: str) -> list[float]:
    try:
        if ":" in values:
            low, high, count = values.split(":")
            return np.linspace(float(low), float(high), int(count)).tolist()
        return [float(value) for value in values.split(",")]
    except ValueError:
        raise RequestError(
            f"--grid {text!r} cannot be read", expected="COLUMN=1,2,3 or COLUMN=FROM:TO:COUNT"
        ) from None


def write(path: Path, rows: Columns, decimal: str = ".") -> None:
    """Write a table in the format that the ending names.

    Raises
    ------
    RequestError
        It names none of a table.
    """
    import pandas as pd

    OutputFile(*TABLES, ".json").check_ending(path)
    if decimal == "." and path.suffix.lower() in ("", ".csv", ".txt"):
        write_csv(path, rows, _cells(rows, ".9g"))
    else:
        write_frame(pd.DataFrame(dict(rows)), path, ["simulated"], decimal)


def _cells(rows: Columns, form: str) -> Iterator[list[str]]:
    """Numbers in a form, and names, row by row."""
    for row in zip(*rows.values(), strict=True):
        yield [value if isinstance(value, str) else format(value, form) for value in row]


def length(rows: Columns) -> int:
    """Number of rows."""
    return len(next(iter(rows.values())))


def _print(rows: Columns) -> None:
    shown = list(_cells(rows, ".5g"))
    print_table("", list(rows), shown[:MOST_PRINTED])
    if len(shown) > MOST_PRINTED:
        click.echo(f"... and {len(shown) - MOST_PRINTED} more rows; -o FILE writes all of them")
