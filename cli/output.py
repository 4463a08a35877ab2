"""What every verb puts out: tables or JSON on standard output, notes on standard error, files and figures.

With the options for it: ``-q`` and ``-v``, which every verb has, ``--plot``, and files that are not replaced.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from specan_cli.option_groups import Grouped

if TYPE_CHECKING:
    from specan.result import Result

_COLLECTED = "specan_cli.collected"
# What makes rich treat standard output as a terminal, or of another width.
_OF_A_TERMINAL = (
    "FORCE_COLOR",
    "TTY_COMPATIBLE",
    "TTY_INTERACTIVE",
    "JUPYTER_COLUMNS",
    "JUPYTER_LINES",
)
_WIDTH = "80"  # of a file or a pipe
LONGEST_WORD = 48  # letters of a cell that are not broken over two lines


@contextmanager
def collecting(ctx: click.Context) -> Iterator[list[Any]]:
    """What `emit_json` is given meanwhile is kept here and not printed."""
    found: list[Any] = []
    ctx.meta[_COLLECTED] = found
    try:
        yield found
    finally:
        del ctx.meta[_COLLECTED]


def emit_json(content: Any) -> None:
    """Print `content` as JSON on standard output."""
    ctx = click.get_current_context(silent=True)
    if ctx is not None and _COLLECTED in ctx.meta:
        ctx.meta[_COLLECTED].append(content)
        return
    from specan.result import finite

    click.echo(json.dumps(finite(content), indent=2, ensure_ascii=False))


def table(title: str, header: Sequence[str], rows: Iterable[Sequence[Any]]) -> None:
    """Print a table that fits the terminal; numbers to the right, NO_COLOR respected."""
    rows = [["" if cell is None else cell for cell in row] for row in rows]
    if (lines := plain_lines(title, header, rows)) is not None:
        click.echo("\n".join(lines))
        return
    from rich.console import Console
    from rich.table import Table

    class Sheet(Console):
        def on_broken_pipe(self) -> None:
            raise BrokenPipeError  # rich would end the process itself

    console = Sheet(soft_wrap=False)
    widths = column_widths([list(header), *rows], console.width)
    console.width = max(console.width, sum(widths) + 2 * (len(widths) - 1))
    sheet = Table(title=title or None, title_justify="left", box=None, pad_edge=False, header_style="bold")
    for index, name in enumerate(header):
        numeric = _numeric(rows, index)
        sheet.add_column(name, justify="right" if numeric else "left", overflow="fold", width=widths[index])
    from rich.text import Text

    for row in rows:
        # Text, not markup: a channel may be called "[bold]".
        sheet.add_row(*(Text(str(cell)) for cell in row))
    console.print(sheet)


def column_widths(rows: Sequence[Sequence[Any]], width: int) -> list[int]:
    """Widths of columns two letters apart that fit in, as far as no word is broken: the widest give way first.

    Names of effects and parameters are copied into commands; nothing is cut off at the edge.
    """
    from rich.cells import cell_len

    columns = [[str(cell) for cell in column] for column in zip(*rows, strict=True)]
    widths = [max(map(cell_len, column)) for column in columns]
    least = [max((cell_len(w) for cell in c for w in cell.split()), default=0) for c in columns]
    least = [min(word, LONGEST_WORD) for word in least]
    while sum(widths) + 2 * (len(widths) - 1) > width:
        shrinkable = [k for k, size in enumerate(widths) if size > least[k]]
        if not shrinkable:
            break
        widths[max(shrinkable, key=lambda k: widths[k])] -= 1
    return widths


def plain_lines(title: str, header: Sequence[str], rows: Sequence[Sequence[Any]]) -> list[str] | None:
    """The lines that rich prints into a file or a pipe, without loading it; None where it is more than that.

    It is more for a terminal, for a table that does not fit in, and for letters that are not one column wide.
    """
    if sys.stdout.isatty() or any(name in os.environ for name in _OF_A_TERMINAL):
        return None
    if any(mark in name for name in (title, *header) for mark in "[:\\"):  # rich takes it for markup
        return None
    cells = [list(header), *([str(cell) for cell in row] for row in rows)]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    width = sum(widths) + 2 * (len(widths) - 1)
    every = [title, *(cell for row in cells for cell in row)]
    columns = os.environ.get("COLUMNS", "")
    if width > int(columns if columns.isdecimal() else _WIDTH) or len(title) > width:
        return None
    if not all(cell.isascii() and cell.isprintable() and cell == cell.strip() for cell in every):
        return None
    right = [_numeric(rows, index) for index in range(len(header))]
    lines = [
        "  ".join(
            cell.rjust(w) if to_the_right else cell.ljust(w)
            for cell, w, to_the_right in zip(row, widths, right, strict=True)
        )
        for row in cells
    ]
    return [title.ljust(width), *lines] if title else lines


def _numeric(rows: Sequence[Sequence[Any]], index: int) -> bool:
    return bool(rows) and all(isinstance(row[index], (int, float)) or row[index] == "" for row in rows)


def say(text: str) -> None:
    """A line of progress or warning, on standard error."""
    click.echo(text, err=True)


# --- how much a verb says on standard error -------------------------------------------------------------

_QUIET, _VERBOSE = "specan_cli.quiet", "specan_cli.verbose"


def add_options(command: click.Command) -> None:
    """Give a verb ``-q`` and ``-v``, once."""
    if isinstance(command, click.Group) or any(p.name == "quiet" for p in command.params):
        return
    for names, text in (
        (["-q", "--quiet"], "No notes and no progress; warnings and errors only."),
        (["-v", "--verbose"], "Print also what is read and how long it takes."),
    ):
        command.params.append(
            click.Option(names, is_flag=True, expose_value=False, callback=_keep, help=text)
        )


def is_quiet() -> bool:
    """Whether notes and progress are unwanted."""
    return bool(_asked(_QUIET))


def is_verbose() -> bool:
    """Whether more is to be said."""
    return bool(_asked(_VERBOSE))


def _asked(key: str) -> Any:
    context = click.get_current_context(silent=True)
    return context is not None and context.meta.get(key, False)


def _keep(context: click.Context, option: click.Parameter, value: bool) -> None:
    context.meta[_QUIET if option.name == "quiet" else _VERBOSE] = value
    if value and option.name == "verbose":
        begun, processor = time.perf_counter(), time.process_time()

        def took() -> None:
            passed, used = time.perf_counter() - begun, time.process_time() - processor
            click.echo(f"{context.info_name}: {passed:.2f} s, {used:.2f} s of processor time", err=True)

        context.call_on_close(took)


# --- files and figures --------------------------------------------------------------------------------

_STANDARD_OUTPUT = Path("-")
_FORCE = "specan_cli.force"


class OutputFile(click.Path):
    """Type of an option that names a file to be written; ``-`` is standard output.

    With `endings` a name that ends otherwise is refused: nobody finds tab-separated text in a workbook.
    """

    def __init__(self, *endings: str) -> None:
        super().__init__(path_type=Path)
        self.endings = endings

    def check_ending(self, path: Path) -> None:
        """Refuse another ending.

        Raises
        ------
        RequestError
            It is one of a format that is not written.
        """
        from specan.errors import RequestError

        ending = path.suffix.lower()
        if self.endings and ending and ending not in self.endings:
            raise RequestError(
                f"{path} ends in {ending}, a format that this command cannot write",
                expected=", ".join(self.endings),
            )


# What specan.io.results_text.write_table writes by the ending; without one, text.
TABLES = (".txt", ".tsv", ".csv", ".xlsx", ".parquet")


class Verb(Grouped):
    """A verb that writes files: its options of type `OutputFile` are checked before the work begins."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self.params.append(
            click.Option(
                ["--force"],
                is_flag=True,
                expose_value=False,
                callback=lambda ctx, _, value: ctx.meta.__setitem__(_FORCE, value),
                help="Replace a file that specan did not write; a recording is never replaced.",
            )
        )

    def invoke(self, ctx: click.Context) -> Any:
        """Refuse targets whose content must not be lost; then do the work."""
        types = {p.name: p.type for p in self.params if isinstance(p.type, OutputFile)}
        given = {name: ctx.params[name] for name in sorted(types) if ctx.params.get(name) is not None}
        targets = list(given.values())
        for name, target in given.items():
            refuse_unsafe(target, ctx)
            types[name].check_ending(target)
        if _STANDARD_OUTPUT in targets and (ctx.params.get("as_json") or targets.count(_STANDARD_OUTPUT) > 1):
            from specan.errors import RequestError

            raise RequestError(
                "standard output is requested twice", expected="either --json or one file called '-'"
            )
        return super().invoke(ctx)


