"""Noise of a field while its source is silent, from a recording of its own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from specan.arrays import Flags, Real
from specan.data.channel import Channel
from specan.data.recording import Recording
from specan.dsp.welch import effective_averages, power_density
from specan.errors import InputError

NEAR_DB = 10.0  # below the recording, within which a line is said to be near the background
MOST_RUNS = 6  # of neighbouring lines that are named


@dataclass(frozen=True, eq=False)
class Background:
    """Noise density of the receivers at the lines of a recording.

    Attributes
    ----------
    density : array (channels, lines)
        One-sided, unit of the receivers squared per Hz.
    averages : float
        Effective number of blocks that it is a mean of.
    near : array of bool (channels, lines)
        Where it lies within 10 dB of the recording.
    text : str
        What was found, for a person.
    """

    density: Real
    averages: float
    near: Flags
    text: str

    def beside(self, noise: Real) -> Real:
        """A noise density found between the lines, and the background where that is surely louder.

        A tone in the background, such as hum, stands on few lines: between them it is not heard. The mean of
        `averages` blocks is surely above a density where it exceeds the quantile of chi-square over its degrees
        of freedom.
        """
        from scipy.stats import chi2

        # below this quantile of a Welch estimate the background agrees with the noise between the lines
        sure = chi2.ppf(0.999, 2 * self.averages) / (2 * self.averages)
        return np.where(self.density > sure * noise, self.density, noise)


def background_noise(
    background: Recording, recording: Recording, channels: tuple[Channel, ...], block_s: float, lines_hz: Real
) -> Background:
    """What the receivers hear without the source, in the blocks of the recording with it.

    Raises
    ------
    InputError
        A receiver is missing, the recording is short, or it is as loud as the one with the source.
    """
    own = [background.channel(channel.name) for channel in channels]
    rate = own[0].sampling_rate
    blocks = int(own[0].duration_s / block_s * 2) - 1
    if blocks < 2:
        raise InputError(
            f"the background {background.label} lasts {own[0].duration_s:.1f} s",
            expected=f"at least {1.5 * block_s:.1f} s for blocks of {block_s:.3g} s",
        )
    quiet = _densities(background, own, block_s, lines_hz)
    loud = _densities(recording, channels, block_s, lines_hz)
    # 3.0: below the recording; where half of the lines are nearer, the source was not silent
    if np.mean(quiet > 10 ** (-3.0 / 10) * loud) > 0.5:
        raise InputError(
            f"the background {background.label} is as loud as {recording.label} on most lines",
            expected="a recording with the source switched off",
            remedy="check that the two files are not exchanged",
        )
    near = quiet > 10 ** (-NEAR_DB / 10) * loud
    at = np.flatnonzero(near.any(axis=0))
    runs = np.split(at, np.flatnonzero(np.diff(at) > 1) + 1)
    text = f"{background.label}: background of {own[0].duration_s:.3g} s at {rate:g} Hz; "
    if at.size:
        ends = [f"{lines_hz[run[0]]:.4g} to {lines_hz[run[-1]]:.4g}" for run in runs[:MOST_RUNS]]
        where = ", ".join(ends) + (" ..." if len(runs) > MOST_RUNS else "")
        text += (
            f"within {NEAR_DB:g} dB of {recording.label} in {100 * near.mean():.2g} % of its values "
            f"({where} Hz), which count with the background's uncertainty"
        )
    else:
        text += f"more than {NEAR_DB:g} dB below {recording.label} on every line"
    return Background(quiet, effective_averages(blocks, "hann", 0.5), near, text)


def _densities(
    recording: Recording, channels: tuple[Channel, ...] | list[Channel], block_s: float, lines_hz: Real
) -> Real:
    found = []
    for channel in channels:
        rate = channel.sampling_rate
        f, density = power_density(recording.read([channel])[0], rate, round(rate * block_s))
        found.append(np.interp(lines_hz, f, density))
    return np.stack(found)
