"""``specan study propose``: laws for what no effect of the catalogue explains."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from specan_cli.output import Delivery, table
from specan_cli.study import show_next, study_verb

if TYPE_CHECKING:
    from specan.study.propose import ProposedLaws
    from specan.study.study import Study


@study_verb("propose")
def command(study: Study, deliver: Delivery) -> None:
    """Search the residuals of DIR for laws, and write them as effect files.

    For an effect outside the catalogue: powers, exponentials and saturation of one operating variable, and
    their products with a power of another. Held-out data are not used.

    \b
    specan study propose my_study
    """
    from specan.study.propose import propose_laws

    found = propose_laws(study)
    deliver.put_out(found, lambda: show(found, study))


def show(found: ProposedLaws, study: Study) -> None:
    """The laws, what they do to the error, and what would distinguish them."""
    from specan.report import study_sheets
    from specan.study.verdict import percent
    from specan.units import printed_unit

    if not found.laws:
        click.echo(f"{found.summary()}.")
        return
    count = len(found.laws)
    click.echo(
        f"Found in these data: {count} {'law' if count == 1 else 'laws that they cannot distinguish'}; "
        f"{found.tried} were tried."
    )
    if found.more:
        click.echo(
            f"These data fit {found.more} further families of laws as well: measure more before you choose."
        )
    before = "" if found.left_out_before is None else f", {found.left_out_before:.4g} in cross-validation"
    click.echo(f"Error now: {found.error_before:.4g} {printed_unit(found.unit)}{before}.")
    table(
        "",
        ["law", "error after", "cross-validated", "probability"],
        [
            [
                law.name, f"{law.error_after:.4g}",
                "" if law.left_out_after is None else f"{law.left_out_after:.4g}", percent(law.probability),
            ]
            for law in found.laws
        ],
    )  # fmt: skip
    for law in found.laws:
        click.echo(f"{law.name}: {law.text}")
        for name, p in law.parameters.items():
            click.echo(f"  {name.rpartition('.')[2]} = {study_sheets.value_text(p)}")
    click.echo(
        "(error after: RMS once it is added. cross-validated: each condition is predicted by a fit without it.)"
    )
    if found.next_measurement:
        click.echo("")
        show_next(found.next_measurement)
    click.echo(f"\nTry it: specan study add {study.directory} {found.laws[0].file}")
