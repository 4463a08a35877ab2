"""A study for work in Python: what ``specan study`` does, one method a verb."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, TypeAlias, TypedDict, Union, Unpack

from specan import __version__
from specan.errors import RequestError
from specan.io.output_file import check_output
from specan.study.study import Study as OpenedStudy

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from specan.models import Model
    from specan.study.comparison import Comparison
    from specan.study.edit import Change
    from specan.study.history import History
    from specan.study.progress import Progress
    from specan.study.propose import ProposedLaws
    from specan.study.verdict import Diagnosis, NextMeasurements

Measured: TypeAlias = Union[str, Path, "pd.DataFrame", Sequence[Union[str, Path, "pd.DataFrame"]]]


class Begun(TypedDict, total=False):
    """Options of `Study.new` with which ``Study(model, frame)`` begins, for editors."""

    rig: str | Path | None
    validation: Measured
    hold_out: str | Sequence[str]
    calibration: str | Path | None
    columns: Mapping[str, str] | None
    groups: str | Sequence[str]
    sheet: str


class Study:
    """A study: a model, measurements, and the steps that were taken.

    An object follows its directory: after `add` or `drop` it is the study as it is then. ``Study(model, frame)`` makes
    one without a directory of yours, which lasts as long as the program.

    Parameters
    ----------
    directory : str, Path or Model
        Of the study; or a model, with the `measurement` to compare it with.
    measurement : DataFrame, path or sequence of them, optional
        Measured data, columns as `Study.new` takes them.
    effects : sequence of paths
        Files with effects of your own, to take in, or to trust where the study comes from elsewhere.
    accept_changes : bool
        Go on although measured files have changed.
    **begun
        With a model: the options of `Study.new`, such as ``hold_out``.

    Raises
    ------
    RequestError, InputError
        The directory holds no study, or what it names is missing or has changed.
    """

    def __init__(
        self,
        directory: str | Path | Model,
        measurement: Measured | None = None,
        *,
        effects: Sequence[str | Path] = (),
        accept_changes: bool = False,
        **begun: Unpack[Begun],
    ) -> None:
        if measurement is not None:
            self._place = TemporaryDirectory(prefix="specan-study-")
            initial = [str(name) for name in effects] or None
            made = Study.new(self._place.name, directory, measurement, effects=initial, **begun)
            self._opened = made.opened
            return
        if not isinstance(directory, (str, Path)) or begun:
            raise RequestError(
                "a study of a model needs a measurement",
                expected="Study(model, frame), or the directory of a study",
            )
        self._opened = OpenedStudy(Path(directory), accept_changes, [Path(e) for e in effects])

    @classmethod
    def new(
        cls,
        directory: str | Path,
        model: str | Path | Model,
        measurement: Measured,
        *,
        rig: str | Path | None = None,
        validation: Measured = (),
        hold_out: str | Sequence[str] = (),
        calibration: str | Path | None = None,
        effects: Sequence[str] | None = None,
        columns: Mapping[str, str] | None = None,
        groups: str | Sequence[str] = (),
        sheet: str = "",
    ) -> Study:
        """Make a study directory and fit the model once.

        Parameters
        ----------
        directory : path
            Made if it does not exist; must not hold a study yet.
        model : str, path or Model
            Name of a model, a Python file that holds one, or one in memory, which lasts as long as the program.
        measurement : path, DataFrame, or sequence of them
            Data to fit. A data frame has a column for each condition and observable, in the model's units or with a
            unit in its name (``flow [l/s]``); it is written to the directory.
        rig : path, optional
            Rig file. Of a model that `load_model` built, give it there instead.
        validation : as `measurement`
            Data that are only ever predicted.
        hold_out : str or sequence of str
            Rows or channels to hold out of the fit: ``"torque=50"``, ``"flow=36..40 m3/h"``.
        calibration : path, optional
            Of recordings.
        effects : sequence of str, optional
            Effects to begin with; the model's base effects by default.
        columns : mapping, optional
            ``{column of the model: header of the table}`` where tables have names of their own.
        groups : str or sequence of str
            Columns of names (``specimen``) by which parameters may differ.
        sheet : str
            Of a workbook; the first with a table by default.

        Returns
        -------
        Study
            `assumptions` says what was found and assumed about the measurement.
        """
        from specan.models.catalogue import keep_in_memory
        from specan.study.create import begin, new_directory

        place = Path(directory)
        with new_directory(place):
            begun = begin(
                place,
                str(model) if isinstance(model, (str, Path)) else keep_in_memory(model),
                None if rig is None else Path(rig),
                _paths(measurement, place, "measurement"),
                validations=_paths(validation, place, "validation"),
                hold_out=[hold_out] if isinstance(hold_out, str) else list(hold_out),
                calibration=None if calibration is None else Path(calibration),
                effects=effects,
                columns=columns,
                groups=[groups] if isinstance(groups, str) else groups,
                sheet=sheet,
            )
        made = cls.__new__(cls)
        made._opened = begun.study
        return made

    @property
    def opened(self) -> OpenedStudy:
        """The study as the engine has it: for what a model analyses by itself."""
        return self._opened

    @property
    def directory(self) -> Path:
        """Where it is."""
        return self._opened.directory

    @property
    def model(self) -> Model:
        """The model, with the study's own effects."""
        return self._opened.model

    @property
    def effects(self) -> tuple[str, ...]:
        """Effects that the model has now."""
        return self._opened.model_effects

    @property
    def assumptions(self) -> tuple[str, ...]:
        """What was found and assumed about the measurement; all conclusions rest on it."""
        return tuple(self._opened.data.statements)

    def compare(self) -> Comparison:
        """Fit the parameters that the model has, and find where it fails.

        Returns
        -------
        Comparison
            Fitted parameters with intervals, errors, and the blocks of conditions where the model fails.
        """
        return self._opened.compare()

    def diagnose(self, *, progress: Progress | None = None) -> Diagnosis:
        """Find out which effect is missing; see `specan.diagnose`.

        Parameters
        ----------
        progress : callable, optional
            Called with a few words on what is being done, and the share of the whole that is over.

        Returns
        -------
        Diagnosis
            The verdict; its data frame holds what was tried, most likely first.
        """
        return self._opened.diagnose(progress=progress)

    def add(self, effect: str | Path, because: str = "") -> Change:
        """Add an effect, or a file with one, refit and keep the step.

        Parameters
        ----------
        effect : str or path
            Name, with its place where it acts at one: ``wall-impedance@z1``.
        because : str
            Reason, for the history.

        Returns
        -------
        Change
            Errors before and after, intervals of the new parameters, remarks.
        """
        from specan.study.edit import add_effect

        return self._changed(add_effect(self._opened, str(effect), because))

    def drop(self, effect: str, because: str = "") -> Change | None:
        """Take an effect out, refit and keep the step; or take out an effect file of your own.

        Parameters
        ----------
        effect : str
            Name, with its place where it acts at one; or an effect file that the study took in.
        because : str
            Reason, for the history.

        Returns
        -------
        Change or None
            Errors before and after, remarks; None for a file, which was only a candidate.
        """
        from specan.study.edit import drop_effect, drop_effect_file

        if effect.endswith(".py"):
            drop_effect_file(self.directory, effect)
            self._opened = OpenedStudy(self.directory)
            return None
        return self._changed(drop_effect(self._opened, effect, because))

    def history(self) -> History:
        """The steps with their errors on fitted and on held-out data.

        Returns
        -------
        History
            One row for each step.
        """
        return self._opened.history

    def next(self) -> NextMeasurements:
        """The measurements, within the rig's limits, that best separate what could be missing.

        Returns
        -------
        NextMeasurements
            The best first.
        """
        self._opened.require_uncertainty("next")
        return self.diagnose().next()

    def propose(self) -> ProposedLaws:
        """Laws for what no effect of the catalogue explains, written as effect files that `add` takes.

        Returns
        -------
        ProposedLaws
            The likeliest first.
        """
        from specan.study.propose import propose_laws

        return propose_laws(self._opened)

    def report(self, path: str | Path) -> Path:
        """Write everything on one self-contained HTML page.

        Parameters
        ----------
        path : str or Path
            File to write; its directory must exist.

        Returns
        -------
        Path
            The file.

        Raises
        ------
        RequestError
            The directory of `path` does not exist, or it is a measured file or one that specan did not write.
        """
        from specan.report.study_report import write_study_report

        path = Path(path)
        check_output(path)
        write_study_report(self._opened, path)
        return path

    def plot(self, path: str | Path | None = None, *, channel: str | None = None) -> Figure:
        """Measured and model, as ``specan study compare --plot`` draws them.

        Parameters
        ----------
        path : str or Path, optional
            Also save it there: .png, .svg or .pdf.
        channel : str, optional
            Of recordings, the channel whose curves are drawn.

        Returns
        -------
        matplotlib.figure.Figure
            Not shown; that is up to the caller.
        """
        return self.compare().plot(path=path, channel=channel)

    def __repr__(self) -> str:
        return repr(self._opened)

    def _repr_html_(self) -> str:
        return f"<p>{escape(repr(self))}</p>{self.history()._repr_html_()}"

    def _changed(self, change: Change) -> Change:
        self._opened = change.study
        return change


