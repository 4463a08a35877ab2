"""A worm gear on a test bench whose truth is known: another physics than that of the models, on purpose.

A model that is tried on data made with its own formulas proves nothing. Here viscosity follows the chart of
Ubbelohde and Walther, tooth friction is integrated over explicit contact points with force vectors, bearings are
summed ball by ball, the oil's drag saturates with speed; hidden effects wear another mathematical form than the
catalogue gives them.
"""

from truth.worm_gear.bench import TruthCase, simulate, write
from truth.worm_gear.effects import EFFECTS, HiddenEffect
from truth.worm_gear.plans import PLANS, Plan

__all__ = ["EFFECTS", "PLANS", "HiddenEffect", "Plan", "TruthCase", "simulate", "write"]
