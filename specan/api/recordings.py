"""Analyses of recordings, one function each: settings are keyword arguments, a recording may be a path."""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias, get_type_hints

from specan.data.calibration import stated
from specan.data.recording import Recording
from specan.errors import RequestError
from specan.io.calibration_file import calibration_beside
from specan.io.open import open_recording

if TYPE_CHECKING:
    import pandas as pd

    from specan.analysis.batch.run import BatchReport
    from specan.data.band_levels import BandLevels
    from specan.data.calibration import Calibration
    from specan.data.decay import DecayTimes, ImpulseResponses
    from specan.data.frequency_response import FrequencyResponse
    from specan.data.levels import SignalLevels
    from specan.data.orders import OrderSpectrum
    from specan.data.spectrum import ShockResponse, Spectrogram, Spectrum
    from specan.data.tone import ToneTable
    from specan.schema import Settings
    from specan.units import Quantity

Source: TypeAlias = Recording | str | Path
# Where the settings of each function stand.
SETTINGS = {
    "octave": "octave:Octave",
    "fft": "spectrum:FourierSpectrum",
    "spectrogram": "spectrum:SpectrogramSettings",
    "frf": "transfer_function:TransferFunction",
    "rms": "levels:Levels",
    "tones": "tone:Tone",
    "orders": "orders:Orders",
    "impulse": "decay:ImpulseResponse",
    "decay": "decay:Decay",
    "calibrate": "insertion:CalibrationSettings",
    "srs": "shock_response:ShockSettings",
    "batch": "batch.settings:BatchSettings",
}


def read(
    path: str | Path,
    *,
    channel_table: str | Path | None = None,
    calibration: Calibration | str | Path | None = None,
    sampling_rate: float | None = None,
    quantity: Quantity | None = None,
) -> Recording:
    """Open a recording; samples are read when they are asked for.

    Parameters
    ----------
    path : str or Path
        A file in TDMS, WAV, UFF, MAT, HDF5 or CSV.
    channel_table : path, optional
        Roles, units and sensitivities; by default ``channels.toml`` or ``channels.csv`` beside the file.
    calibration : Calibration or path, optional
        What `calibrate` returned, or a file; by default ``calibration.toml`` beside the recording, if there is one.
        ``"none"``: nominal sensitivities.
    sampling_rate : float, optional
        In hertz, instead of what the file says.
    quantity : {"displacement", "velocity", "acceleration"}, optional
        What spectra, bands and transfer functions show channels of motion as.

    Returns
    -------
    Recording
        Channels and properties; no sample is read yet.

    Raises
    ------
    InputError
        The file is missing or is not a recording.

    Examples
    --------
    >>> from specan.errors import InputError
    >>> try:
    ...     recording = read("no_such_file.tdms")
    ... except InputError as fault:
    ...     print(fault.expected or "no such file")
    no such file
    """
    if calibration is None:
        calibration = calibration_beside(Path(path))
    elif str(calibration) == "none":
        calibration = None
    found = open_recording(
        path, channel_table=channel_table, calibration=calibration, sampling_rate=sampling_rate
    )
    return found if quantity is None else found.in_quantity(quantity)


def read_functions(path: str | Path) -> pd.DataFrame:
    """Functions of frequency of a universal file: spectra, densities, transfer functions, coherences.

    Parameters
    ----------
    path : str or Path
        Data sets 58, ASCII or binary, of other programs or as ``specan frf -o NAME.uff`` and ``specan fft -o NAME.uff``
        write them.

    Returns
    -------
    pandas.DataFrame
        One row for each line: ``function``, ``response``, ``reference``, ``frequency_hz``, ``value`` and ``unit``.
    """
    import pandas as pd

    from specan.io.uff import FUNCTIONS, read_uff

    names = ("function", "response", "reference", "frequency_hz", "value", "unit")
    parts = [
        pd.DataFrame(dict(zip(names, (FUNCTIONS[s.kind], s.response, s.reference, s.x, s.values, s.unit))))
        for s in read_uff(Path(path), tuple(FUNCTIONS))
    ]
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=names)


