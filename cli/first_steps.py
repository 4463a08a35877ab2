"""What to type first, told to who types nothing but ``specan``: with the files that lie there."""

from __future__ import annotations

import os
import shlex
from pathlib import Path

SUFFIXES = (".tdms", ".wav")
_MOST = 2000  # entries of a directory that are looked at


def first_steps(here: Path) -> str:
    """Commands to begin with in a directory.

    Examples
    --------
    >>> from tempfile import mkdtemp
    >>> print(first_steps(Path(mkdtemp())))
    <BLANKLINE>
    First steps:
      specan info RECORDING.tdms           what is in a recording
      specan inspect RECORDING.tdms        look at it in the browser
      specan batch DIRECTORY -o results    everything in a directory, as text tables
      specan model list                    models to hold against a measurement
    Each verb shows an example with --help.
    """
    recordings, studies = _found(here)
    steps = []
    if studies:
        steps.append((f"specan study compare {studies[0]}", "where the model of this study fails"))
        steps.append((f"specan inspect {studies[0]}", "look at the study in the browser"))
    one = recordings[0] if recordings else "RECORDING.tdms"
    if recordings or not studies:
        place = "." if recordings else "DIRECTORY"
        steps += [
            (f"specan info {one}", "what is in a recording"),
            (f"specan inspect {one}", "look at it in the browser"),
            (f"specan batch {place} -o results", "everything in a directory, as text tables"),
        ]
    if not studies:
        steps.append(("specan model list", "models to hold against a measurement"))
    width = max(len(command) for command, _ in steps)
    here_are = f" ({len(recordings)} recordings lie here)" if len(recordings) > 1 else ""
    lines = [f"  {command:<{width}}    {text}" for command, text in steps]
    return "\n".join([f"\nFirst steps{here_are}:", *lines, "Each verb shows an example with --help."])


def _typed(name: str) -> str:
    """A name as the shell of this system wants it."""
    if os.name == "nt":
        return f'"{name}"' if " " in name else name
    return shlex.quote(name)


def _found(here: Path) -> tuple[list[str], list[str]]:
    """Recordings and studies of a directory, as they are typed; none where it cannot be read."""
    recordings, studies = [], []
    try:
        for number, path in enumerate(sorted(here.iterdir())):
            if number == _MOST:
                break
            if path.suffix.lower() in SUFFIXES and path.is_file():
                recordings.append(_typed(path.name))
            elif (path / "study.toml").is_file():
                studies.append(_typed(path.name))
    except OSError:  # the hints do without
        return [], []
    return recordings, ["."] if (here / "study.toml").is_file() else studies
