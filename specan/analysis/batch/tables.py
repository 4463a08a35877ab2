"""The result tables of a batch, put together from the results of its files."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path, PurePosixPath

from specan import __version__
from specan.analysis.batch.result import FileResult
from specan.analysis.batch.store import Kept
from specan.analysis.batch.table_lines import joined_lines
from specan.analysis.stepped_sine import join_stepped_sine, not_steps
from specan.data.frequency_response import FrequencyResponse
from specan.data.tone import ToneTable
from specan.errors import InputError, unforeseen
from specan.io import results_text as text
from specan.units import LEVEL_REFERENCES

# Stands in the place of a file's name: all sine recordings of a directory joined.
ALL = "*"

UNITS = {
    "sine.txt": "rms, tone_rms: unit; level_dB: 20 log10(rms / reference of the unit); phase_deg: channel minus "
    "reference at the tone, positive when the channel leads; u_phase_deg: standard uncertainty; "
    "magnitude_re_reference: tone_rms over reference_rms",
    "noise.txt": "magnitude: channel over reference; phase_deg: channel minus reference, positive when the channel "
    "leads; u_magnitude_percent, u_phase_deg: standard uncertainties of noise, leakage, calibration and delay together",
    "bands.txt": "band_hz: nominal mid-band frequency, or total with its weighting; level_dB re the reference of "
    "the unit; u_dB: standard uncertainty",
    "other.txt": "rms: unit; level_dB re the reference of the unit; u_dB: standard uncertainty",
    "orders.txt": "order: cycles per turn of the shaft; amplitude: peak of the sine, unit; level_dB: of its RMS re the "
    "reference of the unit; phase_deg: at turn zero; u, u_blocks: standard uncertainty of one component, unit, from "
    "the noise about the line and from the scatter of blocks",
    "skipped.txt": "kind: aside (no failure) or failed; channel is empty where it is the whole file",
}


def write_tables(
    out: Path,
    header: Sequence[str],
    results: Sequence[FileResult],
    kept: Mapping[str, Kept],
    decimal: str = ".",
) -> dict[str, int]:
    """Write every table, those without a row as well; optional ones only where a file has them.

    Parameters
    ----------
    header : sequence of str
        Lines on settings and calibration.
    results : sequence of FileResult
        Sorted by label.
    kept : mapping
        Label to where the lines of a file stand.
    decimal : {".", ","}
        Decimal sign.

    Returns
    -------
    dict
        Number of rows of each table that was written.
    """
    written = {}
    for name, columns in text.COLUMNS.items():
        here = [r for r in results if r.label in kept and name in kept[r.label].places]
        if name in text.OPTIONAL and not here:
            continue
        about = [f"file {r.label}: {line}" for r in here for line in r.about]
        lines: Iterable[str | bytes]
        if name in ("skipped.txt", "sine.txt"):
            made = _skipped(results) if name == "skipped.txt" else _sine_lines(name, results, here, kept)
            lines = texts = list(made)
            written[name] = sum(block.count("\n") for block in texts)
        else:
            lines = (kept[r.label].encoded(name) for r in here)
            written[name] = sum(kept[r.label].rows[name] for r in here)
        text.write_table(out / name, [*_head(name, header), *about], columns, lines, decimal)
    return written


def _head(name: str, header: Sequence[str]) -> list[str]:
    references = ", ".join(f"{unit} re {ref.text}" for unit, ref in LEVEL_REFERENCES.items())
    return [
        f"specan {__version__} {name}",
        *header,
        f"units: {UNITS[name]}",
        f"level references: {references}",
    ]


def _skipped(results: Sequence[FileResult]) -> Iterator[str]:
    rows = []
    for result in results:
        if result.kind != "done":
            rows.append((result.label, "", result.kind, result.reason))
        rows += [(result.label, channel, "aside", reason) for channel, reason in result.set_aside]
    for label, tables in _directories(results).items():
        for one, reason in not_steps(tables).items():
            say = "; state Excitation = 'sine' in its properties if it is one"
            rows.append((one, "", "aside", f"not in the stepped-sine characteristic: {reason}{say}"))
        joined = _join(label, tables)
        if isinstance(joined, InputError):
            rows.append((label, "", "aside", f"no stepped-sine characteristic: {joined}"))
    for row in sorted(rows, key=lambda row: row[0]):
        yield text.rows([text.words([cell]) for cell in row])


def _directories(results: Sequence[FileResult]) -> dict[str, list[ToneTable]]:
    """Directories that hold several sine recordings."""
    together: dict[str, list[ToneTable]] = defaultdict(list)
    for result in results:
        if result.tones:
            together[str(PurePosixPath(result.label).with_name(ALL))] += result.tones
    return {label: tables for label, tables in together.items() if len(tables) > 1}


def _join(label: str, tables: Sequence[ToneTable]) -> FrequencyResponse | InputError | None:
    """The stepped-sine characteristic of a directory, or why there is none; None where one step is left."""
    left_out = not_steps(tables)
    steps = [table for table in tables if table.label not in left_out]
    if len(steps) < 2:
        return None
    try:
        return join_stepped_sine(steps, label)
    except InputError as fault:
        return fault
    except Exception as fault:
        return InputError(unforeseen(fault))


def _sine_lines(
    name: str, results: Sequence[FileResult], here: Sequence[FileResult], kept: Mapping[str, Kept]
) -> Iterator[str]:
    """Lines of the files and of the directories of stepped sines, in order of labels."""
    lines = [(result.label, kept[result.label].lines(name)) for result in here]
    for label, tables in _directories(results).items():
        joined = _join(label, tables)
        if isinstance(joined, FrequencyResponse):
            roles: dict[str, str] = {}
            units: dict[str, str] = {}
            for tone in tables:
                roles |= zip(tone.channels, tone.roles, strict=True)
                units |= zip(tone.channels, tone.units, strict=True)
            lines.append((label, joined_lines(joined, roles, units)))
    yield from (block for _, block in sorted(lines, key=lambda entry: entry[0]))
