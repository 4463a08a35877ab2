"""Which simulation belongs to a model: its own, one that an installed package brings, or that of any table."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from specan.errors import RequestError

if TYPE_CHECKING:
    from specan.models.model import Model

# model -> module with `run(model, options)`
SIMULATORS = {
    "planetary-gear": "specan_cli.simulate_planetary_gear",
    "room": "specan_cli.simulate_room",
    "worm-gear": "specan_cli.simulate_worm_gear",
}
ENTRY_POINTS = "specan.simulators"  # of installed packages: name of the model = `run(model, options)`


def simulator_of(model: Model) -> Callable[[Model, Mapping[str, Any]], None]:
    """The function that carries out ``specan simulate`` for a model.

    Raises
    ------
    RequestError
        None is known, and its measurements are no tables.
    """
    from importlib.metadata import entry_points

    if model.name in SIMULATORS:
        run: Callable[[Model, Mapping[str, Any]], None] = importlib.import_module(SIMULATORS[model.name]).run
        return run
    for point in entry_points(group=ENTRY_POINTS):
        if point.name == model.name:
            run = point.load()
            return run
    if "table" in model.kinds:
        run = importlib.import_module("specan_cli.simulate_table").run
        return run
    raise RequestError(f"the model {model.name!r} cannot be simulated from the command line")