def diagnose(study: Study | str | Path) -> Diagnosis:
    """Find out which physical effect the model of a study is missing. Held-out data are not used.

    Parameters
    ----------
    study : Study or path
        A study, or its directory.

    Returns
    -------
    Diagnosis
        Its data frame holds what was tried, most likely first.

    Raises
    ------
    RequestError
        The uncertainty of the measurement is unknown.
    """
    opened = study if isinstance(study, Study) else Study(study)
    return opened.diagnose()


def _paths(given: Measured, place: Path, name: str) -> list[Path]:
    """Files of measured data; a data frame is written to one."""
    whole: list[Any] = list(given) if isinstance(given, (list, tuple)) else [given]
    found = []
    for number, one in enumerate(whole, 1):
        if isinstance(one, (str, Path)):
            found.append(Path(one))
            continue
        if not hasattr(one, "to_csv"):
            raise RequestError(
                f"the measured data are of type {type(one).__name__}",
                expected="a path or a data frame, or several",
            )
        place.mkdir(parents=True, exist_ok=True)
        found.append(place / f"{name}{'' if len(whole) == 1 else f'_{number}'}.csv")
        check_output(found[-1])
        with found[-1].open("w", encoding="utf-8", newline="") as file:
            file.write(f"# specan {__version__} data frame\n")
            one.to_csv(file, index=False)
    return found