def octave(recording: Source, fraction: int | str = 3, **settings: Any) -> BandLevels:
    """Levels in octave or fractional-octave bands (IEC 61260-1 class 1), and overall levels.

    Parameters
    ----------
    recording : Recording or path
        Opened already, or a file to read.
    fraction : {1, 2, 3, 6, 12, 24, "bark"}
        1/N octave.
    **settings
        ``weighting``, ``averaging``, ``hold``, ``interval_s``, ``percentiles``, ``fmin``, ``fmax``, ``band``,
        ``channels``, ``start_s``, ``stop_s``, ``velocity_reference``, ``settling``: see
        `specan.analysis.octave.Octave`.

    Returns
    -------
    BandLevels
        Levels (channels, bands) and overall levels, dB; `to_dataframe` gives one row for each.
    """
    return _analysed("octave", recording, fraction=fraction, **settings)


def fft(recording: Source, **settings: Any) -> Spectrum:
    """Magnitude and phase spectra: amplitude, RMS or power spectral density.

    Parameters
    ----------
    recording : Recording or path
        Opened already, or a file to read.
    **settings
        ``channels``, ``scaling``, ``weighting``, ``lines``, ``window``, ``overlap``, ``detrend``, ``fmin``,
        ``fmax``, ``start_s``, ``stop_s``, ``whole``, ``averaging``, ``n_exponential``, ``reference``: see
        `specan.analysis.spectrum.FourierSpectrum`.

    Returns
    -------
    Spectrum
        Complex lines or densities (channels, lines) over hertz.
    """
    return _analysed("fft", recording, **settings)


def spectrogram(recording: Source, **settings: Any) -> Spectrogram:
    """Spectra against time.

    Parameters
    ----------
    recording : Recording or path
        Opened already, or a file to read.
    **settings
        ``columns``, ``channels``, ``scaling``, ``weighting``, ``lines``, ``window``, ``overlap``, ``detrend``,
        ``fmin``, ``fmax``, ``start_s``, ``stop_s``: see `specan.analysis.spectrum.SpectrogramSettings`.

    Returns
    -------
    Spectrogram
        Levels (channels, lines, columns) over hertz and seconds.
    """
    return _analysed("spectrogram", recording, **settings)


def frf(recording: Source, reference: str | None = None, **settings: Any) -> FrequencyResponse:
    """Transfer functions of the responses over a reference, with coherence and uncertainty.

    Parameters
    ----------
    recording : Recording or path
        Opened already, or a file to read.
    reference : str, optional
        Channel; the vibrometer by default.
    **settings
        ``instrument``, ``channels``, ``estimator``, ``lines``, ``window``, ``overlap``, ``align``, ``start_s``,
        ``stop_s``: see `specan.analysis.transfer_function.TransferFunction`.

    Returns
    -------
    FrequencyResponse
        Complex ratios (channels, lines) with coherence and standard uncertainty.
    """
    return _analysed("frf", recording, reference=reference, **settings)


def rms(recording: Source, **settings: Any) -> SignalLevels:
    """RMS, level, peak, crest factor, equivalent and percentile levels of every channel.

    Parameters
    ----------
    recording : Recording or path
        Opened already, or a file to read.
    **settings
        ``weighting``, ``averaging``, ``percentiles``, ``channels``, ``start_s``, ``stop_s``,
        ``velocity_reference``: see `specan.analysis.levels.Levels`.

    Returns
    -------
    SignalLevels
        One value a channel of each level, dB, and of peak and RMS in the unit of the channel.
    """
    return _analysed("rms", recording, **settings)


def tones(recording: Source, reference: str | None = None, **settings: Any) -> ToneTable:
    """Frequency of a sine recording, and amplitude, phase and distortion of every channel (IEEE 1057 fit).

    Parameters
    ----------
    recording : Recording or path
        Opened already, or a file to read.
    reference : str, optional
        Channel over which phases stand; the vibrometer by default.
    **settings
        ``channels``, ``frequency_hz``, ``harmonics``, ``start_s``, ``stop_s``: see `specan.analysis.tone.Tone`.

    Returns
    -------
    ToneTable
        One row a channel: amplitude in its unit, phase in degrees, distortion.
    """
    return _analysed("tones", recording, reference=reference, **settings)


