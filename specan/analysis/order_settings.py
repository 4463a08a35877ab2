"""What is asked of an order analysis."""

from __future__ import annotations

from pydantic import Field

from specan.schema import Settings
from specan.units import Quantity

BLOCK_TURNS = 8


class OrderSettings(Settings):
    """Fields of `specan.analysis.orders.Orders`, which says what they are."""

    channels: tuple[str, ...] = ()
    tacho: str | None = None
    pulses_per_turn: float | None = Field(default=None, gt=0.0)
    ratio: float = Field(default=1.0, gt=0.0)
    speed_hz: float | None = Field(default=None, gt=0.0)
    max_order: float | None = Field(default=None, gt=0.0)
    turns: int = Field(default=BLOCK_TURNS, ge=1)
    average_turns: int = Field(default=1, ge=1)
    orders: tuple[float, ...] = ()
    mesh: float | None = Field(default=None, gt=0.0)
    harmonics: int = Field(default=3, ge=1)
    sidebands: int = Field(default=0, ge=0)
    quantity: Quantity | None = None
    envelope_hz: tuple[float, float] | None = None
    columns: int = Field(default=200, ge=1)
    start_s: float = Field(default=0.0, ge=0.0)
    stop_s: float | None = Field(default=None, gt=0.0)

    @property
    def wanted(self) -> tuple[float, ...]:
        """Orders whose amplitudes are wanted, sorted, each once."""
        found = {float(order) for order in self.orders}
        if self.mesh is not None:
            reach = range(-self.sidebands, self.sidebands + 1)
            found |= {h * self.mesh + k for h in range(1, self.harmonics + 1) for k in reach}
        return tuple(sorted(order for order in found if order > 0))
