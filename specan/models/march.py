"""Integration of the rates of a model over a recording.

Rates, and the quantities and effects between them and the states, are written out as one function. With numba it is
compiled once for a model with all of its effects, those that are off being skipped; without, all sets of parameter
values march together, as columns. Quantities that no state moves are evaluated beforehand and taken as straight lines
between the samples.

Runge-Kutta's classical method, with as many steps a sample as its change on doubling them asks for. Where that takes
too many the system is stiff, and the L-stable Rosenbrock method of Shampine and Reichelt (1997, SIAM J. Sci. Comput.
18:1) marches instead.
"""

from __future__ import annotations

import inspect
import types
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.errors import RequestError
from specan.models.effect import ParameterName
from specan.models.loops import reached

Array = NDArray[np.float64]
Evaluator = Any  # an assembly: its module imports this one
UNSETTLED = False, 4  # method and steps at values at which nothing settles


class Program:
    """The rates of a model with some effects as one function ``rates(states, drives, parameters, on, out)``.

    Parameters
    ----------
    assembly : Evaluator
        The model with every effect that the function may have.
    switched : bool
        Whether each effect acts only where its element of `on` says so.
    """

    def __init__(self, assembly: Evaluator, switched: bool) -> None:
        self.assembly, self.switched = assembly, switched
        self.states = assembly.model.rates.states_of(assembly)
        self.moved = self._moved_by_states()
        self.uses = assembly.uses
        self.parameters: list[str] = []
        self.functions: dict[str, Callable[..., Any]] = {}
        self._lines: list[str] = []
        self.drives: list[str] = []
        self._write()

    def _moved_by_states(self) -> set[str]:
        """Quantities that depend on a state."""
        readers = defaultdict(list)
        for name, (base, acting) in self.assembly._calls.items():
            for call in (base, *(c for *_, c in acting)):
                for read in call.reads:
                    readers[read].append(name)
        return reached([n for n in self.states if readers[n]], readers) - set(self.states)

    def _write(self) -> None:
        order = [name for step in self.assembly._plan[0] for name in step]
        read = ["d" + name for name, state in self.states.items() if state.rate is None]
        read += [r for state in self.states.values() for r in state.reads]
        moved, inner = self.moved, reached(read, self.assembly._reads)
        if set(self.assembly._plan[1]) & moved & inner:
            raise RequestError(
                "the rates read each other in a circle within one instant",
                remedy="give one of the effects that close it a state of its own",
            )
        for name in order:
            if name in moved and name in inner:
                self._quantity(name)
        for k, (name, state) in enumerate(self.states.items()):
            if state.rate is None:
                self._lines.append(f"out[{k}] = {self._read('d' + name)}")
            else:
                use = next(u for u in self.uses if name in self.assembly.model.effects[u.name].states)
                own = {n: f"{use}.{n}" for n in self.assembly.model.effects[use.name].parameters}
                self._on(
                    use,
                    f"out[{k}] = {self._call(f'r{k}', state.rate, state.reads, own)}",
                    f"out[{k}] = 0.0",
                )

    def _quantity(self, name: str) -> None:
        base, acting = self.assembly._calls[name]
        self._lines.append(
            f"q_{name} = {self._call(f'f_{name}', base.function, base.reads, dict(base.parameters))}"
        )
        for sign in ("+", "*"):
            for k, (use, effect, call) in enumerate(acting):
                if (sign == "+") != (name in effect.adds_to):
                    continue
                said = self._call(
                    f"e_{name}_{sign == '+'}_{k}", call.function, call.reads, dict(call.parameters)
                )
                said += f"[{name!r}]" if len(effect.changes) > 1 else ""
                self._on(use, f"q_{name} = q_{name} {sign} {said}")

    def _on(self, use: Any, line: str, otherwise: str = "") -> None:
        if not self.switched:
            self._lines.append(line)
            return
        self._lines += [f"if on[{self.uses.index(use)}]:", f"    {line}"]
        self._lines += ["else:", f"    {otherwise}"] if otherwise else []

    def _read(self, name: str) -> str:
        names = list(self.states)
        if name in names:
            return f"s[{names.index(name)}]"
        if name in self.moved:
            return f"q_{name}"
        if name not in self.drives:
            self.drives.append(name)
        return f"d[{self.drives.index(name)}]"

    def _call(self, key: str, function: Any, reads: Sequence[str], own: Mapping[str, str]) -> str:
        """A call with everything by position."""
        plain = getattr(function, "function", function)
        waiting = list(reads)
        given = []
        for argument in inspect.signature(plain).parameters:
            if argument in own:
                if own[argument] not in self.parameters:
                    self.parameters.append(own[argument])
                given.append(f"p[{self.parameters.index(own[argument])}]")
            else:
                given.append(self._read(waiting.pop(0)))
        self.functions[key] = _by_position(plain)
        return f"{key}({', '.join(given)})"

    @cached_property
    def source(self) -> str:
        """The function as text."""
        return "def rates(s, d, p, on, out):\n    " + "\n    ".join(self._lines) + "\n"

    @property
    def identity(self) -> Any:
        """What the function is made of: its text, the code of the functions in it, and what they take from outside."""
        return self.source, tuple(_outside(f) for f in self.functions.values())

    @cached_property
    def marches(self) -> tuple[Any, Any]:
        """Runge-Kutta's method and the implicit one over all samples; with numba where effects are switched."""
        if not self.switched:
            return self._with(lambda function: function)
        if self.identity not in _COMPILED:
            made = self._with(_numba().njit(error_model="numpy"))
            n, d = len(self.states), len(self.drives)
            on = np.ones(len(self.uses), bool)
            made[0](np.arange(2.0), 1, np.ones((d, 2)), np.ones(len(self.parameters)), on, np.ones((n, 2)))
            _COMPILED[self.identity] = made
        return _COMPILED[self.identity]

    def _with(self, decorate: Callable[[Any], Any]) -> tuple[Any, Any]:
        space: dict[str, Any] = {name: decorate(f) for name, f in self.functions.items()}
        exec(self.source, space)
        return _marches(decorate(space["rates"]), decorate)


