"""Sine or noise: recognised from the user, the file's properties, the generator or the vibrometer."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from specan.data.excitation import Excitation, ExcitationKind
from specan.data.recording import Channel, Recording
from specan.dsp.tonality import Appearance, appearance
from specan.errors import RequestError, nearest

SECTION_S = 2.0  # of which three are looked at: beginning, middle and end
MIN_SAMPLES = 256
# A channel this far below its full scale, or below 100 uV on a generator, carries the converter's own noise.
SILENT_RE_FULL_SCALE, SILENT_GENERATOR_V = 1e-5, 1e-4

_WORDS: tuple[tuple[ExcitationKind, tuple[str, ...]], ...] = (
    ("calibrator", ("calibrator", "calibration", "pistonphone")),
    ("unknown", ("sweep", "swept", "chirp", "stepped")),
    ("noise", ("noise", "random", "gauss")),
    ("sine", ("sine", "sinus", "tone")),
)


def recognise(recording: Recording, *, said: str | None = None) -> Excitation:
    """Decide what drove a recording; the first that knows wins.

    The order is: the user, the properties ``Excitation`` and ``ExcitationFrequency_Hz`` of the file or
    of a group, the generator channel, the vibrometer channel. At most three sections of 2 s of a channel
    are read. A property (or a user) that contradicts the signal wins, and `reason` says so.

    Parameters
    ----------
    recording : Recording
    said : {"sine", "noise"}, optional
        What the user says.

    Returns
    -------
    Excitation
        A swept or stepped sine, a transient, an even mixture of tone and noise, and silence are "unknown".

    Raises
    ------
    RequestError
        `said` is neither "sine" nor "noise".

    Examples
    --------
    >>> import numpy as np
    >>> from specan.data.recording import ArraySource, Channel
    >>> volts = np.sin(2 * np.pi * 250 * np.arange(8000) / 8000)
    >>> generator = Channel("Generator", role="generator", unit="V", sampling_rate=8000.0, n_samples=8000)
    >>> found = recognise(Recording("a.tdms", (generator,), ArraySource([volts])))
    >>> found.kind, round(found.frequency_hz, 6)
    ('sine', 250.0)
    """
    if said is not None and said not in ("sine", "noise"):
        raise RequestError(
            f"the excitation {said!r} is unknown",
            expected="sine or noise",
            remedy=nearest(said, ["sine", "noise"]),
        )
    seen = _from_channels(recording)
    stated = stated_excitation(recording)
    if said is not None:
        frequency = seen.frequency_hz if seen.kind == "sine" else None
        if stated is not None and stated.kind == "sine":
            frequency = _agreed(stated.frequency_hz, frequency)
        kind: ExcitationKind = "sine" if said == "sine" else "noise"
        claim = Excitation(kind, frequency if kind == "sine" else None, "said by the user")
        return _confronted(claim, [part for part in (stated, seen) if part is not None])
    if stated is not None:
        if stated.kind == "sine" and seen.kind == "sine":
            agreed = _agreed(stated.frequency_hz, seen.frequency_hz)
            claim = Excitation("sine", agreed, stated.reason)
            return _confronted(claim, [seen] if agreed == stated.frequency_hz else [])
        return _confronted(stated, [seen])
    return seen


def _agreed(stated_hz: float | None, seen_hz: float | None) -> float | None:
    """The measured frequency where it is the stated one to within 1 %, else what is stated."""
    if stated_hz is None or (seen_hz is not None and abs(seen_hz - stated_hz) <= 0.01 * stated_hz):
        return seen_hz
    return stated_hz


def _confronted(claim: Excitation, others: list[Excitation]) -> Excitation:
    """The claim, with what speaks against it added to the reason."""
    against = [
        other.reason
        for other in others
        if other.kind in ("sine", "noise")
        and claim.kind != "calibrator"
        and (other.kind != claim.kind or _differs(claim.frequency_hz, other.frequency_hz))
    ]
    reason = claim.reason + "".join(f"; contradicted: {text}" for text in against)
    return Excitation(claim.kind, claim.frequency_hz, reason)


def _differs(a: float | None, b: float | None) -> bool:
    return a is not None and b is not None and abs(a - b) > 0.01 * a


def _property(recording: Recording, key: str) -> Iterator[tuple[str, Any]]:
    """Every place that holds the property: the file first, then the groups."""
    places: list[tuple[str, Mapping[str, Any]]] = [("file", recording.properties)]
    places += [(f"group {name!r}", content) for name, content in recording.group_properties.items()]
    for place, content in places:
        for name, value in content.items():
            if name.lower() == key.lower() and str(value).strip():
                yield place, value


def stated_excitation(recording: Recording) -> Excitation | None:
    """What the properties of the file or of a group say; None where they are silent. Reads no samples."""
    for place, value in _property(recording, "Excitation"):
        text = str(value).strip().lower()
        for kind, words in _WORDS:
            if any(word in text for word in words):
                reason = f"property Excitation = {value!r} of the {place}"
                keys = {"sine": "ExcitationFrequency_Hz", "calibrator": "CalibratorFrequency_Hz"}
                frequency = _number(recording, keys[kind]) if kind in keys else None
                return Excitation(kind, frequency, reason)
    return None


def _number(recording: Recording, key: str) -> float | None:
    for _, value in _property(recording, key):
        try:
            number = float(value)
        except (TypeError, ValueError):
            continue
        if np.isfinite(number) and number > 0:
            return number
    return None


def _from_channels(recording: Recording) -> Excitation:
    candidates = [*recording.by_role("generator"), *recording.by_role("vibrometer")]
    silent = []
    for channel in candidates:
        if channel.n_samples < MIN_SAMPLES or channel.sampling_rate <= 0:
            silent.append(f"{channel.name} is too short")
            continue
        looks = _looks(recording, channel)
        if looks:
            return _verdict(channel, looks)
        silent.append(f"{channel.name} is silent")
    if silent:
        return Excitation("unknown", None, ", ".join(silent))
    return Excitation("unknown", None, "no property says it, and there is no generator or vibrometer channel")


def _looks(recording: Recording, channel: Channel) -> list[Appearance]:
    """Appearance of the sections in which the channel is not silent."""
    total = channel.n_samples
    size = max(MIN_SAMPLES, min(total // 3, int(SECTION_S * channel.sampling_rate)))
    starts = sorted({0, (total - size) // 2, total - size}) if total >= 3 * size else [0]
    if total < 3 * size:
        size = total
    sections = [recording.read([channel], start, start + size)[0] for start in starts]
    sections = [s for s in sections if np.all(np.isfinite(s))]
    rms = [float(np.sqrt(np.mean((s - s.mean()) ** 2))) for s in sections]
    floor = 0.01 * max(rms, default=0.0)  # 40 dB below the loudest: before the start, after the end
    if channel.full_scale is not None:
        floor = max(floor, SILENT_RE_FULL_SCALE * channel.full_scale)
    if channel.role == "generator" and channel.unit == "V":
        floor = max(floor, SILENT_GENERATOR_V)
    looks = [appearance(s, channel.sampling_rate) for s, level in zip(sections, rms) if level > floor]
    return [look for look in looks if look.look != "silence"]


def _verdict(channel: Channel, looks: list[Appearance]) -> Excitation:
    where = f"{channel.role} channel {channel.name!r}"
    kinds = {look.look for look in looks}
    frequencies = [look.frequency_hz for look in looks]
    share = 100 * min(look.share for look in looks)
    if kinds == {"tone"}:
        low, high = min(frequencies), max(frequencies)
        if high - low > max(0.1 / SECTION_S, 2e-4 * high):
            return Excitation("unknown", None, f"{where}: a tone that moves from {low:.6g} to {high:.6g} Hz")
        middle = float(np.median(frequencies))
        return Excitation(
            "sine", middle, f"{where}: a tone at {middle:.6g} Hz holds {share:.0f} % of the power"
        )
    if kinds == {"noise"}:
        return Excitation("noise", None, f"{where}: no steady tone, broad-band")
    if kinds == {"mixed"}:
        tone = f"a tone at {frequencies[0]:.6g} Hz with {share:.0f} % of the power"
        return Excitation("unknown", None, f"{where}: {tone}, too much for noise and too little for a sine")
    return Excitation("unknown", None, f"{where}: " + ", then ".join(look.look for look in looks))
