"""``specan rms``: single-number values of every channel."""

from __future__ import annotations

from typing import Any

from specan_cli.options import opt, section_options, velocity_option, weighting_option
from specan_cli.output import plot_option
from specan_cli.recording_verb import ResultDelivery, Source, given, recording_verb


@recording_verb("rms")
@weighting_option("Weighting of the time-weighted levels of sound pressure.  [default: A]")
@opt("--averaging", ["fast", "slow"], "Time weighting of these levels.  [default: fast]")
@opt(
    "--percentile percentiles", float,
    "Level exceeded during N % of the time; repeatable.  [default: 5, 10, 50, 90, 95]", "N", multiple=True,
)  # fmt: skip
@section_options
@velocity_option
@plot_option()
def command(source: Source, deliver: ResultDelivery, **options: Any) -> int:
    """Compute RMS, level, peak, crest factor, and equivalent and percentile levels of every channel.

    The mean is subtracted for all other values.

    \b
    specan rms sample_data/recordings/knock.tdms --averaging slow
    """
    from specan.api.recordings import rms

    return deliver(rms(source.open(), **given(**options)))
