"""A stretched spring on a stand that gives way: a model of a user's own, in one file."""

import numpy as np

from specan.models import (
    Condition,
    Model,
    Observable,
    Parameter,
    SettingError,
    Words,
    constant,
    effect,
    quantity,
    rig_statement,
)

EXAMPLE_RIG = {"limits": {"pull_N": [5.0, 60.0], "room_C": [10.0, 40.0]}, "uncertainty": {"stretch_mm": 0.2}}


@quantity(unit="m")
def stretch(pull, stiffness):
    """Stretch of the spring."""
    return pull / stiffness


@effect("stand", adds_to="stretch", neutral={"compliance": 0.0})
def stand(pull, *, compliance=Parameter(1e-3, "m", min=1e-5, max=1e-2, lower=-0.1, upper=0.1, doc="at 30 N")):
    """The stand bends under the pull, and stiffens."""
    return compliance * np.sqrt(pull / 30.0)


@effect("opening", adds_to="stretch", neutral={"cubic": 0.0})
def opening(pull, *, cubic=Parameter(3e-3, "m", min=1e-5, max=5e-2, lower=-0.5, upper=0.5, doc="at 60 N")):
    """Turns of the spring open when it is pulled far."""
    return cubic * (pull / 60.0) ** 3


@effect("warm-steel", scales="stretch", neutral={"softening": 0.0})
def warmth(
    ambient, *, softening=Parameter(1e-3, "1/K", min=1e-5, max=1e-2, lower=-0.02, upper=0.02, doc="rate")
):
    """Warm steel is softer."""
    return 1 + softening * (ambient - 293.15)


def build(rig):
    conditions = [
        Condition("pull", "N", "Force on the spring.", "pull_N", "N"),
        Condition(
            "ambient", "K", "Warmth around it.", "room_C", "degC", usual_setting=SettingError(absolute=1.0),
            label="warmth",
        ),
    ]  # fmt: skip
    observables = [Observable("stretch", "stretch", "m", "Stretch.", column="stretch_mm", column_unit="mm")]
    nodes = [constant("stiffness", 500.0, "N/m", "Stiffness of the spring."), stretch]
    return Model(
        name="spring",
        title="A spring on a stand",
        conditions={c.name: c for c in conditions},
        quantities={q.name: q for q in nodes},
        effects={e.name: e for e in (stand, opening, warmth)},
        observables={o.name: o for o in observables},
        base_effects=("stand",),
        rig=rig_statement(rig, conditions, observables),
        words=Words(ideal="the stiff stand", discrepancy_of="give", vary="pulls"),
    )
