"""How a verb is declared: its files and figures, how it opens and reads recordings, and where its result goes."""

from __future__ import annotations

import errno
import os
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from specan.errors import NoSignalError, RequestError, SpecanError, reason_of
from specan_cli.options import EXCEEDED, Grouped, opening_options, opt
from specan_cli.output import asked, collecting, emit_json, note, say, show_sheets

if TYPE_CHECKING:
    from specan.arrays import Real
    from specan.data.channel import Channel
    from specan.data.recording import Recording
    from specan.io.open import Found
    from specan.result import RecordingResult, Result

_STANDARD_OUTPUT = Path("-")
_FORCE = "specan_cli.force"
_LEFT_OUT = "specan_cli.left_out"  # files by their reason


class OutputFile(click.Path):
    """Type of an option that names a file to be written; ``-`` is standard output.

    With `endings` a name that ends otherwise is refused: nobody finds tab-separated text in a workbook.
    """

    def __init__(self, *endings: str) -> None:
        super().__init__(path_type=Path)
        self.endings = endings

    def check_ending(self, path: Path) -> None:
        """Refuse another ending, and name the option of the verb that takes it.

        Raises
        ------
        RequestError
            It is one of a format that is not written.
        """
        ending = path.suffix.lower()
        if self.endings and ending and ending not in self.endings:
            options = {
                p.name: p.type.endings
                for p in click.get_current_context().command.params
                if isinstance(p.type, OutputFile)
            }
            raise RequestError(
                f"{path} ends in {ending}, a format that this command cannot write",
                expected=", ".join(self.endings),
                remedy=", ".join(f"give --{name} {path}" for name, ends in options.items() if ending in ends),
            )


# What specan.io.results_text.write_table writes by the ending; without one, text.
SAMPLES = (".csv", ".uff", ".unv", ".wav", ".parquet", ".tdms")  # of specan.io.export_file; without one, CSV
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
        """Refuse targets whose content must not be lost, as `check_output` says; then do the work."""
        from specan.io.output_file import check_directory, check_output

        types = {p.name: p.type for p in self.params if isinstance(p.type, OutputFile)}
        given = {name: ctx.params[name] for name in sorted(types) if ctx.params.get(name) is not None}
        targets = list(given.values())
        inputs = [path for name, value in ctx.params.items() if name not in types for path in _paths(value)]
        for name, target in given.items():
            check_directory(target)
            check_output(target, inputs, force=ctx.meta.get(_FORCE, False))
            types[name].check_ending(target)
        if _STANDARD_OUTPUT in targets and (ctx.params.get("as_json") or targets.count(_STANDARD_OUTPUT) > 1):
            raise RequestError(
                "standard output is requested twice", expected="either --json or one file called '-'"
            )
        return super().invoke(ctx)


def samples_option(ending: str) -> Callable[[Any], Any]:
    """The option ``-o`` of samples; without it they are written here, under the name of FILE with `ending`."""

    def chosen(context: click.Context, option: click.Parameter, path: Path | None) -> Path:
        return path or Path(f"{context.params['file'].stem}{ending}")

    text = f"The file to write, in the format of its ending.  [default: FILE{ending}, here]"
    return opt("-o --output", OutputFile(*SAMPLES), text, callback=chosen)


def decimal_option(what: str = "text") -> Callable[[Any], Any]:
    """The option ``--decimal``."""
    text = f"Decimal sign of {what}; with a comma, columns of .csv are separated by semicolons.  [default: .]"
    return opt("--decimal", [".", ","], text, default=".")


def _paths(value: Any) -> Iterator[Path]:
    if isinstance(value, Path):
        yield value
    elif isinstance(value, (tuple, list)):
        for part in value:
            yield from _paths(part)


def plot_option(what: str = "") -> Callable[[Any], Any]:
    """The option ``--plot FILE``."""
    text = f"Draw {what} to a .png, .svg or .pdf; - is standard output.".replace("  ", " ")
    return opt("--plot", OutputFile(".png", ".svg", ".pdf"), text, "FILE")


