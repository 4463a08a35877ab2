"""Begin a study: a directory with its study file, and the first step of its history."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from specan.errors import RequestError
from specan.models import Model, Use
from specan.models.catalogue import is_file, load_model, read_rig_file
from specan.models.groups import with_groups
from specan.models.trial import check_units
from specan.result import gathered
from specan.study.build_problem import undetermined
from specan.study.history import Step, changing
from specan.study.observation import kind_of
from specan.study.study import PREDICTED, Study, relative_to
from specan.study.study_file import NAME, StudyText, file_hash
from specan.study.user_effects import take_in_model


@dataclass(frozen=True, eq=False)
class Begun:
    """A new study, and what was assumed on the way.

    Attributes
    ----------
    held : tuple of str
        Parameters that the data do not determine and that were fixed.
    units : str
        The first formula that contradicts its units, of which only the numbers count here.
    """

    study: Study
    step: Step
    held: tuple[str, ...]
    units: str = ""


def begin(
    directory: Path,
    model_name: str,
    rig: Path | None,
    measurements: Sequence[Path],
    *,
    validations: Sequence[Path] = (),
    hold_out: Sequence[str] = (),
    calibration: Path | None = None,
    effects: Sequence[str] | None = None,
    columns: Mapping[str, str] | None = None,
    groups: Sequence[str] = (),
    sheet: str = "",
) -> Begun:
    """Make a study directory.

    Parameters
    ----------
    directory : Path
        Made if it does not exist; must not hold a study yet.
    model_name : str
        Name of a model, or a Python file that holds one; see `specan.models.catalogue.load_model`.
    rig : Path, optional
        The rig file; a model of its own file may need none.
    measurements, validations : sequence of Path
        Data to fit, and data that are only ever predicted.
    hold_out : sequence of str
        Rows or channels of the measurements to hold out: ``load=60,90``.
    calibration : Path, optional
    effects : sequence of str, optional
        Effects to begin with; the model's base effects by default.
    columns : mapping, optional
        ``{column of the model: header of the table}`` where the tables have names of their own.
    groups : sequence of str, optional
        Columns of names (``specimen``) by which parameters may differ, beside those of the model.
    sheet : str
        Of the workbooks among the data; the first with a table by default.

    Raises
    ------
    RequestError, InputError
        See `Study`. Nothing is left behind then.
    """
    if not measurements:
        raise RequestError("a study needs a measurement", remedy="give one with --measurement FILE")
    if sheet and all(path.suffix.lower() != ".xlsx" for path in (*measurements, *validations)):
        raise RequestError(f"none of the tables has a sheet {sheet!r}", expected="a workbook (.xlsx)")
    model = load_model(model_name, read_rig_file(rig) if rig else {})
    paths = {"rig": rig, "calibration": calibration}
    data = {"measurement": measurements, "validation": validations}
    content: dict[str, Any] = {
        "schema": 1,
        "model": model_name,
        **{key: relative_to(directory, path) for key, path in paths.items() if path is not None},
        "columns": dict(columns or {}),
        "groups": list(groups),
        **{
            key: [_data_entry(directory, path, model, sheet) for path in files] for key, files in data.items()
        },
        "hold_out": [{"where": where} for where in hold_out],
    }
    content = {key: value for key, value in content.items() if value}
    model = with_groups(model, groups)
    content["effect"] = _effects(model, model.base_effects if effects is None else effects, len(measurements))
    with new_directory(directory):
        return _begun(directory, model_name, content)


@contextmanager
def new_directory(directory: Path) -> Iterator[None]:
    """A directory that is to hold a study; where there is a fault it goes again, unless it was there before.

    Raises
    ------
    RequestError
        It holds a study already.
    """
    if (directory / NAME).exists():
        raise RequestError(f"{directory} holds a study already", remedy="choose another directory")
    existed = directory.exists()
    directory.mkdir(parents=True, exist_ok=True)
    try:
        yield
    except BaseException:
        if not existed and not (directory / NAME).exists():
            shutil.rmtree(directory, ignore_errors=True)
        raise


def _begun(directory: Path, model_name: str, content: dict[str, Any]) -> Begun:
    """The study that a content describes, in its directory."""
    if is_file(model_name):
        own, sha256 = take_in_model(directory, Path(model_name))
        content = {"schema": 1, "model": own, "model_sha256": sha256, **dict(list(content.items())[2:])}

    def named(fault: str) -> str:
        """Told of the file that the user has: the study's copy may go."""
        return fault.replace(str(directory / content["model"]), model_name)

    try:
        study, held = hold_undetermined(Study(directory, draft=StudyText.begin(directory / NAME, content)))
    except RequestError as fault:
        raise type(fault)(named(fault.found), expected=fault.expected, remedy=fault.remedy) from None
    if study.problem.strategy.linearised_covariance and study.best.p_value < PREDICTED:
        # covariances about a fit that went astray hold it there
        again = Study(directory, draft=study.text(), near=study.best.values)
        study = min(study, again, key=lambda one: one.best.chi2)
    study = study.settled()
    step = study.step("new")
    with changing(directory):
        if (directory / NAME).exists():
            raise RequestError(f"{directory} holds a study already", remedy="choose another directory")
        study.keep(step)
    try:
        if study.model.is_own:
            check_units(study.model, study.data.fitted[0].conditions)
    except RequestError as fault:
        return Begun(study, step, held, named(fault.found))
    return Begun(study, step, held)


def _data_entry(directory: Path, path: Path, model: Model, sheet: str) -> dict[str, Any]:
    if not os.path.exists(path):  # Path.exists raises where a name is too long
        raise RequestError(f"the measurement {path} does not exist", remedy="check the path")
    entry = {"file": relative_to(directory, path), "sha256": file_hash(path), "kind": kind_of(path, model)}
    return entry | ({"sheet": sheet} if sheet and path.suffix.lower() == ".xlsx" else {})


def _effects(model: Model, names: Sequence[str], recordings: int) -> list[dict[str, Any]]:
    """Entries of the effects to begin with, and of the instrument errors that have a prior."""
    uses = model.assemble(names).uses
    entries = [effect_entry(use) for use in uses]
    held = gathered((Use.parse(nuisance.effect), nuisance) for nuisance in model.nuisances)
    for use, parts in held.items():
        if use in uses:
            continue
        entry = effect_entry(use, "nuisance")
        own = {n.parameter for n in parts if n.per_recording and recordings > 1}
        if len(parts) == 1 and not own:
            entry["prior_sd"] = parts[0].prior_sd
        else:
            known = model.effects[use.name].parameters
            entry["parameters"] = {
                n.parameter: {
                    "prior_sd": n.prior_sd,
                    "unit": known[n.parameter].unit,
                    **({"per": "recording"} if n.parameter in own else {}),
                }
                for n in parts
            }
        entries.append(entry)
    return entries


def effect_entry(use: Use, role: str = "model") -> dict[str, Any]:
    """What the study file says of an effect that was just added."""
    name = use.name + (f"@{use.copy}" if use.copy > 1 else "")
    return {"name": name, **({"at": use.at} if use.at else {}), "role": role}


def hold_undetermined(study: Study) -> tuple[Study, tuple[str, ...]]:
    """Fix, in the draft of the study file, the parameters that the data do not determine; says which."""
    names = tuple(
        n for n in undetermined(study.problem, study.problem.start()) if n.whole not in study.problem.priors
    )
    if not names:
        return study, ()
    text = study.text()
    for name in dict.fromkeys(name.whole for name in names):
        text.fix_parameter(name)
    return Study(study.directory, draft=text), names
