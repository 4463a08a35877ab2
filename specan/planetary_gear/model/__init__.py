"""A planetary gear with a fixed ring: meshing forces in time, order lines of the ring's acceleration.

Decisions: docs/decisions/orders_and_gears.md.
"""

from specan.planetary_gear.model.build import build
from specan.planetary_gear.model.rig import EXAMPLE_RIG

__all__ = ["EXAMPLE_RIG", "build"]
