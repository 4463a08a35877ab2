"""``specan orders``: spectra, lines and averages per turn of a shaft."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from specan_cli.output import plot_option, say, table
from specan_cli.recording_verb import Delivery, Source, given, recording_verb, section_options

if TYPE_CHECKING:
    from specan.data.orders import OrderSpectrum
    from specan.data.recording import Recording


@recording_verb("orders", "all lines")
@section_options
@click.option("--tacho", metavar="CH", help="The tacho.  [default: the recording's only one]")
@click.option(
    "--pulses", "pulses_per_turn", type=float, metavar="N",
    help="Pulses per revolution of the tacho's shaft.  [default: property PulsesPerRevolution]",
)  # fmt: skip
@click.option(
    "--ratio", type=float, metavar="R",
    help="Turns of the tacho's shaft per turn of the shaft whose orders are wanted.  [default: 1]",
)  # fmt: skip
@click.option(
    "--speed", "speed_hz", type=float, metavar="HZ", help="Known constant speed, instead of a tacho."
)
@click.option(
    "--max-order", type=float, metavar="O", help="Highest order.  [default: set by the sampling rate]"
)
@click.option("--turns", type=int, metavar="N", help="Turns of a block: lines lie 1/N apart.  [default: 8]")
@click.option(
    "--average-turns", type=int, metavar="N", help="Turns of the synchronous average.  [default: 1]"
)
@click.option("--order", "orders", type=float, multiple=True, help="Amplitude of this order; repeatable.")
@click.option(
    "--mesh", type=float, metavar="O", help="Order of tooth meshing; its harmonics are added to the orders."
)
@click.option("--harmonics", type=int, help="Harmonics of the mesh.  [default: 3]")
@click.option("--sidebands", type=int, help="Sidebands on each side of each harmonic.  [default: 0]")
@click.option(
    "--quantity",
    type=click.Choice(["displacement", "velocity", "acceleration"]),
    help="Convert vibration to this.",
)
@click.option("--envelope", metavar="LOW:HIGH", help="Analyse the envelope of this band, Hz.")
@click.option("--kurtosis", is_flag=True, help="Also print the kurtosis in octave bands.")
@click.option(
    "--peaks", type=click.IntRange(min=1), default=3, show_default=True, help="Highest lines printed."
)
@click.option("--map", "as_map", is_flag=True, help="Orders against speed: in --plot, -o and --json.")
@plot_option()
def command(
    source: Source,
    deliver: Delivery,
    envelope: str | None,
    kurtosis: bool,
    peaks: int,
    as_map: bool,
    **options: Any,
) -> int:
    """Find order spectra, complex amplitudes of given orders, and synchronous averages.

    Angles are those of a tacho, whose missing and double pulses are repaired and whose jitter is smoothed, or of a
    known constant speed.

    \b
    specan orders run.tdms --tacho "Tacho carrier" --mesh 66 --sidebands 3
    specan orders run.tdms --tacho "Tacho sun" --ratio 3.75 --max-order 200 --map --plot map.png
    """
    from specan.api.recordings import orders
    from specan.data.orders import OrderMap

    recording = source.open()
    found = orders(recording, **given(envelope_hz=_band(envelope), **options))
    impulsive = _kurtosis(recording, found) if kurtosis else {}

    def content() -> dict[str, Any]:
        return {**found.to_json(with_map=as_map), **({"kurtosis": impulsive} if impulsive else {})}

    code = deliver(
        OrderMap(**vars(found)) if as_map else found, lambda: show(found, peaks, impulsive),
        content=content, view="map" if as_map else "",
    )  # fmt: skip
    if found.lines is not None and deliver.writes_table and not as_map:
        say("The table holds only the requested lines; omit them for the whole spectrum.")
    return code


def _band(text: str | None) -> tuple[float, float] | None:
    from specan.errors import RequestError

    if text is None:
        return None
    try:
        low, high = (float(part) for part in text.split(":"))
    except ValueError:
        raise RequestError(f"--envelope {text!r} cannot be read", expected="LOW:HIGH in Hz") from None
    return low, high


def _kurtosis(recording: Recording, found: OrderSpectrum) -> dict[str, Any]:
    """Kurtosis of every channel in octaves, over the same section."""
    from specan.analysis.section import section
    from specan.dsp.envelope import band_kurtosis, octaves_below

    channels = [recording.channel(name) for name in found.channels]
    start, stop = section(recording, channels, found.settings["start_s"], found.settings["stop_s"])
    bands = octaves_below(channels[0].sampling_rate)
    rows = [
        band_kurtosis(recording.read([c], start, stop)[0], c.sampling_rate, bands).tolist() for c in channels
    ]
    return {"bands_hz": bands, "channels": dict(zip(found.channels, rows))}


def show(found: OrderSpectrum, peaks: int, impulsive: dict[str, Any]) -> None:
    """RMS, synchronous part and highest lines of every channel; the lines that were asked for."""
    from specan_cli.fft import highest

    tacho = found.tacho
    low, mean, high = tacho.speed_hz
    source = (
        "stated"
        if tacho.channel is None
        else f"{tacho.channel}, {tacho.pulses} pulses, {tacho.missing} missing, {tacho.double} double, "
        f"jitter {1e6 * tacho.jitter_s:.3g} us"
    )
    click.echo(f"{found.label}: {found.turns} turns, speed {mean:.6g} Hz ({low:.6g} to {high:.6g}; {source})")
    rows = []
    for row, (name, unit) in enumerate(zip(found.channels, found.units)):
        for rank, k in enumerate(highest(found.amplitude[row, 1:], peaks)):
            first = rank == 0
            rows.append(
                [
                    name if first else "",
                    f"{found.rms[row]:.5g} {unit}" if first else "",
                    f"{found.synchronous_rms[row]:.5g}" if first else "",
                    f"{found.order[k + 1]:.6g}",
                    f"{found.amplitude[row, k + 1]:.5g} {unit}",
                    f"{found.level_dB[row, k + 1]:.2f}",
                ]
            )
    table("", ["channel", "RMS", "synchronous", "order", "amplitude", "dB"], rows)
    if found.lines is not None:
        _show_lines(found)
    if impulsive:
        header = ["kurtosis", *(f"{low:.0f}-{high:.0f} Hz" for low, high in impulsive["bands_hz"])]
        table("", header, [[name, *(f"{k:.2f}" for k in ks)] for name, ks in impulsive["channels"].items()])


def _show_lines(found: OrderSpectrum) -> None:
    lines = found.lines
    assert lines is not None
    rows = []
    for row, (name, unit) in enumerate(zip(found.channels, found.units)):
        for k, order in enumerate(lines.order):
            rows.append(
                [
                    name if k == 0 else "",
                    f"{order:.6g}",
                    f"{abs(lines.amplitude[row, k]):.5g} {unit}",
                    f"{lines.u[row, k]:.2g}",
                    f"{lines.u_scatter[row, k]:.2g}"
                    if lines.u_scatter[row, k] == lines.u_scatter[row, k]
                    else "",
                    f"{lines.phase_deg[row, k]:.2f}",
                ]
            )
    table(
        f"Lines over {lines.turns} turns; u: one component, from the noise about the line, from blocks",
        ["channel", "order", "amplitude", "u", "u blocks", "phase deg"],
        rows,
    )
