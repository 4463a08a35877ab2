"""Noise of a field while its source is silent, from a recording of its own."""

from __future__ import annotations

import numpy as np

from specan.arrays import Real
from specan.data.channel import Channel
from specan.data.recording import Recording
from specan.dsp.welch import effective_averages, power_density
from specan.errors import InputError

NEAR_DB = 10.0  # below the recording, within which a line is said to be near the background
MOST_RUNS = 6  # of neighbouring lines that are named


def background_noise(
    background: Recording, recording: Recording, channels: tuple[Channel, ...], block_s: float, lines_hz: Real,
    between: Real,
) -> tuple[Real, str]:  # fmt: skip
    """Noise density of the receivers at the lines of a recording, by what they hear without its source.

    A tone in the background, such as hum, stands on few lines: in the density `between` the lines it is not heard. The
    background counts where it is surely louder: where its mean over blocks exceeds that density by the quantile of
    chi-square over its degrees of freedom.

    Returns
    -------
    density : array (channels, lines)
        One-sided, unit of the receivers squared per Hz.
    text : str
        What was found, for a person.

    Raises
    ------
    InputError
        A receiver is missing, the recording is short, or it is as loud as the one with the source.
    """
    from scipy.stats import chi2

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
    # below this quantile of a Welch estimate the background agrees with the noise between the lines
    dof = 2 * effective_averages(blocks, "hann", 0.5)
    sure = chi2.ppf(0.999, dof) / dof
    return np.where(quiet > sure * between, quiet, between), text


def _densities(
    recording: Recording, channels: tuple[Channel, ...] | list[Channel], block_s: float, lines_hz: Real
) -> Real:
    found = []
    for channel in channels:
        rate = channel.sampling_rate
        f, density = power_density(recording.read([channel])[0], rate, round(rate * block_s))
        found.append(np.interp(lines_hz, f, density))
    return np.stack(found)
