"""What can be hidden in the simulated gear: catalogue effects in another dress, and effects of no catalogue.

A strength is a physical size in the unit given. The shapes that a strength leaves open (an exponent, a time
constant) are drawn per data set, in the ranges stated, so that no candidate can fit them by habit.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from truth.worm_gear.balance import Slots, State
from truth.worm_gear.gear import (
    AMBIENT,
    REFERENCE_SPEED,
    REFERENCE_VISCOSITY,
    Array,
)

_REFERENCE_TORQUE = 40.0


@dataclass(frozen=True)
class HiddenEffect:
    """An effect that the bench can hide.

    Parameters
    ----------
    name : str
        What a simulation is asked for.
    candidate : str or None
        Name of the effect in the catalogue; None for an effect outside it.
    unit : str
        Of the strength.
    low, high : float
        Smallest and largest strength that a real gear would show.
    install : callable
        ``install(slots, strength, rng)`` puts it into the gear.
    signature : str
        The trace of the added power over torque, speed and viscosity.
    needs : str
        What the plan must have for it to leave a trace: "elapsed_time", "idle", "temperatures", or nothing.
    """

    name: str
    candidate: str | None
    unit: str
    low: float
    high: float
    install: Callable[[Slots, float, np.random.Generator], None]
    signature: str
    needs: str = ""


def _speed(state: State) -> Array:
    return state.conditions.speed_rpm / REFERENCE_SPEED


def _omega(state: State) -> Array:
    return 2.0 * np.pi * state.conditions.speed_rpm / 60.0


def _torque_from_power(
    power_at_reference: float, shape: Callable[[State], Array]
) -> Callable[[State], Array]:
    return lambda state: power_at_reference * shape(state) / _omega(state)


def _sigmoid(x: Array) -> Array:
    return 0.5 * (1.0 + np.tanh(0.5 * x))


def _seal_drag(slots: Slots, strength: float, rng: np.random.Generator) -> None:
    # A lip on its meniscus: the torque hardly moves with speed.
    exponent = rng.uniform(-0.06, 0.06)
    slots.torque.append(lambda s: strength * _speed(s) ** exponent)


def _windage(slots: Slots, strength: float, rng: np.random.Generator) -> None:
    # Free discs and fans in air, turbulent: the moment coefficient falls with Reynolds number^0 .. 0.3.
    exponent = rng.uniform(2.7, 3.0)
    slots.torque.append(_torque_from_power(strength, lambda s: _speed(s) ** exponent))


def _speed_dependent_friction(slots: Slots, strength: float, rng: np.random.Generator) -> None:
    # The film lifts off late: a rational decay of the boundary share instead of an exponential.
    lift_off = rng.uniform(0.6, 1.5)
    slots.friction_added.append(lambda s: strength / (1.0 + (s.sliding_speed / lift_off) ** 1.5))


def _viscosity_dependent_friction(slots: Slots, strength: float, rng: np.random.Generator) -> None:
    # Film thickness saturates with viscosity; the local exponent is -strength at the reference viscosity.
    def factor(s: State) -> Array:
        x = s.viscosity / REFERENCE_VISCOSITY
        return (((1.0 + x) / 2.0) ** (-2.0 * strength))[:, None]

    slots.friction_factor.append(factor)


def _load_dependent_friction(slots: Slots, strength: float, rng: np.random.Generator) -> None:
    # A power law with an offset force: friction stays finite where the load vanishes.
    offset = rng.uniform(2.0, 8.0)  # N at a mean point of the contact
    reference = _REFERENCE_TORQUE / 0.045 / 14.0

    def factor(s: State) -> Array:
        mean = np.mean(np.abs(s.local_force), axis=1, keepdims=True)
        return ((1.0 + mean / offset) / (1.0 + reference / offset)) ** strength

    slots.friction_factor.append(factor)


def _oil_heating(slots: Slots, strength: float, rng: np.random.Generator) -> None:
    # Thermal balance of the oil in the gaps: a conductance that grows with the flow the speed makes.
    exponent = rng.uniform(0.0, 0.2)
    slots.film_temperature.append(lambda s: strength * s.loss / _speed(s) ** exponent)


def _bearing_preload(slots: Slots, strength: float, rng: np.random.Generator) -> None:
    # Thermal growth takes up clearance from ambient on; contact stiffness bends the line. Slope is strength at 58 degC.
    exponent = rng.uniform(1.05, 1.2)
    span = 58.0 - AMBIENT
    scale = strength * span / exponent
    slots.torque.append(
        lambda s: scale * (np.maximum(s.conditions.oil_temperature - AMBIENT, 0.0) / span) ** exponent
    )


def _inlet_shear_heating(slots: Slots, strength: float, rng: np.random.Generator) -> None:
    # Thermal loading of the bearings' inlet zone, viscosity x speed squared, as a rational reduction. The catalogue's
    # bearings lose 8 % of their rolling torque at the reference speed and viscosity.
    slots.rolling_factor.append(
        lambda s: 1.0 / (1.0 + strength * (s.viscosity / REFERENCE_VISCOSITY * _speed(s) ** 2) ** 0.64)
    )


def _starvation(slots: Slots, strength: float, rng: np.random.Generator) -> None:
    # The ball tracks do not refill in time; less oil in the sump, sooner. Splash lubrication takes 12 to 23 % of the
    # rolling torque at the reference.
    exponent = rng.uniform(1.2, 1.5)

    def factor(s: State) -> Array:
        demand = s.viscosity / REFERENCE_VISCOSITY * _speed(s) * 100.0 / s.conditions.oil_level
        return 1.0 / (1.0 + strength * demand**exponent)

    slots.rolling_factor.append(factor)


def _running_in(slots: Slots, strength: float, rng: np.random.Generator) -> None:
    # Flanks polish themselves: a rational instead of an exponential approach.
    constant = 3600.0 * rng.uniform(3.0, 8.0)
    slots.friction_factor.append(
        lambda s: (1.0 + strength / (1.0 + s.conditions.elapsed_time / constant) ** 2)[:, None]
    )


def _thermal_lag(slots: Slots, strength: float, rng: np.random.Generator) -> None:
    # Housing and oil in the gaps follow the sump thermometer with one time constant, through the campaign's order.
    def behind(s: State) -> Array:
        c = s.conditions
        order = np.argsort(c.elapsed_time, kind="stable")
        body = c.oil_temperature[order[0]]
        rise = np.zeros_like(c.oil_temperature)
        for i in order:
            body = c.oil_temperature[i] + (body - c.oil_temperature[i]) * np.exp(
                -c.dwell[i] / (60.0 * strength)
            )
            rise[i] = body - c.oil_temperature[i]
        return rise

    slots.film_temperature.append(behind)


def _idle_lag(slots: Slots, strength: float, rng: np.random.Generator) -> None:
    # Idle runs are done first: the gaps have not yet the temperature that the sump thermometer shows.
    slots.film_temperature.append(lambda s: np.where(s.conditions.output_torque < 1.0, -strength, 0.0))


def _torque_zero(slots: Slots, strength: float, rng: np.random.Generator) -> None:
    slots.indicated_torque.append(lambda s, torque: np.full_like(torque, strength))


def _torque_gain(slots: Slots, strength: float, rng: np.random.Generator) -> None:
    # A sensor whose slope has aged; a trace of curvature belongs to it.
    curvature = rng.uniform(-0.1, 0.1)
    slots.indicated_torque.append(
        lambda s, torque: strength / 100.0 * torque * (1.0 + curvature * torque / 10.0)
    )


def _temperature_bias(slots: Slots, strength: float, rng: np.random.Generator) -> None:
    # Heat flows along the stem of the thermometer: the error grows with the distance from ambient.
    slots.indicated_temperature.append(
        lambda s: strength * (s.conditions.oil_temperature - AMBIENT) / (58.0 - AMBIENT)
    )


def _shear_thinning(slots: Slots, strength: float, rng: np.random.Generator) -> None:
    # Eyring: the oil yields where the shear stress passes its characteristic stress; strength is the viscosity lost
    # at 1500 rpm and the reference viscosity.
    grid = np.linspace(1e-4, 30.0, 30001)
    reference = np.interp(strength, np.append(0.0, 1.0 - np.arcsinh(grid) / grid), np.append(0.0, grid))

    def factor(s: State) -> Array:
        stress = np.maximum(reference * s.viscosity / REFERENCE_VISCOSITY * _speed(s), 1e-9)
        return np.arcsinh(stress) / stress

    slots.sheared_viscosity.append(factor)


def _mesh_pocketing(slots: Slots, strength: float, rng: np.random.Generator) -> None:
    # Oil thrown out of the closing tooth spaces: kinetic energy, with a share that meets the housing.
    share = rng.uniform(0.0, 0.15)
    slots.torque.append(
        _torque_from_power(strength, lambda s: _speed(s) ** 2 * (1.0 + share * _speed(s)) / (1.0 + share))
    )


def _axial_preload(slots: Slots, strength: float, rng: np.random.Generator) -> None:
    # A wave spring gives way as the housing warms: its force falls by up to a tenth over 50 K.
    fall = rng.uniform(0.0, 0.1)
    slots.thrust.append(
        lambda s: strength * (1.0 - fall * (s.conditions.oil_temperature - AMBIENT - 25.0) / 50.0)
    )


def _mesh_starvation(slots: Slots, strength: float, rng: np.random.Generator) -> None:
    # Oil that is thrown off: SKF's replenishment of rolling bearings, a film that cannot grow past what is supplied, or
    # flanks that run dry from a speed on. Strength is the friction added at 5 m/s and the reference viscosity.
    form, onset = rng.integers(3), rng.uniform(1.0, 3.0)
    power, sharpness = rng.uniform(1.0, 1.5), rng.uniform(1.5, 4.0)

    def dry(s: State, sliding: Array, viscosity: Array) -> Array:
        if form == 0:
            return 1.0 - np.exp(-viscosity * sliding / (2.0 * onset))
        if form == 1:
            full = (viscosity * sliding / (2.0 * onset)) ** 0.7
            return 1.0 - (1.0 + full**sharpness) ** (-1.0 / sharpness)
        return np.maximum(sliding - onset, 0.0) ** power * np.ones_like(viscosity)

    def added(s: State) -> Array:
        viscosity = (s.viscosity / REFERENCE_VISCOSITY)[:, None]
        return strength * dry(s, s.sliding_speed, viscosity) / dry(s, np.array(5.0), np.array(1.0))

    slots.friction_added.append(added)


def _misalignment(slots: Slots, strength: float, rng: np.random.Generator) -> None:
    # The housing twists and the wheel runs on its edge above a torque; Nm at the worm at 80 Nm.
    threshold = rng.uniform(25.0, 40.0)
    width = 3.0

    def torque(s: State) -> Array:
        def bend(t: Array) -> Array:
            return width * np.logaddexp(0.0, (t - threshold) / width)

        return strength * bend(s.conditions.output_torque) / bend(np.array(80.0))

    slots.torque.append(torque)


def _belt_slip(slots: Slots, strength: float, rng: np.random.Generator) -> None:
    # A belt between the torque sensor and the worm creeps, then slips: Nm at 80 Nm output.
    scale = rng.uniform(14.0, 20.0)
    slots.torque.append(lambda s: strength * np.exp((s.conditions.output_torque - 80.0) / scale))


def _speed_bump(slots: Slots, strength: float, rng: np.random.Generator) -> None:
    # A torsional resonance of the coupling passes through the speed range: W at its top.
    centre, width = rng.uniform(1500.0, 2100.0), rng.uniform(150.0, 300.0)
    slots.torque.append(
        _torque_from_power(strength, lambda s: 1.0 / (1.0 + ((s.conditions.speed_rpm - centre) / width) ** 2))
    )


def _quadratic_friction(slots: Slots, strength: float, rng: np.random.Generator) -> None:
    # A thrust collar that comes to bear with the axial load squared: Nm at 40 Nm.
    slots.torque.append(lambda s: strength * (s.conditions.output_torque / _REFERENCE_TORQUE) ** 2)


def _foaming(slots: Slots, strength: float, rng: np.random.Generator) -> None:
    # Above a speed the oil takes up air: drag rises by this share, the more the warmer (the air comes in more easily).
    onset = rng.uniform(1700.0, 2000.0)

    def factor(s: State) -> Array:
        warm = np.maximum(s.conditions.oil_temperature - 30.0, 0.0) / 30.0
        return 1.0 + strength * _sigmoid((s.conditions.speed_rpm - onset) / 60.0) * warm**1.5

    slots.drag_factor.append(factor)


def _swelling(slots: Slots, strength: float, rng: np.random.Generator) -> None:
    # A polymer cage swells above a temperature and rubs: Nm.
    threshold = rng.uniform(63.0, 68.0)
    slots.torque.append(lambda s: strength * _sigmoid((s.conditions.oil_temperature - threshold) / 1.5))


def _coupling_hysteresis(slots: Slots, strength: float, rng: np.random.Generator) -> None:
    # An offset elastomer coupling works once a turn and hardens with torque and speed: W at 40 Nm, 1500 rpm.
    slots.torque.append(
        _torque_from_power(
            strength, lambda s: s.conditions.output_torque / _REFERENCE_TORQUE * _speed(s) ** 2.5
        )
    )


# name, catalogue name (None: outside it), unit, smallest and largest strength, what installs it, trace in the added
# power over torque T, speed n and viscosity nu, what the plan must have for a trace to be left.
_TABLE: tuple[tuple[Any, ...], ...] = (
    ("seal-drag", "seal-drag", "Nm", 0.02, 0.5, _seal_drag, "T^0 n^1 nu^0"),
    ("windage", "windage", "W", 0.5, 20.0, _windage, "T^0 n^2.7..3 nu^0"),
    ("speed-dependent-friction", "speed-dependent-friction", "1", 0.002, 0.05, _speed_dependent_friction,
     "T^1, grows more slowly than n^1"),
    ("viscosity-dependent-friction", "viscosity-dependent-friction", "1", 0.02, 0.3, _viscosity_dependent_friction,
     "T^1 n^1 nu^-s about the reference viscosity", "temperatures"),
    ("load-dependent-friction", "load-dependent-friction", "1", -0.2, 0.3, _load_dependent_friction, "T^(1+a) n^1"),
    ("oil-heating", "oil-heating", "K/W", 0.005, 0.1, _oil_heating, "less viscous loss at high T n"),
    ("bearing-preload", "bearing-preload", "Nm/K", 0.001, 0.02, _bearing_preload,
     "T^0 n^1, linear in temperature", "temperatures"),
    ("inlet-shear-heating", "inlet-shear-heating", "1", 0.04, 0.12, _inlet_shear_heating,
     "less rolling in the bearings at high n and nu"),
    ("starvation", "starvation", "1", 0.1, 0.3, _starvation, "less rolling in the bearings at high n nu"),
    ("running-in", "running-in", "1", 0.03, 0.4, _running_in, "T^1 n^1, ordered in time", "elapsed_time"),
    ("thermal-lag", "thermal-lag", "min", 3.0, 30.0, _thermal_lag, "hysteresis in the order", "elapsed_time"),
    ("idle-lag", "thermal-lag", "K", 1.0, 15.0, _idle_lag, "idle and loaded runs differ", "idle"),
    ("torque-zero-error", "torque-zero-error", "Nm", 0.02, 0.1, _torque_zero, "T^0 n^1 nu^0"),
    ("torque-gain-error", "torque-gain-error", "percent", 0.1, 0.5, _torque_gain, "T^1 n^1"),
    ("temperature-bias", "temperature-bias", "K", 0.5, 2.0, _temperature_bias, "scales every nu term", "temperatures"),
    ("shear-thinning", "shear-thinning", "1", 0.02, 0.5, _shear_thinning, "less nu loss at high n, low temperature"),
    ("mesh-pocketing", "mesh-pocketing", "W", 0.5, 20.0, _mesh_pocketing, "T^0 n^2 nu^0"),
    ("axial-preload", "axial-preload", "N", 50.0, 2000.0, _axial_preload, "more rolling and sliding at light load"),
    ("mesh-starvation", "mesh-starvation", "1", 0.003, 0.05, _mesh_starvation, "T^1, grows faster than n^1"),
    ("misalignment", None, "Nm", 0.05, 0.8, _misalignment, "T above a threshold"),
    ("belt-slip", None, "Nm", 0.05, 0.8, _belt_slip, "exponential in T"),
    ("speed-bump", None, "W", 2.0, 40.0, _speed_bump, "a peak over n"),
    ("quadratic-friction", None, "Nm", 0.02, 0.3, _quadratic_friction, "T^2 n^1"),
    ("foaming", None, "1", 0.03, 0.6, _foaming, "drag steps up at a speed, more so when warm"),
    ("swelling", None, "Nm", 0.02, 0.3, _swelling, "a step over temperature", "temperatures"),
    ("coupling-hysteresis", None, "W", 1.0, 20.0, _coupling_hysteresis, "T^1 n^2.5"),
)  # fmt: skip

EFFECTS: dict[str, HiddenEffect] = {row[0]: HiddenEffect(*row) for row in _TABLE}
# Numbers of the effects' random streams. Cases hang on them: what came later has the later numbers.
_LATER = ("axial-preload", "mesh-starvation")
STREAMS = {name: 100 + k for k, name in enumerate([*sorted(set(EFFECTS) - set(_LATER)), *_LATER])}
