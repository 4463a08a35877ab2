"""What may be evaluated in one pass over many rows: found out once for each effect and parameter.

Most effects treat every operating point by itself, and take a parameter that differs from row to row.
Some do not: a lag looks at the readings before, an effect may ask ``if parameter > 0``. Nothing declares
this, so it is tried.
"""

from __future__ import annotations

import weakref
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from specan.errors import ComputationError
from specan.models import Assembly, Use
from specan.study.observation import Array


@dataclass
class Knowledge:
    """What was found out about the effects and parameters of one model."""

    coupled: dict[Use, bool] = field(default_factory=dict)
    vector: dict[str, bool] = field(default_factory=dict)


# model id -> (the model, what is known); forgotten together with the model
_KNOWN: dict[int, tuple[weakref.ref[Any], Knowledge]] = {}


def knowledge(assembly: Assembly) -> Knowledge:
    """What is known about the model of an assembly."""
    key = id(assembly.model)
    if key not in _KNOWN:
        _KNOWN[key] = (weakref.ref(assembly.model, lambda _: _KNOWN.pop(key, None)), Knowledge())
    return _KNOWN[key][1]


def rows_are_coupled(assembly: Assembly, conditions: Mapping[str, Array]) -> bool:
    """Whether an effect of the assembly looks from one row at another.

    Tried at the default values: every second row alone must give what it gives among the others.
    """
    known = knowledge(assembly).coupled
    for use in assembly.uses:
        if use not in known:
            known[use] = _is_coupled(assembly, use, conditions)
    return any(known[use] for use in assembly.uses)


def _is_coupled(assembly: Assembly, use: Use, conditions: Mapping[str, Array]) -> bool:
    alone = assembly.model.assemble([*assembly.model.base_effects, use])
    changed = assembly.model.effects[use.name].changes
    half = {name: column[::2] for name, column in conditions.items()}
    try:
        with np.errstate(all="ignore"):
            whole, part = alone.evaluate(conditions, None, changed), alone.evaluate(half, None, changed)
    except ComputationError:
        return True  # nothing is known where the defaults have no solution
    for name in changed:
        if assembly.model.quantities[name].collection:
            return True
        one, two = np.asarray(whole[name]), np.asarray(part[name])
        if one.ndim and not np.allclose(one[..., ::2], two, rtol=1e-9, atol=0, equal_nan=True):
            return True
    return False
