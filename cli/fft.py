"""``specan fft``: magnitude and phase spectra of one recording, and spectrograms."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from specan_cli.options import limit_option, weighting_option
from specan_cli.output import plot_option, say_written, table, to_standard_output
from specan_cli.recording_verb import (
    Delivery,
    Source,
    given,
    quantity_option,
    recording_verb,
    say_calibration,
    say_notes,
    section_options,
)

if TYPE_CHECKING:
    from specan.data.limits import Kept
    from specan.data.recording import Recording
    from specan.data.spectrum import Spectrogram, Spectrum
    from specan.units import Quantity


@recording_verb("fft", "all lines")
@section_options
@quantity_option
@click.option(
    "--scaling",
    type=click.Choice(["amplitude", "rms", "psd"]),
    help="Peak amplitude or RMS of a line (tones), or power spectral density (noise).  [default: amplitude]",
)
@click.option("--lines", type=int, help="Lines up to fs/2.56.  [default: 3200, fewer in a short section]")
@click.option("--whole", is_flag=True, help="The whole section is one block.")
@click.option(
    "--window",
    help="rectangular, hann, hamming, blackman, blackman-harris, nuttall, flat-top.  [default: hann]",
)
@click.option("--overlap", type=float, help="Overlap of the blocks, 0 to 0.95.  [default: 0.5]")
@click.option(
    "--averaging",
    type=click.Choice(["linear", "exponential", "max", "min", "none"]),
    help="Average or hold over the blocks; none: the first block alone.  [default: linear]",
)
@click.option("--blocks", "n_exponential", type=int, help="Blocks of an exponential average.  [default: 10]")
@click.option(
    "--reference",
    metavar="CH",
    help="Reference channel of the phase; averaged spectra have no absolute phase.",
)
@weighting_option("Weighting of the magnitudes of sound pressure; phases are not changed.  [default: Z]")
@click.option("--fmin", "fmin_hz", type=float, metavar="HZ", help="Lowest line.")
@click.option("--fmax", "fmax_hz", type=float, metavar="HZ", help="Highest line.")
@click.option(
    "--peaks", type=click.IntRange(min=1), default=1, show_default=True, help="Highest lines printed."
)
@click.option("--spectrogram", is_flag=True, help="Spectra against time.")
@click.option("--columns", type=int, help="Maximum number of columns of a spectrogram.  [default: 1000]")
@limit_option()
@plot_option()
def command(
    source: Source,
    deliver: Delivery,
    peaks: int,
    spectrogram: bool,
    columns: int | None,
    limit: Path | None,
    quantity: Quantity | None,
    **options: Any,
) -> int:
    """Find magnitude and phase spectra.

    Phases are those of exp(+j w t). A single block (--whole, --averaging none) has phases of its own, of cosines
    with time zero at its first sample; an average has phases only over a --reference.

    \b
    specan fft sample_data/recordings/noise/noise_24_microphones.tdms --channel "Mic 1" --lines 800
    specan fft sample_data/recordings/knock.tdms --spectrogram --lines 100 --plot knock.png
    """
    from specan.api.recordings import fft
    from specan.errors import RequestError

    recording = source.open(quantity)
    single = options["whole"] or options["averaging"] == "none"
    if limit is not None and spectrogram:
        raise RequestError("a spectrogram has no limits", remedy="leave out --limit or --spectrogram")
    if single and not (spectrogram or deliver.wants_json or deliver.plot is not None or limit is not None):
        return _single(recording, options, peaks, deliver.output)
    found = _spectrogram(recording, columns, options) if spectrogram else fft(recording, **given(**options))
    kept = [] if limit is None else _held(found, limit)
    flags = getattr(found, "flags", ())
    return deliver(found, lambda: show(found, peaks), flags=flags, limit=limit, kept=kept)


def _held(found: Spectrum | Spectrogram, limit: Path) -> list[Kept]:
    from specan.io.limit_file import read_limits

    curve = read_limits(limit)
    return [
        curve.of_lines(name, found.frequency_hz, found.level_dB[row])
        for row, name in enumerate(found.channels)
    ]


def _single(recording: Recording, options: dict[str, Any], peaks: int, output: Path | None) -> int:
    """A single block, which may be the whole recording: shown and written channel by channel."""
    from specan.analysis.spectrum import FourierSpectrum, chosen, phase_of_lines, single_blocks, with_phase
    from specan.data.calibration import stated
    from specan.io.results_text import write_result
    from specan.schema import parse

    settings = parse(FourierSpectrum, given(**options), "fft")
    _, _, channels, _ = chosen(recording, settings)
    parts = single_blocks(recording, settings)
    sheet: list[list[str]] = []
    about: list[Spectrum] = []  # without their lines

    def tables(wanted: bool) -> Iterator[dict[str, Any]]:
        for part, lines in parts:

            def phase(_: Any, k: int, lines: Any = lines) -> float:
                return float(phase_of_lines(lines[k : k + 1])[0])

            sheet.extend(_rows(part, peaks, phase))
            # What is said about the spectrum in the end; not its lines, nor a view that would keep them.
            short: dict[str, Any] = {
                "density": part.density[:, :1].copy(),
                "frequency_hz": part.frequency_hz[:1].copy(),
            }
            about.append(stated(replace(part, has_mirror=part.has_mirror[:1].copy(), **short), recording))
            yield from with_phase(part, lines).tables() if wanted else ()
            del part, lines, phase

    if output is None:
        list(tables(False))
    else:
        blocks = tables(True)
        first = next(blocks)
        labels, units = tuple(c.label for c in channels), tuple(c.target_unit for c in channels)
        whole = replace(about[0], channels=labels, units=units)
        write_result(whole, output, chain([first], blocks))
    if not to_standard_output(output):
        table(_title(about[0]), _sheet_header(about[0]), sheet)
        say_calibration(about[0])
        say_written(output)
    flags = {name: words for part in about for name, words in zip(part.channels, part.flags)}
    say_notes(about[0].notes, flags)
    return 0


def _spectrogram(recording: Recording, columns: int | None, options: dict[str, Any]) -> Spectrogram:
    from specan.api.recordings import spectrogram
    from specan.errors import RequestError

    wanted = given(columns=columns, **options)
    for name in ("averaging", "n_exponential", "reference"):
        if name in wanted:
            raise RequestError(f"a spectrogram has no {name}", remedy="leave that option out")
    if wanted.pop("whole"):
        raise RequestError("a spectrogram of one block has one column", remedy="leave out --whole")
    return spectrogram(recording, **wanted)


def show(found: Spectrum | Spectrogram, peaks: int) -> None:
    """RMS and highest lines of every channel."""
    phase = getattr(found, "phase_deg", None)
    rows = _rows(found, peaks, None if phase is None else lambda row, k: float(phase[row, k]))
    table(_title(found), _sheet_header(found), rows)


def _title(found: Spectrum | Spectrogram) -> str:
    from specan.data.spectrum import Spectrogram
    from specan.result import counted

    scale = found.scale
    title = f"{found.label}: {scale.scaling}, {scale.window}, lines {scale.line_spacing_hz:.6g} Hz apart, "
    title += f"noise bandwidth {scale.enbw_hz:.6g} Hz, "
    title += "" if scale.weighting == "Z" else f"{scale.weighting} weighting, "
    if isinstance(found, Spectrogram):
        return title + f"{len(found.time_s)} columns of {counted(found.blocks_per_column, 'block')}"
    return title + f"{counted(found.n_blocks, 'block')}, averaging {found.averaging}"


def _sheet_header(found: Spectrum | Spectrogram) -> list[str]:
    return ["channel", "RMS", "peak Hz", found.scale.scaling, "dB", "re", "phase deg"]


def _rows(
    found: Spectrum | Spectrogram, peaks: int, phase_at: Callable[[int, int], float] | None
) -> list[list[str]]:
    """Cells of the highest lines of every channel."""
    import numpy as np

    from specan.data.spectrum import Spectrogram

    scale, over_time = found.scale, isinstance(found, Spectrogram)
    values = found.values.max(axis=1) if over_time else found.values
    density = found.density.max(axis=1) if over_time else found.density
    rows = []
    for row, (name, unit) in enumerate(zip(found.channels, found.units)):
        for rank, k in enumerate(highest(values[row], peaks)):
            first, level = rank == 0, float(scale.level_dB(density[row, k], unit))
            rows.append(
                [
                    name if first else "",
                    f"{found.rms[row]:.5g} {unit}" if first and not isinstance(found, Spectrogram) else "",
                    f"{found.frequency_hz[k]:.6g}",
                    f"{values[row, k]:.5g} {scale.unit_of(unit)}",
                    f"{level:.2f}" if np.isfinite(level) else "",
                    scale.level_text(unit).removeprefix("dB re "),
                    "" if phase_at is None else f"{phase_at(row, k):.2f}",
                ]
            )
    return rows


def highest(values: Any, count: int) -> list[int]:
    """Lines of the highest local maxima, highest first; the highest line of all where there is none."""
    import numpy as np

    from specan.data.spectrum import PIECE

    best, kept = np.empty(0, dtype=np.intp), np.empty(0)
    for first in range(0, len(values), PIECE):  # a long spectrum has half a million maxima
        last = min(first + PIECE, len(values))
        around = np.nan_to_num(values[max(first - 1, 0) : last + 1], nan=-1.0)
        before = around[:-1] if first else np.concatenate([[-np.inf], around])
        mine = around[1 if first else 0 :][: last - first]
        after = around[2 if first else 1 :]
        after = after if last < len(values) else np.append(after, -np.inf)
        maxima = np.flatnonzero((mine >= before[: mine.size]) & (mine > after))
        best, kept = np.append(best, first + maxima), np.append(kept, mine[maxima])
        if best.size > count:
            high = kept >= np.partition(kept, -count)[-count]
            best, kept = best[high], kept[high]
    ordered = best[np.argsort(-kept, kind="stable")]
    return [int(k) for k in ordered[:count]] or [0]
