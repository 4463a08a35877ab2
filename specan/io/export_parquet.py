"""Samples as Parquet, for programs that ask questions of tables."""

from __future__ import annotations

from pathlib import Path

from specan import __version__
from specan.io.export_file import Excerpt, library
from specan.io.output_file import whole_file
from specan.io.text_cell import escaped


def write_parquet(excerpt: Excerpt, path: Path) -> None:
    """Write time and samples, one column a channel; unit, role and group are in the columns' metadata.

    Raises
    ------
    RequestError
        pyarrow is not installed, or the file cannot be written.
    """
    pyarrow, parquet = library("pyarrow", "parquet"), library("pyarrow.parquet", "parquet")
    fields = [pyarrow.field("time_s", pyarrow.float64(), metadata={"unit": "s"})]
    for name, channel in zip(excerpt.names(), excerpt.channels, strict=True):
        about = {"unit": channel.unit, "role": channel.role, "group": escaped(channel.group)}
        fields.append(pyarrow.field(escaped(name), pyarrow.float64(), metadata=about))
    whole = {
        "writer": f"specan {__version__}",
        "recording": escaped(excerpt.recording.label),
        "sampling_rate_hz": repr(excerpt.rate),
    }
    schema = pyarrow.schema(fields, metadata=whole)
    with whole_file(path) as half, parquet.ParquetWriter(half, schema) as writer:
        for time, samples in excerpt.blocks():
            writer.write_table(pyarrow.table([time, *samples], schema=schema))
