"""What was measured, in the form in which a model can be compared with it.

Every observation brings its strategy, how fits and searches over such data are run; a problem joins them. Who turns
each kind of measured file into observations stands here as well.

Decisions: docs/decisions/covariance.md, docs/decisions/leakage.md.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import entry_points
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from specan.errors import InputError, RequestError, nearest
from specan.models import Assembly, Model

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Strategy:
    """How fits and searches over some data are run: thoroughly, or frugally where an evaluation is worth saving.

    Attributes
    ----------
    frugal : bool
        One start; no refits beside the search (profile intervals, errors on left-out conditions, fits by the data
        alone); what a linear prediction rules out is not refitted; signatures of candidates are worked out at the base
        only; few Jacobians, one-sided, and secants. Else few rows, quickly predicted, as those of a table: central
        differences, and steps to the minimum itself.
    continuation : bool
        The data are narrow peaks, which a fit from a poor start misses: fits begin with a down-weighted problem
        (`specan.study.estimation.continuation`), and several starts are screened.
    linearised_covariance : bool
        The covariance depends on where the model is, and is taken about a fit
        (`specan.study.estimation.continuation`).
    """

    frugal: bool = False
    continuation: bool = False
    linearised_covariance: bool = False


@dataclass(frozen=True)
class Variable:
    """Words and printed unit of a variable.

    Attributes
    ----------
    words : str
        Its name in a sentence.
    unit : str
        As printed; empty for a name or a plain number.
    before : bool
        Whether the words stand before the level, and the level needs no other words.
    partial : frozenset of float
        Levels that the data fill in part only, such as third octaves at the ends of a band.

    Examples
    --------
    >>> Variable("output force", "kN").spoken(2.5), Variable("measurement").spoken("table_7.csv")
    ('2.5 kN (output force)', 'table_7.csv (measurement)')
    >>> Variable("receivers near", before=True).spoken("y1")
    'receivers near y1'
    """

    words: str
    unit: str = ""
    before: bool = False
    partial: frozenset[float] = frozenset()

    def short(self, level: Any, unit: bool = True) -> str:
        """A level without the variable's name: ``2.5 kN``, ``500 Hz in part``; without unit ``2.5``, ``500*``."""
        if isinstance(level, str):
            value = level
        else:
            mark = (" in part" if unit else "*") if level in self.partial else ""
            value = f"{level:g} {self.unit if unit else ''}".rstrip() + mark
        return f"{self.words} {value}" if self.before else value

    def spoken(self, level: Any) -> str:
        """A level in words: ``2.5 kN (output force)``."""
        return self.short(level) if self.before else f"{self.short(level)} ({self.words})"

    @property
    def axis(self) -> str:
        """Label of an axis: ``output force / kN``."""
        mark = " (*: in part)" if self.partial else ""
        return (f"{self.words} / {self.unit}" if self.unit else self.words) + mark


def variable_named(name: str, variables: Mapping[str, Variable]) -> Variable:
    """The variable of a name; without words of its own, its name serves."""
    return variables.get(name) or Variable(name.replace("_", " "))


