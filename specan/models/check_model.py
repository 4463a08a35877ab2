"""A check of a whole model: what a study rests on, and what no measurement within the limits could ever tell."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from specan.errors import RequestError
from specan.models.check import check_effect, conditions_over_limits
from specan.models.effect import Effect, ParameterName, Use
from specan.models.from_function import place_of
from specan.models.model import Assembly, Model
from specan.models.trial import check_units, try_assembly, try_model

Array = NDArray[np.float64]
Conditions = Mapping[str, Array]

MOST_ROWS = 400  # of the plan that stands for every measurement within the limits
MOST_POINTS = 100  # of one condition over its limits
SMALLEST = 1e-3  # of the largest value of a condition: the smallest but zero
DRAWS = 3  # places in the ranges of the parameters at which they are asked for
STEP = 1e-4  # of a parameter's range: central differences are right to 1e-8 there
# Share of a column below which nothing but rounding is left: differences are right to some 1e-8, see STEP.
ROUNDING = 1e-6
SEEN = 0.3  # share of a null direction from which a parameter belongs to it
NEAR = 0.3  # share of a trace, left by linear combination, below which an effect is fitted to it


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


def check_model(model: Model, progress: Callable[[str], None] | None = None) -> ModelReport:
    """Hold a whole model to its promises, over the limits of its conditions.

    Parameters
    ----------
    model : Model
        One whose measurements are tables.
    progress : callable, optional
        Told what is being checked.

    Raises
    ------
    RequestError
        The first promise that is broken, with file and line: units that contradict each other, values that are not
        finite, a parameter that no measurement within the limits determines, an effect that breaks a rule of
        `specan.models.check.check_effect`.
    """
    say = progress or (lambda text: None)
    lacking = without_limits(model)
    if lacking:
        raise RequestError(
            f"the condition {lacking[0]!r} has no limits to check over",
            remedy="say from where to where it can be set",
        )
    conditions = _plan(model)
    say("the base over the limits")
    try_model(model, conditions)
    started = time.perf_counter()
    base = model.assemble(model.base_effects)
    base.evaluate(conditions)
    seconds = time.perf_counter() - started
    notes = check_units(model, conditions)
    say("its parameters")
    free = base.free(tuple(conditions))
    _check_identifiable(base, free, conditions)
    passed = []
    for name, effect in model.effects.items():
        say(name)
        try:
            use = Use(name, model.axes[effect.at][0] if effect.at else "")
            active = model.assemble({*base.uses, use})
            try_assembly(active, conditions)
            check_effect(effect, model, conditions)
            own = [n for n in active.free(tuple(conditions)) if n.startswith(f"{use}.")]
            _check_identifiable(active, own, conditions)
        except RequestError as fault:
            raise _told_of(effect, fault) from None
        passed.append(name)
    say("effects that no measurement could distinguish")
    alike, hidden = _indistinguishable(model, base, free, conditions)
    return ModelReport(
        len(next(iter(conditions.values()))), seconds, free, tuple(passed), alike, hidden, notes
    )


def without_limits(model: Model) -> list[str]:
    """Conditions that a table must hold and that have no limits: nothing can be checked over them."""
    limits = model.rig.limits
    return [
        c.name
        for c in model.conditions.values()
        if c.default is None and c.name not in limits and not c.group
    ]


def _told_of(effect: Effect, fault: RequestError) -> RequestError:
    """The error with the effect's line where it names none of the effect: the base alone has no such fault."""
    where = place_of(effect.function)
    if where in fault.found or f"{effect.name!r} fails" in fault.found:
        return fault
    whose = "" if f"the effect {effect.name!r}" in fault.found else f"with the effect {effect.name!r}, "
    found = f"{where}: {whose}{fault.found}"
    return RequestError(found, expected=fault.expected, remedy=fault.remedy)


