"""What the verbs that write files share: what they refuse to replace, and ``-`` for standard output."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click

from specan_cli.option_groups import Grouped

_STANDARD_OUTPUT = Path("-")
_FORCE = "specan_cli.force"


class OutputFile(click.Path):
    """Type of an option that names a file to be written; ``-`` is standard output."""

    def __init__(self) -> None:
        super().__init__(path_type=Path)


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
        names = {p.name for p in self.params if isinstance(p.type, OutputFile)}
        targets = [ctx.params[name] for name in sorted(names) if ctx.params.get(name) is not None]
        for target in targets:
            refuse_unsafe(target, ctx)
        if _STANDARD_OUTPUT in targets and (ctx.params.get("as_json") or targets.count(_STANDARD_OUTPUT) > 1):
            from specan.errors import RequestError

            raise RequestError(
                "standard output is asked for twice", expected="either --json or one file called '-'"
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
