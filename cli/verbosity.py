"""How much a verb says on standard error: ``-q`` and ``-v``, which every verb has."""

from __future__ import annotations

import time
from typing import Any

import click

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
