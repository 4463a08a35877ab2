"""``specan orders``: spectra, lines and averages per turn of a shaft."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from specan_cli.options import QUANTITIES, opt, section_options
from specan_cli.output import note, plot_option
from specan_cli.recording_verb import ResultDelivery, Source, given, recording_verb

if TYPE_CHECKING:
    from specan.data.orders import OrderSpectrum
    from specan.data.recording import Recording


@recording_verb("orders", "all lines")
@section_options
@opt("--tacho", None, "The tacho.  [default: the recording's only one]", "CH")
@opt(
    "--pulses pulses_per_turn", float,
    "Pulses per revolution of the tacho's shaft.  [default: property PulsesPerRevolution]", "N",
)  # fmt: skip
@opt(
    "--ratio", float, "Turns of the tacho's shaft per turn of the shaft whose orders are wanted.  [default: 1]", "R"
)  # fmt: skip
@opt("--speed speed_hz", float, "Known constant speed, instead of a tacho.", "HZ")
@opt("--max-order", float, "Highest order.  [default: set by the sampling rate]", "O")
@opt("--turns", int, "Turns of a block: lines lie 1/N apart.  [default: 8]", "N")
@opt("--average-turns", int, "Turns of the synchronous average.  [default: 1]", "N")
@opt("--order orders", float, "Amplitude of this order; repeatable.", multiple=True)
@opt("--mesh", float, "Order of tooth meshing; its harmonics are added to the orders.", "O")
@opt("--harmonics", int, "Harmonics of the mesh.  [default: 3]")
@opt("--sidebands", int, "Sidebands on each side of each harmonic.  [default: 0]")
@opt("--quantity", QUANTITIES, "Convert vibration to this.")
@opt("--envelope", None, "Analyse the envelope of this band, Hz.", "LOW:HIGH")
@opt("--kurtosis", bool, "Also print the kurtosis in octave bands.")
@opt("--peaks", click.IntRange(min=1), "Highest lines printed.", default=3, show_default=True)
@opt("--map as_map", bool, "Orders against speed: in --plot, -o and --json.")
@plot_option()
def command(
    source: Source,
    deliver: ResultDelivery,
    envelope: str | None,
    kurtosis: bool,
    peaks: int,
    as_map: bool,
    **options: Any,
) -> int:
    """Compute order spectra, complex amplitudes of given orders, and synchronous averages.

    Angles are those of a tacho, whose missing and double pulses are repaired and whose jitter is smoothed, or of a
    known constant speed.

    \b
    specan simulate planetary-gear sample_data/planetary_gear/rig.toml -o run.tdms --duration 3
    specan orders run.tdms --tacho "Tacho carrier" --mesh 66 --sidebands 3
    specan orders run.tdms --tacho "Tacho sun" --ratio 3.75 --max-order 200 --map --plot map.png
    """
    from specan.api.recordings import orders
    from specan.data.orders import OrderMap

    recording = source.open()
    found = orders(recording, **given(envelope_hz=_band(envelope), **options))
    more = {"kurtosis": _kurtosis(recording, found)} if kurtosis else {}
    shown = OrderMap(**vars(found)) if as_map else found
    code = deliver(shown, shown={"peaks": peaks, **more}, more=more, view="map" if as_map else "")
    if found.lines is not None and deliver.output is not None and not (deliver.wants_whole or as_map):
        note("The table holds only the requested lines; omit them for the whole spectrum.")
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
