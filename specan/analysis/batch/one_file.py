"""What a batch does with one file: open, decide what it is, analyse in one pass, write down as lines."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple, TypeVar

from specan.analysis.accumulator import Reader, feed
from specan.analysis.batch.inputs import Input
from specan.analysis.batch.result import FileResult, Kind
from specan.analysis.batch.settings import BatchSettings
from specan.analysis.batch.store import state_of
from specan.analysis.batch.tables import (
    band_lines,
    noise_lines,
    other_lines,
    rms_lines,
    tone_lines,
    with_orders,
)
from specan.analysis.excitation import recognise
from specan.analysis.octave import Octave, OctaveAccumulator
from specan.analysis.quality import QualityAccumulator
from specan.analysis.section import AT_ONCE, rms_about_mean
from specan.analysis.tone import ToneAccumulator
from specan.analysis.transfer_function import TransferFunctionAccumulator
from specan.data.calibration import Calibration, apply
from specan.data.channel import Channel
from specan.data.levels import Quality
from specan.data.recording import Recording, properties_called
from specan.data.tone import Excitation, ToneTable
from specan.errors import NoSignalError, SpecanError, reason_of
from specan.io.calibration_file import read_calibration
from specan.io.open import open_recording
from specan.result import picked

Made = TypeVar("Made")


def analyse_file(entry: Input, settings: BatchSettings, calibration: Calibration | None) -> FileResult:
    """Result of one file; whatever is wrong with it becomes a reason, never an exception.

    An error that nobody foresaw is a reason as well, with its type: it must not cost the other files
    their results, and it makes the batch end with exit code 1.
    """

    def runs() -> FileResult:
        recording = open_headers(entry)
        if calibration is not None:
            recording = apply(calibration, recording)
        return _together([(r, _attempted(entry, partial(_of_run, r, settings))) for r in recording.runs])

    return _attempted(entry, runs)


def _attempted(entry: Input, work: Callable[[], FileResult]) -> FileResult:
    """A result, or the reason why there is none: what is wrong with one run does not cost another."""
    try:
        return work()
    except OSError as fault:
        return FileResult(entry.label, "failed", f"it cannot be read ({fault.strerror or fault})")
    except Exception as fault:
        kind: Kind = "aside" if isinstance(fault, NoSignalError) else "failed"
        return FileResult(entry.label, kind, entry.neutral(reason_of(fault)))


def _of_run(run: Recording, settings: BatchSettings) -> FileResult:
    return with_orders(_analyse(run, settings), run, settings)


def _together(parts: Sequence[tuple[Recording, FileResult]]) -> FileResult:
    """One result of those of the runs of a file."""
    done = [part for _, part in parts if part.kind == "done"]
    if not done:
        return parts[0][1]
    failed = [("", f"{run.channels[0].group}: {part.reason}") for run, part in parts if part.kind != "done"]
    tables = dict.fromkeys(table for part in done for table in part.blocks)
    return replace(
        done[0],
        reason="; ".join(dict.fromkeys(part.reason for part in done)),
        about=tuple(dict.fromkeys(line for part in done for line in part.about)),
        blocks={table: "".join(part.blocks.get(table, "") for part in done) for table in tables},
        tones=tuple(tone for part in done for tone in part.tones),
        set_aside=(*(aside for part in done for aside in part.set_aside), *failed),
    )


def open_headers(entry: Input) -> Recording:
    """The recording under its label, without a calibration."""
    given = picked(entry, "root label sampling_rate")
    return open_recording(entry.path, channel_table=entry.channel_table or None, **given)


def open_calibrated(entry: Input) -> Recording:
    """The recording under its label, with the calibration of the batch."""
    recording = open_headers(entry)
    return apply(read_calibration(entry.calibration), recording) if entry.calibration else recording


class Written(NamedTuple):
    """What an analysis that has seen all samples adds to a table, notes on it, and tones to be joined."""

    table: str
    lines: str
    notes: Sequence[str] = ()
    tones: tuple[ToneTable, ...] = ()


# Writes down an analysis, given the quality of its channels.
Write = Callable[[Sequence[Quality]], Written]


def _analyse(recording: Recording, settings: BatchSettings) -> FileResult:
    excitation, faults = recognise(recording, said=settings.excitation), list[str]()
    found = FileResult(recording.label, "done", excitation.reason)
    analyses = _planned(recording, settings, excitation, faults)
    if not analyses:
        reason = "; ".join(faults) or "none of its channels was chosen"
        return replace(found, kind="failed", reason=reason)
    texts = (str(text).strip() for _, text in properties_called("Description", recording))
    about = [f"excitation {excitation.kind} ({excitation.reason})"]
    about += [f"Description: {text}" for text in dict.fromkeys(texts)]
    left = _left_out(recording, [analysis.channels for analysis, _ in analyses])
    missing = (("", fault) for fault in dict.fromkeys(faults))
    blocks, tones = defaultdict[str, str](str), list[ToneTable]()
    for written in _few_at_once(recording, analyses):
        blocks[written.table] += written.lines
        about += written.notes
        tones += written.tones
    return replace(
        found,
        blocks=dict(blocks),
        about=tuple(about),
        tones=tuple(tones),
        set_aside=(*sorted(recording.set_aside.items()), *missing, *left),
    )


def _planned(
    recording: Recording, settings: BatchSettings, excitation: Excitation, faults: list[str]
) -> list[tuple[Reader, Write]]:
    """A tone; or band levels, of noise and sweeps transfer functions too, of the rest RMS values without bands.

    Bands of a sweep say how fast it was: they stand with the others.
    """
    kind = excitation.kind
    if kind == "sine":
        chosen = settings.tone
        if chosen.frequency_hz is None:
            chosen = chosen.model_copy(update={"frequency_hz": excitation.frequency_hz})
        tone = ToneAccumulator(recording, chosen)
        return [(tone, partial(_tones, tone, excitation.stated))]
    driven, analyses = kind in ("noise", "sweep"), list[tuple[Reader, Write]]()
    if driven:
        make = partial(TransferFunctionAccumulator, recording, settings.transfer_function)
        transfer = _attempt("transfer function", make, recording.label, faults)
        analyses += [] if transfer is None else [(transfer, partial(_transfer_functions, transfer, kind))]
    for channels, bands in _band_passes(recording, settings.octave, faults):
        if bands is not None:
            analyses.append((bands, partial(_bands, bands, kind)))
        elif not driven:
            look = QualityAccumulator(channels, 0, min(c.n_samples for c in channels))
            analyses.append((look, partial(_rms, look, recording)))
    return analyses


def _tones(done: ToneAccumulator, stated: bool, quality: Sequence[Quality]) -> Written:
    table = replace(done.result(), stated=stated)
    found = [q.flags for c, q in zip(done.channels, quality, strict=True) if c.label in table.channels]
    words = [tuple(dict.fromkeys((*each, *own))) for each, own in zip(found, table.flags, strict=True)]
    table = replace(table, flags=tuple(words))
    return Written("sine.txt", tone_lines(table), table.notes, (table,))


def _transfer_functions(done: TransferFunctionAccumulator, kind: str, quality: Sequence[Quality]) -> Written:
    response = done.result()
    flags = {id(c): q.flags for c, q in zip(done.channels, quality, strict=True)}
    also = ("sweep",) if kind == "sweep" else ()
    about = (
        f"{response.units[0]} over {response.reference}, {response.estimator}, {response.n_blocks} blocks, "
        f"{response.n_effective:.1f} independent"
    )
    words = [(*flags[id(c)], *also) for c in done.responses]
    return Written("noise.txt", noise_lines(response, words), (about, *response.notes))


def _bands(done: OctaveAccumulator, kind: str, quality: Sequence[Quality]) -> Written:
    levels = done.result(quality)
    if kind == "noise":
        return Written("bands.txt", band_lines(levels))
    return Written("other.txt", other_lines(levels, [c.role for c in done.channels]))


def _rms(done: QualityAccumulator, recording: Recording, quality: Sequence[Quality]) -> Written:
    flags = [(*q.flags, *recording.flags) for q in quality]
    rms = rms_about_mean(recording, done.channels, done.stop)
    return Written("other.txt", rms_lines(recording.label, done.channels, rms, flags))


def _few_at_once(recording: Recording, analyses: list[tuple[Reader, Write]]) -> Iterator[Written]:
    """Feed and write down the analyses: in one pass where they have few channels, else one after the other.

    Each is let go of when it is written (`analyses` is empty in the end): memory is bounded in channels too.
    """
    few = len({id(c) for analysis, _ in analyses for c in analysis.channels}) <= AT_ONCE
    while analyses:
        together = [analyses.pop(0) for _ in range(len(analyses) if few else 1)]
        quality = _read(recording, [analysis for analysis, _ in together])
        while together:
            analysis, write = together.pop(0)
            yield write([quality[id(c)] for c in analysis.channels])
            del analysis, write


def _read(recording: Recording, passes: Sequence[Reader]) -> dict[int, Quality]:
    """Feed the analyses, and look at the quality of every channel on the way; by the identity of the channel."""
    looks: list[QualityAccumulator] = []
    seen: set[int] = set()
    for analysis in sorted(passes, key=lambda a: -len(a.channels)):
        if not {id(c) for c in analysis.channels} <= seen:
            looks.append(QualityAccumulator(analysis.channels, analysis.start, analysis.stop))
            seen |= {id(c) for c in analysis.channels}
    feed(recording, [*passes, *looks])
    return {id(c): q for look in looks for c, q in zip(look.channels, look.result(), strict=True)}


def _band_passes(
    recording: Recording, settings: Octave, faults: list[str]
) -> list[tuple[tuple[Channel, ...], OctaveAccumulator | None]]:
    """Channels of one sampling rate and length, at most `AT_ONCE` together, and their band analysis if there is one."""
    together: dict[tuple[float, int], list[Channel]] = defaultdict(list)
    for channel in recording.select(settings.channels):
        weightable = settings.weighting == "Z" or channel.target_unit == "Pa"
        if channel.sampling_rate > 0 and channel.n_samples > 0 and weightable:
            together[channel.sampling_rate, channel.n_samples].append(channel)
    passes = []
    few = (every[k : k + AT_ONCE] for every in together.values() for k in range(0, len(every), AT_ONCE))
    for channels in few:
        names = tuple(c.path for c in channels)
        mine = settings.model_copy(update={"channels": names})
        make = partial(OctaveAccumulator, recording, mine)
        passes.append((tuple(channels), _attempt("band levels", make, recording.label, faults)))
    return passes


def _attempt(what: str, make: Callable[[], Made], label: str, faults: list[str]) -> Made | None:
    """An analysis, or None and the reason why it cannot be done on this recording."""
    try:
        return make()
    except SpecanError as fault:
        faults.append(f"no {what}: {str(fault).removeprefix(f'{label}: ')}")
        return None


def _left_out(recording: Recording, taken: Sequence[Sequence[Channel]]) -> list[tuple[str, str]]:
    """Channels that no analysis took, and what of them speaks against it."""
    ours = {id(c) for channels in taken for c in channels}
    rate = taken[0][0].sampling_rate
    found = []
    for channel in (c for c in recording.channels if id(c) not in ours):
        why = "not among the chosen channels"
        if channel.n_samples == 0:
            why = "holds no samples"
        elif channel.sampling_rate != rate:
            why = f"sampled at {channel.sampling_rate:g} Hz, not at {rate:g} Hz as the others"
        found.append((channel.path, why))
    return found


class Task(NamedTuple):
    """One file, and how it is analysed; small enough to travel between processes and computers.

    Attributes
    ----------
    calibration : Calibration, optional
        The one that the file is given.
    """

    entry: Input
    settings: BatchSettings
    calibration: Calibration | None = None


def analyse_unchanged(task: Task) -> FileResult:
    """Result of one file; a file that changes while it is read has none."""
    before = state_of(task.entry.path)
    result = analyse_file(*task)
    after = state_of(task.entry.path)
    if before is None or before == after:
        return result
    if after is None:
        reason = "it vanished while it was read; put it back and run the batch again"
    else:
        how = f"from {before[0]} to {after[0]} bytes" if before[0] != after[0] else "in time, not in size"
        reason = f"it changed while it was read ({how}); run the batch again when the recording is complete"
    return FileResult(task.entry.label, "failed", reason)
