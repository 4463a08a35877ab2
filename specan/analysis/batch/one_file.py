"""What a batch does with one file: open, decide what it is, analyse in one pass, write down as lines."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import TypeVar

from specan.analysis.batch.band_lines import band_lines, other_lines, rms_lines
from specan.analysis.batch.inputs import Input
from specan.analysis.batch.noise_lines import noise_lines
from specan.analysis.batch.one_pass import Accumulator, feed
from specan.analysis.batch.result import FileResult, Kind
from specan.analysis.batch.rms_pass import RmsPass
from specan.analysis.batch.settings import BatchSettings
from specan.analysis.batch.tone_lines import tone_lines, with_flags
from specan.analysis.excitation import recognise
from specan.analysis.octave import Octave, OctaveAccumulator
from specan.analysis.quality import QualityAccumulator
from specan.analysis.tone import ToneAccumulator
from specan.analysis.transfer_function import TransferFunctionAccumulator
from specan.data.calibration import Calibration, apply
from specan.data.excitation import Excitation
from specan.data.levels import Quality
from specan.data.recording import Channel, Recording
from specan.errors import NoSignalError, SpecanError
from specan.io.open import open_recording

Made = TypeVar("Made")


class QualityPass:
    """Dead, clipped and missing samples of the channels that another analysis reads anyway."""

    def __init__(self, like: Accumulator) -> None:
        self.channels, self.start, self.stop = like.channels, like.start, like.stop
        self._quality = QualityAccumulator(like.channels)
        self.add = self._quality.add

    def by_channel(self) -> dict[int, Quality]:
        """Quality by the identity of the channel."""
        return {id(c): q for c, q in zip(self.channels, self._quality.result(), strict=True)}


def analyse_file(entry: Input, settings: BatchSettings, calibration: Calibration | None) -> FileResult:
    """Result of one file; whatever is wrong with it becomes a reason, never an exception.

    An error that nobody foresaw is a reason as well, with its type: it must not cost the other files
    their results, and it makes the batch end with exit code 1.
    """
    try:
        recording = open_headers(entry)
        if calibration is not None:
            recording = apply(calibration, recording)
        return _analyse(recording, settings)
    except SpecanError as fault:
        kind: Kind = "aside" if isinstance(fault, NoSignalError) else "failed"
        return FileResult(entry.label, kind, entry.neutral(str(fault)))
    except OSError as fault:
        return FileResult(entry.label, "failed", f"it cannot be read ({fault.strerror or fault})")
    except Exception as fault:
        reason = f"specan met something it does not know: {type(fault).__name__}: {fault}"
        return FileResult(entry.label, "failed", entry.neutral(reason))


def open_headers(entry: Input) -> Recording:
    """The recording under its label, without a calibration."""
    return open_recording(
        entry.path,
        root=entry.root,
        label=entry.label,
        channel_table=entry.channel_table or None,
        sampling_rate=entry.sampling_rate,
    )


def _analyse(recording: Recording, settings: BatchSettings) -> FileResult:
    excitation = recognise(recording, said=settings.excitation)
    description = _description(recording)
    found = FileResult(
        recording.label,
        "done",
        excitation.reason,
        about=(f"excitation {excitation.kind} ({excitation.reason})", *description),
        set_aside=tuple(sorted(recording.set_aside.items())),
    )
    if excitation.kind == "sine":
        return _sine(recording, settings, excitation, found)
    if excitation.kind == "noise":
        return _noise(recording, settings, found)
    if excitation.kind == "sweep":
        return _noise(recording, settings, found, swept=True)
    return _other(recording, settings, found)


def _description(recording: Recording) -> tuple[str, ...]:
    """`Description` of the file and of its groups."""
    places = [recording.properties, *recording.group_properties.values()]
    texts = (str(p["Description"]).strip() for p in places if str(p.get("Description", "")).strip())
    return tuple(f"Description: {text}" for text in dict.fromkeys(texts))


def _sine(
    recording: Recording, settings: BatchSettings, excitation: Excitation, found: FileResult
) -> FileResult:
    tone = settings.tone
    if tone.frequency_hz is None:
        tone = tone.model_copy(update={"frequency_hz": excitation.frequency_hz})
    accumulator = ToneAccumulator(recording, tone)
    quality = _read(recording, [accumulator])
    table = replace(accumulator.result(), stated=excitation.stated)
    shown = [c for c in accumulator.channels if c.name in table.channels]
    table = with_flags(table, [quality[id(c)].flags for c in shown])
    found = replace(
        found, blocks={"sine.txt": tone_lines(table)}, tone=table, about=(*found.about, *table.notes)
    )
    return _with_rest(found, recording, (), [accumulator])


def _noise(
    recording: Recording, settings: BatchSettings, found: FileResult, *, swept: bool = False
) -> FileResult:
    """Transfer functions and band levels; those of a sweep say how fast it was, and stand with the others."""
    faults: list[str] = []
    make = partial(TransferFunctionAccumulator, recording, settings.transfer_function)
    transfer = _attempt("transfer function", make, recording.label, faults)
    bands = [b for _, b in _band_passes(recording, settings.octave, faults) if b is not None]
    used: list[Accumulator] = [*([] if transfer is None else [transfer]), *bands]
    if not used:
        return replace(found, kind="failed", reason="; ".join(faults))
    quality = _read(recording, used)
    blocks: dict[str, str] = {}
    notes: list[str] = []
    if transfer is not None:
        response = transfer.result()
        also = ("sweep",) if swept else ()
        words = [(*quality[id(c)].flags, *also) for c in transfer.responses]
        blocks["noise.txt"] = noise_lines(response, words)
        notes.append(
            f"{response.units[0]} over {response.reference}, {response.estimator}, {response.n_blocks} blocks, "
            f"{response.n_effective:.1f} independent"
        )
        notes += response.notes
    if bands:
        levels = [b.result([quality[id(c)] for c in b.channels]) for b in bands]
        if swept:
            lines = [other_lines(each, tuple(c.role for c in b.channels)) for each, b in zip(levels, bands)]
            blocks["other.txt"] = "".join(lines)
        else:
            blocks["bands.txt"] = "".join(band_lines(each) for each in levels)
    found = replace(found, blocks=blocks, about=(*found.about, *notes))
    return _with_rest(found, recording, faults, used)


def _other(recording: Recording, settings: BatchSettings, found: FileResult) -> FileResult:
    faults: list[str] = []
    passes = [
        (RmsPass(channels) if bands is None else bands)
        for channels, bands in _band_passes(recording, settings.octave, faults)
    ]
    if not passes:
        return replace(found, kind="failed", reason="none of its channels was chosen")
    quality = _read(recording, passes)
    lines = []
    for done in passes:
        own = [quality[id(c)] for c in done.channels]
        if isinstance(done, RmsPass):
            words = [(*q.flags, *recording.flags) for q in own]
            lines.append(rms_lines(recording.label, done.channels, done.result(), words))
        else:
            lines.append(other_lines(done.result(own), tuple(c.role for c in done.channels)))
    found = replace(found, blocks={"other.txt": "".join(lines)})
    return _with_rest(found, recording, faults, passes)


def _read(recording: Recording, passes: Sequence[Accumulator]) -> dict[int, Quality]:
    """Feed the analyses, and look at the quality of every channel on the way; by the identity of the channel."""
    looks: list[QualityPass] = []
    seen: set[int] = set()
    for analysis in sorted(passes, key=lambda a: -len(a.channels)):
        if not {id(c) for c in analysis.channels} <= seen:
            looks.append(QualityPass(analysis))
            seen |= {id(c) for c in analysis.channels}
    feed(recording, [*passes, *looks])
    return {key: q for look in looks for key, q in look.by_channel().items()}


def _with_rest(
    found: FileResult, recording: Recording, faults: Sequence[str], used: Sequence[Accumulator]
) -> FileResult:
    """The result with what could not be done and with the channels that no analysis took."""
    missing = tuple(("", fault) for fault in dict.fromkeys(faults))
    return replace(found, set_aside=(*found.set_aside, *missing, *_left_out(recording, used)))


def _band_passes(
    recording: Recording, settings: Octave, faults: list[str]
) -> list[tuple[tuple[Channel, ...], OctaveAccumulator | None]]:
    """Channels of one sampling rate and length together, and their band analysis if there can be one."""
    together: dict[tuple[float, int], list[Channel]] = defaultdict(list)
    for channel in recording.select(settings.channels):
        weightable = settings.weighting == "Z" or channel.target_unit == "Pa"
        if channel.sampling_rate > 0 and channel.n_samples > 0 and weightable:
            together[channel.sampling_rate, channel.n_samples].append(channel)
    passes = []
    for channels in together.values():
        names = tuple(f"{c.group}/{c.name}" for c in channels)
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


def _left_out(recording: Recording, used: Sequence[Accumulator]) -> list[tuple[str, str]]:
    """Channels that no analysis took, and what of them speaks against it."""
    taken = {id(c) for accumulator in used for c in accumulator.channels}
    rate = used[0].channels[0].sampling_rate
    return [
        (
            f"{c.group}/{c.name}",
            "holds no samples"
            if c.n_samples == 0
            else f"sampled at {c.sampling_rate:g} Hz, not at {rate:g} Hz as the others"
            if c.sampling_rate != rate
            else "not among the chosen channels",
        )
        for c in recording.channels
        if id(c) not in taken
    ]
