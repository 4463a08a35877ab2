"""What the data alone would take of a model, compared with what is known of its values."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from specan.study.estimation.fit import describe, fit
from specan.study.selection.acceptance import LEVEL, held_out_gain, noise_dof
from specan.study.selection.f_test import improvement_probability
from specan.study.selection.pulls import Pull, pulls
from specan.study.selection.refits import Refit

STARTS = 3  # of the fit without known ranges
# chi-square that a freed value has to gain to predict better (Akaike 1974, IEEE Trans. AC-19:716)
PRICE = 2.0
# Twice the logarithm of the ratio of cross-validated predictive densities (pseudo-Bayes factor, Geisser and Eddy 1979,
# JASA 74:153) at which equal prior odds leave the known ranges a probability of `LEVEL`: 12.4.
ODDS = -2 * float(np.log(LEVEL))


@dataclass(frozen=True)
class DataAlone:
    """A second explanation of data that the model meets within what is known: the same model with other values.

    Attributes
    ----------
    values : tuple of Pull
        Values of the free fit that contradict what is known, worst first; empty where there are none.
    gain : float
        Chi-square of the fit held by known ranges, pulls included, less that of the free one.
    held : int
        Number of values that the ranges hold: those that rest on an end or are pulled out.
    p_value : float
        Probability of such a gain if the true values lie within what is known.
    likelier : bool
        The free fit predicts better by Akaike's criterion, which asks 2 for every value that is held.
    predicts : float
        Gain of the free fit in blocked cross-validation: twice the logarithm of the ratio of predictive densities.
    """

    values: tuple[Pull, ...] = ()
    gain: float = 0.0
    held: int = 0
    p_value: float = 1.0
    likelier: bool = False
    predicts: float = 0.0

    @property
    def contradicts(self) -> bool:
        """Whether the data refute the known ranges, at the family-wise level at which an effect is named.

        Either by the fall in chi-square, or by predicting: conditions that are left out are predicted better by odds
        that are the inverse of that level.
        """
        return bool(self.values) and (self.p_value <= LEVEL or (self.likelier and self.predicts > ODDS))


def data_alone(base: Refit) -> DataAlone:
    """Fit a model without its known ranges, and test them all at once.

    The fall of chi-square has, if the true values lie within the ranges and k of them hold the fit, the law of
    chi-square with k degrees of freedom: the likelihood-ratio test against an ordered alternative with data-dependent
    degrees of freedom (Susko 2013, Biometrika 100:1019). It is one test for all values together. Soft tails make it
    cautious. The noise is known from as many degrees of freedom as in the tests of effects. Not done where an
    evaluation is expensive.
    """
    problem = base.problem
    held = sum(1 for pull in pulls(base) if pull.pull != 0 and pull.parameter.whole not in problem.priors)
    if not problem.strategy.secondary_refits or not held:
        return DataAlone()
    free = replace(problem, ranges=False)
    alone = Refit(frozenset(), free, fit(free, start=base.fit.theta, starts=STARTS))
    gain = base.chi2 - alone.chi2
    there = Refit(frozenset(), problem, describe(problem, alone.fit.theta))
    values = tuple(pull for pull in pulls(there) if pull.too_far)
    if not values or gain <= 0:
        return DataAlone()
    chance = improvement_probability(gain, held, dispersion=alone.dispersion, noise_dof=noise_dof(alone))
    likelier = gain / alone.dispersion > PRICE * held
    return DataAlone(values, gain, held, chance, likelier, held_out_gain(base, alone) if likelier else 0.0)
