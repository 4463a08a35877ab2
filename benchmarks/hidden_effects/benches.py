"""The benches, one a model: which cases there are and how they are counted."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, ClassVar, Protocol

from hidden_effects import cases, gear_cases, judge, judge_gears, judge_rooms, room_cases


class Case(Protocol):
    """One data set and what is hidden in it."""

    engine: ClassVar[str]

    @property
    def key(self) -> str:
        """Name of the case in result files."""

    @property
    def truth(self) -> tuple[str, ...]:
        """Catalogue names of what is hidden."""

    def simulate(self, cache: Path | None = None) -> Any:
        """The data."""

    def write(self, truth: Any, folder: Path, cache: Path | None = None) -> None:
        """What the search gets."""

    def as_dict(self) -> dict[str, Any]:
        """For a result file."""


@dataclass(frozen=True)
class Bench:
    """Cases of one model.

    Attributes
    ----------
    full : mapping
        Number of cases of each kind in the full bench.
    planned : callable
        ``(kind, count, reserved=, only=)``: the first cases of a kind.
    rows : sequence of Row
        What is counted.
    """

    full: Mapping[str, int]
    planned: Callable[..., list[Any]]
    rows: Sequence[judge.Row]


BENCHES = {
    "worm-gear": Bench(cases.FULL, cases.planned, judge.ROWS),
    "planetary-gear": Bench(gear_cases.FULL, gear_cases.planned, judge_gears.ROWS),
    "floating-set": Bench(
        gear_cases.FULL, partial(gear_cases.planned, case=gear_cases.FloatingCase), judge_gears.ROWS
    ),
    "room": Bench(room_cases.FULL, room_cases.planned, judge_rooms.ROWS),
}
