"""Verbs for one recording or several: each reads, analyses, and delivers what it finds."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from specan.divisions import DIVISIONS
from specan.errors import RequestError
from specan_cli.options import (
    QUANTITIES,
    json_option,
    limit_option,
    opening_options,
    opt,
    quantity_option,
    section_options,
    velocity_option,
    weighting_option,
)
from specan_cli.output import note, show_sheets
from specan_cli.verb import (
    UFF,
    Delivery,
    decimal_option,
    given,
    plot_option,
    reader,
    recording_verb,
    samples_option,
    say_calibration,
    say_notes,
    verb,
)

if TYPE_CHECKING:
    from specan.data.orders import OrderSpectrum
    from specan.data.recording import Recording
    from specan.data.spectrum import Spectrum
    from specan.result import Sheet


def _found(name: str, recording: Recording, **options: Any) -> Any:
    """What the function of `specan` of that name finds."""
    from specan.api import recordings

    return getattr(recordings, name)(recording, **given(**options))


@recording_verb("octave", "all levels")
@opt("--fraction", [*DIVISIONS], "1/N octave, or critical bands.  [default: 3]")
@weighting_option("Weighting of the band levels; A, B and C for sound pressure only.  [default: Z]")
@opt(
    "--averaging", None, "Average over the section, or exponential.  [default: linear]",
    "linear|fast|slow|impulse|SECONDS",
)  # fmt: skip
@opt("--hold", ["max", "min"], "Highest or lowest value of an exponential average.")
@opt("--interval interval_s", float, "Interval of the level history.", "S")
@opt(
    "--percentile percentiles", float,
    "Also the level of an exponential average exceeded during N % of the time; repeatable.", "N", multiple=True,
)  # fmt: skip
@opt("--fmin", float, "Lowest band: the one that contains this frequency.  [default: 20]", "HZ")
@opt("--fmax", float, "Highest band: the one that contains this frequency.  [default: 20000]", "HZ")
@opt("--band", float, "One band: the one that contains HZ.", "HZ")
@section_options
@quantity_option
@opt("--background", Path, "Subtract the levels of this recording of the background.", "FILE")
@velocity_option
@opt(
    "--settling", ["counted", "left-out"],
    "Treatment of the cut at the section's ends, for linear averages and maxima.  [default: counted]",
)  # fmt: skip
@limit_option
@plot_option()
@opt("--history", bool, "Draw the first channel against time.")
def octave(
    recording: Recording,
    deliver: Delivery,
    background: Recording | None,
    limit: Path | None,
    history: bool,
    **options: Any,
) -> int:
    """Compute levels in octave and fractional-octave bands (IEC 61260-1 class 1), and overall levels.

    \b
    specan octave sample_data/recordings/knock.tdms --fraction 3 --weighting A --channel "Mic *"
    specan octave sample_data/recordings/knock.tdms --averaging fast --plot history.png --history
    """
    from specan.analysis.background import without_background

    if history and (deliver.plot is None or options["averaging"] in (None, "linear")):
        raise RequestError(
            "--history draws a time-weighted level", remedy="add --plot and --averaging fast, slow or seconds"
        )
    found = _found("octave", recording, **options)
    if background is not None:
        whole = {**options, "start_s": 0.0, "stop_s": None}
        found = without_background(found, _found("octave", background, **whole))
    return deliver(found, limit=limit, view="history" if history else "")


@recording_verb("fft", "all lines", *UFF)
@section_options
@quantity_option
@opt(
    "--scaling", ["amplitude", "rms", "psd"],
    "Peak amplitude or RMS of a line (tones), or power spectral density (noise).  [default: amplitude]",
)  # fmt: skip
@opt("--lines", int, "Lines up to fs/2.56.  [default: 3200, fewer in a short section or spectrogram]")
@opt("--whole", bool, "The whole section is one block.")
@opt(
    "--window",
    None,
    "rectangular, hann, hamming, blackman, blackman-harris, nuttall, flat-top.  [default: hann]",
)
@opt("--overlap", float, "Overlap of the blocks, 0 to 0.95.  [default: 0.5]")
@opt(
    "--averaging", ["linear", "exponential", "max", "min", "none"],
    "Average or hold over the blocks; none: the first block alone.  [default: linear]",
)  # fmt: skip
@opt("--blocks n_exponential", int, "Blocks of an exponential average.  [default: 10]")
@opt("--reference", None, "Reference channel of the phase; averaged spectra have no absolute phase.", "CH")
@weighting_option("Weighting of the magnitudes of sound pressure; phases are not changed.  [default: Z]")
@opt("--fmin", float, "Lowest line.", "HZ")
@opt("--fmax", float, "Highest line.", "HZ")
@opt("--peaks", click.IntRange(min=1), "Highest lines printed.", "N", default=1, show_default=True)
@opt("--spectrogram", bool, "Spectra against time.")
@opt("--columns", int, "Maximum number of columns of a spectrogram.  [default: 1000]")
@limit_option
@plot_option()
def fft(
    recording: Recording,
    deliver: Delivery,
    peaks: int,
    spectrogram: bool,
    columns: int | None,
    limit: Path | None,
    **options: Any,
) -> int:
    """Compute magnitude and phase spectra.

    Phases are those of exp(+j w t). A single block (--whole, --averaging none) has the phases of
    cosines that begin at its first sample; an average has phases only relative to a --reference.

    \b
    specan fft sample_data/recordings/noise/noise_24_microphones.tdms --channel "Mic 1" --lines 800
    specan fft sample_data/recordings/knock.tdms --spectrogram --lines 100 --plot knock.png
    """
    if spectrogram and deliver.output is not None and deliver.output.suffix.lower() in UFF:
        raise RequestError("a spectrogram cannot be a universal file", remedy="write .csv, .xlsx or .parquet")
    single = options["whole"] or options["averaging"] == "none"
    if not spectrogram:
        if single and not (deliver.wants_whole or deliver.plot is not None or limit is not None):
            return _single(recording, options, peaks, deliver)
        return deliver(_found("fft", recording, **options), shown={"peaks": peaks}, limit=limit)
    if limit is not None:
        raise RequestError("a spectrogram has no limits", remedy="leave out --limit or --spectrogram")
    if not options["whole"]:
        del options["whole"]
    return deliver(_found("spectrogram", recording, columns=columns, **options), shown={"peaks": peaks})


def _single(recording: Recording, options: dict[str, Any], peaks: int, deliver: Delivery) -> int:
    """A single block, which may be the whole recording: shown and written channel by channel."""
    from specan.analysis.spectrum import FourierSpectrum, chosen, single_blocks
    from specan.data.calibration import stated
    from specan.io.export_file import write_result
    from specan.schema import parse

    settings = parse(FourierSpectrum, given(**options), "fft")
    channels, output = chosen(recording, settings)[2], deliver.output
    sheets: list[Sheet] = []
    about: list[Spectrum] = []

    def tables() -> Iterator[dict[str, Any]]:
        for part in single_blocks(recording, settings):
            sheets.extend(part.sheets(peaks))
            # What is said about the spectrum in the end: not its lines, nor a view that would keep them.
            short: dict[str, Any] = {
                "density": part.density[:, :1].copy(),
                "frequency_hz": part.frequency_hz[:1].copy(),
                "phase_deg": None,
            }
            about.append(stated(replace(part, has_mirror=part.has_mirror[:1].copy(), **short), recording))
            yield from part.tables() if output is not None else ()
            del part

    if output is None:
        list(tables())
    else:
        blocks = tables()
        first = next(blocks)
        labels, units = tuple(c.label for c in channels), tuple(c.target_unit for c in channels)
        found = replace(about[0], channels=labels, units=units)
        write_result(found, output, chain([first], blocks), deliver.decimal)

    def show() -> None:
        show_sheets([sheets[0]._replace(rows=[row for sheet in sheets for row in sheet.rows])])
        say_calibration(about[0])

    deliver.put_out({}, show)
    say_notes(about[0].notes, {part.channels[0]: part.flags[0] for part in about})
    return 0


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
def frf(
    recording: Recording, deliver: Delivery, at_hz: tuple[float, ...], unwrap: bool, **options: Any
) -> int:
    """Compute the transfer functions of microphones and accelerometers over the vibrometer, or over --reference.

    Phases are those of exp(+j w t), response over reference: a delayed response has a falling phase.

    \b
    specan frf sample_data/recordings/noise/noise_24_microphones.tdms --at 250 --plot frf.png
    """
    low, high, align = options.pop("fmin"), options.pop("fmax"), not options.pop("no_align")
    found = _found("frf", recording, align=align, **options).between(low, high)
    if outside := [f"{f:g}" for f in at_hz if not found.frequency_hz[0] <= f <= found.frequency_hz[-1]]:
        raise RequestError(
            f"--at {', '.join(outside)} Hz is outside the lines",
            expected=f"{found.frequency_hz[0]:g} to {found.frequency_hz[-1]:g} Hz",
        )
    return deliver(found, shown={"at_hz": at_hz}, unwrapped=unwrap)


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
@opt("--quantity convert", QUANTITIES, "Convert vibration to this.")
@opt("--envelope", None, "Analyse the envelope of this band, Hz.", "LOW:HIGH")
@opt("--kurtosis", bool, "Also print the kurtosis in octave bands.")
@opt("--peaks", click.IntRange(min=1), "Highest lines printed.", "N", default=3, show_default=True)
@opt("--map as_map", bool, "Orders against speed: in --plot, -o and --json.")
@plot_option()
def orders(
    recording: Recording,
    deliver: Delivery,
    envelope: str | None,
    convert: str | None,
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
    from specan.data.orders import OrderMap

    found = _found("orders", recording, envelope_hz=_band(envelope), quantity=convert, **options)
    more = {"kurtosis": _kurtosis(recording, found)} if kurtosis else {}
    shown = OrderMap(**vars(found)) if as_map else found
    code = deliver(shown, shown={"peaks": peaks, **more}, more=more, view="map" if as_map else "")
    if found.lines is not None and deliver.output is not None and not (deliver.wants_whole or as_map):
        note("The table holds only the requested lines; omit them for the whole spectrum.")
    return code


def _band(text: str | None) -> tuple[float, float] | None:
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
def rms(recording: Recording, deliver: Delivery, **options: Any) -> int:
    """Compute RMS, level, peak, crest factor, and equivalent and percentile levels of every channel.

    All but the mean are values of the signal without its mean.

    \b
    specan rms sample_data/recordings/knock.tdms --averaging slow
    """
    return deliver(_found("rms", recording, **options))


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
def srs(recording: Recording, deliver: Delivery, **options: Any) -> int:
    """Compute shock response spectra of accelerations: largest responses, maximax, positive and negative (ISO 18431-4).

    \b
    specan simulate planetary-gear sample_data/planetary_gear/rig.toml -o run.tdms --duration 3
    specan srs run.tdms --channel "Acc*" --q 10 --plot srs.png -o srs.csv
    """
    return deliver(_found("srs", recording, **options))


@recording_verb("tones")
@opt("--reference", None, "Channel over which phases are given.  [default: the vibrometer]", "CH")
@opt(
    "--frequency frequency_hz",
    float,
    "Approximate frequency of the tone.  [default: that of the file, else searched]",
    "HZ",
)
@opt("--harmonics", click.IntRange(min=1), "Harmonics that are fitted.  [default: 10]", "N")
@section_options
@plot_option("the harmonics")
def tones(recording: Recording, deliver: Delivery, **options: Any) -> int:
    """Compute frequency, amplitude, phase and distortion of a sine recording (IEEE Std 1057).

    \b
    specan tones sample_data/recordings/sine/sine_0125.3Hz.tdms --channel "Mic 1"
    """
    return deliver(_found("tones", recording, **options))


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
def decay(recording: Recording, deliver: Delivery, **options: Any) -> int:
    """Compute reverberation times, clarity, definition and centre time (ISO 3382-1).

    FILE holds impulse responses (a shot, a balloon, what `specan impulse` wrote), or noise or a sweep together
    with its excitation.

    \b
    specan decay sample_data/recordings/knock.tdms --fmax 2000
    """
    return deliver(_found("decay", recording, **options))


@verb("impulse")
@click.argument("file", type=click.Path(path_type=Path))
@opt("--reference", None, "Channel of the excitation.  [default: the generator, else the vibrometer]", "CH")
@opt(
    "--method", ["deconvolution", "H1"],
    "Deconvolution of sweeps, maximum length sequences and impulses, or H1 of noise.  [default: as the "
    "excitation is recognised]",
)  # fmt: skip
@opt("--length length_s", float, "Length of the responses.", "S")
@section_options
@samples_option("_impulse.wav")
@decimal_option("CSV")
@plot_option("the responses")
@json_option
@opening_options
def impulse(file: Path, deliver: Delivery, **options: Any) -> int:
    """Compute impulse responses of microphones and accelerometers to the excitation, and write them.

    Maximum length sequences, sweeps and impulses are deconvolved; for noise, the averaged transfer function is
    transformed back.

    \b
    specan impulse sample_data/recordings/noise/noise_24_microphones.tdms --channel "Mic 1" -o mic_1.csv
    """
    from specan.io.export_file import Excerpt, write_excerpt

    found = _found("impulse", reader(options)(file), **options)
    responses = found.recording()
    excerpt = Excerpt(responses, responses.channels, 0, found.samples.shape[1])
    assert deliver.output is not None  # it has a default
    write_excerpt(excerpt, deliver.output, deliver.decimal)
    deliver.draw(found)

    def show() -> None:
        click.echo(f"{found.summary()}.")
        say_calibration(found)

    deliver.put_out({"output": str(deliver.output), **found.to_dict()}, show)
    say_notes(found.notes, {})
    return 0


@verb("export")
@click.argument("file", type=click.Path(path_type=Path))
@samples_option(".csv")
@decimal_option("CSV")
@section_options
@opening_options
@plot_option("what was written")
@json_option
def export(file: Path, deliver: Delivery, **options: Any) -> int:
    """Write the samples of a recording, in SI units, for other programs.

    Sensitivities of a calibration are applied. Phase and delay corrections apply to transfer functions only; the verb
    frf writes those.

    \b
    specan export sample_data/recordings/knock.tdms --channel "Mic 1" --decimal , -o knock.csv
    """
    from specan.analysis.section import aligned, of_one_rate
    from specan.analysis.section import section as samples_of
    from specan.io.export_file import Excerpt, together, write_excerpt
    from specan.result import counted

    whole, section = reader(options)(file), options
    recording, starts = aligned(whole, of_one_rate(whole, section["channels"])[0])
    chosen, notes = of_one_rate(recording, section["channels"])
    excerpt = Excerpt(
        recording, chosen, *samples_of(recording, chosen, section["start_s"], section["stop_s"])
    )
    assert deliver.output is not None  # it has a default
    write_excerpt(excerpt, deliver.output, deliver.decimal)
    deliver.draw(recording, **{**section, "channels": chosen})
    late = [
        f"{c.label} has a phase or delay correction, which is not applied to samples in time"
        for c in chosen
        if c.phase is not None or c.delay_s
    ]
    say_notes((*starts, *notes, *late[:1]), {"the file": whole.flags})
    about = {
        "output": str(deliver.output),
        "samples": excerpt.n,
        "sampling_rate_hz": excerpt.rate,
        "channels": [{"name": c.label, "unit": c.unit} for c in chosen],
    }
    said = f"{counted(len(chosen), 'channel')}, {excerpt.n} samples at {excerpt.rate:g} Hz, in {together(chosen)}"
    calibration = whole.calibration_of([c.label for c in chosen])
    deliver.put_out(about, lambda: click.echo(f"{said}.\nCalibration: {calibration}."))
    return 0
