"""Transfer functions from averaged spectra: H1, H2, Hv, the three-channel estimator, and what each line is worth.

Decisions: docs/decisions/spectra.md.
"""

from __future__ import annotations

from functools import lru_cache, partial
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from specan.arrays import Complex, Real
from specan.dsp.welch import log_bias, log_variance, student_factor
from specan.dsp.windows import WindowName, window_correlation

Estimator = Literal["H1", "H2", "Hv", "H3c"]

_SIDE = 7  # lines to either side over which noise is smoothed
# Standard deviation of a phase that may be anything, 360 / sqrt(12) degrees.
U_PHASE_UNKNOWN_DEG = 360.0 / np.sqrt(12.0)


class Estimate(NamedTuple):
    """Transfer functions (..., n) of responses over one reference.

    Attributes
    ----------
    response : complex array
        Response over reference, exp(+j w t): a delayed response has a falling phase.
    coherence : array
        Ordinary coherence of response and reference, 0 to 1.
    u_relative : array
        Relative standard uncertainty per real component: of the magnitude, and of the phase in radians. Raised by
        `specan.dsp.welch.student_factor`: twice it is the 95 % interval, however few the averages.
    degrees_of_freedom : array
        Of the noise behind `u_relative`.
    """

    response: Complex
    coherence: Real
    u_relative: Real
    degrees_of_freedom: Real


class Instrument(NamedTuple):
    """Spectra with what drives a system and shares no noise with its reference and its response.

    Attributes
    ----------
    auto : array (n,)
        S_ee.
    reference : complex array (n,)
        S_ex.
    response : complex array (..., n)
        S_ey.
    """

    auto: Real
    reference: Complex
    response: Complex