def refuse_unsafe(target: Path, ctx: click.Context | None = None) -> None:
    """Refuse a file that the verb reads, a recording, and without --force what specan did not write.

    Raises
    ------
    RequestError
        As `specan.io.output_file.check_output`.
    """
    from specan.io.output_file import check_output

    ctx = ctx or click.get_current_context()
    outputs = {p.name for p in ctx.command.params if isinstance(p.type, OutputFile)}
    inputs = [path for name, value in ctx.params.items() if name not in outputs for path in _paths(value)]
    check_output(target, inputs, force=ctx.meta.get(_FORCE, False))


def to_standard_output(*targets: Path | None) -> bool:
    """Whether a file goes to standard output, which then holds nothing else."""
    return _STANDARD_OUTPUT in targets


def say_written(*targets: Path | None) -> None:
    """Which files were written."""
    for target in targets:
        if target is not None:
            click.echo(f"Written to {target}.")


def _paths(value: Any) -> Iterator[Path]:
    if isinstance(value, Path):
        yield value
    elif isinstance(value, (tuple, list)):
        for part in value:
            yield from _paths(part)


def _checked(context: click.Context, option: click.Parameter, path: Path | None) -> Path | None:
    """A name that cannot be written is told before the work is done."""
    if path is not None:
        from specan.report.figure_style import figure_format

        figure_format(path)
    return path


def plot_option(what: str = "") -> Callable[[Any], Any]:
    """The option ``--plot FILE``."""
    text = f"Draw {what} to a .png, .svg or .pdf." if what else "Draw to a .png, .svg or .pdf."
    return click.option("--plot", type=OutputFile(), callback=_checked, metavar="FILE", help=text)


def draw(found: Result, plot: Path | None, **options: Any) -> None:
    """The figure of a result, where one was asked for; see `specan.plot` for the options."""
    if plot is not None:
        import specan

        specan.plot(found, plot, **options)


def draw_beside(found: Result, plot: Path | None) -> None:
    """The figure of a result that is printed as well: where there is nothing to draw, a line says so."""
    if plot is None:
        return
    import specan
    from specan.api.drawing import saved
    from specan.errors import RequestError

    try:
        figure = specan.plot(found)
    except RequestError as fault:
        say(f"No figure: {fault}")
        return
    saved(figure, plot)
