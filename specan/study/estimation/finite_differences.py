"""Stencils: points around a place, and the weights that make derivatives of what a model predicts there."""

from __future__ import annotations

import numpy as np

from specan.study.observation import Array

STEP = 1e-4  # of a parameter's scale, for central differences: truncation and rounding both near 1e-8

# Offsets in steps, their weights, and the weight of the centre. Taylor's theorem; Abramowitz & Stegun, table 25.2.
_Rule = tuple[tuple[int, ...], tuple[float, ...], float]
_FORWARD: _Rule = ((1,), (1.0,), -1.0)
_CENTRAL: _Rule = ((-1, 1), (-0.5, 0.5), 0.0)
_AT_AN_END: _Rule = ((1, 2), (2.0, -0.5), -1.5)
_FOURTH: _Rule = ((-2, -1, 1, 2), (1 / 12, -2 / 3, 2 / 3, -1 / 12), 0.0)
_FOURTH_AT_AN_END: _Rule = ((1, 2, 3, 4), (4.0, -3.0, 4 / 3, -1 / 4), -25 / 12)


def usual_stencil(
    theta: Array, scale: Array, low: Array, high: Array, exact: bool
) -> tuple[list[Array], Array]:
    """Points around theta (itself first, where it counts) and the weights that make derivatives of their predictions.

    Central differences; one-sided ones of second order where a bound is near. Plain one-sided ones where they
    need not be `exact`: what they err by, the step's share of the parameter's width, no step
    of a fit and no interval shows.
    """
    steps = STEP * np.maximum(scale, np.abs(theta))
    steps = (theta + steps) - theta
    rules = []
    for k, step in enumerate(steps):
        if not exact:
            rules.append(_mirrored(_FORWARD) if theta[k] + step > high[k] else _FORWARD)
        elif theta[k] - step < low[k]:
            rules.append(_AT_AN_END)
        elif theta[k] + step > high[k]:
            rules.append(_mirrored(_AT_AN_END))
        else:
            rules.append(_CENTRAL)
    return _stencil(theta, steps, rules)


def chosen_stencil(
    theta: Array, steps: Array, low: Array, high: Array, order: int
) -> tuple[list[Array], Array]:
    """The same of second or fourth order, with a step for each element of theta; one-sided where a bound is near.

    Examples
    --------
    >>> import numpy as np
    >>> none = np.array([np.inf])
    >>> points, weights = chosen_stencil(np.array([1.0]), np.array([1e-3]), -none, none, 4)
    >>> derivative = np.exp(np.array(points)[:, 0]) @ weights
    >>> bool(abs(derivative[0] - np.e) < 1e-12)
    True
    """
    inside, at_an_end = (_FOURTH, _FOURTH_AT_AN_END) if order == 4 else (_CENTRAL, _AT_AN_END)
    steps = np.minimum(steps, (high - low) / 8)  # four of them fit between one end and the middle
    steps = (theta + steps) - theta
    rules = []
    for k, step in enumerate(steps):
        reach = order // 2 * step
        if low[k] <= theta[k] - reach and theta[k] + reach <= high[k]:
            rules.append(inside)
        else:
            rules.append(at_an_end if theta[k] + 2 * reach <= high[k] else _mirrored(at_an_end))
    return _stencil(theta, steps, rules)


def _mirrored(rule: _Rule) -> _Rule:
    offsets, weights, centre = rule
    return tuple(-o for o in offsets), tuple(-w for w in weights), -centre


def _stencil(theta: Array, steps: Array, rules: list[_Rule]) -> tuple[list[Array], Array]:
    points = [theta]
    weights = np.zeros((1 + sum(len(rule[0]) for rule in rules), theta.size))
    for k, (step, (offsets, outside, centre)) in enumerate(zip(steps, rules, strict=True)):
        weights[0, k] = centre / step
        for offset, weight in zip(offsets, outside, strict=True):
            weights[len(points), k] = weight / step
            points.append(theta.copy())
            points[-1][k] += offset * step
    return (points, weights) if np.any(weights[0]) else (points[1:], weights[1:])