def estimate(
    estimator: Estimator,
    auto_reference: Real,
    auto_response: Real,
    cross: Complex,
    n_effective: float,
    *,
    instrument: Instrument | None = None,
    line_correlation: float = 4 / 9,
) -> Estimate:
    """Transfer function, coherence and random uncertainty from averaged spectra.

    With x the reference, y the response, e the instrument, S_xy = mean of conj(X) Y:

    - H1 = S_xy / S_xx: unbiased by noise in the response, low by 1 / (1 + noise/signal) in the reference;
    - H2 = S_yy / S_yx: unbiased by noise in the reference;
    - Hv = sqrt(S_yy / S_xx) exp(j arg S_xy): geometric mean of H1 and H2, the total least squares solution for
      signals scaled to equal power;
    - H3c = S_ey / S_ex: unbiased by noise in both, given an instrument e that drives the system and
      shares no noise with them (method of instrumental variables, three-channel technique).

    The uncertainty rests on the spectrum of what the estimate leaves, r = y - H x, smoothed over 15 lines
    (`smoothed_noise`):

    - H1, H2, Hv: u^2 = S_rr / (2 n |H1|^2 S_xx) with S_rr = (1 - coherence) S_yy: (1 - g^2) / (2 n g^2) per
      real component (Bendat and Piersol, Random Data, ch. 9). The magnitude of Hv scatters less, by the
      square root of the coherence; its phase does not;
    - H3c: the error is S_er / S_ex, hence u^2 = S_rr S_ee / (2 n |S_ey|^2) with the residual
      S_rr = S_yy + |H|^2 S_xx - 2 Re(conj(H) S_xy), which holds the noise of both channels.

    One complex parameter is fitted, so S_rr is raised by n / (n - 1). What calibration,
    delay and leakage add is not in it.

    Parameters
    ----------
    auto_reference : array (n,)
    auto_response, cross : arrays (..., n)
        S_yy and S_xy.
    n_effective : float
        Number of independent averages (`specan.dsp.welch.effective_averages`).
    instrument : Instrument, optional
        Needed for H3c.
    line_correlation : float
        Of the errors of neighbouring lines, as the window makes it (`specan.dsp.windows.line_correlation`).

    Examples
    --------
    >>> x, y, xy = np.array([1.0]), np.array([5.0]), np.array([2.0 + 0j])
    >>> found = estimate("H1", x, y, xy, 100)
    >>> complex(found.response[0]), float(found.coherence[0]), round(float(found.u_relative[0]), 4)
    ((2+0j), 0.8, 0.0358)
    """
    if cross.ndim > 1:  # one response after the other: what is between is as large as all spectra
        responses = np.broadcast_to(auto_response, cross.shape)
        through: list[Instrument | None] = [None] * len(cross)
        if instrument is not None:
            through = [instrument._replace(response=r) for r in instrument.response]
        one = partial(estimate, estimator, auto_reference, line_correlation=line_correlation)
        found = [
            one(own, over, n_effective, instrument=mine)
            for own, over, mine in zip(responses, cross, through, strict=True)
        ]
        return Estimate(*map(np.stack, zip(*found, strict=True)))
    with np.errstate(divide="ignore", invalid="ignore"):
        strength, size = np.abs(cross) ** 2, np.sqrt(auto_response / auto_reference)
        coherence = np.minimum(strength / (auto_reference * auto_response), 1.0)
        left, gain = (1 - coherence) * auto_response, auto_reference / strength
        if estimator == "H1":
            response = cross / auto_reference
        elif estimator == "H2":
            response = np.asarray(auto_response / np.conj(cross), dtype=complex)
        elif estimator == "Hv":
            response = size * (cross / np.abs(cross))
        elif instrument is None:
            raise ValueError("H3c needs the spectra of an instrument")
        else:
            response = instrument.response / instrument.reference
            both = np.real(np.conj(response) * cross)
            left = auto_response + np.abs(response) ** 2 * auto_reference - 2 * both
            gain = instrument.auto / np.abs(instrument.response) ** 2
        if n_effective <= 1:  # one block says nothing about its own scatter
            nothing = np.full(coherence.shape, np.nan)
            return Estimate(response, coherence, nothing, np.zeros(coherence.shape))
        left = np.maximum(left, np.finfo(float).eps * auto_response)
        freedom = n_effective - 1  # one complex parameter was fitted
        noise = smoothed_noise(left, freedom)
        degrees = noise_freedom(left, noise, freedom, line_correlation)
        relative = np.sqrt(noise * gain / (2 * freedom)) * student_factor(degrees)
    return Estimate(response, coherence, relative, degrees)


def smoothed_noise(noise: Real, freedom: float) -> Real:
    """Noise spectrum (..., n), smoothed over 15 lines; fewer towards the ends, but never under three.

    A line's own estimate of its noise, from `freedom` complex degrees of freedom, has heavy tails and goes with
    the line's own error; that of its neighbourhood has neither. The mean is that of the logarithm, which a steep
    spectrum does not pull up, corrected for its bias psi(freedom) - ln(freedom). A line that is above its
    neighbourhood by five standard deviations (hum) keeps its own value.
    """
    n = noise.shape[-1]
    logarithm = np.log(np.maximum(noise, np.finfo(float).tiny))
    total, count = np.zeros(noise.shape), np.zeros(n)
    for offset in range(-_SIDE, _SIDE + 1):
        # The lines whose mean takes in the one that is `offset` away; see `noise_freedom`.
        far = abs(offset) if abs(offset) > 1 else 0
        low, high = max(far, -offset), n - max(far, offset)
        if low < high:
            total[..., low:high] += logarithm[..., low + offset : high + offset]
            count[low:high] += 1
    level = np.exp(total / count - log_bias(freedom))
    return np.where(noise > level * (1 + 5 / np.sqrt(freedom)), noise, level)


