"""The bench: sets the conditions, lets the gear run, reads the instruments and writes the table."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from specan.errors import RequestError, nearest
from truth.worm_gear import plans, rig
from truth.worm_gear.balance import Balance, Conditions, Slots, solve
from truth.worm_gear.effects import EFFECTS, STREAMS
from truth.worm_gear.forms import Forms, draw_forms
from truth.worm_gear.forms import noise as drawn_noise
from truth.worm_gear.gear import RATIO, Array, Gear, draw

# What the set values are missed by, as standard deviations.
_BRAKE_PERCENT = 5.0
_DRIVE_PERCENT = 0.3
_HEATER_K = 0.7
# What no column tells and every new set-up changes: where the oil lies, how the flanks bed.
_UNSEEN_DRAG_PERCENT = 0.4
_UNSEEN_MESH_PERCENT = 0.1
# Resolution of the columns.
_STEPS = {
    "speed_rpm": 1.0,
    "output_torque_Nm": 0.01,
    "input_torque_Nm": 0.001,
    "efficiency": 0.0001,
    "oil_temperature_C": 0.1,
    "elapsed_time_s": 1.0,
}


@dataclass(frozen=True)
class Instruments:
    """Errors that all readings of one data set share."""

    input_gain: float = 0.0
    input_zero: float = 0.0
    output_gain: float = 0.0
    output_zero: float = 0.0
    temperature: float = 0.0


@dataclass(frozen=True)
class TruthCase:
    """A simulated data set and all that was hidden in it.

    Parameters
    ----------
    table : dict of str to array
        The measurement as a user would get it, by column; empty cells are NaN.
    noise_free : dict of str to array
        The same rows from ideal instruments at the conditions that really ran, without unseen scatter or rounding;
        hidden instrument errors are kept: they belong to the truth that is looked for.
    without_effects : array
        Input torque of `noise_free` had nothing been hidden, Nm.
    sigma_reading, sigma_setup : array
        Standard deviations of the input torque: of a reading (with its rounding), and of what a new set-up changes
        beyond the columns, Nm.
    rig : dict
        The rig file's content.
    effects : dict
        What was hidden, by name, with its strength.
    gear, instruments, conditions, balance
        The specimen, the shared instrument errors, the true conditions, the losses.
    seed, design : int, str
        How to make it again.
    """

    table: dict[str, Array]
    noise_free: dict[str, Array]
    without_effects: Array
    sigma_reading: Array
    sigma_setup: Array
    rig: dict[str, Any]
    effects: dict[str, float]
    gear: Gear
    instruments: Instruments
    conditions: Conditions
    balance: Balance
    seed: int
    design: str


def _streams(seed: int, effects: Mapping[str, float]) -> dict[str, np.random.Generator]:
    """Independent generators per purpose: hiding an effect changes neither gear nor noise."""
    streams = {
        purpose: np.random.default_rng([seed, number])
        for number, purpose in enumerate(
            ("gear", "order", "setting", "unseen", "reading", "instruments", "forms", "plan")
        )
    }
    streams |= {name: np.random.default_rng([seed, STREAMS[name]]) for name in effects}
    return streams


def _install(effects: Mapping[str, float], streams: dict[str, np.random.Generator]) -> Slots:
    slots = Slots()
    for name, strength in effects.items():
        EFFECTS[name].install(slots, strength, streams[name])
    return slots


def _run_at(settings: plans.Settings, plan: plans.Plan, rng: np.random.Generator) -> Conditions:
    """True conditions of every row: those of one set-up are shared by its readings."""
    index = settings.setup.astype(int) - 1
    draws = rng.standard_normal((3, index.max() + 1))[:, index]
    if plan.setting == "exact":
        draws = np.zeros_like(draws)
    return Conditions(
        speed_rpm=settings.speed * (1.0 + _DRIVE_PERCENT / 100.0 * draws[0]),
        output_torque=settings.torque * (1.0 + _BRAKE_PERCENT / 100.0 * draws[1]),
        oil_temperature=settings.temperature + _HEATER_K * draws[2],
        oil_level=settings.level,
        elapsed_time=settings.elapsed_time,
        dwell=settings.dwell,
    )


def _draw_instruments(uncertainty: dict[str, float], rng: np.random.Generator) -> Instruments:
    draws = rng.standard_normal(5)
    return Instruments(
        input_gain=uncertainty["input_torque_gain_percent"] / 100.0 * draws[0],
        input_zero=uncertainty["input_torque_zero_Nm"] * draws[1],
        output_gain=uncertainty["output_torque_gain_percent"] / 100.0 * draws[2],
        output_zero=uncertainty["output_torque_zero_Nm"] * draws[3],
        temperature=uncertainty["oil_temperature_K"] * draws[4],
    )


def _rounded(values: Array, step: float) -> Array:
    return np.round(np.round(values / step) * step, 6)


def _ideal(conditions: Conditions, balance: Balance, slots: Slots) -> dict[str, Array]:
    """Input torque and temperature as faultless readings of instruments with the hidden errors."""
    torque, temperature = balance.input_torque.copy(), conditions.oil_temperature.copy()
    for error in slots.indicated_torque:
        torque = torque + error(balance.state, balance.input_torque)
    for bias in slots.indicated_temperature:
        temperature = temperature + bias(balance.state)
    return {"input_torque_Nm": torque, "oil_temperature_C": temperature}


def _columns(
    settings: plans.Settings,
    plan: plans.Plan,
    speed: Array,
    output: Array,
    ideal: dict[str, Array],
) -> dict[str, Array]:
    """The table's columns, unrounded."""
    columns = {
        "speed_rpm": speed,
        "output_torque_Nm": output,
        "input_torque_Nm": ideal["input_torque_Nm"],
        "efficiency": np.where(settings.torque > 0.0, output / RATIO / ideal["input_torque_Nm"], np.nan),
        "oil_temperature_C": ideal["oil_temperature_C"],
        "oil_level_percent": settings.level,
        "repeat": settings.repeat,
    }
    if plan.readings > 1:
        columns["setup"] = settings.setup
    if plan.time:
        columns["elapsed_time_s"] = settings.elapsed_time
    return columns


