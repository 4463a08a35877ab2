"""The worm gear: losses of tooth engagement, bearings and oil, and what instruments indicate of them."""

from specan.models.worm_gear.build import build

__all__ = ["build"]
