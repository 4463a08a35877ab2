"""What drove a recording."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

ExcitationKind = Literal["sine", "noise", "sweep", "stepped-sine", "calibrator", "unknown"]


@dataclass(frozen=True)
class Excitation:
    """Kind of excitation and how it was decided.

    Attributes
    ----------
    kind : {"sine", "noise", "sweep", "stepped-sine", "calibrator", "unknown"}
    frequency_hz : float or None
        Frequency of the sine or of the calibrator, where it is known.
    reason : str
        Who said so (user, property, channel), and what contradicts it.
    stated : bool
        Whether somebody said so; else it was found in the signal.
    """

    kind: ExcitationKind
    frequency_hz: float | None
    reason: str
    stated: bool = False
