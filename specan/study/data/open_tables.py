"""From table files to observations: what is fitted, what is held out, what only validates."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from specan.models import Model
from specan.models.groups import grouped
from specan.models.trial import try_model
from specan.study.data.held_out import Column, put_aside
from specan.study.data.operating_table import SCATTER, Rows, check_varied, join
from specan.study.data.setpoints import grouping_of
from specan.study.data.table_covariance import uncertainty
from specan.study.data.table_file import beginning
from specan.study.data.table_reader import read_measurement
from specan.study.observation import MeasuredFiles, OpenedData

TITLE = "a table (text with a header line, .xlsx, Parquet)"


def reads(path: Path) -> bool:
    """Whether a file is text, a workbook or Parquet, whatever its name."""
    start = beginning(path)
    if start[:2] in (b"\xff\xfe", b"\xfe\xff"):  # UTF-16
        return True
    # an archive of another name is not a table
    workbook = start.startswith(b"PK") and path.suffix.lower() in (".xlsx", ".xlsm")
    if start.startswith(b"PAR1") or workbook:
        return True
    return bool(start) and b"\0" not in start and not start.startswith((b"RIFF", b"TDSm", b"PK"))


def open_data(model: Model, wanted: MeasuredFiles) -> OpenedData:
    """Read the tables of a study and work out their uncertainty on the rows that are fitted.

    Raises
    ------
    InputError
        See `read_measurement`; or all rows are alike.
    RequestError
        A condition that no row meets, or nothing left to fit.
    """
    fitted = [read_measurement(f, model) for f in wanted.measurements]
    checked = [read_measurement(f, model) for f in wanted.validations]
    rows = join([*fitted, *checked], model)
    if model.is_own:
        try_model(model.assemble(model.base_effects), rows.conditions)
    columns = {model.conditions[name].column: _column(rows, model, name) for name in rows.conditions}
    unseen = rows.recording >= len(fitted)
    aside = put_aside(columns, wanted, rows.recordings, rows.recording, unseen)
    rows = rows.names_of_first(~aside)
    model = grouped(model, rows.groups)
    check_varied(rows.take(~aside), model)
    found = uncertainty(model, rows.take(~aside))
    whole = found.observe(rows)
    kept = replace(whole.take(~aside), pure_error_dof=whole.pure_error_dof) if np.any(aside) else whole
    return OpenedData(
        fitted=(kept,),
        held_out=(whole.take(aside),) if np.any(aside) else (),
        statements=found.statements,
        known=found.known,
        discrepancy_percent=model.rig.discrepancy_percent,
        doubts=rows.doubts,
    )


def _column(rows: Rows, model: Model, name: str) -> Column:
    condition = model.conditions[name]
    if condition.group:
        return Column(np.array([*rows.groups[name], ""])[rows.conditions[name].astype(int)])
    setting = grouping_of(model, condition)

    def reach(value: float) -> float:
        read = 0.0 if rows.is_set[name] else SCATTER * float(setting.at(value))
        return max(read, 5e-4 * abs(value), 1e-12)  # levels are printed to four digits

    return Column(rows.levels[name], condition, rows.units.get(name, ""), reach)