def noise_freedom(noise: Real, smoothed: Real, freedom: float, line_correlation: float) -> Real:
    """Degrees of freedom (..., n) of a noise spectrum that `smoothed_noise` has smoothed.

    Those of a chi-square whose logarithm has the variance of the mean: 2 m / psi'(freedom) for m independent lines;
    count lines, neighbours correlated by c, are count / (1 + 2 c (1 - 1/count)) independent ones. A line that kept its
    own value has 2 freedom.
    """
    line = np.arange(noise.shape[-1])
    reach = np.maximum(np.minimum(_SIDE, np.minimum(line, line[::-1])), 1)  # as in `smoothed_noise`
    count = np.minimum(2 * reach + 1, line.size)
    independent = count / (1 + 2 * line_correlation * (1 - 1 / count))
    return np.where(smoothed == noise, 2 * freedom, 2 * independent / log_variance(freedom))


def u_phase_deg(u_relative: Real) -> Real:
    """Standard uncertainty of a phase, in degrees, never more than that of a phase that may be anything."""
    return np.minimum(np.degrees(u_relative), U_PHASE_UNKNOWN_DEG)


def phase_deg(response: Complex) -> Real:
    """Phase in degrees in (-180, 180].

    Examples
    --------
    >>> phase_deg(np.array([-1.0 + 0j, complex(-1.0, -0.0)])).tolist()
    [180.0, 180.0]
    """
    phase = np.degrees(np.angle(response))
    return np.where(phase <= -180.0, 180.0, phase + 0.0)  # no -0.0


