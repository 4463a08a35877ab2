"""``specan decay``: reverberation times and clarity."""

from __future__ import annotations

from typing import Any

from specan_cli.options import opt, section_options
from specan_cli.output import plot_option
from specan_cli.recording_verb import ResultDelivery, Source, given, recording_verb


@recording_verb("decay")
@opt(
    "--reference", None, "Channel of the excitation: the impulse responses to it are found first.  "
    "[default: the generator of noise and sweeps]", "CH",
)  # fmt: skip
@opt("--fraction", [1, 3], "1/N octave.  [default: 1]")
@opt("--fmin", float, "From this band.  [default: 125; 100 for thirds]", "HZ")
@opt("--fmax", float, "To this band.  [default: 4000; 5000 for thirds]", "HZ")
@section_options
@plot_option()
def command(source: Source, deliver: ResultDelivery, **options: Any) -> int:
    """Compute reverberation times, clarity, definition and centre time (ISO 3382-1).

    FILE holds impulse responses (a shot, a balloon, what `specan impulse` wrote), or noise or a sweep together
    with its excitation.

    \b
    specan decay sample_data/recordings/knock.tdms --fmax 2000
    """
    from specan.api.recordings import decay

    return deliver(decay(source.open(), **given(**options)))
