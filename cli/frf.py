"""``specan frf``: transfer functions of one recording."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from specan import __version__
from specan_cli.figure_output import plot_option
from specan_cli.output import table
from specan_cli.recording_input import feed, given, quantity_option, say_notes, section_options
from specan_cli.results import deliver, result_options
from specan_cli.several_files import RecordingVerb, recording_argument

if TYPE_CHECKING:
    from specan.data.frequency_response import FrequencyResponse
    from specan.units import Quantity


@click.command("frf", cls=RecordingVerb)
@recording_argument()
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
@result_options("all lines")
def command(
    file: Path,
    reference: str | None,
    estimator: str | None,
    instrument: str | None,
    channels: tuple[str, ...],
    start_s: float,
    stop_s: float | None,
    lines: int | None,
    window: str | None,
    overlap: float | None,
    no_align: bool,
    fmin: float,
    fmax: float | None,
    at_hz: tuple[float, ...],
    plot: Path | None,
    unwrap: bool,
    output: Path | None,
    as_json: bool,
    opening: dict[str, Any],
    quantity: Quantity | None,
) -> int:
    """Find the transfer functions of microphones and accelerometers over the vibrometer, or over --reference.

    Phases are those of exp(+j w t), response over reference: a delayed response has a falling phase.

    \b
    specan frf sample_data/recordings/noise/noise_24_microphones.tdms --at 250 --plot frf.png
    """
    from specan.analysis.transfer_function import TransferFunction
    from specan.api.recordings import read
    from specan.schema import parse

    settings = parse(
        TransferFunction,
        given(
            reference=reference,
            estimator=estimator,
            instrument=instrument,
            channels=channels,
            start_s=start_s,
            stop_s=stop_s,
            lines=lines,
            window=window,
            overlap=overlap,
            align=not no_align,
        ),
        "frf",
    )
    recording = read(file, quantity=quantity, **opening)
    accumulator = settings.accumulator(recording)
    feed(accumulator, recording)
    found = accumulator.result().between(fmin, float("inf") if fmax is None else fmax)
    deliver(
        plot, output, as_json,
        draw=lambda path: _draw(found, path, unwrap), write=lambda path: write_text(found, path),
        content=lambda: content(found), show=lambda: show(found, at_hz),
    )  # fmt: skip
    say_notes(found.notes, dict(zip(found.channels, found.flags)))
    return 0


def _draw(found: FrequencyResponse, path: Path, unwrap: bool) -> None:
    from specan.report.figure_style import save_figure
    from specan.report.figures_spectra import figure_frequency_response

    save_figure(figure_frequency_response(found, unwrapped=unwrap), path)


def content(found: FrequencyResponse) -> dict[str, Any]:
    """All there is, for JSON."""
    channels = [
        {
            "channel": name,
            "unit": found.units[row],
            "magnitude": found.magnitude[row],
            "phase_deg": found.phase_deg[row],
            "coherence": found.coherence[row],
            "u_magnitude_percent": found.u_magnitude_percent[row],
            "u_phase_deg": found.u_phase_deg[row],
            "u_leakage_percent": found.u_leakage_percent[row],
            "degrees_of_freedom": found.degrees_of_freedom[row],
            "u_common_percent": found.u_common_percent[row],
            "u_common_phase_deg": found.u_common_phase_deg[row],
            "delay_s": found.delay_s[row],
            "flags": found.flags[row],
        }
        for row, name in enumerate(found.channels)
    ]
    return {
        "file": found.label,
        "reference": found.reference,
        "reference_unit": found.reference_unit,
        "reference_rms": found.reference_rms,
        "estimator": found.estimator,
        "n_blocks": found.n_blocks,
        "n_effective": found.n_effective,
        "line_correlation": found.line_correlation,
        "frequency_hz": found.frequency_hz,
        "channels": channels,
        "notes": found.notes,
        "settings": found.settings,
    }


def show(found: FrequencyResponse, at_hz: tuple[float, ...]) -> None:
    """One row a channel, and one a channel and line that was asked for."""
    import numpy as np

    u_percent = np.hypot(found.u_magnitude_percent, found.u_common_percent)
    u_phase = np.hypot(found.u_phase_deg, found.u_common_phase_deg)
    spacing = found.frequency_hz[1] - found.frequency_hz[0] if len(found.frequency_hz) > 1 else 0.0
    title = (
        f"{found.label}: {found.estimator} over {found.reference} "
        f"({found.reference_rms:.4g} {found.reference_unit} RMS), {len(found.frequency_hz)} lines "
        f"{spacing:.4g} Hz apart, {found.n_blocks} blocks ({found.n_effective:.0f} independent)"
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


def write_text(found: FrequencyResponse, path: Path) -> None:
    """All lines, tab-separated, the channels one after the other."""
    from specan.io import results_text as text

    low = found.line_flags
    blocks = []
    for row, name in enumerate(found.channels):
        marked = [
            " ".join(
                [
                    *found.flags[row],
                    *(w for w, mask in low.items() if mask[row, k] and w not in found.flags[row]),
                ]
            )
            for k in range(len(found.frequency_hz))
        ]
        blocks.append(
            text.rows(
                [
                    [text.word(name)] * len(found.frequency_hz),
                    text.frequencies(found.frequency_hz),
                    text.significant(found.magnitude[row]),
                    text.phases(found.phase_deg[row]),
                    text.fixed(found.coherence[row], 4),
                    text.significant(found.u_magnitude_percent[row], 3),
                    text.significant(found.u_phase_deg[row], 3),
                    text.significant(found.u_leakage_percent[row], 3),
                    text.significant(found.u_common_percent[row], 3),
                    text.significant(found.u_common_phase_deg[row], 3),
                    marked,
                ]
            )
        )
    header = [
        f"specan {__version__} frf",
        f"transfer functions of {found.label}: {found.estimator} over {found.reference} ({found.reference_unit})",
        "magnitude in " + ", ".join(f"{u} ({n})" for n, u in zip(found.channels, found.units)),
        "phase in degrees: exp(+j w t), response over reference",
        "u: standard uncertainty of noise and leakage, u_leakage: its part of leakage; u_common: that of calibration "
        "and delay",
        f"settings: {found.settings}",
        *found.notes,
    ]
    columns = (
        "channel", "frequency_hz", "magnitude", "phase_deg", "coherence", "u_magnitude_percent", "u_phase_deg",
        "u_leakage_percent", "u_common_percent", "u_common_phase_deg", "flags",
    )  # fmt: skip
    text.write_table(path, header, columns, blocks)
