"""From a rig file to the worm-gear model; and the rules that the columns of its tables follow."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from specan.arrays import Flags, Real
from specan.models.catalogue import effects_in
from specan.models.model import Model, Nuisance, Words
from specan.models.quantity import (
    Completed,
    Condition,
    Observable,
    RigStatement,
    SettingError,
    TableFault,
    TableRules,
    rig_statement,
)
from specan.worm_gear.model.bearings import bearing_quantities
from specan.worm_gear.model.power import IDLE, QUANTITIES, article_quantities, constants, viscosity
from specan.worm_gear.model.rig import (
    Operation,
    Rig,
    defaults_used,
    placed_bearings,
    read_rig,
    scaled_to_torque,
)

BASE_EFFECTS = ("bearing-friction", "churning", "tooth-friction")
OTHER_FORMS = {
    "bearing-friction": ("palmgren-bearings", "iso-bearings"),
    "churning": ("exponential-churning",),
}

# key of [uncertainty], in the unit of the parameter: effect and parameter that it holds
CERTIFICATES = {
    "input_torque_zero_Nm": ("torque-zero-error", "input"),
    "output_torque_zero_Nm": ("torque-zero-error", "output"),
    "input_torque_gain_percent": ("torque-gain-error", "input"),
    "output_torque_gain_percent": ("torque-gain-error", "output"),
    "oil_temperature_K": ("temperature-bias", "bias"),
}


def build(rig: Mapping[str, Any]) -> Model:
    """Build the model of a worm gear.

    Parameters
    ----------
    rig : mapping
        The parsed rig file.

    Raises
    ------
    RequestError
        The rig file has an unknown key, lacks one, or says something impossible.
    """
    settings = read_rig(rig)
    ratio = settings.gear.z_wheel / settings.gear.z_worm
    bearings = placed_bearings(settings)
    quantities = [
        *constants(settings),
        viscosity(settings.oil, settings.model),
        *bearing_quantities(bearings, settings.gear),
        *QUANTITIES,
    ]
    if settings.model.mesh == "article":
        quantities += article_quantities(settings)  # of the same names, and later ones win
    conditions = _conditions(settings.operation)
    largest = max(map(abs, settings.limits.output_torque_Nm))
    idle_below = IDLE * largest if settings.operation.idle_uncoupled else 0.0
    return Model(
        name="worm-gear",
        title="Worm gear: losses in steady operation",
        conditions=conditions,
        quantities={quantity.name: quantity for quantity in quantities},
        effects=scaled_to_torque(effects_in("specan.worm_gear.model.effects"), largest),
        observables={o.name: o for o in OBSERVABLES},
        base_effects=BASE_EFFECTS,
        other_forms=OTHER_FORMS,
        nuisances=_nuisances(settings),
        axes={"bearing": tuple(f"{b.shaft} {i % 2 + 1}: {b.size}" for i, b in enumerate(bearings))},
        rig=_rig_statement(settings, conditions),
        words=WORDS,
        table_rules=TableRules(
            partial(
                complete,
                ratio=ratio,
                ambient=settings.operation.ambient_temperature_C,
                idle_below=idle_below,
            ),
            {OUT: frozenset({IN, ETA})},
        ),
        settings={"rig": settings.model_dump()},
        law="power_loss",
    )


def _conditions(operation: Operation) -> dict[str, Condition]:
    listed = [
        Condition(
            "worm_speed", "rad/s", "Speed of the worm shaft.", "speed_rpm", "rpm",
            usual_setting=SettingError(relative=0.01),
        ),
        Condition(
            "indicated_output_torque", "N*m", "Torque that the output sensor indicates.",
            "output_torque_Nm", "N*m", usual_setting=SettingError(relative=0.05), idles="coupled",
        ),
        Condition(
            "indicated_oil_temperature", "K", "Temperature that the sensor in the oil sump indicates.",
            OIL, "degC", operation.oil_temperature_C,
            usual_setting=SettingError(absolute=1.5),
        ),
        Condition(
            "oil_level", "1", "Oil level over the standard one.", "oil_level_percent", "percent",
            operation.oil_level_percent,
        ),
        Condition(
            "ambient_temperature", "K", "Temperature of the room.", "ambient_temperature_C", "degC",
            operation.ambient_temperature_C, varies=False,
            usual_setting=SettingError(absolute=1.5),
        ),
        Condition(
            "coupled", "1", "Whether the brake was coupled to the output: 1, or 0 in runs without it.", "coupled", "1",
            1.0, varies=False, usual_setting=SettingError(absolute=0.1),
        ),
        Condition(
            "elapsed_time", "s", "Time since the first reading.", "elapsed_time_s", "s", float("nan"),
        ),
    ]  # fmt: skip
    return {condition.name: condition for condition in listed}


WORDS = Words(
    ideal="the ideal machine",
    discrepancy_of="losses",
    remedy_uncertainty="input_torque_Nm = 0.005",
    vary="speeds, torques or temperatures",
)
OBSERVABLES = (
    Observable("input_torque", "indicated_input_torque", "N*m", "Torque at the input shaft; what is fitted."),
    Observable(
        "efficiency", "indicated_efficiency", "1", "Power out over power in.", reading_of="input_torque"
    ),
    Observable("power_loss", "indicated_power_loss", "W", "Power in less power out."),
)


def _nuisances(rig: Rig) -> tuple[Nuisance, ...]:
    """Instrument errors that the rig file gives a certificate of."""
    held = ((getattr(rig.uncertainty, key), key, *of) for key, of in CERTIFICATES.items())
    return tuple(Nuisance(effect, name, sd, f"[uncertainty] {key}") for sd, key, effect, name in held if sd)


# key of [uncertainty]: the same by the columns of tables
BY_COLUMN = {
    "torque_setting_percent": "output_torque_Nm_setting_percent",
    "speed_setting_percent": "speed_rpm_setting_percent",
    "oil_temperature_setting_K": "oil_temperature_C_setting",
    "input_torque_Nm": "input_torque_Nm",
    "input_torque_percent": "input_torque_Nm_percent",
    "output_torque_Nm": "output_torque_Nm",
    "output_torque_percent": "output_torque_Nm_percent",
    "oil_temperature_reading_K": "oil_temperature_C",
    "speed_reading_rpm": "speed_rpm",
    "model_discrepancy_percent": "model_discrepancy_percent",
}


def _rig_statement(rig: Rig, conditions: Mapping[str, Condition]) -> RigStatement:
    """Limits and uncertainties of the bench, SI."""
    given = rig.uncertainty.model_dump(exclude_none=True)
    content = {
        "limits": rig.limits.model_dump(exclude_none=True),
        "uncertainty": {column: given[key] for key, column in BY_COLUMN.items() if key in given},
    }
    stated = rig_statement(content, conditions.values(), OBSERVABLES)
    return replace(stated, defaults_used=defaults_used(rig))


Columns = Mapping[str, Real]


IN, OUT, ETA, LOSS = "input_torque_Nm", "output_torque_Nm", "efficiency", "power_loss_W"
SPEED = "speed_rpm"
OIL = "oil_temperature_C"
AS_WARM_K = 2.0  # a loaded gear's oil is warmer than the room by more


def complete(
    columns: Columns, steps: Mapping[str, float], ratio: float, ambient: float, idle_below: float = 0.0
) -> Completed:
    """Input torque, output torque and efficiency of every row, as far as two of them give the third.

    Columns that follow from the others are checked against them and used once: where the input torque
    is given, the efficiency says nothing more.

    Parameters
    ----------
    columns : mapping
        ``{header: array (rows,)}`` of the table.
    steps : mapping
        ``{header: step in which it is printed}``.
    ratio : float
        Speed of the input shaft over that of the output shaft.
    ambient : float
        Temperature of the room, degrees Celsius.
    idle_below : float
        Output torque below which the rig file says that the brake is uncoupled.

    Raises
    ------
    TableFault
        Fewer than two of the three, efficiency in percent or above one, columns that contradict each
        other, speeds that cannot be.
    """
    size = next(iter(columns.values())).size
    empty = np.full(size, np.nan)
    found = {name: columns.get(name, empty).copy() for name in (IN, OUT, ETA)}
    torque_in, torque_out, eta = found.values()
    printed = {name: np.full(size, steps.get(name, 0.0)) for name in found}
    _check_efficiency(eta)
    speed = columns.get(SPEED, np.ones(1))
    turning = "a speed above zero; a standing gear has no efficiency"
    _refuse(~(speed > 0), "the speed is {:g} rpm", speed, expected=turning, remedy="leave such rows out")
    few = np.isfinite(np.stack([*found.values()])).sum(axis=0) < 2
    _refuse(few, f"fewer than two of {IN}, {OUT} and {ETA}", expected="any two of them in every row")
    notes, doubts = [], []
    derived = np.isnan(torque_out)
    if np.any(derived):
        torque_out[derived] = ratio * (eta * torque_in)[derived]
        printed[OUT][derived] = (ratio * torque_in * printed[ETA])[derived]
        notes.append(f"{OUT} is worked out from {ETA} and {IN} in {derived.sum()} rows")
    idle = np.isnan(torque_in) & ~(torque_out > 0)
    unspoken = "without load efficiency is not defined"
    _refuse(idle, unspoken, expected=f"{IN} where the output torque is zero")
    _check_torques(torque_in, torque_out, ratio)
    _check_idle(torque_out, idle_below)
    both = np.isfinite(torque_in) & np.isfinite(eta) & ~derived
    _check_agreement(found, ratio, printed, both)
    if np.any(both):
        notes.append(f"{ETA} follows from the torques in {both.sum()} rows (checked) and is used once")
    oil = columns.get(OIL, empty)
    if np.all(np.abs(oil - ambient) < AS_WARM_K):
        doubts.append(
            f"{OIL} is {oil.min():.4g} to {oil.max():.4g} in every row, as warm as the room ([operation] "
            f"ambient_temperature_C = {ambient:g}): check that the thermometer is in the oil"
        )
    with np.errstate(invalid="ignore"):  # an efficiency of zero measures nothing
        found[ETA] = np.where((eta > 0) & np.isnan(torque_in), eta, np.nan)
    return Completed(found | ({LOSS: empty} if LOSS in columns else {}), printed, tuple(notes), tuple(doubts))


def _refuse(rows: Flags, found: str, *values: Real, expected: str, remedy: str = "") -> None:
    """Refuse rows, if there are any; `found` says what one of them has, its numbers are out of the `values`."""
    if np.any(rows):
        first = int(np.argmax(rows))
        said = found.format(*(np.broadcast_to(column, rows.shape)[first] for column in values))
        raise TableFault(said, rows=rows, expected=expected, remedy=remedy)


def _check_efficiency(eta: Real) -> None:
    given = eta[np.isfinite(eta)]
    if given.size and np.median(given) > 1.5 and np.all(given <= 100):
        raise TableFault(
            f"the column {ETA!r} goes up to {given.max():g}, it seems to be in percent",
            expected="a fraction between 0 and 1",
            remedy="divide it by 100",
        )
    with np.errstate(invalid="ignore"):
        _refuse((eta > 1) | (eta < 0), "efficiency {:g}", eta, expected="a value between 0 and 1")


def _check_torques(torque_in: Real, torque_out: Real, ratio: float) -> None:
    with np.errstate(invalid="ignore", divide="ignore"):
        driving, braking = torque_in <= 0, torque_out < -_idle_reading(torque_out)
        found = torque_out / ratio / torque_in
    expected = "a driving torque above zero"
    _refuse(driving, "the input torque is {:g} Nm", torque_in, expected=expected)
    expected = "the torque of the brake counted positive"
    _refuse(braking, "the output torque is {:g} Nm", torque_out, expected=expected)
    impossible = found > 1.02
    exchanged = "are the two torque columns exchanged, or in other units?"
    _refuse(
        impossible,
        f"{{:g}} Nm come out for {{:g}} Nm at a ratio of {ratio:g}, an efficiency of {{:.2f}}",
        torque_out, torque_in, found,
        expected="an efficiency of at most 1",
        remedy=exchanged if np.mean(impossible) > 0.5 else "correct the row",
    )  # fmt: skip


def _check_idle(torque_out: Real, below: float) -> None:
    """Refuse loads that would be taken for the reading of an uncoupled brake, which is the same in all idle rows."""
    idle, size = torque_out <= below, np.abs(torque_out)
    if not below or not np.any(idle):
        return
    least_load = np.min(torque_out[~idle], initial=np.inf)
    _refuse(
        idle & ((torque_out > np.min(torque_out[idle]) + 0.2 * below) | (size > 0.5 * least_load)),
        f"the output torque of {{:g}} Nm is below {below:g} Nm, a twentieth of the [limits], and would count as idle "
        "(idle_uncoupled)",
        torque_out,
        expected="idle rows whose torque sensor reads alike, and loads well above",
        remedy="mark idle rows by 0 in a column 'coupled', and remove idle_uncoupled",
    )


def _idle_reading(torque_out: Real) -> float:
    """Largest output torque, of either sign, that may be read without load."""
    return IDLE * float(np.nanmax(np.abs(torque_out))) + 1e-12


def _check_agreement(given: Columns, ratio: float, steps: Columns, rows: Flags) -> None:
    torque_in, torque_out, eta = (given[name] for name in (IN, OUT, ETA))
    with np.errstate(invalid="ignore", divide="ignore"):
        expected = torque_out / (ratio * torque_in)
        rounding = steps[OUT] / (ratio * torque_in) + np.abs(expected) * steps[IN] / torque_in + steps[ETA]
        # The torque of an idle brake reads a little off zero, to either side; the efficiency is written as zero then.
        idle = (eta == 0) & (np.abs(torque_out) <= _idle_reading(torque_out))
        bad = rows & ~idle & (np.abs(eta - expected) > 0.01 * np.abs(expected) + rounding)
    contradiction = "the columns contradict each other (efficiency {:g}, but the torques give {:.3f}"
    _refuse(
        bad, f"{contradiction} at a ratio of {ratio:g})", eta, expected, expected="columns that agree",
        remedy="correct the rows, or the teeth in the rig file, or leave one of the columns out",
    )  # fmt: skip
