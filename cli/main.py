"""Entry point: a lazy command group, so that ``specan --help`` loads no verb."""

from __future__ import annotations

import atexit
import errno
import gc
import importlib
import io
import os
import sys
from pathlib import Path
from typing import Any

import click
from click.shell_completion import CompletionItem

from specan import __file__ as _PACKAGE
from specan import __version__
from specan.errors import SpecanError, reason_of

# verb -> (module in this package, one line of help). The module holds the click command `command`, or the one named.
VERBS: dict[str, tuple[str, str]] = {
    "info": ("info", "Contents of a recording: channels, roles, rates, units, excitation, notes."),
    "octave": ("analyses:octave", "Levels in octave bands, and overall levels; against time."),
    "fft": ("analyses:fft", "The spectrum: magnitude and phase; spectrograms."),
    "frf": ("analyses:frf", "Transfer functions: magnitude, phase, coherence, uncertainty."),
    "tones": ("analyses:tones", "Amplitude, phase and distortion of sine recordings."),
    "orders": ("analyses:orders", "Order spectra, lines and averages against a tacho or a known speed."),
    "impulse": ("analyses:impulse", "Impulse responses from noise, sweeps, sequences and impulses."),
    "decay": ("analyses:decay", "Reverberation times, clarity, definition (ISO 3382)."),
    "srs": ("analyses:srs", "Shock response spectra (ISO 18431-4)."),
    "rms": ("analyses:rms", "RMS, level, peak, crest factor, equivalent and percentile levels."),
    "calibrate": ("calibrate", "Sensitivities and phases of microphones from recordings of a calibrator."),
    "batch": ("batch", "All analyses of a directory of recordings, as text tables."),
    "inspect": ("inspect", "One recording, or a study, on an interactive page in the browser."),
    "export": ("analyses:export", "Samples written for other tools: CSV, UFF58, WAV, Parquet, TDMS."),
    "model": ("model", "The models: their quantities, effects, parameters and sources."),
    "simulate": ("simulate", "Predictions of a model as a table, a look-up map, a recording or a figure."),
    "study": ("study", "Compare a model with measurements: where it fails, what is missing, what to add."),
    "conformance": ("conformance", "Test against IEC 61260-1, IEC 61672-1 and IEEE 1057."),
    "demo": ("demo", "The sample data of the examples, written to a directory."),
}

CLOSED_PIPE = 141  # as a shell reports it: 128 + SIGPIPE


class LazyGroup(click.Group):
    """Loads a verb's module only when that verb is called."""

    verbs = VERBS

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Verbs in the order in which a user meets them."""
        return list(self.verbs)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import the module of one verb."""
        if cmd_name not in self.verbs:
            return None
        module, _, name = self.verbs[cmd_name][0].partition(":")
        home = module if "." in module else f"specan_cli.{module}"
        command: click.Command = getattr(importlib.import_module(home), name or "command")
        from specan_cli.output import add_options

        add_options(command)
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the verbs without importing them."""
        with formatter.section("Commands"):
            formatter.write_dl([(verb, text) for verb, (_, text) in self.verbs.items()])

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """Verbs that begin so, and options; no verb is imported."""
        items = [
            CompletionItem(verb, help=text)
            for verb, (_, text) in self.verbs.items()
            if verb.startswith(incomplete)
        ]
        return [*items, *click.Command.shell_complete(self, ctx, incomplete)]

    def resolve_command(self, ctx: click.Context, args: list[str]) -> Any:
        """Name the nearest verb when one is mistyped."""
        from specan.errors import nearest

        if args and args[0] not in self.verbs and not args[0].startswith("-"):
            word = args[0].lower()
            about = [verb for verb, (_, text) in self.verbs.items() if len(word) > 2 and word in text.lower()]
            hint = f"see {', '.join(about)}" if about else nearest(word, self.verbs)
            ctx.fail(f"no such command {args[0]!r}; {hint}")
        return super().resolve_command(ctx, args)


class Program(LazyGroup):
    """The command ``specan``."""

    def invoke(self, ctx: click.Context) -> Any:
        """Run the verb; click itself would end with 1 where who reads its output stops early (``| head``)."""
        try:
            return super().invoke(ctx)
        except OSError as fault:
            if fault.errno == errno.ENAMETOOLONG:
                name = str(fault.filename)[:40]
                raise click.ClickException(f"the name {name}... is too long for a file; shorten it") from None
            if fault.errno not in (errno.EPIPE, errno.ENOSPC):
                raise
            # What is left in the buffer has nowhere to go; Python would complain about it at its end.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            if fault.errno == errno.EPIPE:
                raise click.exceptions.Exit(CLOSED_PIPE) from None
            raise click.ClickException("the disk is full; free some space and repeat the command") from None


@click.group(
    cls=Program, invoke_without_command=True, context_settings={"help_option_names": ["-h", "--help"]}
)
@click.option(
    "--version", is_flag=True, is_eager=True, expose_value=False, help="Show the version and exit.",
    callback=lambda ctx, _, wanted: _show_version(ctx, wanted),
)  # fmt: skip
@click.option("--debug", is_flag=True, help="Show a traceback with an error.")
@click.pass_context
def main(ctx: click.Context, debug: bool) -> None:
    """Spectral analysis of recordings, and models compared with them."""
    ctx.obj = {"debug": debug}
    if ctx.invoked_subcommand is None:
        click.echo(ctx.get_help())
        click.echo(FIRST_STEPS)


def _show_version(ctx: click.Context, wanted: bool) -> None:
    """Version and commit, such as ``specan 0.2.0 (commit 1a2b3c4d5e)``; without a commit the version alone."""
    if wanted:
        commit = _commit(Path(_PACKAGE).parent)
        click.echo(f"specan {__version__}" + (f" (commit {commit[:10]})" if commit else ""))
        ctx.exit()


def run() -> None:
    """Run the suite and turn errors into messages and exit codes."""
    debug = "--debug" in sys.argv
    # The system takes the memory back: looking through all modules for what is not used takes 0.05 s more.
    atexit.register(gc.freeze)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # a name may hold what the terminal cannot show
            stream.reconfigure(errors="backslashreplace")
    try:
        sys.exit(main(prog_name="specan", standalone_mode=False) or 0)
    except click.exceptions.Exit as done:
        sys.exit(done.exit_code)
    except click.ClickException as fault:
        fault.show()
        sys.exit(2)
    except SpecanError as fault:
        if debug:
            raise
        click.echo(f"Error: {fault}", err=True)
        sys.exit(fault.exit_code)
    except (KeyboardInterrupt, click.Abort):
        click.echo("Interrupted.", err=True)
        sys.exit(130)
    except Exception as fault:
        if debug:
            raise
        click.echo(
            f"Error: {reason_of(fault)}; run again with --debug before the verb and report the traceback.",
            err=True,
        )
        sys.exit(4)


COMMIT_FILE = "commit.txt"  # setup.py writes it into what it builds


def _commit(package: Path) -> str | None:
    """What the build left in the package, or what the repository around the package has checked out."""
    built = package / COMMIT_FILE
    if built.is_file():
        return built.read_text(encoding="ascii").strip() or None
    if not (package.parent / ".git").exists():
        return None
    import subprocess

    command = ["git", "-C", str(package.parent), "rev-parse", "HEAD"]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return None


FIRST_STEPS = """
First steps:
  specan info RECORDING.tdms           what is in a recording
  specan inspect RECORDING.tdms        show it in the browser
  specan batch DIRECTORY -o results    analyse a directory, write text tables
  specan model list                    models to compare with a measurement
Each verb shows an example with --help."""