class Observation:
    """A measured vector, the model's prediction of it, and the covariance of their difference.

    The covariance V holds what is random: reading noise, the scatter of setting a condition again, and
    the declared, smooth discrepancy of the model. It belongs to the observation and never changes with
    the model under test, so that chi-squares of different models may be compared. Errors that all rows
    share (a gain, a zero) are nuisance parameters with a prior in the `Problem`.

    The methods below hold for rows that are cheap to predict, and whose covariance was found without the model.

    Attributes
    ----------
    name : str
        File or channel, for messages.
    kind : str
        Kind of measurement.
    measured : array, shape (n,)
        What was measured, SI; complex data as the real parts followed by the imaginary ones.
    sigma : array, shape (n,)
        Standard uncertainty of each value: the root of V's diagonal.
    conditions : mapping
        Operating conditions in SI, arrays.
    labels : mapping
        Operating variable (``load_kN``) to one level a row: values that were meant to be equal are equal.
    variables : mapping
        Words and unit of each label.
    recordings : tuple of str
        Recordings of the rows; a parameter with ``per="recording"`` has one element each.
    n_effective : float
        Number of independent values that the data are worth; all by default.
    noise_dof : float
        Degrees of freedom of the noise estimate; inf where the noise is known.
    pure_error_dof : float
        Degrees of freedom of the residual that only compare repeats, and that the noise was estimated from. They are
        spent: whatever the model, their share of chi-square equals their number.
    size_error : float
        Relative standard uncertainty that the sizes of all effects share.
    strategy : Strategy
        How fits and searches over these data are run.
    """

    kind: ClassVar[str]
    noise_dof: float = float("inf")
    pure_error_dof: float = 0.0
    size_error: float = 0.0

    if TYPE_CHECKING:
        name: str

        @property
        def strategy(self) -> Strategy: ...  # noqa: D102
        @property
        def measured(self) -> Array: ...  # noqa: D102
        @property
        def sigma(self) -> Array: ...  # noqa: D102
        @property
        def conditions(self) -> Mapping[str, Array]: ...  # noqa: D102
        @property
        def labels(self) -> Mapping[str, NDArray[Any]]: ...  # noqa: D102
        @property
        def variables(self) -> Mapping[str, Variable]: ...  # noqa: D102
        @property
        def recordings(self) -> tuple[str, ...]: ...  # noqa: D102

    @property
    def places(self) -> Mapping[str, Any]:
        """What a list of all values says of each before its conditions and labels."""
        return {"file": self.name}

    @property
    def available(self) -> frozenset[str]:
        """Conditions that the data hold."""
        return frozenset(self.conditions)

    @property
    def n(self) -> int:
        """Length of `measured`."""
        return int(self.measured.size)

    @property
    def n_effective(self) -> float:
        """Number of rows: what correlates them is in the covariance."""
        return float(self.n)

    def predict(self, assembly: Assembly, values: Mapping[str, Any]) -> Array:
        """What the model expects in place of `measured`.

        A parameter with ``per="recording"`` comes as a vector over `recordings`.
        """
        return self.predict_many(assembly, [values])[:, 0]

    def plain(self, assembly: Assembly, values: Mapping[str, Any]) -> Array:
        """Prediction as it is shown: without what `predict` allows for declared errors of the model."""
        return self.predict(assembly, values)

    def settled(self, assembly: Assembly, values: Mapping[str, Any]) -> bool:
        """Whether predictions are exact enough at some values; if not, they are from then on."""
        return True

    def predict_many(self, assembly: Assembly, many: Sequence[Mapping[str, Any]]) -> Array:
        """Predictions for several sets of values, shape (n, len(many))."""
        raise NotImplementedError

    def whiten(self, array: Array) -> Array:
        """Apply V^(-1/2) along axis 0 of a vector, or of the columns of a matrix."""
        raise NotImplementedError

    def excess(self, residual: Array, jacobian: Array) -> Array | float:
        """What correlation of whitened residuals, as they show it, adds to the covariance J'J of their scores."""
        return 0.0

    def take(self, mask: NDArray[np.bool_]) -> Self:
        """The same observation with some of its rows only."""
        raise NotImplementedError

    def subsample(self, assembly: Assembly, values: Mapping[str, Any], rows: int) -> Self:
        """About so many rows, cheaper to predict, with the residual that the whole has at these values; all of them."""
        return self

    def down_weighted(self, percent: float) -> Self:
        """The same with every row uncertain by so much of the level around it; itself without `continuation`."""
        return self

    def without_leakage(self, assembly: Assembly, values: Mapping[str, Any]) -> Self:
        """The same without windows, as far as the model at these values knows what they do; itself where none are."""
        return self

    def about(
        self, assembly: Assembly, values: Mapping[str, Any], seen: bool = True, placed: Collection[str] = ()
    ) -> Self:
        """The same with a covariance that is linearised about the model at these values; itself where it is not.

        What is held out may not be `seen`: then the measured values themselves must not enter. Receivers whose places
        are free by effects that are `placed` stand where these say, whatever is declared of their places.
        """
        return self


def shared_labels(observations: Sequence[Observation]) -> dict[str, NDArray[Any]]:
    """Labels that all observations have, over the rows of all."""
    names = [name for name in observations[0].labels if all(name in o.labels for o in observations)]
    return {name: np.concatenate([o.labels[name] for o in observations]) for name in names}


# kind -> module with `reads(path) -> bool`, `TITLE`, `open_data(model, wanted) -> OpenedData`, and what `brought` lists
KINDS = {
    "table": "specan.study.data.open_tables",
    "transfer": "specan.study.data.open_transfer",
    "time": "specan.study.data.open_time",
}
ENTRY_POINTS = "specan.measurement_kinds"  # of installed packages: name = such a module