def _by_position(function: Any) -> Any:
    """The function with arguments by position only, without defaults."""
    code = getattr(function, "__code__", None)
    if code is None:
        return function
    total = code.co_argcount + code.co_kwonlyargcount
    code = code.replace(co_argcount=total, co_kwonlyargcount=0)
    return types.FunctionType(code, function.__globals__, function.__name__, None, function.__closure__)


def _outside(function: Any) -> Any:
    code = getattr(function, "__code__", None)
    if code is None:
        return id(function)
    taken = [function.__globals__.get(name) for name in code.co_names]
    taken += [cell.cell_contents for cell in function.__closure__ or ()]
    return code, tuple(v if isinstance(v, int | float | str) else id(v) for v in taken)


_COMPILED: dict[Any, tuple[Any, Any]] = {}  # by what was compiled: a model that is loaded again is the same


def _marches(rates: Any, decorate: Callable[[Any], Any]) -> tuple[Any, Any]:
    """Runge-Kutta's method and the implicit one over all samples."""
    between, moved = decorate(_between), decorate(_moved)
    implicit = _implicit(rates, between, moved, decorate(_solver(moved)))
    return decorate(_explicit(rates, between, moved)), decorate(implicit)


def _between(drives, i, part, d):
    for k in range(drives.shape[0]):
        d[k] = drives[k, i] + (drives[k, i + 1] - drives[k, i]) * part


def _moved(s, h, slope, y):
    for k in range(s.shape[0]):
        y[k] = s[k] + h * slope[k]


