"""``specan demo``: the sample data of the examples."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import click

from specan.errors import RequestError

# Below `sample_data`: all but the scripts that made them, which need the simulators of the benches.
SAMPLES = (
    "recordings/**/*.tdms",
    "truth/*",
    "broken/*",
    "two_mass/*",
    "own_model/*",
    "worm_drive/*",
    "worm_gear/*",
    "worm_gear/study/[!_]*/*",
    "planetary_gear/*",
)


@click.command("demo")
@click.argument("directory", type=click.Path(path_type=Path), metavar="[DIR]", default=Path("sample_data"))
def command(directory: Path) -> None:
    """Write the sample data of the examples to DIR, by default sample_data.

    Recordings of a simulated box with microphones and of a calibrator, a gear's table and rig. Existing files
    are not changed.

    \b
    specan demo
    specan batch sample_data/recordings -o results
    """
    written = copy_samples(directory)
    if written:
        click.echo(f"{written} files written to {directory}.")
    else:
        click.echo(f"{directory} holds the sample data already.")
    click.echo(f"Next: specan info {directory / 'recordings' / 'knock.tdms'}")


def sample_place() -> Path:
    """Where the sample data are: in the installed package, or beside it in a clone.

    Raises
    ------
    RequestError
        They are in neither.
    """
    here = Path(__file__).resolve().parent
    for place in (here / "sample_data", here.parent / "sample_data"):
        if any(place.glob(SAMPLES[0])):
            return place
    raise RequestError(
        "the sample data are not installed", remedy="install specan again, or clone the project"
    )


def copy_samples(directory: Path) -> int:
    """Copy the sample data; returns how many files were written.

    Raises
    ------
    RequestError
        The directory cannot be written to.
    """
    source, written = sample_place(), 0
    for path in sorted({p for pattern in SAMPLES for p in source.glob(pattern) if p.is_file()}):
        target = directory / path.relative_to(source)
        if not os.path.exists(target):  # Path.exists raises where a name is too long
            copied(path, target)
            written += 1
    return written


def copied(source: Path, target: Path) -> None:
    """Copy one file.

    Raises
    ------
    RequestError
        It cannot be written.
    """
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(source, target)
    except OSError as fault:
        raise RequestError(
            f"{target} cannot be written ({fault.strerror})", remedy="choose another directory"
        ) from None
