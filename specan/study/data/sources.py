"""Kinds of measured files, and who turns each into observations."""

from __future__ import annotations

import importlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

from specan.errors import InputError, RequestError, nearest
from specan.models import Model
from specan.study.observation import Observation

# kind -> module with `reads(path) -> bool`, `TITLE` and `open_data(model, wanted) -> OpenedData`
KINDS = {
    "table": "specan.study.data.open_tables",
    "frf": "specan.study.data.open_recordings",
    "transfer": "specan.study.data.open_transfer",
    "orders": "specan.study.data.open_orders",
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


@dataclass(frozen=True)
class MeasuredFiles:
    """The files of one kind, and what is to be put aside: pairs (file name or None, ``load=60``)."""

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
    """

    fitted: tuple[Observation, ...]
    held_out: tuple[Observation, ...]
    statements: tuple[str, ...] = ()
    known: bool = True
    discrepancy_percent: float = 0.0


def kind_named(kind: str) -> Any:
    """Module of a kind of measurement, built in or from an installed package.

    Raises
    ------
    RequestError
        There is none of that name.
    """
    if kind in KINDS:
        return importlib.import_module(KINDS[kind])
    installed = {point.name: point for point in entry_points(group=ENTRY_POINTS)}
    if kind in installed:
        return installed[kind].load()
    raise RequestError(f"a study reads no {kind!r}", remedy=nearest(kind, [*KINDS, *installed]))


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
    )
