"""``specan frf``: transfer functions of one recording."""

from __future__ import annotations

from typing import Any

from specan_cli.options import opt, quantity_option, section_options
from specan_cli.output import plot_option
from specan_cli.recording_verb import UFF, ResultDelivery, Source, given, recording_verb


@recording_verb("frf", "all lines", *UFF)
@opt("--reference", None, "Reference channel.  [default: the vibrometer]", "CH")
@opt(
    "--estimator", ["H1", "H2", "Hv", "H3c"],
    "H1: noise in the responses; H2: in the reference; Hv: in both; H3c: the generator as "
    "instrument, for a noisy vibrometer.  [default: H1]",
)  # fmt: skip
@opt("--instrument", None, "Instrument of H3c.  [default: the generator]", "CH")
@section_options
@quantity_option
@opt(
    "--lines",
    int,
    "Lines up to fs/2.56.  [default: 3200, more for a long response, fewer in a short section]",
)
@opt("--window", None, "Window of the blocks.  [default: hann]")
@opt("--overlap", float, "Overlap of the blocks, 0 to 0.95.  [default: 0.5]")
@opt("--no-align", bool, "Do not compensate delayed responses.")
@opt("--fmin", float, "Lowest line shown.", "HZ", default=0.0)
@opt("--fmax", float, "Highest line shown.", "HZ", default=float("inf"), show_default=False)
@opt("--at at_hz", float, "Print this line; repeatable.", "HZ", multiple=True)
@plot_option()
@opt("--unwrap", bool, "Draw the phase without jumps.")
def command(
    source: Source, deliver: ResultDelivery, at_hz: tuple[float, ...], unwrap: bool, **options: Any
) -> int:
    """Compute the transfer functions of microphones and accelerometers over the vibrometer, or over --reference.

    Phases are those of exp(+j w t), response over reference: a delayed response has a falling phase.

    \b
    specan frf sample_data/recordings/noise/noise_24_microphones.tdms --at 250 --plot frf.png
    """
    from specan.api.recordings import frf
    from specan.errors import RequestError

    recording = source.open(options.pop("quantity"))
    low, high, align = options.pop("fmin"), options.pop("fmax"), not options.pop("no_align")
    found = frf(recording, align=align, **given(**options)).between(low, high)
    if outside := [f"{f:g}" for f in at_hz if not found.frequency_hz[0] <= f <= found.frequency_hz[-1]]:
        raise RequestError(
            f"--at {', '.join(outside)} Hz is outside the lines",
            expected=f"{found.frequency_hz[0]:g} to {found.frequency_hz[-1]:g} Hz",
        )
    return deliver(found, shown={"at_hz": at_hz}, unwrapped=unwrap)
