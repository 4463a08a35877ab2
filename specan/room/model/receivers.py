"""What a model of a room tells of its microphones: their places, their errors, where further ones can stand."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.arrays import Real
from specan.models.model import Model
from specan.room.model.rig import Rig


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

    position_m: float | Real
    calibration_dB: float | Real
    calibration_phase_deg: float | Real
    discrepancy: float
    detuning: float
    frame_m: float = 0.0
    frame_tilt_deg: float = 0.0
    common_dB: float = 0.0


@dataclass(frozen=True)
class ModeShifts:
    """Shifts of single modes, of which only a standard uncertainty is known: a fit finds them beside everything else.

    They are parameters of the model that no one names, vectors over the modes, in standard uncertainties.

    Attributes
    ----------
    size : int
        Number of modes.
    """

    size: int

    def of(self, values: Mapping[str, Any]) -> Real:
        """Shifts out of the values of parameters, natural frequencies before dampings, array (2 modes,)."""
        names = ("mode_shift.frequency", "mode_shift.damping")
        return np.concatenate(
            [np.broadcast_to(np.asarray(values.get(n, 0.0), float), (self.size,)) for n in names]
        )

    def named(self, shifts: Real) -> dict[str, Real]:
        """The parameters, from shifts (2 modes,)."""
        frequency, damping = np.split(shifts, 2)
        return {"mode_shift.frequency": frequency, "mode_shift.damping": damping}


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
    drift: tuple[str, Real] | None = None
    text: str = ""


@dataclass(frozen=True, eq=False)
class FieldReceivers:
    """Microphones at places in a room, compared with the vibrometer.

    Attributes
    ----------
    rig : Rig
        The checked rig file.
    names : tuple of str
        Of the places.
    positions_m : array (places, 3)
    errors : ReceiverErrors
    in_recording : callable
        ``in_recording(file name, start, duration_s) -> InRecording``, `start` a datetime64 (UTC) or None where nothing
        tells.
    box : tuple of float, optional
        Edges of a rectangular room: then modes have names, and places near walls and on them are known.
    shifts : ModeShifts, optional
        Shifts of single modes, if any are declared.
    """

    rig: Rig
    names: tuple[str, ...]
    positions_m: Real
    errors: ReceiverErrors
    in_recording: Callable[[str, Any, float], InRecording]
    box: tuple[float, float, float] | None
    shifts: ModeShifts | None


def receivers_of(model: Model) -> FieldReceivers:
    """The receivers of a room's model."""
    found: FieldReceivers = model.for_kinds["frf"]
    return found
