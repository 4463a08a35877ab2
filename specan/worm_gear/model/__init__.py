"""The worm gear: losses of tooth engagement, bearings and oil, and what instruments indicate of them.

Decisions: docs/decisions/worm_gear.md.
"""

from specan.worm_gear.model.build import build
from specan.worm_gear.model.rig import EXAMPLE_RIG

__all__ = ["EXAMPLE_RIG", "build"]