def _printed(columns: dict[str, Array], settings: plans.Settings) -> dict[str, Array]:
    """Printed values: efficiencies in steps of 0.01 at set conditions, input torque only where there is no load."""
    idle = settings.torque == 0.0
    return {
        "speed_rpm": settings.speed,
        "output_torque_Nm": settings.torque,
        "input_torque_Nm": np.where(idle, _rounded(columns["input_torque_Nm"], 0.01), np.nan),
        "efficiency": _rounded(columns["efficiency"], 0.01),
    }


def _check(effects: Mapping[str, float], design: str) -> None:
    for name, strength in effects.items():
        if name not in EFFECTS:
            raise RequestError(f"no effect {name!r} can be hidden", remedy=nearest(name, EFFECTS))
        if not np.isfinite(strength):
            raise RequestError(f"the strength of {name} is {strength}", expected="a finite number")
    if design not in plans.PLANS:
        raise RequestError(f"there is no test plan {design!r}", remedy=nearest(design, plans.PLANS))


def _reading_noise(uncertainty: dict[str, float], torque: Array, percent: float | None) -> Array:
    """Standard deviation of every reading; one in percent is not told in the rig file."""
    if percent is None:
        return np.full(torque.size, uncertainty["input_torque_Nm"])
    uncertainty.pop("input_torque_Nm")
    return percent / 100.0 * torque


