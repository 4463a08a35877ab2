"""The study that a page was opened for: opened once for all windows, anew when somebody changed it."""

from __future__ import annotations

from collections.abc import Callable
from threading import Lock, RLock

from specan.inspect.opened import stamp_of
from specan.inspect.superseded import Superseded, Tell
from specan.inspect.trial import Trial, as_it_is
from specan.study.history import NAME as HISTORY
from specan.study.study import Study
from specan.study.study_file import NAME
from specan.study.verdict import Diagnosis

_WAIT_S = 0.2


class KeptStudy:
    """A study, its fit and its diagnosis; every one of them is worked out once.

    Parameters
    ----------
    study : Study
    """

    def __init__(self, study: Study) -> None:
        self.directory = study.directory
        self._lock = RLock()
        self._diagnosing = Lock()
        self._take(study)

    def _take(self, study: Study) -> None:
        self._study = study
        self._stamps = self._stamp()
        self._now: Trial | None = None
        self._found: Diagnosis | None = None

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
                self._take(Study(self.directory))
            return self._study

    def changed_to(self, study: Study) -> None:
        """A window has added an effect."""
        with self._lock:
            self._take(study)

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

        def progress(text: str) -> None:
            if not tell(0.0):
                raise Superseded
            say(text)

        while not self._diagnosing.acquire(timeout=_WAIT_S):  # another window is at it
            if not tell(0.0):
                raise Superseded
        try:
            study = self.current()
            if self._found is None:
                found = study.diagnose(progress=progress)
                with self._lock:
                    if study is not self._study:  # changed meanwhile
                        raise Superseded
                    self._found = found
            return self._found
        finally:
            self._diagnosing.release()
