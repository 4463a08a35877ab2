"""What a model of a room tells of its microphones: their places, their errors, where further ones can stand."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.models.model import Model

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ReceiverErrors:
    """Declared standard uncertainties of the receivers and of the model.

    Attributes
    ----------
    position_m : float or array (receivers, 1)
        Of each coordinate of a receiver.
    calibration_dB, calibration_phase_deg : float or array (receivers, 1)
        Of a receiver's calibration.
    discrepancy : float
        Of the model: part of the response, and half of that part of the third octave's RMS response over all
        receivers (where modes cancel, their errors do not).
    detuning : float
        Part of the model's natural frequencies and bandwidths, smooth over neighbouring modes.
    frame_m, frame_tilt_deg : float
        Of each coordinate of all receivers together, and of their rotation about each axis through their middle.
    common_dB : float
        Of the level of the calibrator, common to all receivers.
    """

    position_m: float | Array
    calibration_dB: float | Array
    calibration_phase_deg: float | Array
    discrepancy: float
    detuning: float
    frame_m: float = 0.0
    frame_tilt_deg: float = 0.0
    common_dB: float = 0.0


@dataclass(frozen=True)
class WaveNumberStep:
    """How the derivative of a response by the logarithm of the wave number follows from an effect's parameter.

    dH/d ln k = `slope` dH/dp + `own` H, with p the parameter.

    Attributes
    ----------
    effect, parameter : str
        Effect and its parameter p, neutral at its neutral value.
    step : float
        By which p is moved for a difference quotient, SI.
    slope, own : float
    """

    effect: str
    parameter: str
    step: float
    slope: float
    own: float


@dataclass(frozen=True, eq=False)
class Places:
    """Where further receivers can stand.

    Attributes
    ----------
    free : callable
        ``free() -> array (n, 3)``: places in m that can be taken, where none stands yet.
    with_receivers : callable
        ``with_receivers(model, places) -> (model, names)``: the model with further receivers behind its own.
    depth : callable
        ``depth(group, places) -> array (n,)``: distance of places from what a group lies near, m.
    extent_m : tuple of float
        Edges of the box that holds all of them, for a plan.
    """

    free: Callable[[], Array]
    with_receivers: Callable[[Any, Array], tuple[Any, tuple[str, ...]]]
    depth: Callable[[str, Array], Array]
    extent_m: tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class SourcePlaces:
    """Where the source of a field may be if it is not where it is declared.

    Attributes
    ----------
    faces : tuple of str
        Elements on which it may lie.
    with_source : callable
        ``with_source(model, face, across, along) -> model``: the model with its source there, in parts of the face's
        edges.
    words : callable
        ``words(face, across, along) -> str``: a sentence that says so.
    """

    faces: tuple[str, ...]
    with_source: Callable[[Any, str, float, float], Any]
    words: Callable[[str, float, float], str]


@dataclass(frozen=True, eq=False)
class UsualShifts:
    """Shifts of single modes that nobody has declared, though they are usual.

    Attributes
    ----------
    with_shifts : callable
        ``with_shifts(model) -> model`` with `ModeShifts` of a usual size.
    words : str
        What is to be declared then.
    """

    with_shifts: Callable[[Any], Any]
    words: str


@dataclass(frozen=True, eq=False)
class InRecording:
    """What of the receivers and the conditions holds in one recording.

    Attributes
    ----------
    rows : array of int
        Receivers of the axis that it has, in the order of its channels.
    conditions : mapping
        Conditions that hold for the whole of it.
    drift : tuple of str and array (n,), optional
        A condition that changed while it was recorded, and by how much it was off its mean, at even steps.
    text : str
        What was found, for a person.
    """

    rows: NDArray[np.intp]
    conditions: Mapping[str, float] = field(default_factory=dict)
    drift: tuple[str, Array] | None = None
    text: str = ""


@dataclass(frozen=True, eq=False)
class PlacedEffects:
    """Effects that act at one place, and how the receivers hear what is emitted there.

    Whatever such an effect is, it changes the response by one factor a line times the response to a source at
    its place: a place can be looked for before anything else of the effect is known (matched-field processing:
    Baggeroer, Kuperman & Mikhalevsky 1993, IEEE J. Oceanic Eng. 18:401).

    Attributes
    ----------
    shapes : mapping
        Effect to the names of the two parameters that are its place, in parts of an element's edges.
    reads : tuple of str
        Quantities of the model that `patterns` needs.
    patterns : callable
        ``patterns(quantities, element, places) -> complex array (places, receivers, lines)``: response to a source
        at each of `places` (n, 2), to any scale.
    """

    shapes: Mapping[str, tuple[str, str]]
    reads: tuple[str, ...]
    patterns: Callable[[Mapping[str, Any], str, Array], NDArray[np.complex128]]


@dataclass(frozen=True, eq=False)
class NamedModes:
    """Modes of a field by name, so that a failure near one can be told by it.

    Attributes
    ----------
    reads : tuple of str
        Quantities of the model that `names` needs.
    names : callable
        ``names(quantities, f_max_hz) -> [(natural frequency, name), ...]``, the lowest first.
    """

    reads: tuple[str, ...]
    names: Callable[[Mapping[str, Any], float], list[tuple[float, str]]]


@dataclass(frozen=True, eq=False)
class ModeShifts:
    """Shifts of single modes, of which only a standard uncertainty is known: a fit finds them beside everything else.

    They are parameters of the model that no one names, in standard uncertainties.

    Attributes
    ----------
    parameters : tuple of str
        Full names of the two parameters, vectors over the modes: natural frequency, damping.
    size : int
        Number of modes.
    reads : tuple of str
        Quantities of the model that `columns` needs.
    columns : callable
        ``columns(quantities) -> iterator`` over the modes of (derivative by the mode's pole, array (receivers,
        frequencies); what one standard uncertainty of either parameter moves the pole).
    """

    parameters: tuple[str, str]
    size: int
    reads: tuple[str, ...]
    columns: Callable[[Mapping[str, Any]], Iterator[tuple[NDArray[np.complex128], tuple[complex, complex]]]]

    def of(self, values: Mapping[str, Any]) -> Array:
        """Shifts out of the values of parameters, array (2 modes,)."""
        return np.concatenate(
            [np.broadcast_to(np.asarray(values.get(n, 0.0), float), (self.size,)) for n in self.parameters]
        )

    def named(self, shifts: Array) -> dict[str, Array]:
        """The parameters, from shifts (2 modes,)."""
        return {self.parameters[0]: shifts[: self.size], self.parameters[1]: shifts[self.size :]}


@dataclass(frozen=True, eq=False, kw_only=True)
class FieldReceivers:
    """Microphones at places in a field, compared with a reference channel.

    Attributes
    ----------
    axis : str
        The model's axis that names them.
    noun, plural : str
        What they are called in sentences.
    role, reference_role : str
        Roles of their channels and of the reference channel in a recording.
    band_hz : tuple of float
        Lowest and highest frequency that is looked at.
    positions_m : array (receivers, 3)
    moved_by : str
        Effect that acts at one receiver and moves it by the parameters `along`, m.
    errors : ReceiverErrors
    wave_number : WaveNumberStep
    groups : callable
        ``groups(channels) -> {name: numbers of some channels}`` at which a failure is looked for together.
    group_label, group_words : str
        Key of a group in results, and the words that stand before its name.
    placed : PlacedEffects, optional
        Effects at one place, if the model can tell how a place is heard.
    modes : NamedModes, optional
        Names of the field's modes, if the model knows any.
    shifts : ModeShifts, optional
        Shifts of single modes, if any are declared.
    places : Places, optional
        Where further receivers can stand, if the model can tell.
    source : SourcePlaces, optional
        Where the source may be, if the model can move it.
    block_s : float, optional
        Length of the blocks of the analysis; its inverse is the distance of lines. Of each recording its own, by how
        long the field rings, where none is given.
    left_out_hz : tuple of pairs of float
        Bands whose lines are not looked at.
    background : str, optional
        Path of a recording of the receivers while the source is silent.
    usual_shifts : UsualShifts, optional
        What shifts of single modes may be where none are declared.
    in_recording : callable, optional
        ``in_recording(file name, start, duration_s) -> InRecording``, `start` a datetime64 (UTC) or None where nothing
        tells; all receivers where it is not given.
    """

    axis: str
    noun: str
    plural: str
    role: str
    reference_role: str
    band_hz: tuple[float, float]
    positions_m: Array
    moved_by: str
    along: tuple[str, str, str]
    errors: ReceiverErrors
    wave_number: WaveNumberStep
    groups: Callable[[Sequence[str]], Mapping[str, list[int]]]
    group_label: str
    group_words: str
    placed: PlacedEffects | None = None
    modes: NamedModes | None = None
    shifts: ModeShifts | None = None
    places: Places | None = None
    source: SourcePlaces | None = None
    block_s: float | None = None
    left_out_hz: tuple[tuple[float, float], ...] = ()
    background: str | None = None
    usual_shifts: UsualShifts | None = None
    in_recording: Callable[[str, Any, float], InRecording] | None = None


def receivers_of(model: Model) -> FieldReceivers:
    """The receivers of a room's model."""
    found: FieldReceivers = model.for_kinds["frf"]
    return found
