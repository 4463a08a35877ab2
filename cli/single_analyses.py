"""Verbs whose options are the settings of one analysis: ``rms``, ``srs``, ``tones`` and ``decay``."""

from __future__ import annotations

from typing import Any

import click

from specan_cli.options import opt, section_options, velocity_option, weighting_option
from specan_cli.output import plot_option
from specan_cli.recording_verb import ResultDelivery, Source, given, recording_verb


def _analyse(name: str, source: Source, deliver: ResultDelivery, **options: Any) -> int:
    """Deliver what the function of `specan` of that name finds."""
    from specan.api import recordings

    return deliver(getattr(recordings, name)(source.open(), **given(**options)))


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
def rms(source: Source, deliver: ResultDelivery, **options: Any) -> int:
    """Compute RMS, level, peak, crest factor, and equivalent and percentile levels of every channel.

    The mean is subtracted for all other values.

    \b
    specan rms sample_data/recordings/knock.tdms --averaging slow
    """
    return _analyse("rms", source, deliver, **options)


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
def srs(source: Source, deliver: ResultDelivery, **options: Any) -> int:
    """Compute shock response spectra of accelerations: largest responses, maximax, positive and negative (ISO 18431-4).

    \b
    specan simulate planetary-gear sample_data/planetary_gear/rig.toml -o run.tdms --duration 3
    specan srs run.tdms --channel "Acc*" --q 10 --plot srs.png -o srs.csv
    """
    return _analyse("srs", source, deliver, **options)


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
def tones(source: Source, deliver: ResultDelivery, **options: Any) -> int:
    """Compute frequency, amplitude, phase and distortion of a sine recording (IEEE Std 1057).

    \b
    specan tones sample_data/recordings/sine/sine_0125.3Hz.tdms --channel "Mic 1"
    """
    return _analyse("tones", source, deliver, **options)


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
def decay(source: Source, deliver: ResultDelivery, **options: Any) -> int:
    """Compute reverberation times, clarity, definition and centre time (ISO 3382-1).

    FILE holds impulse responses (a shot, a balloon, what `specan impulse` wrote), or noise or a sweep together
    with its excitation.

    \b
    specan decay sample_data/recordings/knock.tdms --fmax 2000
    """
    return _analyse("decay", source, deliver, **options)
