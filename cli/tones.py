"""``specan tones``: amplitude, phase and distortion of a sine recording."""

from __future__ import annotations

from typing import Any

import click

from specan_cli.options import opt, section_options
from specan_cli.recording_verb import ResultDelivery, Source, given, recording_verb


@recording_verb("tones")
@opt("--reference", None, "Channel over which phases are given.  [default: the vibrometer]", "CH")
@opt(
    "--frequency frequency_hz",
    float,
    "Approximate frequency of the tone.  [default: that of the file, else searched]",
    "HZ",
)
@opt("--harmonics", click.IntRange(min=1), "Harmonics that are fitted.  [default: 10]")
@section_options
def command(source: Source, deliver: ResultDelivery, **options: Any) -> int:
    """Compute frequency, amplitude, phase and distortion of a sine recording (IEEE Std 1057).

    \b
    specan tones sample_data/recordings/sine/sine_0125.3Hz.tdms --channel "Mic 1"
    """
    from specan.api.recordings import tones

    return deliver(tones(source.open(), **given(**options)))
