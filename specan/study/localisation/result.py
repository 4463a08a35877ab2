"""Where a model fails, as blocks of conditions and as sentences; and the control of false discoveries."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specan.study.observation.variable import Variable, variable_named

LEVEL = 0.05  # false discovery rate
CLEAR = 3.0  # |z| from which a mean error is named


@dataclass(frozen=True)
class Block:
    """Rows that were left out together.

    Attributes
    ----------
    where : mapping
        Operating variable to level, ``{"load_kN": 2.0}``.
    n : int
        Number of rows.
    statistic, p_value : float
        S_b and its probability under a true model.
    z : float
        Mean relative error over its standard uncertainty; positive where the model is high.
    error_percent, error : float
        That mean relative error of the prediction, and what it is in the observable's unit.
    significant : bool
        Passed by Benjamini and Yekutieli's rule (blocks overlap) at a false discovery rate of 5 %.
    level_dB, phase_deg, z_phase : float or None
        Of transfer functions: model over measurement, and the z of the phase (`z` is that of the level).
    variables : mapping
        Words and unit of the operating variables.
    """

    where: Mapping[str, Any]
    observable: str
    n: int
    statistic: float
    p_value: float
    z: float
    error_percent: float
    error: float
    unit: str
    significant: bool = False
    level_dB: float | None = None
    phase_deg: float | None = None
    z_phase: float | None = None
    variables: Mapping[str, Variable] = field(default_factory=dict, repr=False)

    @property
    def text(self) -> str:
        """What the model does there: ``model 4.2 % (0.11 mm) high``, ``model 4 dB high``."""
        if self.level_dB is not None:
            return level_and_phase(self.level_dB, self.z, self.phase_deg, self.z_phase)
        if abs(self.z) < CLEAR:
            return "model off in both directions"
        size = f" ({abs(self.error):.2g} {self.unit})" if self.unit not in ("", "1") else ""
        return f"model {abs(self.error_percent):.2g} %{size} {'high' if self.z > 0 else 'low'}"

    @property
    def place(self) -> str:
        """Where that is: ``2 kN (load), 60 mm (width)``."""
        return ", ".join(self._variable(name).spoken(level) for name, level in self.where.items())

    @property
    def short_place(self) -> str:
        """The same without the variables' names: ``2 kN, 60 mm``."""
        return ", ".join(self._variable(name).short(level) for name, level in self.where.items())

    def _variable(self, name: str) -> Variable:
        return variable_named(name, self.variables)

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        found = {
            "where": dict(self.where), "observable": self.observable, "z": self.z, "p_value": self.p_value,
            "error_percent": self.error_percent, "error": self.error, "unit": self.unit, "n": self.n, "text": self.text,
        }  # fmt: skip
        if self.level_dB is not None:
            found |= {"level_dB": self.level_dB, "phase_deg": self.phase_deg, "z_phase": self.z_phase}
        return found


@dataclass(frozen=True)
class Trend:
    """Whether the residual depends on an operating variable at all.

    Attributes
    ----------
    p_value : float
        Of the fall in chi-square if every level had its own offset.
    sentence : str
        ``fails from 2 kN up: model 6 % low (z = -5.1)``; empty where there is nothing to say.
    """

    variable: str
    p_value: float
    significant: bool
    sentence: str
    words: str = ""


@dataclass(frozen=True)
class Localisation:
    """Blocks and trends of one fit, the most improbable first.

    Attributes
    ----------
    notes : tuple of str
        Sentences on where it fails, where they say more than those of the trends.
    """

    blocks: tuple[Block, ...]
    trends: tuple[Trend, ...]
    notes: tuple[str, ...] = ()

    @property
    def fails_at(self) -> tuple[Block, ...]:
        """Blocks that are significant."""
        return tuple(b for b in self.blocks if b.significant)

    def sentences(self) -> list[str]:
        """Where the model fails and where not, in words."""
        failing = list(self.notes) or list(
            dict.fromkeys(t.sentence for t in self.trends if t.significant and t.sentence)
        )
        calm = [f"{t.words or t.variable} (p = {t.p_value:.2g})" for t in self.trends if not t.significant]
        if not failing and self.fails_at:
            worst = self.fails_at[0]
            failing = [f"fails at {worst.place}: {worst.text} (z = {worst.z:.1f})"]
        if not failing:
            return ["no block of conditions stands out"]
        return [*failing, *(["no dependence on " + ", ".join(calm)] if calm else [])]


def level_and_phase(level_dB: float | None, z: float, phase_deg: float | None, z_phase: float | None) -> str:
    """``model 4.0 dB high``, ``model 12 degrees ahead``, or both.

    Examples
    --------
    >>> level_and_phase(3.96, 8.0, -2.0, -1.0)
    'model 4 dB high'
    >>> level_and_phase(-0.31, -4.0, -12.2, -9.0)
    'model 0.31 dB low and 12 degrees behind'
    """
    parts = []
    if abs(z) >= CLEAR and level_dB is not None:
        parts.append(f"{abs(level_dB):.2g} dB {'high' if level_dB > 0 else 'low'}")
    if z_phase is not None and abs(z_phase) >= CLEAR and phase_deg is not None:
        parts.append(f"{abs(phase_deg):.2g} degrees {'ahead' if phase_deg > 0 else 'behind'}")
    return "model " + (" and ".join(parts) or "off in no one direction")


def benjamini_yekutieli(p_values: Sequence[float], level: float) -> NDArray[np.bool_]:
    """Which hypotheses fall at a false discovery rate, whatever the dependence between them.

    Examples
    --------
    >>> benjamini_yekutieli([1e-6, 0.2, 0.9], 0.05).tolist()
    [True, False, False]
    """
    p = np.asarray(p_values, dtype=float)
    if not p.size:
        return np.zeros(0, dtype=bool)
    p = np.where(np.isfinite(p), p, 1.0)
    m = p.size
    limit = level / np.sum(1 / np.arange(1, m + 1)) * np.arange(1, m + 1) / m
    ordered = np.sort(p)
    below = np.flatnonzero(ordered <= limit)
    return p <= (ordered[below[-1]] if below.size else -1.0)
