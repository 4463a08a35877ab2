"""The worm-gear rig file: what a user knows about the gear, its bearings, its oil, its bench.

Deep groove ball bearings are named by their designation: bore and outside diameter are those of ISO 15; the static load
rating C0 is the SKF catalogue's (publication 17000 EN, 2018, product table 1.1). C0 enters friction through an angle
that goes with its power 0.24 only. R1, R2, S1, S2: SKF, "The SKF model for calculating the frictional moment", table 3
(publication 10000 EN, 2013, pp. 97-112, unchanged in 17000 EN), in N and mm.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, Field, model_validator

from specan.errors import RequestError, require_known
from specan.models.effect import Effect, Parameter
from specan.schema import Settings, parse, read_toml

# designation: bore mm, outside diameter mm, static load rating kN
SIZES: dict[str, tuple[float, float, float]] = {
    "6000": (10, 26, 1.96), "6001": (12, 28, 2.36), "6002": (15, 32, 2.85), "6003": (17, 35, 3.25),
    "6004": (20, 42, 5.0), "6005": (25, 47, 6.55), "6006": (30, 55, 8.3), "6007": (35, 62, 10.2),
    "6008": (40, 68, 11.0), "6009": (45, 75, 14.6), "6010": (50, 80, 16.0), "6011": (55, 90, 21.2),
    "6012": (60, 95, 23.2),
    "6200": (10, 30, 2.36), "6201": (12, 32, 3.1), "6202": (15, 35, 3.75), "6203": (17, 40, 4.75),
    "6204": (20, 47, 6.55), "6205": (25, 52, 7.8), "6206": (30, 62, 11.2), "6207": (35, 72, 15.3),
    "6208": (40, 80, 19.0), "6209": (45, 85, 21.6), "6210": (50, 90, 23.2), "6211": (55, 100, 29.0),
    "6212": (60, 110, 36.0),
    "6300": (10, 35, 3.4), "6301": (12, 37, 4.15), "6302": (15, 42, 5.4), "6303": (17, 47, 6.55),
    "6304": (20, 52, 7.8), "6305": (25, 62, 11.6), "6306": (30, 72, 16.0), "6307": (35, 80, 19.0),
    "6308": (40, 90, 24.0), "6309": (45, 100, 31.5), "6310": (50, 110, 38.0), "6311": (55, 120, 45.0),
    "6312": (60, 130, 52.0),
}  # fmt: skip

# series: R1, R2, S1, S2
SERIES: dict[str, tuple[float, float, float, float]] = {
    "60": (4.1e-7, 1.7, 3.73e-3, 14.6),
    "62": (3.9e-7, 1.7, 3.23e-3, 36.5),
    "63": (3.7e-7, 1.7, 2.84e-3, 92.8),
}

K_Z = 3.1  # geometry constant of single row deep groove ball bearings (same source, table 4)

# Suffixes of rubbing seals; a shield (Z, 2Z) does not rub.
_CONTACT_SEAL = re.compile(r"RS|RSH|RSL|LLU|DDU", re.IGNORECASE)


Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
Range = tuple[float, float]

REFERENCE_TORQUE = 100.0  # N*m at the output, for which the ranges of these effects are declared
SCALED = ("torque-zero-error", "zero-drift")


class Gear(Settings):
    """Geometry of the worm and its wheel."""

    z_worm: Annotated[int, Field(ge=1)]
    z_wheel: Annotated[int, Field(ge=2)]
    worm_pitch_diameter_mm: Positive
    wheel_pitch_diameter_mm: Positive
    lead_angle_deg: Annotated[float, Field(gt=0, lt=90)]
    normal_pressure_angle_deg: Annotated[float, Field(gt=0, lt=45)] = 20.0
    worm_width_mm: Positive
    wheel_width_mm: Positive
    worm_bearing_positions_mm: Range = (-31.0, 31.0)
    wheel_bearing_positions_mm: Range = (-31.0, 31.0)
    bearing_dead_load_N: Positive = 10.0

    @model_validator(mode="after")
    def _possible(self) -> Gear:
        # d1 tan(lead) = z1 m and d2 = z2 m for the same module m
        ratio = self.wheel_pitch_diameter_mm * self.z_worm / (self.z_wheel * self.worm_pitch_diameter_mm)
        closing = math.degrees(math.atan(ratio))
        if abs(closing - self.lead_angle_deg) > 0.1 * closing:
            raise ValueError(
                f"a lead angle near {closing:.2f} degrees, which the teeth and pitch diameters give "
                f"(the file says {self.lead_angle_deg})"
            )
        for shaft in ("worm", "wheel"):
            low, high = getattr(self, f"{shaft}_bearing_positions_mm")
            if not low < 0 < high:
                raise ValueError(
                    f"{shaft}_bearing_positions_mm of one bearing on each side of the mesh plane, "
                    f"the negative first (the file says [{low}, {high}])"
                )
        return self


class BearingEntry(Settings):
    """One or several equal bearings of a shaft, in the order of the positions."""

    designation: str
    shaft: Literal["worm", "wheel"]
    count: Annotated[int, Field(ge=1, le=2)] = 1
    locating: bool | None = None
    seal_torque_Nm: NotNegative | None = None
    oil_height_mm: NotNegative = 0.0
    drag_loss_factor: NotNegative = 0.0

    @property
    def size(self) -> str:
        """Size of the table that the designation means; what follows it (2Z, C3) does not change its constants."""
        return re.split(r"[\s\-/]", self.designation.strip(), maxsplit=1)[0]


class Oil(Settings):
    """Data sheet of the oil."""

    density_kg_m3: Positive
    viscosity_40C_mm2_s: Positive
    viscosity_100C_mm2_s: Positive
    volume_ml: Positive = 180.0
    vogel_constant_C: Annotated[float, Field(ge=60, le=273)] | None = None

    @model_validator(mode="after")
    def _thins_when_warm(self) -> Oil:
        if self.viscosity_100C_mm2_s >= self.viscosity_40C_mm2_s:
            raise ValueError(
                f"a viscosity at 100 degC below that at 40 degC (the file says "
                f"{self.viscosity_100C_mm2_s} and {self.viscosity_40C_mm2_s} mm²/s; are they exchanged?)"
            )
        return self


class Operation(Settings):
    """Conditions where a table has no column of them."""

    oil_temperature_C: Annotated[float, Field(gt=-50, lt=200)] = 60.0
    oil_level_percent: Positive = 100.0
    ambient_temperature_C: Annotated[float, Field(gt=-50, lt=100)] = 22.0
    idle_uncoupled: bool | None = None


class Uncertainty(Settings):
    """Standard uncertainties of instruments and settings; what is not given is not assumed."""

    torque_setting_percent: NotNegative | None = None
    speed_setting_percent: NotNegative | None = None
    oil_temperature_setting_K: NotNegative | None = None
    input_torque_Nm: NotNegative | None = None
    input_torque_percent: NotNegative | None = None
    input_torque_gain_percent: NotNegative | None = None
    input_torque_zero_Nm: NotNegative | None = None
    output_torque_Nm: NotNegative | None = None
    output_torque_percent: NotNegative | None = None
    output_torque_gain_percent: NotNegative | None = None
    output_torque_zero_Nm: NotNegative | None = None
    oil_temperature_K: NotNegative | None = None
    oil_temperature_reading_K: NotNegative | None = None
    speed_reading_rpm: NotNegative | None = None
    model_discrepancy_percent: NotNegative = 0.5


class Limits(Settings):
    """What the bench can run."""

    speed_rpm: Range = (300.0, 3000.0)
    output_torque_Nm: Range = (0.0, 100.0)
    oil_temperature_C: Range = (25.0, 80.0)
    oil_level_percent: Range | None = None

    @model_validator(mode="after")
    def _ordered(self) -> Limits:
        for name, span in self:
            if span is not None and not span[0] < span[1]:
                raise ValueError(f"{name} from low to high (the file says {list(span)})")
        return self


class Choice(Settings):
    """Which form of the base physics."""

    mesh: Literal["worm", "article"] = "worm"
    viscosity: Literal["vogel", "exponential"] = "vogel"


class Rig(Settings):
    """A worm-gear rig file."""

    gear: Gear
    bearing: tuple[BearingEntry, ...]
    oil: Oil
    operation: Operation = Operation()
    uncertainty: Uncertainty = Uncertainty()
    limits: Limits = Limits()
    model: Choice = Choice()


def read_rig(content: Mapping[str, Any]) -> Rig:
    """Check the parsed rig file.

    Raises
    ------
    RequestError
        Unknown key (the nearest is offered), missing key, impossible value, unknown bearing.
    """
    rig = parse(Rig, content, "the rig file")
    placed_bearings(rig)
    return rig


def placed_bearings(rig: Rig) -> list[BearingEntry]:
    """The four bearings, two of the worm's shaft, two of the wheel's, in the order of their positions; all is said.

    Examples
    --------
    >>> rig = parse(Rig, EXAMPLE_RIG, "the rig file")
    >>> [(bearing.size, bearing.locating) for bearing in placed_bearings(rig)]
    [('6009', True), ('6202', False), ('6211', True), ('6211', False)]
    """
    return [*_shaft(rig, "worm"), *_shaft(rig, "wheel")]


def _shaft(rig: Rig, shaft: str) -> list[BearingEntry]:
    entries = [entry for entry in rig.bearing for _ in range(entry.count) if entry.shaft == shaft]
    if len(entries) != 2:
        raise RequestError(
            f"the rig file: the {shaft} shaft has {len(entries)} bearings",
            expected="two",
            remedy=f'give [[bearing]] entries with shaft = "{shaft}" whose counts add up to 2',
        )
    for entry in entries:
        unknown = f"the bearing {entry.designation!r} is not in the table of deep groove ball bearings"
        require_known(entry.size, SIZES, unknown)
        if entry.seal_torque_Nm is None and _CONTACT_SEAL.search(entry.designation.strip()[4:]):
            raise RequestError(
                f"the rig file: the bearing {entry.designation!r} has rubbing seals",
                remedy="give their torque as seal_torque_Nm (SKF: K_S1 d_s^beta + K_S2), or 0 to neglect it",
            )
    # Two equal entries share the settings; the first of them locates the shaft.
    chosen = [i for i, entry in enumerate(entries) if entry.locating]
    free = [i for i, entry in enumerate(entries) if entry.locating is None]
    if not chosen and not free:
        raise RequestError(
            f"the rig file: no bearing of the {shaft} shaft takes the axial load",
            remedy="give one of them locating = true",
        )
    locating = chosen[0] if chosen else max(free, key=lambda i: SIZES[entries[i].size][2])
    return [
        entry.model_copy(update={"locating": i == locating, "seal_torque_Nm": entry.seal_torque_Nm or 0.0})
        for i, entry in enumerate(entries)
    ]


def defaults_used(settings: BaseModel, prefix: str = "") -> dict[str, Any]:
    """Dotted key and value of every default that the file left open; None is no assumption.

    Examples
    --------
    >>> defaults_used(Operation(oil_level_percent=80.0))
    {'oil_temperature_C': 60.0, 'ambient_temperature_C': 22.0}
    """
    found: dict[str, Any] = {}
    for name in type(settings).model_fields:
        value = getattr(settings, name)
        if isinstance(value, BaseModel):
            found |= defaults_used(value, f"{prefix}{name}.")
        elif name not in settings.model_fields_set and value is not None:
            found[prefix + name] = value
    return found


def scaled_to_torque(effects: Mapping[str, Effect], largest_torque: float) -> dict[str, Effect]:
    """Effects with the zero errors of both sensors on the scale of the bench.

    A sensor's zero is specified in percent of its full scale (VDI/VDE 2646), and the sensor chosen for the largest
    torque. `largest_torque` is the upper limit of the output torque, N*m.

    Examples
    --------
    >>> from specan.models.catalogue import effects_in
    >>> found = scaled_to_torque(effects_in("specan.worm_gear.model.effects"), 300.0)
    >>> found["torque-zero-error"].parameters["output"].max
    6.0
    """
    factor = largest_torque / REFERENCE_TORQUE

    def scaled(p: Parameter) -> Parameter:
        ends = {name: getattr(p, name) for name in ("default", "min", "max", "lower", "upper")}
        return replace(p, **{name: end * factor for name, end in ends.items() if end is not None})

    own = {
        name: replace(effects[name], parameters={n: scaled(p) for n, p in effects[name].parameters.items()})
        for name in SCALED
    }
    return {**effects, **own}


EXAMPLE_RIG = read_toml(Path(__file__).with_name("example.toml"))