def _explicit(rates, between, moved):
    """Runge-Kutta's method."""

    def explicit(times, steps, drives, p, on, states):
        s, d = states[:, 0].copy(), drives[:, 0].copy()
        y, k1, k2, k3, k4 = s.copy(), s.copy(), s.copy(), s.copy(), s.copy()
        for i in range(times.size - 1):
            h = (times[i + 1] - times[i]) / steps
            for j in range(steps):
                between(drives, i, j / steps, d)
                rates(s, d, p, on, k1)
                between(drives, i, (j + 0.5) / steps, d)
                moved(s, 0.5 * h, k1, y)
                rates(y, d, p, on, k2)
                moved(s, 0.5 * h, k2, y)
                rates(y, d, p, on, k3)
                between(drives, i, (j + 1) / steps, d)
                moved(s, h, k3, y)
                rates(y, d, p, on, k4)
                for k in range(s.shape[0]):
                    s[k] = s[k] + h / 6 * (k1[k] + 2 * k2[k] + 2 * k3[k] + k4[k])
            moved(s, 0.0, s, states[:, i + 1])

    return explicit


def _solver(moved):
    """Gauss's elimination with pivots: numba takes seconds to compile that of LAPACK."""

    def solve(matrix, right, found):
        n, a = right.shape[0], matrix.copy()
        moved(right, 0.0, right, found)
        for k in range(n):
            best = k + np.argmax(np.abs(a[k:, k]))
            for j in range(n):
                a[k, j], a[best, j] = a[best, j], a[k, j]
            found[k], found[best] = found[best], found[k]
            for i in range(k + 1, n):
                share = a[i, k] / a[k, k]
                found[i] -= share * found[k]
                for j in range(k, n):
                    a[i, j] -= share * a[k, j]
        for i in range(n - 1, -1, -1):
            for j in range(i + 1, n):
                found[i] -= a[i, j] * found[j]
            found[i] /= a[i, i]

    return solve


def _implicit(rates, between, moved, solve):
    """The method of Rosenbrock."""

    def implicit(times, steps, drives, p, on, states):
        n, gamma = states.shape[0], 1 / (2 + np.sqrt(2.0))
        s, d = states[:, 0].copy(), drives[:, 0].copy()
        f0, f1, y, right, k1, k2 = s.copy(), s.copy(), s.copy(), s.copy(), s.copy(), s.copy()
        matrix = np.eye(n)
        for i in range(times.size - 1):
            h = (times[i + 1] - times[i]) / steps
            for j in range(steps):
                between(drives, i, j / steps, d)
                rates(s, d, p, on, f0)
                for k in range(n):
                    kept = s[k]
                    step = 1e-7 * max(abs(kept), abs(h * f0[k]), 1e-12)
                    s[k] = kept + step
                    rates(s, d, p, on, f1)
                    s[k] = kept
                    for m in range(n):
                        matrix[m, k] = (1.0 if m == k else 0.0) - gamma * h * (f1[m] - f0[m]) / step
                between(drives, i, (j + 0.01) / steps, d)
                rates(s, d, p, on, f1)
                for k in range(n):
                    right[k] = f0[k] + gamma * (f1[k] - f0[k]) / 0.01
                solve(matrix, right, k1)
                between(drives, i, (j + 0.5) / steps, d)
                moved(s, 0.5 * h, k1, y)
                rates(y, d, p, on, f1)
                moved(f1, -1.0, k1, right)
                solve(matrix, right, k2)
                for k in range(n):
                    s[k] = s[k] + h * (k1[k] + k2[k])
            moved(s, 0.0, s, states[:, i + 1])

    return implicit


def _numba() -> Any:
    try:
        import numba
    except ImportError:
        return None
    return numba