@dataclass(frozen=True)
class DataFile:
    """A measured file of a study.

    Attributes
    ----------
    name : str
        What results call it; unique in the study.
    conditions : mapping
        Conditions of the whole file that it does not hold itself.
    columns : mapping
        ``{column of the model: header of the table}`` where the file has names of its own.
    """

    name: str
    path: Path
    estimator: str = ""
    conditions: Mapping[str, float | str] = field(default_factory=dict)
    columns: Mapping[str, str] = field(default_factory=dict)
    sheet: str = ""


@dataclass(frozen=True)
class MeasuredFiles:
    """The files of one kind, and what is to be held out: pairs (file name or None, ``load=60``)."""

    measurements: Sequence[DataFile]
    validations: Sequence[DataFile] = ()
    hold_out: Sequence[tuple[str | None, str]] = ()
    calibration: Path | None = None


@dataclass(frozen=True, eq=False)
class OpenedData:
    """Observations, and what was found out about their uncertainty.

    Attributes
    ----------
    fitted, held_out : tuple of Observation
    statements : tuple of str
        What was found and assumed, for a person.
    known : bool
        False where the uncertainty is unknown.
    discrepancy_percent : float
        Declared discrepancy of the model that the covariance holds.
    model : Model, optional
        Completed by what was measured.
    doubts : tuple of str
        What looks wrong with the samples or rows, among the statements and beside every verdict.
    """

    fitted: tuple[Observation, ...]
    held_out: tuple[Observation, ...]
    statements: tuple[str, ...] = ()
    known: bool = True
    discrepancy_percent: float = 0.0
    model: Model | None = None
    doubts: tuple[str, ...] = ()


def kind_named(kind: str) -> Any:
    """Module of a kind of measurement, built in or from an installed package.

    Raises
    ------
    RequestError
        There is none of that name.
    """
    if (module := _module(kind)) is None:
        installed = [point.name for point in entry_points(group=ENTRY_POINTS)]
        raise RequestError(f"a study reads no {kind!r}", remedy=nearest(kind, [*KINDS, *installed]))
    return module


def brought(observations: Sequence[Observation], name: str) -> Callable[..., Any] | None:
    """Function of this name that the kind of measurement of all observations brings; None where there is none.

    ``diagnosed(start, set_up, progress)``, ``localise(problem, best)``, ``curve_errors(observation, predicted)``,
    ``mistaken_set_up(problem)``, ``undeclared_shifts(problem, least)``,
    ``propose_places(rivals, weights, count)``, ``explore_places(problem, block)``, ``with_mode_shifts(problem,
    assembly, values)``, ``mode_shifts(assembly, values)``, ``likely_places(refit, candidates)``,
    ``knowing_shifts(problem, unseen)``, ``near_the_data(problem)``, ``growing(problem, values)``.
    """
    kinds = {o.kind for o in observations}
    kind = kinds.pop() if len(kinds) == 1 else ""
    return getattr(_module(kind), name, None)


def _module(kind: str) -> Any:
    """None for what somebody made without any file."""
    if kind in KINDS:
        return importlib.import_module(KINDS[kind])
    return next((point.load() for point in entry_points(group=ENTRY_POINTS) if point.name == kind), None)


def kind_of(path: Path, model: Model) -> str:
    """Kind of a measured file: the first that the model can be compared with and that the file's content is of.

    Raises
    ------
    InputError
        The file is empty.
    RequestError
        The file is of no kind that the model can be compared with.
    """
    if path.is_file() and not path.stat().st_size:
        raise InputError(f"{path.name} is empty", remedy="export it again")
    for kind in model.kinds:
        if kind_named(kind).reads(path):
            return kind
    titles = " or ".join(kind_named(kind).TITLE for kind in model.kinds)
    raise RequestError(
        f"{path.name} is not a kind of file that a study of the model {model.name} reads", expected=titles
    )


def together(parts: Sequence[OpenedData]) -> OpenedData:
    """The data of several kinds as one."""
    return OpenedData(
        fitted=tuple(o for p in parts for o in p.fitted),
        held_out=tuple(o for p in parts for o in p.held_out),
        statements=tuple(s for p in parts for s in p.statements),
        known=all(p.known for p in parts),
        discrepancy_percent=max((p.discrepancy_percent for p in parts), default=0.0),
        model=next((p.model for p in parts if p.model), None),
        doubts=tuple(d for p in parts for d in p.doubts),
    )
