"""What a model says of its measurement, with or without further effects; the study that a page was opened for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from threading import Lock, RLock

from specan.arrays import Real
from specan.errors import RequestError
from specan.inspect.opened import stamp_of
from specan.inspect.work import Superseded, Tell
from specan.models import Use
from specan.report import study_sheets
from specan.report.residual_map import ResidualMap, residual_map
from specan.result import Sheet
from specan.study.edit import with_effects
from specan.study.estimation.fit import Fit
from specan.study.estimation.prediction_error import ObservableError, observable_errors
from specan.study.estimation.problem import Problem
from specan.study.history import NAME as HISTORY
from specan.study.selection.candidates import candidates
from specan.study.study import Study
from specan.study.study_file import NAME
from specan.study.verdict import Diagnosis, parameter_table


@dataclass(frozen=True, eq=False)
class Trial:
    """A fitted model over the measurements.

    Attributes
    ----------
    uses : tuple of str
        The effects that were tried; empty for the model as it is.
    predictions : tuple of array
        One an observation of the problem.
    parameters : Sheet
        Those of the tried effects, or all, with their intervals.
    where : ResidualMap or None
        Where the model fails; None where no operating variable varies.
    """

    uses: tuple[str, ...]
    problem: Problem
    fit: Fit
    errors: tuple[ObservableError, ...]
    predictions: tuple[Real, ...]
    parameters: Sheet
    where: ResidualMap | None

    @property
    def name(self) -> str:
        """In words."""
        return " with ".join(self.uses)


def as_it_is(study: Study) -> Trial:
    """The study's model, fitted as ``specan study compare`` shows it."""
    return _trial((), study.problem, study.shown)


def try_effects(study: Study, uses: Sequence[str]) -> Trial:
    """Refit with further effects, as when they are accepted.

    Parameters
    ----------
    study : Study
    uses : sequence of str

    Raises
    ------
    RequestError
        These data cannot test one of them.
    ComputationError
        No start converged.
    """
    found, not_testable = candidates(study.problem)
    known = {str(c.use): c for c in found}
    for name in uses:
        if name not in known:
            why = not_testable.get(Use.parse(name).name, "it is in the model or unknown")
            raise RequestError(f"{name} cannot be tried: {why}")
    changed, _ = with_effects(study, study.text(), [known[name].use for name in uses])
    return _trial(tuple(uses), changed.problem, changed.shown)


def _trial(uses: tuple[str, ...], problem: Problem, best: Fit) -> Trial:
    predictions = problem.plain(best.theta)
    errors = observable_errors(problem, problem.observations, predictions)
    parameters = study_sheets.parameters(parameter_table(problem, best, uses or None))
    return Trial(
        uses, problem, best, tuple(errors), tuple(predictions), parameters, residual_map(problem, best)
    )


_WAIT_S = 0.2


class KeptStudy:
    """A study and its fit, which is made once; its diagnosis is kept with it on the disk.

    Parameters
    ----------
    study : Study
    """

    def __init__(self, study: Study) -> None:
        self.directory = study.directory
        self._lock = RLock()
        self._diagnosing = Lock()
        self.take(study)

    def take(self, study: Study) -> None:
        """Another state of the study: a window has added an effect, or its files have changed."""
        with self._lock:
            self._study = study
            self._stamps = self._stamp()
            self._now: Trial | None = None

    def _stamp(self) -> list[tuple[int, int]]:
        files = [NAME, HISTORY, self._study.content.rig, *(e.file for e in self._study.content.measurement)]
        return [stamp_of(self.directory / name) for name in files]

    def current(self) -> Study:
        """The study as it is in its directory.

        Raises
        ------
        InputError
            A file of it has vanished.
        RequestError
            Measured data changed, or the study file cannot be understood any more.
        """
        with self._lock:
            if self._stamp() != self._stamps:
                self.take(Study(self.directory))
            return self._study

    def now(self) -> Trial:
        """The model as it is, fitted."""
        with self._lock:
            study = self.current()
            if self._now is None:
                self._now = as_it_is(study)
            return self._now

    def diagnosis(self, tell: Tell, say: Callable[[str], None]) -> Diagnosis:
        """What is missing, as ``specan study diagnose`` finds it; `say` hears in words what is being done.

        Raises
        ------
        Superseded
            `tell` said not to go on.
        RequestError
            The uncertainty of the measurement is unknown.
        """

        def progress(text: str, share: float | None = None) -> None:
            if not tell(0.0):
                raise Superseded
            say(text)

        while not self._diagnosing.acquire(timeout=_WAIT_S):  # another window is at it
            if not tell(0.0):
                raise Superseded
        try:
            return self.current().diagnose(progress=progress)
        finally:
            self._diagnosing.release()
