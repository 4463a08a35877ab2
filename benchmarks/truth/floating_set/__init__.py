"""Planetary gears whose parts move in the plane on their bearings, in an elastic ring, heard through a drawn path."""

from truth.floating_set.case import draw, write_case

__all__ = ["draw", "write_case"]
