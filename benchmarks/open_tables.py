"""Tables as observations, without the directory of a study."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from specan.models import Model
from specan.study.data.open_tables import open_data
from specan.study.observation import DataFile, MeasuredFiles, OpenedData


def read_tables(
    model: Model, measurements: Sequence[Path], hold_out: Sequence[tuple[str | None, str]] = ()
) -> OpenedData:
    """What is fitted and held out; `hold_out` are pairs of a file's name, or None, and ``load=60,90``."""
    fitted = [DataFile(path.name, path) for path in measurements]
    return open_data(model, MeasuredFiles(fitted, hold_out=hold_out))
