"""Models for work in Python."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from specan.models import Model


def load_model(name: str | Path, rig: Mapping[str, Any] | str | Path | None = None) -> Model:
    """Build a model for a rig, installed plug-in effects included.

    Parameters
    ----------
    name : str or Path
        Name of a built-in or installed model, a Python file that holds one Model or a function
        ``build(rig) -> Model``, or an FMU with a TOML file beside it.
    rig : mapping or path, optional
        A rig file, or what it says; by default the example that comes with the model, to look at.

    Returns
    -------
    Model
        With its whole catalogue of effects.

    Raises
    ------
    RequestError
        Unknown model, a file that holds none, or a rig that is incomplete or impossible.

    Examples
    --------
    >>> "windage" in load_model("worm-gear").effects
    True
    """
    from specan.models import catalogue
    from specan.models.catalogue import read_rig_file

    if rig is None:
        return catalogue.example_model(str(name))
    return catalogue.load_model(name, rig if isinstance(rig, Mapping) else read_rig_file(Path(rig)))
