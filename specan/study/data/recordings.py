"""Recordings as measurements of a study: what is one, which rows of it are held out, what looks wrong."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import numpy as np
from scipy.stats import linregress

from specan.arrays import Flags, Real
from specan.data.channel import Channel
from specan.data.recording import Recording
from specan.errors import InputError
from specan.study.data.held_out import Column, put_aside
from specan.study.observation import DataFile, MeasuredFiles, Observation, shared_labels

ObservationT = TypeVar("ObservationT", bound=Observation)
SECTIONS = 24  # of a recording, over which a drift is sought


def reads(path: Path) -> bool:
    """Whether a file is a recording by its content."""
    from specan.io.open import format_of

    try:
        format_of(path)
    except InputError:
        return False
    return True


def parted(
    wholes: Iterable[tuple[DataFile, ObservationT]],
    wanted: MeasuredFiles,
) -> tuple[list[ObservationT], list[ObservationT]]:
    """What is fitted, and what is held out: ``channel=A 6``, ``third_octave_hz=200``, and all of validations.

    Raises
    ------
    RequestError
        See `put_aside`.
    """
    files = list(wholes)
    unseen = [whole for file, whole in files if file not in wanted.measurements]
    of = [file.name for file, _ in files if file in wanted.measurements]
    parts = [whole for file, whole in files if file in wanted.measurements]
    sizes = [whole.n for whole in parts]
    columns = {name: Column(labels) for name, labels in shared_labels(parts).items()}
    aside = put_aside(columns, wanted, of, np.repeat(np.arange(len(of)), sizes))
    rows = list(zip(parts, np.split(aside, np.cumsum(sizes)[:-1]), strict=True))
    fitted = [whole.take(~out) for whole, out in rows if not np.all(out)]
    return fitted, [whole.take(out) for whole, out in rows if np.any(out)] + unseen


def doubts(
    recording: Recording, channels: Sequence[Channel], reference: Channel
) -> tuple[list[str], list[int]]:
    """What looks wrong with the samples of a steady recording, in sentences: clipping, hum, a drift; mains heard, Hz.

    Parameters
    ----------
    recording : Recording
    channels : sequence of Channel
        That are looked at.
    reference : Channel
        Of the excitation; a level that drifts with it is none of the channel.
    """
    from specan.analysis.quality import rms_and_quality

    part = replace(recording, channels=tuple(channels))
    looks = rms_and_quality(part)
    flags = {channel.name: looks[k][1].flags for k, channel in enumerate(channels)}
    heard: set[int] = set()
    excitation = recording.read([reference])[0]
    found: dict[str, list[str]] = {}
    for channel in channels:
        samples = recording.read([channel])[0]
        said = [*flags[channel.name]]
        if "nan" not in said and "dead" not in said and samples.size == excitation.size:
            hum = _hum(samples, excitation, channel.sampling_rate)
            heard |= set(hum)
            said += [f"hum at {mains} Hz and multiples" for mains in hum]
            said += _drift(samples, excitation)
        for text in said:
            found.setdefault(text, []).append(channel.name)
    return [
        f"{recording.label}: {text} in {', '.join(names)}: "
        + ("lines there are not fitted" if text.startswith("hum") else "check before anything else")
        for text, names in found.items()
    ], sorted(heard)


def off_the_mains(frequency_hz: Real, heard: Iterable[float], line_hz: float) -> Flags:
    """Lines that are no multiple of a mains frequency, nor reached by one through a Hann window.

    Examples
    --------
    >>> off_the_mains(np.arange(97.0, 104.0), [50], 1.0)
    array([ True,  True, False, False, False,  True,  True])
    """
    apart = [np.abs(frequency_hz - mains * np.maximum(np.rint(frequency_hz / mains), 1)) for mains in heard]
    # 1.5: lines around a multiple of the mains' frequency that a Hann window lets it reach
    return np.all([gap > 1.5 * line_hz for gap in apart], axis=0) & np.ones(len(frequency_hz), dtype=bool)


def _hum(samples: Real, excitation: Real, rate: float) -> list[int]:
    """Mains frequencies at multiples of which a tone goes on that does not follow from the excitation.

    What the response to the excitation (H1) leaves of a line differs at random from block to block; of a tone it turns
    at a constant rate, so that one line of its spectrum over the blocks holds nearly all of it. A share g or more has
    white noise on one of m lines of n blocks with probability m (1 - g)^(n - 1) at most (Fisher 1929, Proceedings of
    the Royal Society A 125:54).
    """
    block = round(rate)  # one second: multiples of 50 and 60 Hz are lines
    count = samples.size // block
    if count < 4:
        return []
    cut = (x[: count * block].reshape(count, block) * np.hanning(block) for x in (samples, excitation))
    response, cause = (np.fft.rfft(x) for x in cut)
    h1 = np.sum(response * cause.conj(), axis=0) / np.maximum(np.sum(np.abs(cause) ** 2, axis=0), 1e-300)
    left = response - h1 * cause
    turning = (
        np.abs(np.fft.fft(left, 4 * count, axis=0)) ** 2
    )  # four lines for one, or a tone falls between two
    share = turning.max(axis=0) / np.maximum(count * np.sum(np.abs(left) ** 2, axis=0), 1e-300)
    steady = 4 * count * (1 - share) ** (count - 1) < 1e-3
    places = {m: np.arange(m, min(8 * m + 1, int(0.4 * rate)), m) for m in (50, 60)}
    # hum has the first or the second beside others
    return [m for m, at in places.items() if np.sum(steady[at]) >= 2 and np.any(steady[at[:2]])]


def _drift(samples: Real, excitation: Real) -> list[str]:
    """A level over that of the excitation that changes steadily from the beginning to the end."""
    size = (samples.size - 1) // SECTIONS
    # Of differences: a single low mode that swells and fades does not make the level.
    steps = [np.diff(x)[: SECTIONS * size].reshape(SECTIONS, size) for x in (samples, excitation)]
    rms = [np.sqrt(np.mean(x**2, axis=1)) for x in steps]
    if not np.all(rms[0] > 0) or not np.all(rms[1] > 0):
        return []
    level = 20 * np.log10(rms[0] / rms[1])
    line = linregress(np.linspace(0, 1, SECTIONS), level)
    # by chance in none of 30 channels, and no less than a calibration is known
    sure = line.pvalue < 1e-5 and abs(line.slope) > 0.3
    return [f"a drift of {line.slope:+.1f} dB over the recording"] if sure else []
