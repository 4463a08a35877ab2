"""Sine, noise, sweep or steps: recognised from the user, the file's properties, the generator or the vibrometer.

Decisions: docs/decisions/recognition.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from specan.analysis.quality import LARGEST
from specan.arrays import Real
from specan.data.channel import Channel
from specan.data.recording import Recording, properties_called
from specan.data.tone import Excitation, ExcitationKind
from specan.dsp import tonality
from specan.errors import RequestError, nearest
from specan.units import number, spoken

# Five sections are looked at; in a recording of less than six seconds they are its fifths.
SECTION_S, LEAST_SECTION_S = 1.2, 0.33
# Their places in a longer one, from its beginning to its end: uneven, so that nothing periodic meets all of them alike.
PLACES = (0.0, 0.17, 0.45, 0.71, 1.0)
MIN_SAMPLES = 256
# Relative standard deviation of the amplitude from section to section: that of one part in a hundred of the power.
STEADY = 0.1
# A channel this far below its full scale, or below 100 uV on a generator, carries the converter's own noise.
SILENT_RE_FULL_SCALE, SILENT_GENERATOR_V = 1e-5, 1e-4

SAYABLE: dict[str, ExcitationKind] = {"sine": "sine", "noise": "noise", "sweep": "sweep"}
CALIBRATOR_WORDS = ("calibrator", "calibration", "pistonphone")
_WORDS: tuple[tuple[ExcitationKind, tuple[str, ...]], ...] = (
    ("calibrator", CALIBRATOR_WORDS),
    ("stepped-sine", ("stepped",)),
    ("sweep", ("sweep", "swept", "chirp")),
    ("noise", ("noise", "random", "gauss")),
    ("sine", ("sine", "sinus", "tone")),
)


def recognise(recording: Recording, *, said: str | None = None) -> Excitation:
    """Decide what drove a recording; the first that knows wins.

    The order is: the user, the properties ``Excitation`` and ``ExcitationFrequency_Hz`` of the file or
    of a group, the generator channel, the vibrometer channel. At most five sections of 1.2 s of a channel
    are read. A property (or a user) that contradicts the signal wins, and `reason` says so.

    Parameters
    ----------
    recording : Recording
    said : {"sine", "noise", "sweep"}, optional
        What the user says.

    Returns
    -------
    Excitation
        "sine" is one steady tone, "noise" scatters as a Gaussian process does; a sweep and steps have their own
        words. All else is "unknown": several tones, modulation, pulses, a transient, an even mixture of tone and
        noise, silence.

    Raises
    ------
    RequestError
        `said` is none of the three.

    Examples
    --------
    >>> import numpy as np
    >>> from specan.data.channel import Channel
    >>> from specan.data.recording import ArraySource
    >>> volts = np.sin(2 * np.pi * 250 * np.arange(8000) / 8000)
    >>> generator = Channel("Generator", role="generator", unit="V", sampling_rate=8000.0, n_samples=8000)
    >>> found = recognise(Recording("a.tdms", (generator,), ArraySource([volts])))
    >>> found.kind, round(found.frequency_hz, 6)
    ('sine', 250.0)
    """
    if said is not None and said not in SAYABLE:
        raise RequestError(
            f"the excitation {said!r} is unknown",
            expected="sine or noise, or sweep",
            remedy=nearest(said, list(SAYABLE)),
        )
    stated = stated_excitation(recording)
    claimed = said or (stated.kind if stated is not None else None)
    # What is said to be noise is only contradicted by a tone, and one look shows whether there can be one.
    seen = _NOT_LOOKED if claimed == "noise" and not _may_be_a_tone(recording) else _from_channels(recording)
    if claimed is None:
        return seen
    sine = stated.frequency_hz if stated is not None and stated.kind == "sine" else None
    frequency = seen.frequency_hz if seen.kind == "sine" else None
    if sine is not None and (frequency is None or abs(frequency - sine) > 0.01 * sine):
        frequency = sine
    if said is not None:
        claim = Excitation(SAYABLE[said], frequency if said == "sine" else None, "stated by the user")
        return _confronted(claim, [part for part in (stated, seen) if part is not None])
    assert stated is not None
    return _confronted(replace(stated, frequency_hz=frequency) if stated.kind == "sine" else stated, [seen])


def _confronted(claim: Excitation, others: list[Excitation]) -> Excitation:
    """The claim, with what speaks against it added to the reason."""
    against = [
        other.reason
        for other in others
        if other.kind in ("sine", "noise", "sweep", "stepped-sine")
        and claim.kind != "calibrator"
        and (other.kind != claim.kind or _differs(claim.frequency_hz, other.frequency_hz))
    ]
    reason = claim.reason + "".join(f"; contradicted: {text}" for text in against)
    return Excitation(claim.kind, claim.frequency_hz, reason, stated=True)


def _differs(a: float | None, b: float | None) -> bool:
    return a is not None and b is not None and abs(a - b) > 0.01 * a


def stated_excitation(recording: Recording) -> Excitation | None:
    """What the properties of the file or of a group say; None where they are silent. Reads no samples."""
    for place, value in properties_called("Excitation", recording):
        text = str(value).strip().lower()
        for kind, words in _WORDS:
            if any(word in text for word in words):
                reason = f"property Excitation = {value!r} of the {place}"
                keys = {"sine": "ExcitationFrequency_Hz", "calibrator": "CalibratorFrequency_Hz"}
                frequency = _number(recording, keys[kind]) if kind in keys else None
                return Excitation(kind, frequency, reason)
    return None


def _number(recording: Recording, key: str) -> float | None:
    found = (number(value) for _, value in properties_called(key, recording))
    return next((value for value in found if value is not None and 0 < value < np.inf), None)


def _from_channels(recording: Recording) -> Excitation:
    candidates = [*recording.by_role("generator"), *recording.by_role("vibrometer")]
    silent = []
    for channel in candidates:
        if channel.n_samples < MIN_SAMPLES or channel.sampling_rate <= 0:
            silent.append(f"{channel.label} is too short")
            continue
        sections = _sections(recording, channel)
        if sections is None:
            silent.append(
                f"{channel.label} holds samples that are not finite, or too large for their squares"
            )
            continue
        looks = [tonality.appearance(s, channel.sampling_rate) for s in sections]
        sections, looks = _without_switching(sections, looks)
        if any(look.look != "silence" for look in looks):
            return _verdict(channel, sections, looks)
        silent.append(f"{channel.label} is silent")
    if silent:
        return Excitation("unknown", None, ", ".join(silent))
    return Excitation("unknown", None, "no property says it, and there is no generator or vibrometer channel")


_NOT_LOOKED = Excitation("unknown", None, "not analysed")


def _may_be_a_tone(recording: Recording) -> bool:
    """Whether one line of the first section with a signal holds as much as a tone does."""
    for channel in [*recording.by_role("generator"), *recording.by_role("vibrometer")]:
        if channel.n_samples >= MIN_SAMPLES and channel.sampling_rate > 0:
            size = min(channel.n_samples, max(MIN_SAMPLES, int(LEAST_SECTION_S * channel.sampling_rate)))
            if tonality.tonal_share(recording.read([channel], 0, size)[0]) >= tonality.TONE_SHARE:
                return True
    return False


def _without_switching(
    sections: list[Real], looks: list[tonality.Appearance]
) -> tuple[list[Real], list[tonality.Appearance]]:
    """Without the first or the last section where a tone begins or ends in it."""
    first = 1 if looks and looks[0].look == "transient" else 0
    last = len(looks) - 1 if len(looks) > first and looks[-1].look == "transient" else len(looks)
    if last - first >= 2 and {look.look for look in looks[first:last]} == {"tone"}:
        return sections[first:last], looks[first:last]
    return sections, looks


def _sections(recording: Recording, channel: Channel) -> list[Real] | None:
    """The sections in which the channel is not silent, in their order; None where all hold what is not finite."""
    total, rate = channel.n_samples, channel.sampling_rate
    count = max(1, min(len(PLACES), int(total / max(LEAST_SECTION_S * rate, MIN_SAMPLES))))
    size = min(total // count, max(MIN_SAMPLES, int(SECTION_S * rate)))
    # Contiguous in a short recording, spread over a long one.
    rest = total - count * size
    starts = [
        number * size + int(rest * PLACES[number * (len(PLACES) - 1) // max(count - 1, 1)])
        for number in range(count)
    ]
    sections = [recording.read([channel], start, start + size)[0] for start in starts]
    sections = [s for s in sections if np.all(np.abs(s) < LARGEST)]
    if not sections:
        return None
    rms = [float(np.sqrt(np.mean((s - s.mean()) ** 2))) for s in sections]
    floor = 0.01 * max(rms, default=0.0)  # 40 dB below the loudest: before the start, after the end
    if channel.full_scale is not None:
        floor = max(floor, SILENT_RE_FULL_SCALE * channel.full_scale)
    if channel.role == "generator" and channel.unit == "V":
        floor = max(floor, SILENT_GENERATOR_V)
    return [s for s, level in zip(sections, rms) if level > floor]


def _verdict(channel: Channel, sections: Sequence[Real], looks: Sequence[tonality.Appearance]) -> Excitation:
    where = f"{channel.role} channel {channel.label!r}"
    kinds = {look.look for look in looks}
    frequencies = [look.frequency_hz for look in looks]
    low, high, middle = min(frequencies), max(frequencies), float(np.median(frequencies))
    share = 100 * min(look.share for look in looks)
    if kinds == {"tone"} and high - low <= max(0.1 / SECTION_S, 2e-4 * high):
        amplitudes = np.array([look.amplitude for look in looks])
        if np.std(amplitudes) > STEADY * np.mean(amplitudes):
            return Excitation("unknown", None, f"{where}: a tone at {middle:.6g} Hz whose amplitude varies")
        text = f"{where}: a tone at {middle:.6g} Hz holds {share:.0f} % of the power"
        return Excitation("sine", middle, text)
    if kinds == {"mixed"}:
        tone = f"a tone at {frequencies[0]:.6g} Hz with {share:.0f} % of the power"
        return Excitation("unknown", None, f"{where}: {tone}, too much for noise and too little for a sine")
    # Among a few lines of a narrow band, two may stand out in a section, but not in most of them.
    several = 2 * sum(look.look == "several tones" for look in looks) < len(looks)
    unclear = {"broad", "narrow", "mixed", "transient", *(["several tones"] if several else [])}
    if kinds <= unclear and kinds != {"transient"} and _is_noise(channel, sections, looks):
        return Excitation("noise", None, f"{where}: no steady tone, broad-band")
    moving = _moving(channel, sections, looks, where)
    if moving is not None:
        return moving
    alone = len(sections) == 1 and channel.n_samples >= 3 * len(sections[0])  # all the rest is silent
    if ("transient" in kinds or alone) and kinds <= {"broad", "narrow", "transient"}:
        return Excitation("unknown", None, f"{where}: transient")
    words = dict.fromkeys(_SAID.get(look.look, look.look) for look in looks)
    return Excitation("unknown", None, f"{where}: " + ", then ".join(words))


_SAID = {
    "broad": "neither a tone nor noise (pulses, modulation)",
    "narrow": "a narrow band that is neither a tone nor noise",
    "square wave": "a square wave",
    "slow": "too few periods in a second",
}


def _moving(
    channel: Channel, sections: Sequence[Real], looks: Sequence[tonality.Appearance], where: str
) -> Excitation | None:
    """A sweep, steps, or a tone that moves otherwise; None where there is no tone to follow."""
    rate = channel.sampling_rate
    tracks = [found for s in sections if (found := tonality.track(s, rate)) is not None]
    several = sum(look.look == "several tones" for look in looks)
    if len(tracks) < len(sections) or 2 * several > len(sections):
        return None
    size = len(sections[0]) / rate
    every = np.concatenate([t.frequency_hz for t in tracks])
    low, high = (float(x) for x in np.percentile(every, [2, 98]))
    ways = f"from about {spoken(low, high, digits=2)} Hz"
    match tonality.path(
        tracks, [look.look == "tone" for look in looks], size, channel.n_samples / rate - size
    ):
        case "sweep":
            return Excitation("sweep", None, f"{where}: a swept tone {ways}")
        case "steps":
            return Excitation("stepped-sine", None, f"{where}: a tone in steps {ways}")
        case "moves":
            return Excitation("unknown", None, f"{where}: a tone whose frequency varies {ways}")
    return None


def _is_noise(channel: Channel, sections: Sequence[Real], looks: Sequence[tonality.Appearance]) -> bool:
    """Whether the sections scatter as noise does, and so does what surrounds the strongest line of any of them."""
    broad = tonality.scatters_as_noise(sections)
    narrow = any(look.look != "broad" for look in looks)
    low, high = min(look.band_hz[0] for look in looks), max(look.band_hz[1] for look in looks)
    if broad is False or (broad is None and not narrow):
        return False
    if not narrow and high - low > 0.25 * channel.sampling_rate:
        return True
    return tonality.narrow_band_is_noise(sections, low / channel.sampling_rate, high / channel.sampling_rate)