def orders(recording: Source, **settings: Any) -> OrderSpectrum:
    """Order spectrum, order lines and time-synchronous average against a tacho or a known speed.

    Parameters
    ----------
    recording : Recording or path
        Opened already, or a file to read.
    **settings
        ``channels``, ``tacho``, ``pulses_per_turn``, ``ratio``, ``speed_hz``, ``max_order``, ``turns``,
        ``average_turns``, ``orders``, ``mesh``, ``harmonics``, ``sidebands``, ``quantity``, ``envelope_hz``,
        ``columns``, ``start_s``, ``stop_s``: see `specan.analysis.orders.Orders`.

    Returns
    -------
    OrderSpectrum
        Lines (channels, orders), and averages over a turn.
    """
    return _analysed("orders", recording, **settings)


def impulse(recording: Source, reference: str | None = None, **settings: Any) -> ImpulseResponses:
    """Impulse responses to the excitation: deconvolution of sweeps and sequences, H1 of noise.

    Parameters
    ----------
    recording : Recording or path
        Opened already, or a file to read.
    reference : str, optional
        Channel of the excitation; by default the generator, else the vibrometer.
    **settings
        ``channels``, ``method``, ``length_s``, ``start_s``, ``stop_s``: see
        `specan.analysis.decay.ImpulseResponse`.

    Returns
    -------
    ImpulseResponses
        Responses (channels, samples) over seconds.
    """
    return _analysed("impulse", recording, reference=reference, **settings)


def decay(recording: Source, reference: str | None = None, **settings: Any) -> DecayTimes:
    """Reverberation times, clarity, definition and centre time in bands (ISO 3382-1, ISO 3382-2).

    Parameters
    ----------
    recording : Recording or path
        Opened already, or a file to read.
        Impulse responses; of noise and sweeps, and where `reference` is named, they are found first.
    reference : str, optional
        Channel of the excitation.
    **settings
        ``fraction``, ``fmin``, ``fmax``, ``channels``, ``start_s``, ``stop_s``: see `specan.analysis.decay.Decay`.

    Returns
    -------
    DecayTimes
        Times in seconds, ratios in dB, one row for each channel and band.
    """
    from specan.analysis.excitation import recognise

    asked, source = _settings("decay", **settings), _opened(recording)
    if reference is None and recognise(source).kind not in ("noise", "sweep", "stepped-sine"):
        return _analysed("decay", source, **settings)
    section = {"start_s": asked.start_s, "stop_s": asked.stop_s}
    responses = impulse(source, reference, channels=asked.channels, **section)
    whole = asked.model_copy(update={"start_s": 0.0, "stop_s": None, "channels": ()})
    found = whole(responses.recording(), responses.upper_hz)
    kept = {"calibration": responses.settings["calibration"]}
    remark = f"from impulse responses to {responses.reference} ({responses.method})"
    notes = (*responses.notes, *found.notes, remark)
    return replace(found, notes=notes, settings={**asked.model_dump(mode="json"), **kept})


def srs(recording: Source, **settings: Any) -> ShockResponse:
    """Shock response spectra of accelerations (ISO 18431-4).

    Parameters
    ----------
    recording : Recording or path
        Opened already, or a file to read.
    **settings
        ``quality``, ``response``, ``fmin``, ``fmax``, ``per_octave``, ``detrend``, ``channels``, ``start_s``,
        ``stop_s``: see `specan.analysis.shock_response.ShockSettings`.

    Returns
    -------
    ShockResponse
        Largest responses (channels, natural frequencies): ``maximax``, ``positive``, ``negative``.
    """
    return _analysed("srs", recording, **settings)


