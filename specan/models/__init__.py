"""Physics: quantities, parameters, effects and the models made of them.

A model is an acyclic graph of named quantities; an effect is a small pure function that adds to,
scales or joins some of them. See `specan.models.effect.effect` for how to write one.
"""

from specan.models.check import check_effect, conditions_over_limits
from specan.models.effect import Effect, Parameter, Use, effect
from specan.models.evaluation import Evaluation, varying
from specan.models.model import Assembly, Model, Nuisance, Words
from specan.models.quantity import (
    Completed,
    Condition,
    Frf,
    Observable,
    Quantity,
    Reading,
    RigStatement,
    SettingError,
    TableFault,
    TableRules,
    constant,
    quantity,
    rig_statement,
)
from specan.models.rates import Signal, State

__all__ = [
    "Assembly", "Completed", "Condition", "Effect", "Evaluation", "Frf", "Model", "Nuisance", "Observable",
    "Parameter", "Quantity", "Reading", "RigStatement", "SettingError", "Signal", "State", "TableFault",
    "TableRules", "Use", "Words", "check_effect", "conditions_over_limits", "constant", "effect", "quantity",
    "rig_statement", "varying",
]  # fmt: skip
