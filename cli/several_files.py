"""Verbs for a recording that take several, one after the other."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from specan_cli.output import Verb, collecting, emit_json, say

if TYPE_CHECKING:
    from specan.io.open import Found

PARAMETER = "file"  # the callback gets one path under this name


def recording_argument() -> Callable[[Any], Any]:
    """The argument ``FILE...`` of a verb of the class `RecordingVerb`."""
    return click.argument(
        PARAMETER, nargs=-1, required=True, type=click.Path(path_type=Path), metavar="FILE..."
    )


class RecordingVerb(Verb):
    """A verb for a recording. Of several, each is analysed by itself, and one that fails costs only itself.

    A directory stands for all recordings in it. The callback sees one file at a time; the JSON of several is one
    object, ``{"files": [...], "failures": [...]}``.
    """

    def invoke(self, ctx: click.Context) -> Any:
        """One file as it always was; several in turn."""
        files = [one.path for one in expand(ctx.params[PARAMETER])]
        if len(files) == 1:
            ctx.params[PARAMETER] = files[0]
            return super().invoke(ctx)
        return self._several(ctx, files)

    def _several(self, ctx: click.Context, files: Sequence[Path]) -> int:
        from specan.errors import InputError, RequestError

        for name in ("output", "plot"):
            if ctx.params.get(name) is not None:
                raise RequestError(
                    f"--{name} writes one recording, and there are {len(files)}",
                    remedy="name one, or take --json or specan batch",
                )
        done, failures, faults, code = [], [], [], 0
        for path in files:
            ctx.params[PARAMETER] = path
            try:
                with collecting(ctx) as content:
                    code = max(code, super().invoke(ctx) or 0)
            except (InputError, RequestError) as fault:
                faults.append(fault)
                failures.append({"file": str(path), "reason": str(fault)})
                say(f"Left out: {fault}")
                continue
            done.append({**(content[0] if content else {}), "path": str(path)})
        if not done:
            raise faults[0]
        if ctx.params.get("as_json"):
            emit_json({"files": done, "failures": failures})
        return 1 if failures else code


def expand(paths: Sequence[Path]) -> list[Found]:
    """Files, and in place of a directory the recordings in it.

    Raises
    ------
    RequestError
        A directory holds none.
    """
    from specan.errors import RequestError
    from specan.io.open import Found, find_recordings

    found: list[Found] = []
    for path in paths:
        # os.path: Path.is_dir raises where a name is too long for the file system.
        inside = find_recordings([path]) if os.path.isdir(path) else [Found(path, path.name)]
        if not inside:
            raise RequestError(f"the directory {path} holds no recording", expected="*.tdms or *.wav in it")
        found += inside
    return found
