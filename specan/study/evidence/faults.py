"""Faults of the data, as columns that the prediction may lack.

Each is a set of columns over the measured rows for one unit of a coefficient that is known beforehand to a deviation.
A reading may be off by a share of what the model predicts: a gain, or a zero of the same size in all rows. A condition
may not be what the table says: the prediction changes by its derivative. In which rows, and by how much, is summed
over. Samples of a recording may be spoilt by hum of the mains, and by values that were cut off.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial, reduce

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import betaln

from specan.arrays import Flags
from specan.dsp.clipping import SAME, is_cut_off
from specan.errors import ComputationError
from specan.models.effect import ParameterName, Use
from specan.models.quantity import Condition, direction
from specan.models.rates import TIME as OF_SAMPLES
from specan.result import first_of, gathered
from specan.study.data.setpoints import MOST_LEVELS, TIME, grouping_of, operating, round_step, slope_by
from specan.study.estimation.problem import Problem
from specan.study.evidence.marginal import FORMS, Marginal, Tangent
from specan.study.observation import Array
from specan.study.observation.table import TableObservation
from specan.study.observation.time import TimeObservation
from specan.units import convert, printed_unit, spoken

OFF_MAINS = 0.002  # of them, that grids leave their frequency by
MULTIPLES = 6

# Name, sentence, columns over all rows of a size of one, and ln of how many places were tried for them.
Spoilt = tuple[str, str, Array, float]


def spoilt(o: TimeObservation, off: Array) -> Iterator[Spoilt]:
    """What is looked for in the samples of each observable.

    Parameters
    ----------
    o : TimeObservation
    off : array, shape (n,)
        What a prediction leaves.
    """
    for name in o.chains:
        # Hz
        for mains in (50.0, 60.0):
            yield from _hum(o, name, off, mains)
        yield from _cut_off(o, name)


def _hum(o: TimeObservation, name: str, off: Array, mains: float) -> Iterator[Spoilt]:
    """Lines at multiples of the mains' frequency, which is the likeliest near the nominal one."""
    chains, time = o.chains[name], o.conditions[OF_SAMPLES]
    longest = max(chains, key=lambda rows: rows.size)
    length = float(np.ptp(time[longest]))
    count = int(min(0.45 * (longest.size - 1) / length // mains, MULTIPLES))
    if not count or length * mains < MULTIPLES:
        return
    steps = 2 * int(np.ceil(OFF_MAINS * mains * count * length)) + 1  # half a line of the highest multiple
    likeliest = mains * (1 + OFF_MAINS * np.linspace(-1, 1, steps))
    angle = 2j * np.pi * time[longest]
    power = [
        sum(abs(np.exp(k * f * angle) @ off[longest]) ** 2 for k in range(1, count + 1)) for f in likeliest
    ]
    f = likeliest[int(np.argmax(power))]
    turns = 2 * np.pi * f * time[:, None] * np.arange(1, count + 1)
    waves = np.hstack([np.cos(turns), np.sin(turns)])
    columns = np.hstack([waves * np.isin(np.arange(o.n), rows)[:, None] for rows in chains])
    text = f"there is mains hum in {name}, at {f:.4g} Hz and multiples"
    yield "hum", text, columns, float(np.log(steps))


def _cut_off(o: TimeObservation, name: str) -> Iterator[Spoilt]:
    """Samples on the largest or the least value, each rest there as the top of a parabola."""
    rows = np.concatenate(o.chains[name])
    span = float(np.ptp(o.measured[rows]))
    for sign, end in ((1, "largest"), (-1, "least")):
        samples = sign * o.measured[rows]
        top = float(samples.max())
        if not is_cut_off(samples, top, span):
            continue
        on = np.flatnonzero(samples >= top - SAME * span)
        rests = np.split(on, np.flatnonzero(np.diff(on) > 1) + 1)
        columns = np.zeros((o.n, len(rests)))
        for k, rest in enumerate(rests):
            columns[rows[rest], k] = 1 - np.linspace(-1, 1, rest.size + 2)[1:-1] ** 2
        text = f"{name} stays at its {end} value, {sign * top:.4g}, in {on.size} samples"
        yield "clipped samples", f"{text}: it is clipped there", columns, 0.0


def unspoilt(problem: Problem, theta: Array, residual: Array) -> Array:
    """A whitened residual of recordings without what may have spoilt their samples: that is no noise."""
    parts = []
    each = zip(problem.observations, problem.split(residual), problem.predictions(theta), strict=False)
    for o, left, predicted in each:
        assert isinstance(o, TimeObservation)
        columns = [o.whiten(found) for _, _, found, _ in spoilt(o, o.measured - predicted)]
        white = np.hstack([np.zeros((o.n, 1)), *columns])
        parts.append(left - white @ np.linalg.lstsq(white, left, rcond=None)[0])
    return np.concatenate(parts)


# Deviations of what is not known, summed over: of what the model predicts; and of a condition, in uncertainties of
# setting.
SIZES = (0.003, 0.01, 0.03, 0.1, 0.3)
OF_A_SETTING = (1.0, 3.0, 10.0, 30.0)
LEAST_ROWS = 3  # on either side of such a row
WARM_UP = (0.02, 0.05, 0.15)  # of the whole measurement, over which first rows settle

Words = Callable[[Array], str]
# Residual with pseudo-measurements, and what gives the derivatives of the prediction by parameters and coefficients.
Moved = tuple[Array, Callable[[], tuple[Array, Array]]]


@dataclass(frozen=True, eq=False)
class Fault:
    """Something that may be wrong with the data.

    Attributes
    ----------
    name : str
        Short, as ``drift of the zero``.
    text : str
        A sentence without its end.
    columns : array, shape (n, k)
        Change of the measured rows, for a size of one.
    sizes : tuple of float
        Deviations of the coefficients, each as likely.
    in_words : callable, optional
        What follows the text for given coefficients; by default the size in the readings.
    ln_known : float
        ln of the evidence beside what its columns make of it.
    moves : callable, optional
        Of a problem, theta and coefficients, where a straight line may not lead there.
    of_condition : bool
        Whether effects were fitted at conditions that are not the right ones.
    apart : tuple of Fault
        Those of each column alone, each as likely as all columns.
    """

    name: str
    text: str
    columns: Array
    sizes: tuple[float, ...] = SIZES
    in_words: Words | None = None
    ln_known: float = 0.0
    moves: Callable[[Problem, Array, Array], Moved] | None = None
    of_condition: bool = False
    apart: tuple[Fault, ...] = ()

    def of_size(self, problem: Problem, coefficients: Array) -> Fault:
        """The same with its size in words: by how much it changes the readings of the observable that it shows in."""
        if self.in_words is not None:
            return replace(self, text=self.text + self.in_words(coefficients))
        change, model = self.columns @ coefficients, problem.assembly.model
        name, rows = max(
            problem.observable_rows.items(), key=lambda item: float(np.ptp(problem.whiten(change)[item[1]]))
        )
        unit = model.observables[name].unit if name in model.observables else "1"
        size = spoken(float(np.ptp(change[rows])), unit=unit, digits=2)
        return replace(self, text=f"{self.text}, {name} by up to {size}")


# ln of the evidence that a fault adds, its likeliest coefficients, and the fault there.
Weighed = tuple[float, Array, Fault]


class Faults:
    """Everything that is looked for in the rows of tables, beside fits of one form of the base.

    Parameters
    ----------
    tangent : Tangent
        Of the base.
    predicted : array
        By it.
    """

    def __init__(self, tangent: Tangent, predicted: Array) -> None:
        self.problem = tangent.problem
        self.all = sorted(faults(tangent, predicted), key=lambda one: one.name)
        alone = gathered((one.sizes, one) for one in self.all if one.columns.shape[1] == 1)
        self._alone = {
            sizes: (own, self.problem.whiten(np.hstack([one.columns for one in own])))
            for sizes, own in alone.items()
        }
        several = (one for one in self.all if one.columns.shape[1] != 1)
        self._several = [(one, self.problem.whiten(one.columns)) for one in several]

    def beside(self, marginal: Marginal) -> list[tuple[float, Fault]]:
        """ln of the evidence with a fault over that without, and the likeliest place and size, for each name."""
        each: list[Weighed] = []

        def add(faults: Sequence[Fault], gains: Array, coefficients: Array) -> None:
            means, places = ln_mean(gains), np.argmax(gains, axis=0)
            for k, fault in enumerate(faults):
                each.append((fault.ln_known + float(means[k]), coefficients[places[k], k], fault))

        for sizes, (own, white) in self._alone.items():
            gains, coefficients = marginal.one_by_one(white, np.array(sizes))
            add(own, gains, coefficients[:, :, None])
        for fault, white in self._several:
            gains, coefficients = marginal.beside(white, np.array(fault.sizes))
            add([fault], gains[:, None], coefficients[:, None])
            if fault.apart:
                gains, coefficients = marginal.one_by_one(white, np.array(fault.sizes))
                add(fault.apart, gains, coefficients[:, :, None])
        most = max((gain for gain, *_ in each), default=0.0)
        told = []
        for named in gathered((one[2].name, one) for one in each).values():
            # 0.5: share of ln of the likeliest fault, from which steps are taken: a straight line may tell of half
            near = [one for one in named if one[0] > max(0.5 * most, 0.0)]
            for alike in gathered((one[2].columns.shape[1], one) for one in near).values():
                best = max(alike, key=lambda one: one[0])
                named = [_followed(marginal, *one) if one is best else one for one in named]
            gain = float(ln_mean([one[0] for one in named]))
            _, likeliest, fault = max(named, key=lambda one: one[0])
            told.append((gain, fault.of_size(self.problem, likeliest)))
        return told


def ln_mean(ln: ArrayLike) -> Array:
    """ln of the mean over the first axis."""
    return np.asarray(np.logaddexp.reduce(ln, axis=0) - np.log(np.shape(ln)[0]))


def _followed(marginal: Marginal, gain: float, coefficients: Array, fault: Fault) -> Weighed:
    """The same of what bends, after steps as a fit takes them."""
    tangent, sizes = marginal.tangent, np.array(fault.sizes)
    white = tangent.problem.whiten(fault.columns)
    if fault.columns.size:
        gains, each = marginal.with_pulls(white, sizes)
        gain, coefficients = fault.ln_known + float(ln_mean(gains)), each[int(np.argmax(gains))]
    if fault.moves is None:
        return gain, coefficients, fault
    found = [_after_steps(marginal, gain, coefficients, fault)]
    # Errors of form are of the likeliest size without the fault; beside it they may be as small as nothing.
    if marginal.columns.size:
        exact = Marginal(tangent)
        gains, each = exact.beside(white, sizes)
        gain = fault.ln_known + float(ln_mean(gains))
        gain, *rest = _after_steps(exact, gain, each[int(np.argmax(gains))], fault)
        found.append((gain + exact.ln_evidence - marginal.ln_evidence - np.log(len(FORMS)), *rest))
    return max(found, key=lambda one: one[0])


def _after_steps(marginal: Marginal, gain: float, coefficients: Array, fault: Fault) -> Weighed:
    """The same after linear steps to the minimum, beside the columns of `marginal`."""
    problem, tangent, sizes = marginal.tangent.problem, marginal.tangent, np.array(fault.sizes)
    assert fault.moves is not None
    rows, size = tangent.residual.size, tangent.theta.size
    at, least = np.concatenate([tangent.theta, np.zeros(coefficients.size)]), 2 * tangent.chi2
    new = np.concatenate([marginal.shifted(problem.whiten(fault.columns), coefficients), coefficients])
    # 6: steps that are taken to where a condition would be
    for _ in range(6):
        theta, by = new[:size], new[size:]
        try:
            residual, slopes = fault.moves(problem, theta, by)
        except ComputationError:  # no machine runs there
            residual = np.full(rows, np.inf)
        if not residual @ residual < least:
            new = (new + at) / 2
            continue
        at, least = new, float(residual @ residual)
        jacobian, columns = slopes()
        white, fault = problem.whiten(columns), replace(fault, columns=columns)
        one = Tangent(problem, theta, residual[:rows] - white @ by, problem.whiten(jacobian))
        beside = Marginal(reduce(Tangent.with_noise, tangent.noises, one), marginal.columns)
        gains, each = beside.beside(white, sizes)
        gain = fault.ln_known + beside.ln_evidence - marginal.ln_evidence + float(ln_mean(gains))
        coefficients = each[int(np.argmax(gains))]
        new = np.concatenate([beside.shifted(white, coefficients), coefficients])
    return gain, coefficients, fault


def _at_other_conditions(name: str, course: Array, problem: Problem, theta: Array, by: Array) -> Moved:
    """A condition that is another by so much of each course over the rows."""
    there = _moved(problem, name, course @ by)

    def slopes() -> tuple[Array, Array]:
        return there.sensitivities(theta)[0], _slope(there, theta, name)[:, None] * course

    return there.residual(theta), slopes


def _of_another_machine(
    names: Sequence[ParameterName], after: Flags, problem: Problem, theta: Array, by: Array
) -> Moved:
    """Parameters that are others in some rows, by a share each."""
    own, ratio = [problem.names.index(name) for name in names], np.ones(theta.size)
    ratio[own] += by
    other = np.clip(theta * ratio, *problem.bounds)
    predicted = np.where(after, problem.predictions(other)[0], problem.predictions(theta)[0])

    def slopes() -> tuple[Array, Array]:
        (before,), (later,) = problem.sensitivities(theta), problem.sensitivities(other)
        rows = after[:, None]
        return np.where(rows, later * ratio, before), (later * theta)[:, own] * rows

    white = problem.whiten(predicted - problem.observations[0].measured)
    return np.concatenate([white, problem.pseudo.residual(theta)]), slopes


def _moved(problem: Problem, name: str, by: Array | float) -> Problem:
    """A problem whose condition is another by so much."""
    (o,) = problem.observations
    assert isinstance(o, TableObservation)  # faults of conditions are those of tables
    conditions = {**o.conditions, name: o.conditions[name] + by}
    return problem.over([replace(o, conditions=conditions, series=None, position=None)])


def sizes_of(problem: Problem, predicted: Array) -> tuple[Array, Array]:
    """What an error may be a share of: what the effects do to each row, and the RMS of that over an observable.

    A prediction that is off by more than all of it tells no size: what it is off by does.
    """
    percent = problem.assembly.model.rig.discrepancy_percent
    parts = []
    for o, own in zip(problem.observations, problem.split(np.abs(predicted)), strict=False):
        declared = getattr(o, "parts", {}).get("discrepancy")
        parts.append(own if declared is None or not percent else np.abs(declared) / percent * 100)
    relative = np.concatenate(parts)
    level = np.empty_like(relative)
    off = np.abs(np.concatenate([o.measured for o in problem.observations]) - predicted)
    for rows in problem.observable_rows.values():
        level[rows] = np.sqrt(max(np.mean(relative[rows] ** 2), np.mean(off[rows] ** 2)))
    return relative, level


def faults(tangent: Tangent, predicted: Array) -> Iterator[Fault]:
    """Everything that is looked for in the rows of tables.

    Parameters
    ----------
    tangent : Tangent
        Of the explanation that the faults stand beside.
    predicted : array
        Of its base.
    """
    problem = tangent.problem
    first, *others = problem.observations
    if others or not isinstance(first, TableObservation):
        return
    yield from _of_readings(problem, first, predicted)
    if first.kind != "table":  # samples are no set-points
        return
    names = operating(problem.assembly.model, first.conditions)
    slopes = {name: _slope(problem, tangent.theta, name) for name in names}
    for name, slope in slopes.items():
        yield from _of_condition(tangent, first, name, slope)
    yield from _of_machine(tangent, first)
    yield from _not_set_anew(problem, first, slopes)
    yield from _copies(tangent, first)


# --- readings -----------------------------------------------------------------------------------


def _of_readings(problem: Problem, o: TableObservation, predicted: Array) -> Iterator[Fault]:
    """A zero or a gain of one observable that is not the same in all rows, or readings that are off."""
    _, level = sizes_of(problem, predicted)
    samples = spoilt(o, o.measured - predicted) if isinstance(o, TimeObservation) else ()
    for name, text, shape, tried in samples:
        yield Fault(name, text, level[:, None] * shape, ln_known=-tried)
    for observable, rows in problem.observable_rows.items():
        unit = printed_unit(problem.assembly.model.observables[observable].unit)
        ranges = _ranges(observable, unit, rows, np.abs(predicted)) if o.kind == "table" else ()
        lags = [_hysteresis(o, rows, predicted)] if o.kind == "table" else []
        for name, text, shape in (*_courses(o), *ranges, *lags):
            for kind, size in {"gain": predicted, "zero": level}.items():
                columns = (size * rows)[:, None] * shape
                if np.any(columns):
                    yield Fault(name.format(kind), text.format(kind), columns)
        for name, text, shape in _off(o, rows) if o.kind == "table" else ():
            yield Fault(name, text, (level * shape)[:, None])


def _courses(o: TableObservation) -> Iterator[tuple[str, str, Array]]:
    """Name, sentence and course over the rows of what goes with their order."""
    text = "the {} of the readings drifts with the order of the rows"
    yield "drift of the {}", text, (_elapsed(o) - 0.5)[:, None]
    text = "the first rows differ from the others and settle, as while warming up"
    for share in WARM_UP if o.kind == "table" else ():  # of a recording what its start leaves settles too
        yield "first rows", text, np.exp(-_elapsed(o) / share)[:, None]
    for line, after in _from_a_row_on(o):
        text = f"the {{}} of the readings differs from {line} on"
        yield "{} from a row on", text, after[:, None].astype(float)
    # pieces of a recording are no files
    if o.recording is not None and np.unique(o.recording).size > 1 and o.kind == "table":
        inside = o.recording[:, None] == np.unique(o.recording)[1:]
        yield "{} of a file", "the {} of the readings differs between the files", inside.astype(float)


def _ranges(name: str, unit: str, rows: Flags, size: Array) -> Iterator[tuple[str, str, Array]]:
    """The same of readings above some size, as where an instrument switches its range."""
    for above in _steps(size[rows]):
        limit = float(size[rows][above].min())
        text = f"the {{}} of the readings differs from {name} {limit:.3g} {unit}".rstrip() + " on"
        shape = np.zeros((rows.size, 1))
        shape[np.flatnonzero(rows)[above]] = 1.0
        yield "{} of a range", f"{text}, as after a switch of range", shape


def _hysteresis(o: TableObservation, rows: Flags, predicted: Array) -> tuple[str, str, Array]:
    """The same of readings after a rise and after a fall: the reversibility error of an instrument (VDI/VDE 2646)."""
    shape = np.zeros((o.n, 1))
    # 3: standard deviations of a reading, up to which it is no change
    shape[rows, 0] = direction(predicted[rows], _elapsed(o)[rows], 3 * float(np.median(o.sigma[rows])))
    text = "the {} of the readings differs between rising and falling values"
    return "hysteresis of the {}", f"{text}, as of an instrument that lags behind", shape


def _off(o: TableObservation, rows: Flags) -> Iterator[tuple[str, str, Array]]:
    """Single readings, and all repeats of a condition."""
    for k in np.flatnonzero(rows):
        yield "one reading", f"the reading of {o.place_of(int(k))} is off", np.eye(1, o.n, int(k))[0]
    if o.replicate_group is None:
        return
    for group in np.unique(o.replicate_group[rows]):
        alike = np.flatnonzero(rows & (o.replicate_group == group))
        if 1 < alike.size < rows.sum():
            # 6: lines that a sentence names
            lines = first_of([o.place_of(int(k)) for k in alike], 6)
            shape = np.isin(np.arange(o.n), alike).astype(float)
            yield "one condition", f"the readings of one condition are off ({lines})", shape


# --- conditions ---------------------------------------------------------------------------------


def _slope(problem: Problem, theta: Array, name: str) -> Array:
    """Derivative of the prediction by a condition."""
    x = problem.observations[0].conditions[name]
    return slope_by(x, lambda step: _moved(problem, name, step).predictions(theta)[0])


def _of_condition(tangent: Tangent, o: TableObservation, name: str, slope: Array) -> Iterator[Fault]:
    """A condition that is not what the table says: at some levels, from a row on, or everywhere."""
    problem = tangent.problem
    condition, x = problem.assembly.model.conditions[name], o.conditions[name]
    words, setting = condition.words, grouping_of(problem.assembly.model, condition)
    scale = np.asarray(setting.at(x))
    if not np.any(slope * scale):
        return

    def fault(kind: str, text: str, course: Array | Flags, told: bool = True) -> Fault:
        own = np.asarray(course, dtype=float).reshape(o.n, -1)

        def in_words(coefficients: Array) -> str:
            if not told:
                return ""
            off = scale * (own @ coefficients)
            at = int(np.argmax(np.abs(off)))
            read, true = float(x[at]), float(x[at] + off[at])
            return f": where it says {_shown(condition, read)} it would be {_shown(condition, true)}"

        by = np.broadcast_to(scale, (o.n,))[:, None] * own
        columns, moves = slope[:, None] * by, partial(_at_other_conditions, name, by)
        called = f"{words} {kind}"
        return Fault(called, text, columns, OF_A_SETTING, in_words, moves=moves, of_condition=True)

    for level, rows in levels_of(condition, o).items():
        at = spoken(level, unit=condition.column_unit, digits=6)
        yield fault("of a level", f"the {words} of the rows at {at} is off", rows)
    for line, rows in _from_a_row_on(o):
        yield fault("from a row on", f"the {words} differs from {line} on", rows)
    if condition.setting.absolute and np.ptp(x) > 0:
        text = f"the {words} of the first rows is not the effective one, as while warming up"
        for share in WARM_UP:
            yield fault("of the first rows", text, np.exp(-_elapsed(o) / share))
        text = f"the {words} is not the effective one; its sensor may be in another place"
        # Any course of the difference over the condition would imitate every effect that this condition could carry.
        # Where the sensor says that it stays as it is, no effect goes with it: then it may go anywhere in time.
        course, further = np.column_stack([np.ones(o.n), (x - x.mean()) / x.std()]), [np.zeros((o.n, 0))]
        if condition.column not in o.labels:
            steps = np.array([after for _, after in _from_a_row_on(o)])
            further = [steps.T / np.sqrt(len(steps)), *_rises(tangent, o)]
        for more in further:  # what is to be read where it moves in time, a fit as good can be far from
            yield fault("of another place", text, np.hstack([course, more]), told=not more.size)


def _rises(tangent: Tangent, o: TableObservation) -> Iterator[Array]:
    """Courses of what warms with a machine that works and cools by itself, from some start on."""
    assembly, values, u = tangent.problem.assembly, tangent.problem.values_at(tangent.theta), _elapsed(o)
    found = assembly.evaluate(o.conditions, values)
    measured = [assembly.model.observables[name].quantity for name in dict.fromkeys(o.observable.tolist())]
    for name in [assembly.model.law] if assembly.model.law else measured:
        loss = np.abs(np.broadcast_to(found[name], u.shape))
        # lags: shares of the whole measurement, after which a sensor elsewhere has followed
        for lag in (0.003, 0.01, 0.03, 0.1, 0.3):
            before = np.exp(-np.maximum(u[:, None] - u, 0.0) / lag) * (u[:, None] >= u)
            rise = before @ loss / before.sum(axis=1) / max(float(np.mean(loss)), 1e-300)
            yield np.column_stack([rise, np.exp(-u / lag)])


def _of_machine(tangent: Tangent, o: TableObservation) -> Iterator[Fault]:
    """The parts of the base are others from a row on, as after a service."""
    problem, known = tangent.problem, tangent.problem.assembly.model.effects
    instruments = {name for name, effect in known.items() if effect.instrument}
    own = [k for k, n in enumerate(problem.names) if Use.parse(n.owner).name not in instruments]
    changes = (problem.sensitivities(tangent.theta)[0] * tangent.theta)[:, own]
    names = [problem.names[k] for k in own]

    def fault(line: str, after: Flags, chosen: slice, apart: tuple[Fault, ...] = ()) -> Fault:
        text = f"the machine behaves differently from {line} on, as after a change of oil or parts"
        columns = changes[:, chosen] * after[:, None]
        moves = partial(_of_another_machine, names[chosen], after)
        return Fault("machine from a row on", text, columns, moves=moves, apart=apart)

    for line, after in _from_a_row_on(o) if np.any(changes) else ():
        each = (fault(line, after, slice(k, k + 1)) for k in range(len(own)))
        yield fault(line, after, slice(None), tuple(each) if len(own) > 1 else ())


def levels(problem: Problem) -> Iterator[Flags]:
    """Rows at each level of each condition that has a few, and above each."""
    for o in problem.observations[:1]:
        if isinstance(o, TableObservation):
            for name in operating(problem.assembly.model, o.conditions):
                own = list(levels_of(problem.assembly.model.conditions[name], o).values())
                yield from own
                for k in range(2, len(own) - 1):
                    yield np.any(own[k:], axis=0)


def levels_of(condition: Condition, o: TableObservation) -> dict[float, Flags]:
    """Rows at each of the few levels of a condition; none where it has many, or two."""
    labels = np.asarray(o.labels.get(condition.column, np.empty(0)))
    levels = np.unique(labels)
    return {float(x): labels == x for x in levels} if 2 < levels.size <= MOST_LEVELS else {}


def _shown(condition: Condition, value: float) -> str:
    shown = float(convert(value, condition.unit, condition.column_unit))
    return spoken(shown, unit=condition.column_unit, digits=4)


# --- repeats ------------------------------------------------------------------------------------


def _not_set_anew(problem: Problem, o: TableObservation, slopes: Mapping[str, Array]) -> Iterator[Fault]:
    """Repeats of which each was not set anew hold less than setting is declared to scatter; that is in their means."""
    declared = problem.assembly.model.rig.setting
    variance = sum((slopes[n] * declared[n].at(o.conditions[n])) ** 2 for n in slopes if n in declared)
    if o.replicate_group is None or not np.isfinite(problem.noise_dof) or not np.any(variance):
        return
    groups = o.replicate_group[:, None] == np.unique(o.replicate_group)
    text = (
        "the repeats scatter less than the declared scatter of setting: they were read without setting anew; say so in "
        "a column 'setup'"
    )
    yield Fault("repeats not set anew", text, np.sqrt(variance)[:, None] * groups, (1.0,), lambda _: "")


def _copies(tangent: Tangent, o: TableObservation) -> Iterator[Fault]:
    """Rows that equal an earlier one in every number, more of them than chance makes.

    Two normal readings of deviation u, in steps s, agree with probability s / (2 sqrt(pi) u), and so do conditions that
    are read. Steps are those that are printed, or as coarse as makes readings at other conditions agree as often as
    they do: a converter's. A copy is one of any earlier repeat; the share of rows that are copies is uniform.
    """
    conditions = [c for n, c in o.conditions.items() if n != TIME]
    if o.lines is None or o.replicate_group is None or not conditions:
        return
    kinds = np.unique(o.observable, return_inverse=True)[1]
    table = np.column_stack([*conditions, o.measured, kinds])
    _, first, index = np.unique(table, axis=0, return_index=True, return_inverse=True)
    original = first[np.ravel(index)]
    copies = np.flatnonzero(original != np.arange(o.n))
    if not copies.size:
        return
    alike = (o.replicate_group[:, None] == o.replicate_group) & (kinds[:, None] == kinds)
    earlier = np.sum(np.tril(alike, -1), axis=1)
    count = int(np.count_nonzero(earlier))
    reading = o.parts.get("reading", np.zeros(o.n))
    scatter = min(1.0, float(np.sqrt(np.mean(tangent.residual**2)))) * np.where(reading > 0, reading, o.sigma)
    of_group = alike / np.sum(alike, axis=1)
    by_chance = np.zeros(o.n)
    for c in conditions:
        by_chance += _ln_agreement(_printed_step(np.unique(c)), np.sqrt(of_group @ (c - of_group @ c) ** 2))
    # Readings of one setting, whose conditions were read once, agree in these and differ themselves.
    unlike = np.tril(alike, -1) & (o.measured[:, None] != o.measured)
    at_once = unlike & np.all([c[:, None] == c for c in conditions], axis=0)
    if np.any(at_once):
        by_chance = np.maximum(by_chance, np.log(np.sum(at_once) / np.sum(unlike)))
    for kind in np.unique(kinds):
        rows = np.flatnonzero(kinds == kind)
        reach = 3 * float(np.median(scatter[rows]))
        gaps = np.abs(o.measured[rows, None] - o.measured[rows])
        apart = gaps[~alike[np.ix_(rows, rows)] & (gaps < reach)]
        step = max(
            _printed_step(np.unique(o.measured[rows])),
            2 * reach * float(np.mean(apart == 0)) if apart.size else 0,
        )
        by_chance[rows] += _ln_agreement(step, scatter[rows])
    gain = float(betaln(copies.size + 1, max(count - copies.size, 0) + 1))
    gain -= float(np.sum(np.log(np.maximum(earlier, 1))[copies] + by_chance[copies]))
    pairs = [f"{o.place_of(int(k))} and {o.place_of(int(original[k]))}" for k in copies]
    text = f"rows are copies, equal to the last digit ({first_of(pairs, LEAST_ROWS, ' pairs')}); keep one of each"
    yield Fault("copied rows", text, np.zeros((o.n, 0)), (1.0,), lambda _: "", gain)


def _ln_agreement(step: float, scatter: Array) -> Array:
    """ln of the probability that two values in such steps agree; 0 where they are set and do not scatter."""
    return np.log(np.minimum(step / (2 * np.sqrt(np.pi) * np.maximum(scatter, 1e-300)), 1.0))


def _printed_step(distinct: Array) -> float:
    """In which readings are printed; the least difference where they are not decimal, as after a change of unit."""
    step = round_step(distinct)
    return step if step > 1e-9 * np.abs(distinct).max() else float(np.diff(distinct).min(initial=np.inf))


# --- order of rows ------------------------------------------------------------------------------


def _from_a_row_on(o: TableObservation) -> Iterator[tuple[str, Flags]]:
    """Where from, and the rows after that."""
    row = _order(o)
    for after in _steps(np.asarray(o.conditions.get(TIME, row), float)):
        yield o.place_of(int(np.flatnonzero(after)[np.argmin(row[after])])), after


def _steps(x: Array) -> Iterator[Flags]:
    """Where values lie above one of them, that leaves rows on either side."""
    # 200: rows from which on something may differ, or values above which, that are tried
    for place in np.unique(np.quantile(x, np.linspace(0, 1, min(x.size, 200)), method="lower")):
        above = x > place
        if min(above.sum(), (~above).sum()) >= LEAST_ROWS:
            yield above


def _elapsed(o: TableObservation) -> Array:
    """Share of the whole measurement that had passed before each row."""
    time = np.asarray(o.conditions.get(TIME, _order(o)), float)
    return np.asarray((time - time.min()) / max(float(np.ptp(time)), 1e-300))


def _order(o: TableObservation) -> Array:
    """Place of each row in the order of the files."""
    recording = np.zeros(o.n) if o.recording is None else o.recording
    lines = np.arange(o.n) if o.lines is None else o.lines
    _, place = np.unique(np.stack([recording, lines]), axis=1, return_inverse=True)
    return np.asarray(place.ravel(), float)
