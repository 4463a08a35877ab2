"""A check that the author of an effect runs on it; every built-in effect passes it in the tests."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import permutations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.errors import RequestError
from specan.models.effect import Effect, Use
from specan.models.model import Assembly, Model


def check_effect(
    effect: Effect,
    model: Model,
    conditions: Mapping[str, NDArray[np.float64]],
    *,
    with_effects: Sequence[str] = (),
    at: str = "",
    observable: str | None = None,
) -> None:
    """Check that an effect keeps the rules that every effect keeps.

    Neutral values leave every quantity exactly as it is; effects commute to the last bit; results are
    finite over the validity range and have the shape of what they change; a scalar gives what an array
    gives; *planted, it is found*: the amplitude is recovered from noise-free data by least squares.

    Parameters
    ----------
    effect : Effect
        What to check.
    model : Model
        The model that it belongs to.
    conditions : mapping
        SI conditions to check at; arrays of one length. An effect that looks at readings before wants its
        first row to be the earliest.
    with_effects : sequence of str
        Uses that are switched on beside it; the model's base effects by default.
    at : str
        Element of its axis, where it acts at one.
    observable : str, optional
        Observable to check the recovery in; the model's first by default.

    Raises
    ------
    RequestError
        Names the first rule that is broken.
    """
    model = model.with_effect(effect)
    base = model.assemble(with_effects or [u for u in model.base_effects if Use.parse(u).name != effect.name])
    use = Use(effect.name, at or (model.axes[effect.at][0] if effect.at else ""))
    active = model.assemble([*base.uses, use])
    _check_neutral(use, base, active, conditions)
    _check_order(active, conditions)
    _check_values(use, base, active, conditions)
    _check_scalar(use, active, conditions)
    _check_recovery(use, base, active, conditions, observable)


def conditions_over_limits(model: Model, points: int = 4) -> dict[str, NDArray[np.float64]]:
    """Conditions all over what the rig can run, in random order one a quarter of an hour, for `check_effect`.

    Raises
    ------
    RequestError
        The model's rig declares no limits.
    """
    limits = model.rig.limits
    if not limits:
        raise RequestError(
            f"the rig of {model.name} has no limits to check over", remedy="call check_effect from Python"
        )
    axes = np.meshgrid(*(np.linspace(low, high, points) for low, high in limits.values()), indexing="ij")
    order = np.random.default_rng(0).permutation(axes[0].size)
    found: dict[str, NDArray[np.float64]] = {
        name: np.asarray(axis.ravel()[order], dtype=np.float64)
        for name, axis in zip(limits, axes, strict=True)
    }
    unknown = [c.name for c in model.conditions.values() if c.default is not None and not c.known]
    found |= {name: np.asarray(900.0 * np.arange(order.size), dtype=np.float64) for name in unknown}
    return found


def _fail(use: Use, what: str, remedy: str = "") -> None:
    raise RequestError(f"the effect {str(use)!r} {what}", remedy=remedy)


def _check_neutral(use: Use, base: Assembly, active: Assembly, conditions: Mapping[str, Any]) -> None:
    neutral = {name: value for name, value in active.neutral.items() if name.startswith(f"{use}.")}
    without, with_it = base.evaluate(conditions), active.evaluate(conditions, neutral)
    for name in base.model.quantities:
        if base.model.quantities[name].collection or base.model.quantities[name].opaque:
            continue
        if not np.allclose(without[name], with_it[name], rtol=1e-12, atol=0, equal_nan=True):
            _fail(use, f"changes {name} though it is neutral", "correct neutral= or the equation")


def _check_order(active: Assembly, conditions: Mapping[str, Any]) -> None:
    reference = active.evaluate(conditions)
    for order in list(permutations(active.uses))[1:7]:
        again = active.model.assemble(order).evaluate(conditions)
        for name in active.model.quantities:
            if active.model.quantities[name].opaque or active.model.quantities[name].collection:
                continue
            if not np.array_equal(np.asarray(reference[name]), np.asarray(again[name]), equal_nan=True):
                raise RequestError(f"the order of effects changes {name}", remedy="report this: it must not")


def _check_values(use: Use, base: Assembly, active: Assembly, conditions: Mapping[str, Any]) -> None:
    without, with_it = base.evaluate(conditions), active.evaluate(conditions)
    effect = active.model.effects[use.name]
    changed = False
    for name in active.model.quantities:
        if base.model.quantities[name].collection:
            changed |= len(without[name]) != len(with_it[name])
            continue
        if base.model.quantities[name].opaque:
            continue
        old, new = np.asarray(without[name]), np.asarray(with_it[name])
        was = ~np.isfinite(old) if old.shape == new.shape else False  # a length may depend on what is there
        if not np.all(np.isfinite(new) | was):
            _fail(use, f"makes {name} not finite", "limit valid= or correct the equation")
        if name in effect.changes and old.ndim and new.shape != old.shape:
            _fail(use, f"gives {name} the shape {new.shape} where it had {old.shape}")
        changed |= not np.array_equal(old, new, equal_nan=True)
    if not changed:
        _fail(use, "changes nothing at its default values", "give a default that is not neutral")


def _check_scalar(use: Use, active: Assembly, conditions: Mapping[str, Any]) -> None:
    whole = active.evaluate(conditions)
    arrays = {n: np.asarray(v) for n, v in conditions.items() if np.ndim(v) == 1}
    if not arrays or len({a.size for a in arrays.values()}) > 1:
        return
    one = active.evaluate({**conditions, **{n: a[:1] for n, a in arrays.items()}})
    for observable in active.model.observables.values():
        first, single = np.asarray(whole[observable.quantity]), np.asarray(one[observable.quantity])
        if first.ndim == 1 and not np.allclose(first[:1], single, rtol=1e-9, atol=0):
            _fail(use, f"gives another {observable.quantity} for one row than for many")


def _check_recovery(
    use: Use, base: Assembly, active: Assembly, conditions: Mapping[str, Any], observable: str | None
) -> None:
    """Plant the effect at its default, fit its amplitudes from neutral, and want them back."""
    from scipy.optimize import least_squares

    model = active.model
    node = model.observables[observable or next(iter(model.observables))].quantity
    effect = model.effects[use.name]
    names = [n for n in effect.neutral if not effect.parameters[n].per]
    truth = active.evaluate(conditions, wanted=[node])[node]
    start_values = base.evaluate(conditions, wanted=[node])[node]
    if np.array_equal(truth, start_values):
        return  # its trace lies in another observable; the registry test names which
    size = np.array([effect.parameters[n].si.default - effect.neutral_si[n] for n in names])
    if not names or np.any(size == 0):
        _fail(use, "has a default that is neutral", "give a default inside the plausible range")
    scale = float(np.max(np.abs(truth - start_values)))

    def misfit(steps: NDArray[np.float64]) -> NDArray[np.float64]:
        values = {
            f"{use}.{n}": effect.neutral_si[n] + s * w for n, s, w in zip(names, steps, size, strict=True)
        }
        gap = np.ravel((active.evaluate(conditions, values, wanted=[node])[node] - truth) / scale)
        return np.concatenate([gap.real, gap.imag]) if np.iscomplexobj(gap) else gap

    found = least_squares(misfit, np.full(len(names), 0.3), x_scale=1.0, xtol=1e-14, ftol=1e-14, gtol=1e-14)
    if np.sqrt(np.mean(found.fun**2)) > 1e-5:
        _fail(
            use,
            f"is not found again when planted (steps {found.x}, expected 1)",
            "give it one amplitude a trace",
        )
