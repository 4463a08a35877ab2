"""Planetary gears with a known truth, by equations and an integrator that the model does not use."""

from truth.planetary_gear.case import OUTSIDE, Gear, draw, write_case

__all__ = ["OUTSIDE", "Gear", "draw", "write_case"]
