"""The worm gear: losses of tooth engagement, bearings and oil, and what instruments indicate of them.

Decisions: docs/decisions/worm_gear.md.
"""

from specan.models.worm_gear.build import build
from specan.models.worm_gear.rig import EXAMPLE_RIG

__all__ = ["EXAMPLE_RIG", "build"]
