"""The file that ``specan model new`` writes: a model that keeps its promises, to be changed into another."""

TEMPLATE = '''"""NAME: what it is a model of, in a line."""

from specan.models import Condition, Model, Observable, Parameter, Words, constant, effect, quantity, rig_statement

EXAMPLE_RIG = {"limits": {"load_N": [5.0, 60.0]}, "uncertainty": {"stretch_mm": 0.2}}  # a rig file's tables

CONDITIONS = [Condition("load", "N", "What is set or read, one value a row.", "load_N", "N")]
OBSERVABLES = [Observable("stretch", "stretch", "m", "What is measured.", column="stretch_mm", column_unit="mm")]


@quantity(unit="m")
def stretch(load, stiffness):
    """A quantity; its arguments are the conditions and quantities that it reads, in SI."""
    return load / stiffness


@effect("give", adds_to="stretch", neutral={"compliance": 0.0})
def give(load, *, compliance=Parameter(1e-3, "m", min=1e-5, max=1e-2, lower=-0.1, upper=0.1, doc="at 30 N")):
    """An effect that may be missing: what it is, for whoever reads the verdict."""
    return compliance * (load / 30.0) ** 2


def build(rig):
    """The model for a rig file."""
    nodes = [constant("stiffness", 500.0, "N/m", "A number that the model takes as known."), stretch]
    return Model(
        name="NAME",
        title="What it is a model of",
        conditions={c.name: c for c in CONDITIONS},
        quantities={q.name: q for q in nodes},
        effects={e.name: e for e in [give]},
        observables={o.name: o for o in OBSERVABLES},
        base_effects=(),  # effects that a study starts with
        rig=rig_statement(rig, CONDITIONS, OBSERVABLES),
        words=Words(discrepancy_of="stretch"),
    )
'''
