"""``specan fft``: magnitude and phase spectra of one recording, and spectrograms."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from specan_cli.options import limit_option, opt, quantity_option, section_options, weighting_option
from specan_cli.output import plot_option, show_sheets
from specan_cli.recording_verb import (
    UFF,
    ResultDelivery,
    Source,
    given,
    recording_verb,
    say_calibration,
    say_notes,
)

if TYPE_CHECKING:
    from specan.data.recording import Recording
    from specan.data.spectrum import Spectrum
    from specan.result import Sheet


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
@opt("--peaks", click.IntRange(min=1), "Highest lines printed.", default=1, show_default=True)
@opt("--spectrogram", bool, "Spectra against time.")
@opt("--columns", int, "Maximum number of columns of a spectrogram.  [default: 1000]")
@limit_option
@plot_option()
def command(
    source: Source,
    deliver: ResultDelivery,
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
    from specan.api import recordings as analyses
    from specan.errors import RequestError

    if spectrogram and deliver.output is not None and deliver.output.suffix.lower() in UFF:
        raise RequestError("a spectrogram cannot be a universal file", remedy="write .csv, .xlsx or .parquet")
    recording = source.open(options.pop("quantity"))
    single = options["whole"] or options["averaging"] == "none"
    if not spectrogram:
        if single and not (deliver.wants_whole or deliver.plot is not None or limit is not None):
            return _single(recording, options, peaks, deliver)
        return deliver(analyses.fft(recording, **given(**options)), shown={"peaks": peaks}, limit=limit)
    wanted = given(columns=columns, **options)
    if limit is not None:
        raise RequestError("a spectrogram has no limits", remedy="leave out --limit or --spectrogram")
    if not wanted["whole"]:
        del wanted["whole"]
    return deliver(analyses.spectrogram(recording, **wanted), shown={"peaks": peaks})


def _single(recording: Recording, options: dict[str, Any], peaks: int, deliver: ResultDelivery) -> int:
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
