"""What one file gives to a batch: lines of the tables, and what is needed to join files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from specan.data.tone import ToneTable

Kind = Literal["done", "aside", "failed"]


@dataclass(frozen=True)
class FileResult:
    """Result of one file, small enough to travel between processes.

    Attributes
    ----------
    kind : {"done", "aside", "failed"}
        Skipped is what is not a failure: a calibrator, a spectrum, a table.
    reason : str
        Why there is no result, or why the file was taken for what it is.
    about : tuple of str
        Lines for the headers of the tables that the file appears in.
    blocks : mapping of str to str
        Lines of each table.
    tones : tuple of ToneTable
        Of sine recordings, one for each run, for the stepped-sine characteristic of its directory.
    set_aside : tuple of (channel, reason)
        Channels that gave no result; the channel is empty for the whole file.
    """

    label: str
    kind: Kind
    reason: str = ""
    about: tuple[str, ...] = ()
    blocks: Mapping[str, str] = field(default_factory=dict)
    tones: tuple[ToneTable, ...] = ()
    set_aside: tuple[tuple[str, str], ...] = ()