def _plan(model: Model) -> Conditions:
    """Conditions all over the limits, denser where they are small: what acts at low speed only is met too."""
    conditions = conditions_over_limits(model, 2)
    each = max(2, min(MOST_POINTS, int(MOST_ROWS ** (1 / len(model.rig.limits)))))
    axes = []
    for low, high in model.rig.limits.values():
        even = np.linspace(low, high, (each + 1) // 2)
        sizes = max(abs(low), abs(high)) * np.geomspace(SMALLEST, 1.0, 4 * each)
        small = np.concatenate([-sizes, sizes])
        small = np.sort(small[(small > low) & (small < high)])
        picked = (
            small[np.linspace(0, small.size - 1, min(each // 2, small.size)).astype(int)]
            if small.size
            else small
        )
        axes.append(np.unique(np.concatenate([even, picked])))
    rows = [a.ravel() for a in np.meshgrid(*axes, indexing="ij")]
    order = np.random.default_rng(0).permutation(rows[0].size)
    plan = {n: np.asarray(r[order], dtype=np.float64) for n, r in zip(model.rig.limits, rows, strict=True)}
    others = [n for n in conditions if n not in plan]  # what the data may tell, one a quarter of an hour
    return {**plan, **{n: np.asarray(900.0 * np.arange(order.size), dtype=np.float64) for n in others}}


def _predict(assembly: Assembly, conditions: Conditions, values: Mapping[str, float]) -> Array:
    """All observables one behind the other, real and imaginary parts of complex ones."""
    nodes = [o.quantity for o in assembly.model.observables.values()]
    size = len(next(iter(conditions.values())))
    with np.errstate(all="ignore"):
        found = assembly.evaluate(conditions, values, wanted=nodes)
    parts = [np.broadcast_to(np.asarray(found[n]), (size,)) for n in nodes]
    return np.concatenate(
        [p for part in parts for p in ([part.real, part.imag] if part.dtype.kind == "c" else [part])]
    )


def _jacobian(
    assembly: Assembly, names: Sequence[str], conditions: Conditions, at: Mapping[str, float]
) -> Array:
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
    for _ in range(DRAWS - 1):
        place = dict(assembly.defaults)
        for name in names:
            si = assembly.parameters[name].si
            ends = (si.min, si.max) if np.isfinite(si.max - si.min) else (0.5 * si.default, 1.5 * si.default)
            place[name] = ends[0] + (ends[1] - ends[0]) * random.uniform(0.25, 0.75)
        places.append(place)
    return places


def _check_identifiable(base: Assembly, names: Sequence[str], conditions: Conditions) -> None:
    """Every free parameter has a trace of its own at some place in the ranges."""
    if not names:
        return
    undetermined: dict[str, tuple[str, ...]] = {}
    for turn, place in enumerate(_draws(base, names)):
        jacobian = _jacobian(base, names, conditions, place)
        if not np.all(np.isfinite(jacobian)):
            continue
        norms = np.linalg.norm(jacobian, axis=0)
        largest = float(np.max(np.abs(_predict(base, conditions, place))) or 1.0) * np.sqrt(len(jacobian))
        dead = norms <= ROUNDING * STEP * largest
        _, sizes, rows = np.linalg.svd(jacobian / np.where(dead, 1.0, norms), full_matrices=True)
        sizes = np.pad(sizes, (0, len(names) - sizes.size))
        null = np.abs(rows[sizes <= ROUNDING * max(sizes[0], 1e-300)])
        members = {
            name: tuple(
                n for n, share in zip(names, null[np.argmax(null[:, k])], strict=True) if share > SEEN
            )
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
    model: Model, base: Assembly, free: Sequence[str], conditions: Conditions
) -> tuple[tuple[tuple[str, str], ...], tuple[str, ...]]:
    """Pairs of effects of which one does all that the other does, and effects that the base does itself."""
    traces = {}
    hidden = []
    tangent = _jacobian(base, free, conditions, base.defaults)
    plain = _predict(base, conditions, {})
    for name, effect in model.effects.items():
        if name in {use.name for use in base.uses} or effect.at:
            continue
        trace = _predict(model.assemble({*base.uses, Use(name)}), conditions, {}) - plain
        left = float(np.linalg.norm(_beyond(tangent, trace)))
        if left <= ROUNDING * float(np.linalg.norm(trace)):
            hidden.append(name)
        else:
            traces[name] = (trace, left)
    alike = []
    for one, other in combinations(traces, 2):
        if any(_imitates(model, base, free, conditions, plain + traces[a][0], b, traces[a][1])
               for a, b in ((one, other), (other, one))):  # fmt: skip
            alike.append((one, other))
    return tuple(alike), tuple(hidden)


def _beyond(columns: Array, values: Array) -> Array:
    """What a linear combination of columns leaves of some values."""
    if not columns.shape[1]:
        return values
    norms = np.linalg.norm(columns, axis=0)
    scaled = columns / np.where(norms > 0, norms, 1.0)
    return np.asarray(values - scaled @ np.linalg.lstsq(scaled, values, rcond=1e-10)[0])


def _imitates(
    model: Model, base: Assembly, free: Sequence[str], conditions: Conditions, truth: Array, name: str, size: float
) -> bool:  # fmt: skip
    """Whether the base with an effect gives some values, whatever its parameters then are."""
    from scipy.optimize import least_squares

    active = model.assemble({*base.uses, Use(name)})
    own = [n for n in active.free(tuple(conditions)) if n.startswith(f"{name}.")]
    names = [*free, *own]
    start = active.defaults
    with_it = _predict(active, conditions, {})
    columns = np.column_stack(
        [_jacobian(active, names, conditions, start), with_it - _predict(base, conditions, {})]
    )
    if np.linalg.norm(_beyond(columns, truth - with_it)) > NEAR * size:
        return False
    widths = np.array([_range(active, n) for n in names])
    centre = np.array([start[n] for n in names])

    def misfit(steps: Array) -> Array:
        values = dict(zip(names, centre + steps * widths, strict=True))
        gap = (_predict(active, conditions, values) - truth) / size
        return np.nan_to_num(gap, nan=1e6, posinf=1e6, neginf=-1e6)

    domain = np.array([[active.parameters[n].si.lower, active.parameters[n].si.upper] for n in names]).T
    bounds = tuple((end - centre) / widths for end in domain)
    found = least_squares(
        misfit, np.zeros(len(names)), bounds=bounds, xtol=1e-14, ftol=1e-14, gtol=1e-14, max_nfev=200
    )
    return float(np.linalg.norm(found.fun)) < 1e-5
