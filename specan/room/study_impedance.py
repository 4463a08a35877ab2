"""``specan study impedance``: what the walls of a room are made of, as sound sees them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import click

from specan_cli.output import show_sheets
from specan_cli.study import study_verb, told
from specan_cli.verb import Delivery, plot_option

if TYPE_CHECKING:
    from specan.room.wall_impedance.surface_impedance import Impedance
    from specan.study.study import Study


@study_verb("impedance")
@click.option("--wall", metavar="NAME", help="Show this wall only: x0, x1, y0 ...")
@click.option("--accuracy", default=0.1, show_default=True, metavar="ALPHA",
              help="Half-width of the 95 % interval up to which absorption counts as determined.")  # fmt: skip
@plot_option("impedance and absorption")
def command(study: Study, deliver: Delivery, wall: str | None, accuracy: float) -> None:
    """Surface impedance and absorption of the walls of a room.

    All walls are estimated together in every third octave, with the errors of the instruments. The walls of the
    study's model are not used. Where the microphones do not determine a value, specan says so and proposes positions.

    \b
    specan study impedance my_room --plot walls.png
    """
    from specan.room.wall_impedance.advice import advise
    from specan.room.wall_impedance.surface_impedance import study_impedance

    progress = told()
    whole = study_impedance(study, accuracy, progress)
    shown = whole if wall is None else whole.only(wall)
    progress("what would determine the rest")
    advice = advise(shown)
    deliver.draw(shown)
    deliver.put_out({**shown.to_dict(), "advice": advice}, lambda: _print(shown, advice))


def _print(found: Impedance, advice: Sequence[Mapping[str, Any]]) -> None:
    for sheet in found.sheets():
        show_sheets([sheet])
        click.echo("")
    for text in found.sentences():
        click.echo(text[0].upper() + text[1:] + ".")
    click.echo(
        "Z/(rho c): a mass is a positive imaginary part. alpha: absorption coefficient that follows from Z. "
        f"a..b: 95 % interval. {found.criterion[0].upper()}{found.criterion[1:]}. "
        f"Reduced chi-square {found.fit.reduced_chi2:.2f}."
    )
    if advice:
        click.echo("\nMeasurements that would determine more:")
        for one in advice:
            click.echo(f"  {one['text']}")
