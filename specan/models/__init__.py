"""Physics: quantities, parameters, effects and the models made of them.

A model is an acyclic graph of named quantities; an effect is a small pure function that adds to,
scales or joins some of them. See `specan.models.effect.effect` for how to write one.
"""

from specan.models.assembly import Assembly, Evaluation, varying
from specan.models.check import check_effect, conditions_over_limits
from specan.models.effect import Effect, Use, effect
from specan.models.model import LawSpace, Model, Nuisance, Observable
from specan.models.parameter import Parameter
from specan.models.quantity import Condition, Quantity, constant, quantity

__all__ = [
    "Assembly", "Condition", "Effect", "Evaluation", "LawSpace", "Model", "Nuisance", "Observable", "Parameter",
    "Quantity", "Use", "check_effect", "conditions_over_limits", "constant", "effect", "quantity", "varying",
]  # fmt: skip
