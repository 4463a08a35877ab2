"""A channel of a simulated recording."""

from __future__ import annotations

from dataclasses import dataclass, field

from specan.arrays import Real


@dataclass(frozen=True)
class SimulatedChannel:
    """Samples of one channel in the unit of the quantity, and what an acquisition program would say of it."""

    name: str
    unit: str
    samples: Real
    sensitivity: float = 1.0
    sensitivity_unit: str = "V/V"
    properties: dict[str, object] = field(default_factory=dict)

    @property
    def volts(self) -> Real:
        """What the converter saw."""
        if self.unit == "V":
            return self.samples
        per_volt = self.sensitivity_unit.endswith("/V")
        scale = 1e-3 if self.sensitivity_unit.startswith("mm") else 1.0
        if per_volt:
            return self.samples / (self.sensitivity * scale)
        return self.samples * 1e-3 * self.sensitivity
