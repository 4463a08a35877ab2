"""Plausible errors of torque sensors, on the scale of the machine that they are made for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from specan.models.effect import Effect

REFERENCE_TORQUE = 100.0  # N*m at the output, for which the ranges of these effects are declared
SCALED = ("torque-zero-error", "zero-drift")


def scaled_to_torque(effects: Mapping[str, Effect], largest_torque: float | None) -> dict[str, Effect]:
    """Effects with the zero errors of both sensors on the scale of the bench.

    A sensor's zero is specified in percent of its full scale (VDI/VDE 2646), and the sensor chosen for the largest
    torque. `largest_torque` is the upper limit of the output torque, N*m; None leaves the declared ranges.

    Examples
    --------
    >>> from specan.models.catalogue import effects_in
    >>> found = scaled_to_torque(effects_in("specan.models.worm_gear.effects"), 300.0)
    >>> found["torque-zero-error"].parameters["output"].max
    6.0
    """
    if not largest_torque:
        return dict(effects)
    factor = largest_torque / REFERENCE_TORQUE
    return {**effects, **{name: _scaled(effects[name], factor) for name in SCALED if name in effects}}


def _scaled(effect: Effect, factor: float) -> Effect:
    parameters = {
        name: replace(
            p, default=p.default * factor, min=p.min * factor, max=p.max * factor,
            lower=None if p.lower is None else p.lower * factor,
            upper=None if p.upper is None else p.upper * factor,
        )
        for name, p in effect.parameters.items()
    }  # fmt: skip
    return replace(effect, parameters=parameters)