def simulate(
    seed: int,
    effects: Mapping[str, float] | None = None,
    design: str = "grid",
    noise_percent: float | None = None,
    drawn: bool = False,
) -> TruthCase:
    """Run a worm gear with hidden effects on the bench.

    Parameters
    ----------
    seed : int
        Draws specimen, noise and the open shapes of the effects; the same seed gives the same bits. Specimen and
        noise do not depend on what is hidden.
    effects : mapping of str to float, optional
        Names in :data:`EFFECTS` and their strengths; none for a healthy gear.
    design : str
        Name of a test plan in :data:`PLANS`.
    noise_percent : float, optional
        Standard deviation of a reading of the input torque in percent of it, instead of the rig's in Nm; the rig file
        then says nothing of it, so that repeats have to tell.
    drawn : bool
        Draw a published form of every part (`forms`) and the grid of the plan, instead of this simulator's own.

    Returns
    -------
    TruthCase

    Raises
    ------
    RequestError
        For an unknown effect or plan.

    Examples
    --------
    >>> case = simulate(7, {"windage": 8.0})
    >>> case.table["input_torque_Nm"].size
    180
    """
    hidden = dict(effects or {})
    _check(hidden, design)
    plan = plans.PLANS[design]
    streams = _streams(seed, hidden)
    gear = draw(streams["gear"])
    forms = draw_forms(streams["forms"]) if drawn else Forms()
    plan = plans.draw_grid(plan, streams["plan"]) if drawn else plan
    settings = plans.lay_out(plan, streams["order"])
    conditions = _run_at(settings, plan, streams["setting"])
    slots = _install(hidden, streams)
    balance = solve(gear, conditions, slots, forms)
    ideal = _ideal(conditions, balance, slots)
    content = copy.deepcopy(rig.RIG)
    instruments = _draw_instruments(content["uncertainty"], streams["instruments"])

    omega = 2.0 * np.pi * conditions.speed_rpm / 60.0
    setups = settings.setup.astype(int) - 1
    unseen = streams["unseen"].standard_normal((2, setups.max() + 1))[:, setups]
    parts = (
        _UNSEEN_DRAG_PERCENT / 100.0 * balance.drag / omega,
        _UNSEEN_MESH_PERCENT / 100.0 * balance.mesh / omega,
    )
    reading = _reading_noise(content["uncertainty"], ideal["input_torque_Nm"], noise_percent)
    if drawn:
        reading = np.hypot(reading, forms.reading / 100.0 * ideal["input_torque_Nm"])
        content["uncertainty"].pop("input_torque_Nm", None)  # of such noise only repeats tell
    steps = {**_STEPS, "input_torque_Nm": forms.step if drawn else _STEPS["input_torque_Nm"]}
    torque = ideal["input_torque_Nm"] + parts[0] * unseen[0] + parts[1] * unseen[1]
    shown = {
        "input_torque_Nm": torque * (1.0 + instruments.input_gain + forms.curvature / 1000.0 * torque)
        + instruments.input_zero
        + reading * drawn_noise(forms, streams["reading"], torque.size),
        "oil_temperature_C": ideal["oil_temperature_C"] + instruments.temperature,
    }
    output = conditions.output_torque * (1.0 + instruments.output_gain) + instruments.output_zero
    table = _columns(settings, plan, conditions.speed_rpm, output, shown)
    if plan.columns == "efficiency":
        table = _printed(table, settings)
    else:
        table = {name: _rounded(v, steps[name]) if name in steps else v for name, v in table.items()}
    return TruthCase(
        table=table,
        noise_free=_columns(settings, plan, conditions.speed_rpm, conditions.output_torque, ideal),
        without_effects=solve(gear, conditions, forms=forms).input_torque,
        sigma_reading=np.hypot(reading, steps["input_torque_Nm"] / np.sqrt(12.0)),
        sigma_setup=np.hypot(*parts),
        rig=content,
        effects=hidden,
        gear=gear,
        instruments=instruments,
        conditions=conditions,
        balance=balance,
        seed=seed,
        design=design,
    )


def _cell(name: str, value: float) -> str:
    if not np.isfinite(value):
        return ""
    if name in ("repeat", "setup"):
        return str(int(value))
    return f"{value:.6f}".rstrip("0").rstrip(".")


def write(case: TruthCase, directory: Path | str, *, noise_free: bool = False) -> tuple[Path, Path]:
    """Write ``measurement.csv`` and ``rig.toml``; nothing in them tells what was hidden.

    Parameters
    ----------
    case : TruthCase
        What to write.
    directory : path
        Made if it is not there.
    noise_free : bool
        Write the noise-free table instead, with more digits than any instrument has.

    Returns
    -------
    measurement, rig : Path
    """
    folder = Path(directory)
    folder.mkdir(parents=True, exist_ok=True)
    table = case.noise_free if noise_free else case.table
    names = list(table)
    rows = [",".join(names)]
    for values in zip(*table.values()):
        rows.append(
            ",".join(
                (f"{v:.12g}" if np.isfinite(v) else "") if noise_free else _cell(n, v)
                for n, v in zip(names, values)
            )
        )
    measurement, rig_file = folder / "measurement.csv", folder / "rig.toml"
    measurement.write_text("\n".join(rows) + "\n", encoding="utf-8", newline="\n")
    rig_file.write_text(rig.as_toml(case.rig), encoding="utf-8", newline="\n")
    return measurement, rig_file
