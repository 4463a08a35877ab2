"""Checks of an effect and of a whole model: what a study rests on, what no measurement within the limits could tell."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import combinations

import numpy as np

from specan.arrays import Real
from specan.errors import RequestError
from specan.models.effect import Effect, ParameterName, Use
from specan.models.from_function import place_of
from specan.models.model import Assembly, Model
from specan.models.trial import check_units, try_model

Conditions = Mapping[str, Real]
# the base with an effect, its free parameters, what it predicts at their defaults, and what these change of that
_Linear = tuple[Assembly, list[str], Real, Real]

STEP = 1e-4  # of a parameter's range: central differences are right to 1e-8 there
# Share of a column below which nothing but rounding is left: differences are right to some 1e-8, see STEP.
ROUNDING = 1e-6
DETECTED = 4.0  # standard deviations of the noise: of an effect that ln of the evidence sees among thirty
SEEN = 0.3  # share of a null direction from which a parameter belongs to it


def check_effect(effect: Effect, model: Model, conditions: Conditions) -> None:
    """Check that an effect keeps the rules that every effect keeps.

    Neutral values leave every quantity exactly as it is; results are finite and have the shape of what they change;
    one row gives what it gives among many; *something measured determines each amplitude*: its derivative is no
    combination of the others.

    Parameters
    ----------
    effect : Effect
        What to check.
    model : Model
        The model that it belongs to; its base effects are switched on beside it.
    conditions : mapping
        SI conditions to check at; arrays of one length. An effect that looks at readings before wants its
        first row to be the earliest.

    Raises
    ------
    RequestError
        Names the first rule that is broken.
    """
    model = model.with_effect(effect)
    base = model.assemble(u for u in model.base_effects if Use.parse(u).name != effect.name)
    use = Use(effect.name, model.axes[effect.at][0] if effect.at else "")
    active = model.assemble([*base.uses, use])
    _check_values(use, base, active, conditions)
    _check_one_row(use, active, conditions)
    amplitudes = [n for n in effect.neutral if not (effect.parameters[n].per or effect.parameters[n].fixed)]
    _check_determined(active, [f"{use}.{n}" for n in amplitudes], conditions)


def _check_values(use: Use, base: Assembly, active: Assembly, conditions: Conditions) -> None:
    def fail(what: str, remedy: str = "") -> None:
        raise RequestError(f"the effect {str(use)!r} {what}", remedy=remedy)

    neutral = {name: value for name, value in active.neutral.items() if name.startswith(f"{use}.")}
    without, with_it = base.evaluate(conditions), active.evaluate(conditions)
    as_neutral = active.evaluate(conditions, neutral)
    changed = False
    for name, node in base.model.quantities.items():
        if node.collection:
            changed |= len(without[name]) != len(with_it[name])
        if not node.comparable:
            continue
        # each set of effects takes the steps that it needs
        close = 1e-3 * float(np.max(np.abs(without[name]))) if active.model.rates else 0.0
        if not np.allclose(without[name], as_neutral[name], rtol=1e-12, atol=close, equal_nan=True):
            fail(f"changes {name} though it is neutral", "correct neutral= or the equation")
        old, new = np.asarray(without[name]), np.asarray(with_it[name])
        was = ~np.isfinite(old) if old.shape == new.shape else False  # a length may depend on what is there
        if not np.all(np.isfinite(new) | was):
            fail(f"makes {name} not finite", "limit valid= or correct the equation")
        if name in active.model.effects[use.name].changes and old.ndim and new.shape != old.shape:
            fail(f"gives {name} the shape {new.shape} where it had {old.shape}")
        changed |= not np.array_equal(old, new, equal_nan=True)
    if not changed:
        fail("changes nothing at its default values", "give a default that is not neutral")


def _check_one_row(use: Use, active: Assembly, conditions: Conditions) -> None:
    arrays = {n: np.asarray(v) for n, v in conditions.items() if np.ndim(v) == 1}
    if not arrays or len({a.size for a in arrays.values()}) > 1:
        return
    whole = active.evaluate(conditions)
    one = active.evaluate({**conditions, **{n: a[:1] for n, a in arrays.items()}})
    for observable in active.model.observables.values():
        first, single = np.asarray(whole[observable.quantity]), np.asarray(one[observable.quantity])
        if first.ndim == 1 and not np.allclose(first[:1], single, rtol=1e-9, atol=0):
            raise RequestError(
                f"the effect {use} gives another {observable.quantity} for one row than for many"
            )


def conditions_over_limits(model: Model) -> dict[str, Real]:
    """Conditions all over what the rig can run, in random order one a quarter of an hour, for `check_effect`.

    All combinations of levels of those that have limits; those that are not known without a column as time goes on.

    Raises
    ------
    RequestError
        The model's rig declares no limits.
    """
    if not model.rig.limits:
        raise RequestError(
            f"the rig of {model.name} has no limits to check over", remedy="call check_effect from Python"
        )
    rows = [axis.ravel() for axis in np.meshgrid(*_dense_axes(model), indexing="ij")]
    order = np.random.default_rng(0).permutation(rows[0].size)
    unknown = [c.name for c in model.conditions.values() if c.default is not None and not c.known]
    return {
        **{name: np.asarray(row[order], float) for name, row in zip(model.rig.limits, rows, strict=True)},
        **{name: 900.0 * np.arange(order.size) for name in unknown},
    }


@dataclass(frozen=True)
class ModelReport:
    """What a whole model was found to be.

    Attributes
    ----------
    rows : int
        Places within the limits at which it was evaluated.
    seconds : float
        Time of one evaluation.
    parameters : tuple of str
        Parameters that some measurement within the limits determines: all that are free.
    effects : tuple of str
        Effects that keep the rules.
    alike : tuple of (str, str)
        Pairs of effects that no measurement within the limits separates.
    hidden : tuple of str
        Effects that the base's parameters imitate everywhere within the limits.
    notes : tuple of str
        What could not be checked.
    """

    rows: int
    seconds: float
    parameters: tuple[str, ...]
    effects: tuple[str, ...]
    alike: tuple[tuple[str, str], ...]
    hidden: tuple[str, ...]
    notes: tuple[str, ...]


def check_model(model: Model, recorded: Conditions | None = None) -> ModelReport:
    """Hold a whole model to its promises, over the limits of its conditions or over a recording.

    Parameters
    ----------
    model : Model
        Its measurements are tables; or it is one of rates, with the noise of its channels.
    recorded : mapping, optional
        SI conditions of a recording. Effects that its noise hides are then told, and values at the limits of parameters
        at which the states grow without bound.

    Raises
    ------
    RequestError
        The first promise that is broken, with file and line: units that contradict each other, values that are not
        finite, a parameter that no measurement within the limits determines, an effect that breaks a rule of
        `check_effect`.
    """
    lacking = without_limits(model)
    if lacking and recorded is None:
        raise RequestError(
            f"the condition {lacking[0]!r} has no limits to check over",
            remedy="give its lowest and highest value",
        )
    conditions = recorded or conditions_over_limits(model)
    base = model.assemble(model.base_effects)
    try_model(base, conditions)
    started = time.perf_counter()
    base.evaluate(conditions)
    seconds = time.perf_counter() - started
    notes = check_units(model, conditions)
    free = base.free(tuple(conditions))
    _check_determined(base, free, conditions)
    for name, effect in model.effects.items():
        try:
            use = Use(name, model.axes[effect.at][0] if effect.at else "")
            active = model.assemble({*base.uses, use})
            try_model(active, conditions)
            check_effect(effect, model, conditions)
            _check_determined(active, _own(active, use, conditions), conditions)
        except RequestError as fault:
            raise _told_of(effect, fault) from None
    alike, hidden = _indistinguishable(base, free, conditions)
    rows = len(next(iter(conditions.values())))
    notes += tuple(_running_away(model, conditions)) if recorded else ()
    return ModelReport(rows, seconds, free, tuple(model.effects), alike, hidden, notes)


def _running_away(model: Model, conditions: Conditions) -> Iterator[str]:
    """Ends of plausible ranges at which a prediction is not finite."""
    for names in ((), *((name,) for name, effect in model.effects.items() if not effect.at)):
        assembly = model.assemble({*model.base_effects, *names})
        for name in assembly.free(tuple(conditions)):
            if names and not ParameterName(name).owned_by(names):
                continue
            p = assembly.parameters[name]
            for end, value in ((p.min, p.si.min), (p.max, p.si.max)):
                if np.isfinite(value) and not np.all(
                    np.isfinite(_predict(assembly, conditions, {name: value}))
                ):
                    yield f"the states grow without bound with {name} at {end:g} {p.unit}, an end of its range"


def without_limits(model: Model) -> list[str]:
    """Conditions that a table must hold and that have no limits: nothing can be checked over them."""
    return [
        c.name
        for c in model.conditions.values()
        if c.default is None and c.name not in model.rig.limits and not c.group
    ]


def _told_of(effect: Effect, fault: RequestError) -> RequestError:
    """The error with the effect's line where it names none of the effect: the base alone has no such fault."""
    where = place_of(effect.function)
    if where in fault.found or f"{effect.name!r} fails" in fault.found:
        return fault
    whose = "" if f"the effect {effect.name!r}" in fault.found else f"with the effect {effect.name!r}, "
    found = f"{where}: {whose}{fault.found}"
    return RequestError(found, expected=fault.expected, remedy=fault.remedy)