@dataclass(frozen=True)
class Delivery:
    """Where a result goes: into a figure, into a file, and to standard output, to read or as JSON."""

    plot: Path | None = None
    output: Path | None = None
    as_json: bool = False
    decimal: str = "."

    def put_out(self, content: Result | Any, show: Callable[[], object]) -> None:
        """Print JSON of a result or of plain values; else what `show` prints, and which files were written.

        Nothing is printed where standard output is that of a file.
        """
        targets = (self.plot, self.output)
        if self.as_json:
            emit_json(content.to_dict() if hasattr(content, "to_dict") else content)
        elif _STANDARD_OUTPUT not in targets:
            show()
            for target in filter(None, targets):
                click.echo(f"Written to {target}.")

    def draw(self, found: Result, **options: Any) -> None:
        """The figure of a result, where one was asked for; see `specan.plot` for the options."""
        if self.plot is not None:
            import specan

            specan.plot(found, self.plot, **options)

    def draw_beside(self, found: Result) -> Delivery:
        """Draw a result that is printed as well; what is left to put out, without a figure where there is none."""
        try:
            self.draw(found)
        except RequestError as fault:
            say(f"No figure: {fault}")
            return replace(self, plot=None)
        return self

    @property
    def wants_whole(self) -> bool:
        """Whether the whole result is wanted at once: as JSON, or in a file that is no table."""
        ending = "" if self.output is None else self.output.suffix.lower()
        return self.as_json or bool(ending and ending not in TABLES)

    def __call__(
        self,
        found: RecordingResult,
        *,
        shown: Mapping[str, Any] | None = None,
        more: Mapping[str, Any] | None = None,
        limit: Path | None = None,
        **drawn: Any,
    ) -> int:
        """Draw and write a result where that is wanted, print it, and say its notes.

        Nothing is printed to read where the text itself goes to standard output. `shown` are options of the tables on
        the screen, `drawn` of the figure; `more` stands in the JSON as well. The exit code says whether a `limit` is
        kept.
        """
        from specan.io.export_file import write_result
        from specan.io.limit_file import read_limits
        from specan.result import picked

        curve = None if limit is None else read_limits(limit)
        kept = [] if curve is None else found.keeps(curve)
        if curve is not None and not drawn.get("view"):  # over time none are drawn
            drawn["limits"] = curve
        self.draw(found, **drawn)
        if self.output is not None:
            write_result(found, self.output, decimal=self.decimal)
        label = "" if curve is None else curve.label
        limits = [picked(one, "channel passed excess_dB place compared") for one in kept]

        def show() -> None:
            show_sheets(found.sheets(**(shown or {})))
            say_calibration(found)
            for one in kept:
                distance = f"{abs(one.excess_dB):.2f} dB"
                text = f"passed, margin {distance}" if one.passed else f"FAILED, {distance} beyond the limit"
                where = f"at {one.place} ({one.compared} compared)"
                click.echo(f"Limits {label}: {one.channel}: {text} {where}")

        content: dict[str, Any] = {}
        if self.as_json:
            content = {**found.to_dict(), **(more or {}), **({"limits": limits} if kept else {})}
        self.put_out(content, show)
        say_notes(found.notes, dict(zip(found.channels, found.flags)))
        return 0 if all(one.passed for one in kept) else EXCEEDED


def delivered(function: Callable[..., Any]) -> Callable[..., Any]:
    """Where the result of a verb goes reaches it as `deliver`."""

    @wraps(function)
    def gathered(**options: Any) -> Any:
        where = {one.name: options.pop(one.name) for one in fields(Delivery) if one.name in options}
        return function(deliver=Delivery(**where), **options)

    return gathered


def verb(name: str) -> Callable[[Any], click.Command]:
    """Decorator above the options of a verb that writes files."""
    return lambda function: click.command(name, cls=Verb)(delivered(function))


UFF = (".uff", ".unv")  # of functions of frequency


def given(**options: Any) -> dict[str, Any]:
    """Options that were given; the settings' own defaults hold for the others."""
    return {name: value for name, value in options.items() if value is not None and value != ()}


def say_calibration(found: Any) -> None:
    """Which calibration the channels of a result have, below its table."""
    if said := found.settings.get("calibration"):
        click.echo(f"Calibration: {said}.")


def say_notes(notes: Sequence[str], flags: Mapping[str, Sequence[str]]) -> None:
    """Notes and flags, on standard error."""
    from specan.result import gathered

    for text in notes:
        note(f"Note: {text}.")
    alike = gathered((", ".join(words), name) for name, words in flags.items() if words)
    for said, names in alike.items():
        whose = ", ".join(names) if len(names) <= 8 else f"{names[0]} ... {names[-1]} ({len(names)})"
        say(f"Warning: {whose}: {said}.")


class RecordingVerb(Verb):
    """A verb for a recording. Of several, each is analysed by itself, and one that fails costs only itself.

    A directory stands for all recordings in it. The callback sees one `file` at a time; the JSON of several is one
    object, ``{"files": [...], "failures": [...]}``.
    """

    def invoke(self, ctx: click.Context) -> Any:
        """One file as it always was; several in turn."""
        from numpy import errstate

        files = [one.path for one in expand(ctx.params["file"])]
        # What is not a number, or too large for one, is flagged in the result.
        with errstate(all="ignore"):
            if len(files) == 1:
                ctx.params["file"] = files[0]
                return super().invoke(ctx)
            return self._several(ctx, files)

    def _several(self, ctx: click.Context, files: Sequence[Path]) -> int:
        for name in ("output", "plot"):
            if ctx.params.get(name) is not None:
                raise RequestError(
                    f"--{name} is for one recording, and there are {len(files)}",
                    remedy="name one, or take --json or specan batch",
                )
        done, faults, code = [], dict[str, Exception](), 0
        for path in files:
            ctx.params["file"] = path
            with left_out(str(path), faults), collecting(ctx) as content:
                code = max(code, super().invoke(ctx) or 0)
                done.append({**(content[0] if content else {}), "path": str(path)})
        if not done:
            raise next(iter(faults.values()))
        if ctx.params.get("as_json"):
            emit_json({"files": done, "failures": failures(faults)})
        return 1 if any(not isinstance(fault, NoSignalError) for fault in faults.values()) else code


