"""``specan frf``: transfer functions of one recording."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from specan_cli.output import plot_option, table
from specan_cli.recording_verb import (
    Delivery,
    Source,
    given,
    quantity_option,
    recording_verb,
    section_options,
)

if TYPE_CHECKING:
    from specan.data.frequency_response import FrequencyResponse
    from specan.units import Quantity


@recording_verb("frf", "all lines")
@click.option("--reference", metavar="CH", help="Channel of reference [default: the vibrometer].")
@click.option(
    "--estimator",
    type=click.Choice(["H1", "H2", "Hv", "H3c"], case_sensitive=False),
    help="H1: noise in the responses; H2: in the reference; Hv: in both; H3c: the generator as "
    "instrument, for a noisy vibrometer.  [default: H1]",
)
@click.option("--instrument", metavar="CH", help="Instrument of H3c [default: the generator].")
@section_options
@quantity_option
@click.option(
    "--lines",
    type=int,
    help="Lines up to fs/2.56.  [default: 3200, more where the response is longer]",
)
@click.option("--window", help="Window of the blocks.  [default: hann]")
@click.option("--overlap", type=float, help="Overlap of the blocks, 0 to 0.95.  [default: 0.5]")
@click.option("--no-align", is_flag=True, help="Do not compensate delayed responses.")
@click.option("--fmin", type=float, default=0.0, metavar="HZ", help="Lowest line shown.")
@click.option("--fmax", type=float, metavar="HZ", help="Highest line shown.")
@click.option("--at", "at_hz", type=float, multiple=True, metavar="HZ", help="Print this line; repeatable.")
@plot_option()
@click.option("--unwrap", is_flag=True, help="Draw the phase without jumps.")
def command(
    source: Source,
    deliver: Delivery,
    no_align: bool,
    fmin: float,
    fmax: float | None,
    at_hz: tuple[float, ...],
    unwrap: bool,
    quantity: Quantity | None,
    **options: Any,
) -> int:
    """Find the transfer functions of microphones and accelerometers over the vibrometer, or over --reference.

    Phases are those of exp(+j w t), response over reference: a delayed response has a falling phase.

    \b
    specan frf sample_data/recordings/noise/noise_24_microphones.tdms --at 250 --plot frf.png
    """
    from specan.api.recordings import frf
    from specan.errors import RequestError

    found = frf(source.open(quantity), align=not no_align, **given(**options))
    found = found.between(fmin, float("inf") if fmax is None else fmax)
    if outside := [f"{f:g}" for f in at_hz if not found.frequency_hz[0] <= f <= found.frequency_hz[-1]]:
        raise RequestError(
            f"--at {', '.join(outside)} Hz is outside the lines",
            expected=f"{found.frequency_hz[0]:g} to {found.frequency_hz[-1]:g} Hz",
        )
    return deliver(found, lambda: show(found, at_hz), flags=found.flags, unwrapped=unwrap)


def show(found: FrequencyResponse, at_hz: tuple[float, ...]) -> None:
    """One row a channel, and one a channel and line that was asked for."""
    import numpy as np

    from specan.result import counted

    u_percent = np.hypot(found.u_magnitude_percent, found.u_common_percent)
    u_phase = np.hypot(found.u_phase_deg, found.u_common_phase_deg)
    spacing = found.frequency_hz[1] - found.frequency_hz[0] if len(found.frequency_hz) > 1 else 0.0
    title = (
        f"{found.label}: {found.estimator} over {found.reference} "
        f"({found.reference_rms:.4g} {found.reference_unit} RMS), {len(found.frequency_hz)} lines "
        f"{spacing:.4g} Hz apart, {counted(found.n_blocks, 'block')} ({found.n_effective:.0f} independent)"
    )
    units = set(found.units)
    header = ["channel", "peak Hz", "magnitude", "phase deg", "coherence", "u %", "u deg"]
    if len(units) == 1:
        header[2] = units.pop()
    rows = []
    for row, name in enumerate(found.channels):
        magnitude = found.magnitude[row]
        if np.isfinite(magnitude).any():
            picked = [int(np.nanargmax(magnitude))]
        else:
            picked = []
        if at_hz:
            picked = [int(np.argmin(np.abs(found.frequency_hz - f))) for f in at_hz]
        rows += [
            [
                name,
                f"{found.frequency_hz[k]:.6g}",
                f"{magnitude[k]:.5g}" + (f" {found.units[row]}" if units else ""),
                f"{found.phase_deg[row, k]:.2f}",
                f"{found.coherence[row, k]:.4f}",
                f"{u_percent[row, k]:.3g}",
                f"{u_phase[row, k]:.3g}",
            ]
            for k in picked
        ]
        if not picked:
            rows.append([name, *[""] * 6])
    if at_hz:
        header[1] = "Hz"
    table(title, header, rows)
