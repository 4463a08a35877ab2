"""``specan srs``: shock response spectra of one recording."""

from __future__ import annotations

from typing import Any

from specan_cli.options import opt, section_options
from specan_cli.output import plot_option
from specan_cli.recording_verb import ResultDelivery, Source, given, recording_verb


@recording_verb("srs", "all lines")
@opt("--q quality", float, "Q of the oscillators: 10 is a damping ratio of 5 %.  [default: 10]")
@opt(
    "--response", ["acceleration", "pseudo-velocity", "displacement"],
    "Absolute acceleration; or relative displacement, as it is or times the natural angular frequency.  "
    "[default: acceleration]",
)  # fmt: skip
@opt("--fmin", float, "Lowest natural frequency.  [default: 10]", "HZ")
@opt("--fmax", float, "Highest natural frequency.  [default: a tenth of the sampling rate]", "HZ")
@opt("--per-octave", int, "Natural frequencies in an octave.  [default: 12]")
@opt("--detrend", bool, "Subtract the mean of the section.")
@section_options
@plot_option()
def command(source: Source, deliver: ResultDelivery, **options: Any) -> int:
    """Compute shock response spectra of accelerations: largest responses, maximax, positive and negative (ISO 18431-4).

    \b
    specan simulate planetary-gear sample_data/planetary_gear/rig.toml -o run.tdms --duration 3
    specan srs run.tdms --channel "Acc*" --q 10 --plot srs.png -o srs.csv
    """
    from specan.api.recordings import srs

    return deliver(srs(source.open(), **given(**options)))
