"""The sound field on a plane through the room at one frequency."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from specan.arrays import Complex, Real
from specan.errors import RequestError
from specan.models.chosen_model import ChosenModel
from specan.models.effect import Use
from specan.room.model.simulated_recording import check_frequency

STEP_M = 0.03  # about, between points of the plane
MOST_POINTS = 120  # along an edge


@dataclass(frozen=True)
class FieldMap:
    """Sound pressure over the velocity of the diaphragm on a grid of a plane.

    Attributes
    ----------
    axis : str
        Axis that the plane is normal to, ``x``, ``y`` or ``z``.
    at_m : float
        Where it cuts that axis.
    frequency_hz : float
    first_m, second_m : array
        Coordinates along the two other axes, in alphabetical order.
    response : complex array (first, second)
        Pa s/m.
    microphone_m : array (microphones, 3)
    names : tuple of str
        Of the microphones.
    """

    axis: str
    at_m: float
    frequency_hz: float
    first_m: Real
    second_m: Real
    response: Complex
    microphone_m: Real
    names: tuple[str, ...]

    @property
    def along(self) -> tuple[str, str]:
        """Names of the plane's own axes."""
        first, second = (name for name in "xyz" if name != self.axis)
        return first, second

    @property
    def level_dB(self) -> Real:
        """Level of the sound pressure in dB re 20 uPa while the diaphragm moves with 1 mm/s RMS."""
        return 20.0 * np.log10(np.maximum(np.abs(self.response) * 1e-3, 1e-12) / 20e-6)

    @property
    def phase_deg(self) -> Real:
        """Phase of the pressure against the velocity, degrees."""
        return np.degrees(np.angle(self.response))

    def columns(self) -> dict[str, Real]:
        """Columns of a table with one row a point."""
        place = dict(zip(self.along, np.meshgrid(self.first_m, self.second_m, indexing="ij"), strict=True))
        place[self.axis] = np.full(self.response.shape, self.at_m)
        found = {
            **{f"{axis}_m": place[axis] for axis in "xyz"},
            "level_dB_re_20uPa_at_1mm_s": self.level_dB,
            "phase_deg": self.phase_deg,
            "real_Pa_s_m": self.response.real,
            "imaginary_Pa_s_m": self.response.imag,
        }
        return {name: values.ravel() for name, values in found.items()}


def read_plane(text: str) -> tuple[str, float]:
    """Axis and place of ``z=0.35``.

    >>> read_plane("z=0.35")
    ('z', 0.35)
    """
    axis, equals, value = text.replace(" ", "").partition("=")
    try:
        if axis in ("x", "y", "z") and equals:
            return axis, float(value)
    except ValueError:
        pass
    raise RequestError(f"{text!r} is not a plane", expected="x=METRES, y=METRES or z=METRES")


def of_microphones(chosen: ChosenModel) -> list[Use]:
    """Effects that change what microphones read of a field, and not the field."""
    effects = chosen.assembly.model.effects
    return [u for u in chosen.assembly.uses if effects[u.name].at in ("microphone", "place", "card")]


def field_map(chosen: ChosenModel, plane: tuple[str, float], frequency_hz: float) -> FieldMap:
    """Evaluate the field on a plane.

    Errors of microphones and their cards, where the chosen has any, do not touch it.

    Parameters
    ----------
    chosen : ChosenModel
        Model of a room with effects and parameter values.
    plane : tuple
        Axis that the plane is normal to, and where it cuts it, m.
    frequency_hz : float

    Raises
    ------
    RequestError
        The plane does not cut the room, or the frequency lies outside the band.
    """
    model = chosen.assembly.model
    rig = model.settings["rig"]
    axis, at = plane
    dims, normal = rig["room"]["dims_m"], "xyz".index(axis)
    if dims is None:
        raise RequestError(
            "the room is a mesh, and its field is drawn in rectangular rooms only", expected="[room] dims_m"
        )
    if not 0.0 <= at <= dims[normal]:
        raise RequestError(
            f"the plane {axis} = {at:g} m lies outside the room",
            expected=f"{axis} between 0 and {dims[normal]:g} m",
        )
    check_frequency(frequency_hz, rig["band"]["f_max_hz"])
    across = [i for i in range(3) if i != normal]
    grids = [np.linspace(0.0, dims[i], int(np.clip(dims[i] / STEP_M, 10, MOST_POINTS)) + 1) for i in across]
    points = np.empty((len(grids[0]), len(grids[1]), 3))
    points[..., normal] = at
    points[..., across[0]], points[..., across[1]] = np.meshgrid(*grids, indexing="ij")
    # the model's field with receivers at all points
    receivers = points.reshape(-1, 3)
    names = tuple(f"point {k}" for k in range(len(receivers)))
    moved = model.with_constants({"receiver_position": receivers})
    moved = replace(moved, axes={**model.axes, "place": names}, nuisances=())
    assembly = moved.assemble(set(chosen.assembly.uses) - set(of_microphones(chosen)))
    values = {n: v for n, v in chosen.values.items() if n in assembly.parameters}
    conditions = {"frequency": np.array([frequency_hz]), "velocity_psd": np.ones(1)}
    field = assembly.evaluate(conditions, values, ["field"])["field"]
    response = np.asarray(field).reshape(points.shape[:2])
    places, microphones = np.array(rig["mics"]["position_m"]), tuple(model.axes["microphone"])
    return FieldMap(axis, at, frequency_hz, grids[0], grids[1], response, places, microphones)