def arrivals(impulse: Real) -> NDArray[np.int_]:
    """Samples by which the strongest arrival of each impulse response (..., n) is late; below 0: early."""
    n, peak = impulse.shape[-1], np.argmax(impulse, axis=-1)
    return np.where(peak > n // 2, peak - n, peak)


# Lines of a section whose lags are looked at together, per line of the block that is judged: 1/64 of a block
# is the finest lag that is distinguished, where a Hann window costs 0.16 %.
SECTION_LINES = 64
# Lags before and after the aligned arrival, in blocks of the spectrum at hand; a response has hardly anything
# before its arrival.
_BEFORE = 0.25
# Below this value of the window's correlation a lag is lost in rounding and noise.
_LEAST_CORRELATION = 0.15
# Times the noise that the mean of about five lags and sections must exceed: chance does so in 2 of 100 cases
# (chi-square of 10 degrees of freedom).
_ABOVE_NOISE = 3.0
# The same for longer blocks: their noise is that of fewer averages and, at lags beyond a short block, counts
# wholly. What chance brings is then up to ten times as large as the noise of the short blocks lets it be; it
# is one to two orders of magnitude rarer at 4 than at 3.
_ABOVE_NOISE_OF_LONGER = 4.0


def leakage_bias(response: Complex, variance: Real, window_name: WindowName, ratio: int = 1) -> Complex:
    """What blocks take from each line of a transfer function: its expectation minus the response, negated.

    White noise through a response h, cut into blocks with a window of the correlation rho, gives

        E H1(f) = sum over lags of rho(lag / block) h(lag) exp(-j 2 pi f lag)

    (Bendat and Piersol, Random Data, section 11.2; the sum over lags of the cross correlation). H1 is thus smoothed
    over lines: a reverberant tail, an echo and the peak of a resonance are lost in part. What is lost,
    the sum of (1 - rho) h, follows from the estimate itself where rho is not too small: the spectrum is cut into
    overlapping sections of lines, each is transformed to lags, what does not rise above the noise is left out, the
    rest is weighted by (1 - rho) / rho and transformed back.

    Parameters
    ----------
    response : complex array (..., n)
        Estimate on consecutive lines, aligned: its arrival is at lag zero. Lines that are not finite count as zero.
    variance : array (..., n)
        Mean square of the random error of each line, both components together.
    window_name : str
    ratio : int
        How many of the blocks that are judged the block of `response` holds. With 1 the estimate is judged from
        itself, and what is later than 0.6 of a block is hardly seen.

    Returns
    -------
    complex array (..., n)
        To be added to an estimate with the shorter blocks, on the lines of `response`.

    Examples
    --------
    An echo of 0.5, 0.3 of a block late, is seen with rho(0.3) = 0.546 of its strength:

    >>> late = np.exp(-2j * np.pi * np.arange(400) * 0.3)
    >>> lost = leakage_bias(1 + 0.5 * 0.546 * late, np.full(400, 1e-8), "hann")
    >>> float(np.round(np.median(abs(lost)), 2)), round(0.5 * (1 - 0.546), 2)
    (0.23, 0.23)
    """
    n = response.shape[-1]
    size = min(SECTION_LINES * ratio, 1 << (n.bit_length() - 1))
    hop, bell = size // 2, 0.5 - 0.5 * np.cos(2 * np.pi * (np.arange(size) + 0.5) / size)
    lost = _lost_of_seen(size, ratio, window_name)
    count = -(-n // hop) + 1  # each line lies in two sections
    sections = _cut(_finite(response), size, hop, count)
    noise = _cut(_finite(variance), size, hop, count)
    lags = np.fft.ifft(sections * bell, axis=-1)
    floor = np.mean(noise * bell**2, axis=-1, keepdims=True) / size
    energy = _neighbours(_neighbours(lags.real**2 + lags.imag**2, -1, circular=True), -2, circular=False)
    threshold = _ABOVE_NOISE if ratio == 1 else _ABOVE_NOISE_OF_LONGER
    with np.errstate(divide="ignore", invalid="ignore"):
        above = np.sqrt(np.nan_to_num(np.maximum(1 - threshold * floor / energy, 0.0)))
    back = np.fft.fft(lags * above * lost, axis=-1)
    found = np.zeros((*response.shape[:-1], count + 1, hop), dtype=complex)
    found[..., :-1, :] = back[..., :hop]
    found[..., 1:, :] += back[..., hop:]
    return found.reshape(*response.shape[:-1], -1)[..., hop : hop + n]


def _finite(values: NDArray) -> NDArray:
    finite = np.isfinite(values)
    return values if finite.all() else np.where(finite, values, 0.0)


@lru_cache(maxsize=16)
def _lost_of_seen(size: int, ratio: int, window_name: WindowName) -> Real:
    """(1 - rho) / rho of each lag: what the judged blocks lose, over what is seen of it."""
    lag = np.arange(size) / size
    lag = np.where(lag < 1 - _BEFORE, lag, lag - 1)
    seen = np.maximum(window_correlation(window_name, lag), _LEAST_CORRELATION)
    return np.asarray((1 - window_correlation(window_name, lag * ratio)) / seen)


def _cut(values: NDArray, size: int, hop: int, count: int) -> NDArray:
    """Sections (..., count, size), the first and the last half beyond the ends.

    Below line 1 stand the conjugates of the lines above: the response is real. Beyond the last line the same is done,
    turned so that it goes on from there: a conjugate mirror image keeps the lags.
    """
    n = values.shape[-1]
    below = np.conj(values[..., : hop - 1][..., ::-1])
    past = (count + 1) * hop - hop - n
    phase = np.exp(2j * np.angle(values[..., -1:])) if np.iscomplexobj(values) else 1.0
    above = np.conj(values[..., n - 1 - past : n - 1][..., ::-1]) * phase
    extended = np.concatenate([below, np.real(values[..., :1]), values, above], axis=-1)
    index = hop * np.arange(count)[:, None] + np.arange(size)
    return extended[..., index]


def _neighbours(values: Real, axis: int, *, circular: bool) -> Real:
    """Means over a value (half) and its two neighbours (a quarter each)."""
    along = np.moveaxis(values, axis, -1)
    ends = (-1, 0) if circular else (0, -1)
    before, after = (along[..., end, None] for end in ends)
    wide = np.concatenate([before, along, after], axis=-1)
    return np.moveaxis((2 * along + wide[..., :-2] + wide[..., 2:]) / 4, -1, axis)
