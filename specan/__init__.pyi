"""Signatures for editors; made by tests/api/test_typed_signatures.py."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

from specan.analysis.batch.run import BatchReport
from specan.api.recordings import read as read
from specan.api.recordings import read_functions as read_functions
from specan.api.studies import Study as Study
from specan.api.studies import diagnose as diagnose
from specan.data.band_levels import BandLevels
from specan.data.calibration import Calibration
from specan.data.decay import DecayTimes, ImpulseResponses
from specan.data.frequency_response import FrequencyResponse
from specan.data.levels import SignalLevels
from specan.data.orders import OrderSpectrum
from specan.data.recording import Recording as Recording
from specan.data.spectrum import ShockResponse, Spectrogram, Spectrum
from specan.data.tone import ToneTable
from specan.errors import SpecanError as SpecanError
from specan.models import Condition as Condition
from specan.models import Model as Model
from specan.models import Observable as Observable
from specan.models import Parameter as Parameter
from specan.models import Reading as Reading
from specan.models import check_effect as check_effect
from specan.models import constant as constant
from specan.models import effect as effect
from specan.models import quantity as quantity
from specan.models.catalogue import load_model as load_model
from specan.report.figures import plot as plot

__version__: str

def octave(
    recording: Recording | str | Path,
    fraction: int | str = 3,
    *,
    channels: Sequence[str] = (),
    start_s: float = 0.0,
    stop_s: float | None = None,
    weighting: Literal["A", "B", "C", "Z"] = "Z",
    averaging: Literal["linear", "fast", "slow", "impulse"] | float = "linear",
    hold: Literal["max", "min"] | None = None,
    interval_s: float | None = None,
    percentiles: Sequence[float] = (),
    fmin: float | None = None,
    fmax: float | None = None,
    band: float | None = None,
    velocity_reference: Literal["1 nm/s", "50 nm/s"] = "1 nm/s",
    settling: Literal["left-out", "counted"] = "counted",
) -> BandLevels:
    """Levels in octave or fractional-octave bands (IEC 61260-1 class 1), and overall levels.

    Parameters
    ----------
    recording : Recording or path
        Opened already, or a file to read.
    fraction : {1, 2, 3, 6, 12, 24, "bark"}
        1/N octave.
    weighting : {"A", "B", "C", "Z"}
        Of the band levels. A, B and C are for sound pressure; the overall levels with all of them stand
        beside every spectrum of sound pressure anyway.
    averaging : {"linear", "fast", "slow", "impulse"} or float
        Linear over the section, or exponential: 0.125 s, 1 s, 35 ms with a peak detector that falls with
        1.5 s, or any time constant in s.
    hold : {"max", "min"} or None
        Of an exponential average: the largest or smallest level instead of that at the end of the section.
    interval_s : float or None
        Distance of the readings of an exponential average's history; by default an eighth of the time constant
        (of 0.125 s for impulse), or a multiple of it that gives at most 1000 readings.
    percentiles : tuple of float
        Of an exponential average: also find the levels exceeded during so many percent of the time, and the maximum
        and minimum. They rest on the readings of the history after a band has settled.
    fmin, fmax : float
        The bands from the one that contains `fmin` to the one that contains `fmax`; by default 20 Hz to
        20 kHz, or to the highest band below half the sampling rate.
    band : float or None
        The one band that contains this frequency, instead of a range.
    channels : tuple of str
        Names or patterns; all by default.
    start_s, stop_s : float
        Time section.
    velocity_reference : {"1 nm/s", "50 nm/s"}
        What 0 dB of velocity is: that of ISO 1683, or that of building acoustics.
    settling : {"left-out", "counted"}
        Whether what the cut at the two ends of the section does to the bands is left out of a linear average or a
        maximum, or counted. What the other choice gives is beside it.

    Returns
    -------
    BandLevels
        Levels (channels, bands) and overall levels, dB; `to_dataframe` gives one row for each.
    """
    ...

def fft(
    recording: Recording | str | Path,
    *,
    channels: Sequence[str] = (),
    start_s: float = 0.0,
    stop_s: float | None = None,
    scaling: Literal["amplitude", "rms", "psd"] = "amplitude",
    lines: int | None = None,
    window: Literal[
        "rectangular", "hann", "hamming", "blackman", "blackman-harris", "nuttall", "flat-top"
    ] = "hann",
    overlap: float = 0.5,
    detrend: bool = True,
    fmin: float = 0.0,
    fmax: float | None = None,
    weighting: Literal["A", "B", "C", "Z"] = "Z",
    whole: bool = False,
    averaging: Literal["linear", "exponential", "max", "min", "none"] = "linear",
    n_exponential: int = 10,
    reference: str | None = None,
) -> Spectrum:
    """Magnitude and phase spectra: amplitude, RMS or power spectral density.

    Parameters
    ----------
    recording : Recording or path
        Opened already, or a file to read.
    channels : tuple of str
        Names or patterns; all by default.
    scaling : {"amplitude", "rms", "psd"}
        Peak amplitude or RMS of a line (for tones), or power spectral density (for noise).
    lines : int or None
        Lines up to rate/2.56; a block has 2.56 times as many samples. All lines up to rate/2 are given. By
        default 3200, or as many as a short section allows.
    window, overlap
        Of the blocks.
    detrend : bool
        Take the mean out of each block.
    fmin, fmax, start_s, stop_s : float
        Range of the lines that are kept, and time section.
    weighting : {"A", "B", "C", "Z"}
        Of the magnitudes (IEC 61672-1:2013, annex E); A, B and C of sound pressure only. Phases stay.
    whole : bool
        The whole section is one block; `lines` is not used.
    averaging : {"linear", "exponential", "max", "min", "none"}
        "none" analyses the first block only.
    n_exponential : int
        Number of blocks of the exponential average: a new block has the weight 1/n.
    reference : str or None
        Channel over which the phase of an average stands.

    Returns
    -------
    Spectrum
        Complex lines or densities (channels, lines) over hertz.
    """
    ...

def spectrogram(
    recording: Recording | str | Path,
    *,
    channels: Sequence[str] = (),
    start_s: float = 0.0,
    stop_s: float | None = None,
    scaling: Literal["amplitude", "rms", "psd"] = "amplitude",
    lines: int | None = None,
    window: Literal[
        "rectangular", "hann", "hamming", "blackman", "blackman-harris", "nuttall", "flat-top"
    ] = "hann",
    overlap: float = 0.5,
    detrend: bool = True,
    fmin: float = 0.0,
    fmax: float | None = None,
    weighting: Literal["A", "B", "C", "Z"] = "Z",
    columns: int = 1000,
) -> Spectrogram:
    """Spectra against time.

    Parameters
    ----------
    recording : Recording or path
        Opened already, or a file to read.
    channels : tuple of str
        Names or patterns; all by default.
    scaling : {"amplitude", "rms", "psd"}
        Peak amplitude or RMS of a line (for tones), or power spectral density (for noise).
    lines : int or None
        Lines up to rate/2.56; a block has 2.56 times as many samples. All lines up to rate/2 are given. By
        default 3200, or as many as a short section allows.
    window, overlap
        Of the blocks.
    detrend : bool
        Take the mean out of each block.
    fmin, fmax, start_s, stop_s : float
        Range of the lines that are kept, and time section.
    weighting : {"A", "B", "C", "Z"}
        Of the magnitudes (IEC 61672-1:2013, annex E); A, B and C of sound pressure only. Phases stay.

    Returns
    -------
    Spectrogram
        Levels (channels, lines, columns) over hertz and seconds.
    """
    ...

def frf(
    recording: Recording | str | Path,
    reference: str | None = None,
    *,
    channels: Sequence[str] = (),
    start_s: float = 0.0,
    stop_s: float | None = None,
    instrument: str | None = None,
    estimator: Literal["H1", "H2", "Hv", "H3c"] = "H1",
    lines: int | None = None,
    window: Literal[
        "rectangular", "hann", "hamming", "blackman", "blackman-harris", "nuttall", "flat-top"
    ] = "hann",
    overlap: float = 0.5,
    align: bool = True,
) -> FrequencyResponse:
    """Transfer functions of the responses over a reference, with coherence and uncertainty.

    Parameters
    ----------
    recording : Recording or path
        Opened already, or a file to read.
    reference : str, optional
        Channel; the vibrometer by default.
    instrument : str or None
        For H3c, the channel that drives the system; the generator by default.
    channels : tuple of str
        Names or patterns of the responses; by default microphones and accelerometers, without any all other channels.
    estimator : {"H1", "H2", "Hv", "H3c"}
    lines : int or None
        Number of lines up to rate/2.56; a block has 2.56 times as many samples. By default as many as the
        response needs: 3200 times a power of two, so that leakage is below 1 % or half the random
        uncertainty, while eight independent averages are left; fewer in a short section.
    window, overlap
        Of the blocks. Hann with 50 % gives 95 % of the blocks' number as independent averages. Unless it is asked
        for, blocks overlap by 75 % where the reference passes each line once, as a sweep does.
    align : bool
        Read channels later by the delay that is found at the beginning of the recording, where it would
        bias the result.
    start_s, stop_s : float
        Time section.

    Returns
    -------
    FrequencyResponse
        Complex ratios (channels, lines) with coherence and standard uncertainty.
    """
    ...

def rms(
    recording: Recording | str | Path,
    *,
    channels: Sequence[str] = (),
    start_s: float = 0.0,
    stop_s: float | None = None,
    weighting: Literal["A", "B", "C", "Z"] | None = None,
    averaging: Literal["fast", "slow"] = "fast",
    percentiles: Sequence[float] = (5.0, 10.0, 50.0, 90.0, 95.0),
    velocity_reference: Literal["1 nm/s", "50 nm/s"] = "1 nm/s",
) -> SignalLevels:
    """RMS, level, peak, crest factor, equivalent and percentile levels of every channel.

    Parameters
    ----------
    recording : Recording or path
        Opened already, or a file to read.
    weighting : {"A", "B", "C", "Z"} or None
        Of the time-weighted level; by default A for sound pressure. Channels in other units have Z.
    averaging : {"fast", "slow"}
        Of that level.
    percentiles : tuple of float
        N of the levels exceeded during N percent of the time.
    channels : tuple of str
        Names or patterns; all by default.
    start_s, stop_s : float
        Time section.
    velocity_reference : {"1 nm/s", "50 nm/s"}

    Returns
    -------
    SignalLevels
        One value a channel of each level, dB, and of peak and RMS in the unit of the channel.
    """
    ...

def tones(
    recording: Recording | str | Path,
    reference: str | None = None,
    *,
    channels: Sequence[str] = (),
    start_s: float = 0.0,
    stop_s: float | None = None,
    frequency_hz: float | None = None,
    harmonics: int = 10,
) -> ToneTable:
    """Frequency of a sine recording, and amplitude, phase and distortion of every channel (IEEE 1057 fit).

    Parameters
    ----------
    recording : Recording or path
        Opened already, or a file to read.
    reference : str, optional
        Channel over which phases stand; the vibrometer by default.
    channels : tuple of str
        Names or patterns; all by default. The reference is always among them.
    frequency_hz : float or None
        By default from the recording's properties or its generator or vibrometer channel. A stated frequency
        is refined within 1 % (5 % where the section is short) on the leading channel.
    harmonics : int
    start_s, stop_s : float
        Time section.

    Returns
    -------
    ToneTable
        One row a channel: amplitude in its unit, phase in degrees, distortion.
    """
    ...

def orders(
    recording: Recording | str | Path,
    *,
    channels: Sequence[str] = (),
    start_s: float = 0.0,
    stop_s: float | None = None,
    tacho: str | None = None,
    pulses_per_turn: float | None = None,
    ratio: float = 1.0,
    speed_hz: float | None = None,
    max_order: float | None = None,
    turns: int = 8,
    average_turns: int = 1,
    orders: Sequence[float] = (),
    mesh: float | None = None,
    harmonics: int = 3,
    sidebands: int = 0,
    quantity: Literal["displacement", "velocity", "acceleration"] | None = None,
    envelope_hz: Sequence[float] | None = None,
    columns: int = 200,
) -> OrderSpectrum:
    """Order spectrum, order lines and time-synchronous average against a tacho or a known speed.

    Parameters
    ----------
    recording : Recording or path
        Opened already, or a file to read.
    channels : tuple of str
        Names or patterns; all but the tachos by default.
    tacho : str or None
        Channel; the recording's only tacho by default.
    pulses_per_turn : float or None
        Of the tacho's shaft; its property ``PulsesPerRevolution`` by default.
    ratio : float
        Turns of the tacho's shaft per turn of the reference shaft, to which orders belong.
    speed_hz : float or None
        Known constant speed of the reference shaft, instead of a tacho.
    max_order : float or None
        By default what 1/2.56 of the sampling rate holds at the highest speed.
    turns : int
        Turns of a block of the spectrum: lines lie 1/turns apart.
    average_turns : int
        Turns of the synchronous average: as many as the machine takes to repeat itself.
    orders : tuple of float
        Orders whose complex amplitudes are wanted.
    mesh : float or None
        Order of tooth meshing: its first `harmonics` multiples with `sidebands` orders to either side join `orders`.
    quantity : str or None
        Convert vibration to displacement, velocity or acceleration, by the frequency of each line.
    envelope_hz : pair or None
        Analyse the envelope of this band instead of the signal.
    columns : int
        Columns of the map over speed, at most.

    Returns
    -------
    OrderSpectrum
        Lines (channels, orders), and averages over a turn.
    """
    ...

def impulse(
    recording: Recording | str | Path,
    reference: str | None = None,
    *,
    channels: Sequence[str] = (),
    start_s: float = 0.0,
    stop_s: float | None = None,
    method: Literal["deconvolution", "H1"] | None = None,
    length_s: float | None = None,
) -> ImpulseResponses:
    """Impulse responses to the excitation: deconvolution of sweeps and sequences, H1 of noise.

    Parameters
    ----------
    recording : Recording or path
        Opened already, or a file to read.
    reference : str, optional
        Channel of the excitation; by default the generator, else the vibrometer.
    channels : tuple of str
        Names or patterns of the responses; by default microphones and accelerometers, without any all others.
    method : {"deconvolution", "H1"} or None
        Division of the whole section's spectra (sweeps, maximum length sequences, impulses), or the inverse
        transform of an averaged transfer function (noise). By default as the excitation is recognised.
    length_s : float or None
        Of the responses; by default what follows the end of the reference, half the section where the
        reference does not end, or half a block of H1.
    start_s, stop_s : float
        Time section.

    Returns
    -------
    ImpulseResponses
        Responses (channels, samples) over seconds.
    """
    ...

def decay(
    recording: Recording | str | Path,
    reference: str | None = None,
    *,
    channels: Sequence[str] = (),
    start_s: float = 0.0,
    stop_s: float | None = None,
    fraction: Literal[1, 3] = 1,
    fmin: float | None = None,
    fmax: float | None = None,
) -> DecayTimes:
    """Reverberation times, clarity, definition and centre time in bands (ISO 3382-1, ISO 3382-2).

    Parameters
    ----------
    recording : Recording or path
        Opened already, or a file to read.
        Impulse responses; of noise and sweeps, and where `reference` is named, they are found first.
    reference : str, optional
        Channel of the excitation.
    fraction : {1, 3}
        Octaves or one-third octaves.
    fmin, fmax : float
        Bands from the one that contains `fmin` to the one that contains `fmax`; by default 125 Hz to 4 kHz in
        octaves, 100 Hz to 5 kHz in thirds (ISO 3382-2:2008, 6), as far as the sampling rate allows.
    channels : tuple of str
        Names or patterns; all microphones by default, all channels where there is none.
    start_s, stop_s : float
        Time section.

    Returns
    -------
    DecayTimes
        Times in seconds, ratios in dB, one row for each channel and band.
    """
    ...

def calibrate(
    recordings: Recording | str | Path | Sequence[Recording | str | Path],
    *,
    output: str | Path | None = None,
    level_dB: float | None = None,
    frequency_hz: float | None = None,
    windows: int = 20,
    u_level_dB: float = 0.1,
    u_insertion_dB: float = 0.05,
    u_insertion_deg: float = 0.12,
    channels: Sequence[str] = (),
    phase_model: Literal["delay", "constant"] = "delay",
) -> Calibration:
    """Sensitivity and phase of every microphone that was in the calibrator.

    Parameters
    ----------
    recordings : Recording, path, or several
        All insertions of one calibration; those that share a microphone are chained in phase.
    output : path, optional
        Where to write the ``calibration.toml``; a file that specan did not write is not replaced.
    level_dB : float or None
        Sound pressure level of the calibrator re 20 uPa; None takes `CalibratorLevel_dB`, else what a
        calibrator of its frequency gives: 94 dB, or at 250 Hz the level of a pistonphone.
    frequency_hz : float or None
        Nominal tone; None takes `CalibratorFrequency_Hz`, else the strongest tone.
    windows : int
        Number of measurement windows n of the means; windows longer than a second are divided.
    u_level_dB : float
        Standard uncertainty of the calibrator's level, as its certificate says.
    u_insertion_dB : float
        Standard uncertainty by which a level differs from one insertion of the microphone to the next.
    u_insertion_deg : float
        The same of the phase between two microphones of one insertion, at the tone. Both hold where the
        recordings do not tell how well insertions repeat.
    channels : tuple of str
        Names or patterns of the calibrated channels; none takes `CalibratedChannels`, else all that
        show the tone.
    phase_model : {"delay", "constant"}
        How the phase goes on to other frequencies.

    Returns
    -------
    Calibration
        `read` takes it.
    """
    ...

def srs(
    recording: Recording | str | Path,
    *,
    channels: Sequence[str] = (),
    start_s: float = 0.0,
    stop_s: float | None = None,
    quality: float = 10.0,
    response: Literal["acceleration", "pseudo-velocity", "displacement"] = "acceleration",
    fmin: float = 10.0,
    fmax: float | None = None,
    per_octave: int = 12,
    detrend: bool = False,
) -> ShockResponse:
    """Shock response spectra of accelerations (ISO 18431-4).

    Parameters
    ----------
    recording : Recording or path
        Opened already, or a file to read.
    quality : float
        Q of the oscillators: 10 is a damping ratio of 5 %.
    response : {"acceleration", "pseudo-velocity", "displacement"}
        Absolute acceleration; or relative displacement, as it is or times the natural angular frequency.
    fmin, fmax : float
        Natural frequencies; by default from 10 Hz to a tenth of the sampling rate.
    per_octave : int
        Natural frequencies in an octave.
    detrend : bool
        Subtract the mean of the section.
    channels : tuple of str
        Names or patterns; all accelerations by default.
    start_s, stop_s : float
        Time section.

    Returns
    -------
    ShockResponse
        Largest responses (channels, natural frequencies): ``maximax``, ``positive``, ``negative``.
    """
    ...

def batch(
    directories: str | Path | Sequence[str | Path],
    output: str | Path,
    *,
    calibration: str | Path | None = None,
    channel_table: str | Path | None = None,
    jobs: int | None = None,
    reference: str | None = None,
    excitation: Literal["sine", "noise", "sweep"] | None = None,
    sampling_rate: float | None = None,
    tone: Mapping[str, Any] = ...,
    transfer_function: Mapping[str, Any] = ...,
    octave: Mapping[str, Any] = ...,
    orders: Mapping[str, Any] | None = None,
    decimal: Literal[".", ","] = ".",
) -> BatchReport:
    """Analyse every recording below one or several directories and write the result tables.

    Parameters
    ----------
    directories : path or sequence of paths
        Searched with everything below them.
    output : path
        Directory for the tables; results that an earlier batch left there are kept where nothing has changed.
    calibration, channel_table : path, optional
        For all files.
    jobs : int, optional
        Number of processes; more than one only in a script with ``if __name__ == "__main__"``.
    reference : str or None
        Channel over which phases and transfer functions stand; the vibrometer by default.
    excitation : {"sine", "noise", "sweep"} or None
        What drove all recordings; recognised file by file by default.
    sampling_rate : float or None
        In hertz, of all channels, in place of what the files say.
    tone : Tone
        Of sine recordings.
    transfer_function : TransferFunction
        Of noise recordings; 3200 lines unless it says otherwise: the tables of all files then have the same lines.
    octave : Octave
        Band levels of noise recordings and of those that are neither.
    calibration : CalibrationSettings
        Of calibrator recordings among the files.
    orders : Orders or None
        Of all recordings; by default those that have a tacho are analysed, with its own settings.
    decimal : {".", ","}
        Decimal sign of the tables; results do not depend on it.

    Returns
    -------
    BatchReport
        `BatchReport.to_dataframe` reads a table.
    """
    ...