def calibrate(
    recordings: Source | Sequence[Source], *, output: str | Path | None = None, **settings: Any
) -> Calibration:
    """Sensitivity and phase of every microphone that was in the calibrator.

    Parameters
    ----------
    recordings : Recording, path, or several
        All insertions of one calibration; those that share a microphone are chained in phase.
    output : path, optional
        Where to write the ``calibration.toml``; a file that specan did not write is not replaced.
    **settings
        ``level_dB``, ``frequency_hz``, ``windows``, ``u_level_dB``, ``u_insertion_dB``, ``u_insertion_deg``,
        ``channels``, ``phase_model``: see `specan.analysis.insertion.CalibrationSettings`.

    Returns
    -------
    Calibration
        `read` takes it.
    """
    from specan.analysis.calibration import calibrate as evaluate
    from specan.io.calibration_file import write_calibration
    from specan.io.output_file import check_output

    sources = [recordings] if isinstance(recordings, (Recording, str, Path)) else recordings
    found = evaluate(
        [one if isinstance(one, Recording) else open_recording(one) for one in sources],
        _settings("calibrate", **settings),
    )
    if output is not None:
        check_output(Path(output), [Path(one) for one in sources if not isinstance(one, Recording)])
        write_calibration(found, Path(output))
    return found


def batch(
    directories: str | Path | Sequence[str | Path],
    output: str | Path,
    *,
    calibration: str | Path | None = None,
    channel_table: str | Path | None = None,
    jobs: int | None = None,
    **settings: Any,
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
    **settings
        ``reference``, ``excitation``, ``sampling_rate``, and as dicts ``tone``, ``transfer_function``, ``octave``,
        ``calibration``, ``orders``, and ``decimal`` of the tables: see `specan.analysis.batch.settings.BatchSettings`.

    Returns
    -------
    BatchReport
        `BatchReport.to_dataframe` reads a table.
    """
    from specan.analysis.batch.run import run_batch

    places = [directories] if isinstance(directories, (str, Path)) else directories
    return run_batch(
        [Path(place) for place in places],
        Path(output),
        _settings("batch", **settings),
        calibration=None if calibration is None else Path(calibration),
        channel_table=None if channel_table is None else Path(channel_table),
        jobs=jobs,
    )


def signed(function: Callable[..., Any]) -> Callable[..., Any]:
    """A function of this module whose signature names every setting, for notebooks and `help`."""
    if function.__name__ in SETTINGS:
        own = inspect.signature(function)
        known = [p for p in own.parameters.values() if p.kind is not p.VAR_KEYWORD]
        kind = _kind(function.__name__)
        hints = get_type_hints(kind)  # without the bounds of pydantic, which nobody reads in a tool tip
        more = [
            inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=f.default, annotation=hints[name])
            for name, f in kind.model_fields.items()
            if name not in own.parameters
        ]
        function.__dict__["__signature__"] = own.replace(parameters=[*known, *more])
    return function


def _kind(name: str) -> type[Settings]:
    place, _, kind = SETTINGS[name].partition(":")
    found: type[Settings] = getattr(importlib.import_module(f"specan.analysis.{place}"), kind)
    return found


def _analysed(name: str, recording: Source, **settings: Any) -> Any:
    """The result of one analysis; its settings say which calibration its channels have."""
    source = _opened(recording)
    return stated(_settings(name, **settings)(source), source)


def _opened(recording: Source) -> Recording:
    if isinstance(recording, (str, Path)):
        return read(recording)
    if not isinstance(recording, Recording):
        raise RequestError(
            f"expected a Recording or the path of one file, found: {type(recording).__name__}",
            remedy="use Recording.from_arrays for arrays",
        )
    return recording


def _settings(where: str, **given: Any) -> Any:
    """The settings of an analysis; one channel or percentile may be given without a tuple around it."""
    from specan.schema import parse

    for name in ("channels", "percentiles", "orders"):
        if isinstance(given.get(name), (str, float, int)):
            given[name] = (given[name],)
    return parse(
        _kind(where), {name: value for name, value in given.items() if value is not None}, f"specan.{where}"
    )