@contextmanager
def left_out(file: str, faults: dict[str, Exception], several: bool = True) -> Iterator[None]:
    """What goes wrong with one of several files is said, and costs no other its result."""
    try:
        yield
    except (click.ClickException, click.exceptions.Exit, click.Abort, BrokenPipeError):
        raise
    except Exception as fault:
        if not several or (isinstance(fault, OSError) and fault.errno == errno.ENOSPC):
            raise
        faults[file] = fault
        context, reason, name = click.get_current_context(), _reason(file, fault), Path(file).name
        alike = context.meta.setdefault(_LEFT_OUT, {}).setdefault(reason.replace(name, ""), [])
        alike.append(name)
        if len(alike) == 1:
            say(f"Left out: {reason}")
        elif len(alike) == 2:
            text = "Left out for the same reason as"
            context.call_on_close(lambda: say(f"{text} {alike[0]}: {', '.join(alike[1:])}."))


def failures(faults: Mapping[str, Exception]) -> list[dict[str, str]]:
    """Files that were left out, and why, for JSON."""
    return [{"file": file, "reason": _reason(file, fault)} for file, fault in faults.items()]


def _reason(file: str, fault: Exception) -> str:
    return str(fault) if isinstance(fault, SpecanError) else f"{Path(file).name}: {reason_of(fault)}"


def expand(paths: Sequence[Path]) -> list[Found]:
    """Files, and in place of a directory the recordings in it.

    Raises
    ------
    RequestError
        A directory holds none.
    """
    from specan.io.open import Found, find_recordings, suffixes

    found: list[Found] = []
    for path in paths:
        # os.path: Path.is_dir raises where a name is too long for the file system.
        path = at_hand(path)
        inside = find_recordings([path]) if os.path.isdir(path) else [Found(path, path.name)]
        if not inside:
            raise RequestError(
                f"the directory {path} holds no recording",
                expected=f"files that end in {', '.join(suffixes())}",
            )
        found += inside
    return found


def at_hand(path: Path) -> Path:
    """A file; of standard input, ``-``, a copy that is removed when the verb ends: formats are read from anywhere."""
    if str(path) != "-":
        return path
    place = tempfile.TemporaryDirectory()
    click.get_current_context().call_on_close(place.cleanup)
    path = Path(place.name) / "standard_input"
    with path.open("wb") as file:
        shutil.copyfileobj(sys.stdin.buffer, file)
    return path


def reader(options: dict[str, Any]) -> Callable[[Path], Recording]:
    """What opens a recording as `opening_options` and ``--quantity`` say, which are taken out of the options."""
    names = ("channel_table", "calibration", "sampling_rate", "quantity")
    said = {name: options.pop(name) for name in names if name in options}

    def opened(file: Path) -> Recording:
        from specan.api.recordings import read

        return shown(read(at_hand(file), **said))

    return opened


def recording_verb(name: str, what: str = "everything", *more: str) -> Callable[[Any], click.Command]:
    """A verb for one recording or several, with ``-o`` and ``--json`` of `what`, behind the options of its own.

    `more` are further endings of ``-o``.

    The callback gets a `Source` and a `Delivery`, as `source` and `deliver`, and its own options.
    """

    def make(function: Callable[..., int]) -> click.Command:
        own = function.__dict__.pop("__click_params__", [])

        @opt(
            "-o --output",
            OutputFile(*TABLES, ".json", *more),
            f"Write {what} as text, or as .csv, .xlsx, .parquet, {''.join(f'{m}, ' for m in more[:1])}or .json.",
        )
        @decimal_option()
        @opt("--json as_json", bool, f"Print {what} as JSON.")
        @opening_options
        @delivered
        @wraps(function)
        def gathered(file: Path, deliver: Delivery, **options: Any) -> int:
            opened = reader(options)
            if options.get("background") is not None:
                options["background"] = opened(options["background"])
            return function(opened(file), deliver, **options)

        gathered.__click_params__ += own
        files = click.argument(
            "file", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="FILE..."
        )
        return click.command(name, cls=RecordingVerb)(files(gathered))

    return make


_LONG_SAMPLES = 50_000_000  # some seconds of work


def shown(recording: Recording) -> Recording:
    """The same, with a bar on a terminal where reading takes some time, and a line under ``--verbose``."""
    said = set[str]()

    def watch(blocks: Iterator[Real], channels: Sequence[Channel], length: int) -> Iterator[Real]:
        rate = channels[0].sampling_rate if channels else 0.0
        text = f"Reading {recording.label}: {len(channels)} channels, {length} samples at {rate:g} Hz."
        if asked("verbose") and text not in said:
            say(text)
            said.add(text)
        hidden = length * len(channels) < _LONG_SAMPLES or asked("quiet") or not sys.stderr.isatty()
        with click.progressbar(length=length, file=sys.stderr, label=recording.label, hidden=hidden) as bar:
            for samples in blocks:
                yield samples
                bar.update(samples.shape[1])

    return replace(recording, watch=watch)