def _dense_axes(model: Model) -> list[Real]:
    """Levels of each condition, denser where they are small: what acts at low speed only is met too."""
    # some 400 places stand for every measurement within the limits
    each = max(2, min(100, int(400 ** (1 / len(model.rig.limits)))))
    axes = []
    for low, high in model.rig.limits.values():
        # from a thousandth of the largest value: the smallest but zero
        sizes = max(abs(low), abs(high)) * np.geomspace(1e-3, 1.0, 4 * each)
        small = np.sort(np.concatenate([-sizes, sizes]))
        small = small[(small > low) & (small < high)]
        picked = np.linspace(0, small.size - 1, min(each // 2, small.size)).astype(int)
        axes.append(np.unique(np.concatenate([np.linspace(low, high, (each + 1) // 2), small[picked]])))
    return axes


def _own(assembly: Assembly, use: Use, conditions: Conditions) -> list[str]:
    return [n for n in assembly.free(tuple(conditions)) if n.startswith(f"{use}.")]


def _predict(assembly: Assembly, conditions: Conditions, values: Mapping[str, float]) -> Real:
    """All observables one behind the other, real and imaginary parts of complex ones; over the noise of channels."""
    model = assembly.model
    nodes = [o.quantity for o in model.observables.values()]
    size = max(np.size(values) for values in conditions.values())
    with np.errstate(all="ignore"):
        found = assembly.evaluate(conditions, values, wanted=nodes)
    parts = [np.ravel(found[n]) if np.ndim(found[n]) else np.full(size, found[n]) for n in nodes]
    if model.rates:
        parts = [p / model.rig.reading.get(n, 1.0) for n, p in zip(model.observables, parts, strict=True)]
    return np.concatenate([real for part in parts for real in (part.real, part.imag)])


def _jacobian(
    assembly: Assembly, names: Sequence[str], conditions: Conditions, at: Mapping[str, float]
) -> Real:
    """Derivatives by parameters in parts of their ranges, central differences."""
    columns = np.zeros((_predict(assembly, conditions, at).size, len(names)))
    for k, name in enumerate(names):
        step = STEP * _range(assembly, name)
        low, high = (_predict(assembly, conditions, {**at, name: at[name] + s * step}) for s in (-1, 1))
        columns[:, k] = (high - low) / (2 * STEP)
    return columns


def _range(assembly: Assembly, name: str) -> float:
    """Width of a parameter's plausible range, or its size where that has none."""
    si = assembly.parameters[name].si
    width = si.max - si.min
    return width if np.isfinite(width) and width > 0 else abs(si.default) or 1.0


def _draws(assembly: Assembly, names: Sequence[str]) -> list[dict[str, float]]:
    """The defaults, and places in the inner half of the plausible ranges."""
    random = np.random.default_rng(1)
    places = [dict(assembly.defaults)]
    for _ in range(2):
        place = dict(assembly.defaults)
        for name in names:
            si = assembly.parameters[name].si
            ends = (si.min, si.max) if np.isfinite(si.max - si.min) else (0.5 * si.default, 1.5 * si.default)
            place[name] = ends[0] + (ends[1] - ends[0]) * random.uniform(0.25, 0.75)
        places.append(place)
    return places


def _check_determined(base: Assembly, names: Sequence[str], conditions: Conditions) -> None:
    """Every one of some parameters has a trace of its own at some place in the ranges."""
    undetermined: dict[str, list[str]] = {}
    for turn, place in enumerate(_draws(base, names) if names else ()):
        jacobian = _jacobian(base, names, conditions, place)
        if not np.all(np.isfinite(jacobian)):
            continue
        norms = np.linalg.norm(jacobian, axis=0)
        largest = float(np.max(np.abs(_predict(base, conditions, place))) or 1.0) * np.sqrt(len(jacobian))
        dead = norms <= ROUNDING * STEP * largest
        few = len(jacobian) < len(names)
        _, sizes, rows = np.linalg.svd(jacobian / np.where(dead, 1.0, norms), full_matrices=few)
        sizes = np.pad(sizes, (0, len(names) - sizes.size))
        null = np.abs(rows[sizes <= ROUNDING * max(sizes[0], 1e-300)])
        members = {
            name: [n for n, share in zip(names, null[np.argmax(null[:, k])], strict=True) if share > SEEN]
            for k, name in enumerate(names)
            if null.size and np.max(null[:, k]) > SEEN
        }
        undetermined = members if turn == 0 else {n: m for n, m in undetermined.items() if n in members}
    for name, group in undetermined.items():
        owner = Use.parse(ParameterName(name).owner).name
        node = base.model.quantities.get(owner) or base.model.effects[owner]
        others = ", ".join(n for n in group if n != name)
        why = (
            f"; only together with {others} does it change anything" if others else ", which changes nothing"
        )
        raise RequestError(
            f"{place_of(node.function)}: no measurement within the limits determines the parameter {name}{why}",
            remedy="fix one of them (fixed=True or vary=False), or measure something more",
        )


def _indistinguishable(
    base: Assembly, free: Sequence[str], conditions: Conditions
) -> tuple[tuple[tuple[str, str], ...], tuple[str, ...]]:
    """Pairs of effects of which one does all that the other does, and effects that the base does itself."""
    model, traces, hidden = base.model, {}, []
    tangent = _jacobian(base, free, conditions, base.defaults)
    plain = _predict(base, conditions, {})
    unseen = DETECTED if model.rates else 0.0  # norm of a change that the noise of a recording hides
    for name, effect in model.effects.items():
        if name in {use.name for use in base.uses} or effect.at:
            continue
        trace = _predict(model.assemble({*base.uses, Use(name)}), conditions, {}) - plain
        left = float(np.linalg.norm(_beyond(tangent, trace)))
        if left <= max(ROUNDING * float(np.linalg.norm(trace)), unseen):
            hidden.append(name)
        else:
            traces[name] = (plain + trace, left)

    @cache
    def linear(name: str) -> _Linear:
        active = model.assemble({*base.uses, Use(name)})
        names = [*free, *_own(active, Use(name), conditions)]
        with_it = _predict(active, conditions, {})
        changes = _jacobian(active, names, conditions, active.defaults)
        return active, names, with_it, np.column_stack([changes, with_it - plain])

    alike = [
        (one, other)
        for one, other in combinations(traces, 2)
        if any(_imitates(linear(b), conditions, *traces[a]) for a, b in ((one, other), (other, one)))
    ]
    return tuple(alike), tuple(hidden)


def _beyond(columns: Real, values: Real) -> Real:
    """What a linear combination of columns leaves of some values."""
    if not columns.shape[1]:
        return values
    norms = np.linalg.norm(columns, axis=0)
    scaled = columns / np.where(norms > 0, norms, 1.0)
    return np.asarray(values - scaled @ np.linalg.lstsq(scaled, values, rcond=1e-10)[0])


def _imitates(effect: _Linear, conditions: Conditions, truth: Real, size: float) -> bool:
    """Whether the base with an effect gives some values, whatever its parameters then are."""
    from scipy.optimize import least_squares

    active, names, with_it, columns = effect
    if active.model.rates:
        return float(np.linalg.norm(_beyond(columns, truth - with_it))) < DETECTED
    # fitted only where linear combination leaves less than three tenths of the trace
    if np.linalg.norm(_beyond(columns, truth - with_it)) > 0.3 * size:
        return False
    widths = np.array([_range(active, n) for n in names])
    centre = np.array([active.defaults[n] for n in names])

    def misfit(steps: Real) -> Real:
        values = dict(zip(names, centre + steps * widths, strict=True))
        gap = (_predict(active, conditions, values) - truth) / size
        return np.nan_to_num(gap, nan=1e6, posinf=1e6, neginf=-1e6)

    domain = np.array([[active.parameters[n].si.lower, active.parameters[n].si.upper] for n in names]).T
    bounds = tuple((end - centre) / widths for end in domain)
    found = least_squares(
        misfit, np.zeros(len(names)), bounds=bounds, xtol=1e-14, ftol=1e-14, gtol=1e-14, max_nfev=200
    )
    return float(np.linalg.norm(found.fun)) < 1e-5