class Solver:
    """What marches a model: its compiled programs, and the method and steps that are enough.

    Both are found for the first parameter values asked for with some effects and kept: all predictions of a fit come
    by the same way, whose error is small against the noise.
    """

    def __init__(self, model: Any) -> None:
        self.model = model
        self._programs: dict[Any, Program | None] = {}
        self._steps: dict[Any, tuple[bool, int]] = {}

    def program(self, assembly: Evaluator) -> Program:
        """One for all effects of the model, or for these; without numba, or where that fails, as it stands."""
        everything = self.model.assemble([e.name for e in self.model.effects.values() if not e.at])
        for key in (everything, assembly):
            if not set(assembly.uses) <= set(key.uses):
                continue
            if key.uses not in self._programs:
                self._programs[key.uses] = _compile(key)
            found = self._programs[key.uses]
            if found is not None:
                return found
        return Program(assembly, switched=False)

    def march(
        self, assembly: Evaluator, times: Array, drives_of: Any, many: Sequence[Mapping[str, Any]]
    ) -> Array:
        """States over time for several sets of values, shape (states, times, sets)."""
        program = self.program(assembly)
        key = assembly.uses, times.size, float(times[-1] - times[0])
        known = self._steps.get(key)
        if known is None:  # of the effects at their defaults, whatever is asked for first
            usual = {n: v for n, v in many[0].items() if not ParameterName(n).owned_by(assembly.uses)}
            known = self._needed(program, self._marching(program, assembly, times, drives_of, [usual]))
            if known is not None:
                self._steps[key] = known
        return self._marching(program, assembly, times, drives_of, many)(*(known or UNSETTLED))

    def _marching(
        self,
        program: Program,
        assembly: Evaluator,
        times: Array,
        drives_of: Any,
        many: Sequence[Mapping[str, Any]],
    ) -> Callable[[bool, int], Array]:
        """What marches from one set of inputs, starts and parameter values, for a method and its steps a sample."""
        drives, starts = drives_of(program.drives, program.states, many)
        defaults = {**self.model.assemble(program.uses).defaults, **assembly.defaults}
        values = np.array([[float(v.get(n, defaults[n])) for v in many] for n in program.parameters])
        values = values.reshape(len(program.parameters), len(many))
        on = np.array([use in assembly.uses for use in program.uses], bool)

        def march(implicit: bool, steps: int) -> Array:
            found = np.empty((len(program.states), times.size, len(many)))
            found[:, 0] = starts
            way = program.marches[int(implicit)]
            with np.errstate(all="ignore"):
                if not program.switched and not implicit:  # all sets as columns
                    way(times, steps, drives, values, on, found)
                else:
                    for k in range(len(many)):
                        states, own, given = map(
                            np.ascontiguousarray, (found[:, :, k], values[:, k], drives[:, :, k])
                        )
                        way(times, steps, given, own, on, states)
                        found[:, :, k] = states
            found[~(np.abs(found) < 1e100)] = np.nan
            return found

        return march

    def _needed(self, program: Program, march: Callable[[bool, int], Array]) -> tuple[bool, int] | None:
        """Whether the implicit method is needed, and steps a sample; None where nothing settles at these values."""
        allowed = np.array([self.model.rates.tolerances.get(n, 0.0) for n in program.states])
        for implicit in (False, True):
            steps, last = 1, march(implicit, 1)[:, :, 0]
            excess = np.inf
            while steps < 16:  # a system for which Runge-Kutta needs more a sample is stiff
                found = march(implicit, 2 * steps)[:, :, 0]
                change, size = (np.sqrt(np.mean(part**2, axis=1)) for part in (found - last, found))
                # where no noise is declared, a thousandth of a state's RMS is a small change
                excess = np.max(change / (np.where(allowed > 0, allowed, 1e-3 * size) + 1e-300))
                if excess <= 1:
                    return implicit, steps
                steps, last = 2 * steps, found
            # ten times that still keeps Runge-Kutta's method: corners, and no stiffness, slow its convergence
            if excess <= 10.0:
                return implicit, steps // 2
        return None

    def method(self) -> str:
        """What marched, in words."""
        ways = {implicit for implicit, _ in self._steps.values()}
        most = max((steps for _, steps in self._steps.values()), default=1)
        name = "the implicit method of Rosenbrock (the model is stiff)" if True in ways else "Runge-Kutta"
        return f"{name}, up to {most} steps a sample"


def _compile(assembly: Evaluator) -> Program | None:
    numba = _numba()
    if numba is None:
        return None
    try:
        program = Program(assembly, switched=True)
        program.marches  # noqa: B018 - compiles
    except (RequestError, numba.errors.NumbaError, TypeError):
        return None
    return program
