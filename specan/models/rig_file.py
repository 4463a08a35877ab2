"""A rig file and the files that it names, which lie beside it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from specan.schema import read_toml

_FILES = (("room", "mesh"),)  # keys whose values are paths


def read_rig_file(path: Path) -> dict[str, Any]:
    """Read a rig file; paths in it are relative to where it lies, and are made absolute.

    Raises
    ------
    RequestError
        It does not exist or is not valid TOML.
    """
    content = read_toml(path)
    for table, key in _FILES:
        given = content.get(table)
        if isinstance(given, dict) and isinstance(given.get(key), str):
            given[key] = str((path.parent / given[key]).resolve())
    return content


def rig_files(path: Path) -> tuple[Path, ...]:
    """The rig file and the files that it names: everything that decides what the rig is."""
    content = read_rig_file(path)
    tables = [(content.get(table), key) for table, key in _FILES]
    named = [table.get(key) for table, key in tables if isinstance(table, dict)]
    return (path, *(Path(name) for name in named if isinstance(name, str)))
