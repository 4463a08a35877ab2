"""From a model and its measurements to the verdict: which physical effect is missing.

The method in its order: fit the model as it is; check that the data can tell anything, and that the set-up is as it is
declared; work out how probable every explanation is; say what follows from that.
"""

from __future__ import annotations

from specan.result import counted
from specan.study.estimation.fit import Fit, fit
from specan.study.estimation.problem import Problem
from specan.study.evidence.diagnosis import told
from specan.study.evidence.explanations import Explanations
from specan.study.evidence.of_responses import OfResponses
from specan.study.localisation.localise import MistakenSetUp
from specan.study.observation import brought
from specan.study.observation.frf import FrfObservation
from specan.study.progress import Progress, unheard
from specan.study.recorded_noise import NoiseError, with_noise_of_largest
from specan.study.selection.refits import Refit
from specan.study.verdict import Diagnosis


def diagnose(
    problem: Problem,
    *,
    base: Fit | None = None,
    set_up: MistakenSetUp | None = None,
    progress: Progress | None = None,
) -> Diagnosis:
    """Find out which effect a model is missing.

    Parameters
    ----------
    problem : Problem
        The model with the effects it has, its observations, nuisances and free parameters.
    base : Fit, optional
        A fit of it, where it has been fitted already.
    set_up : MistakenSetUp, optional
        What `mistaken_set_up` has found, where it has been looked for already.
    progress : callable, optional
        Told in a few words what is being done.

    Returns
    -------
    Diagnosis

    Raises
    ------
    ComputationError
        A fit that a verdict would rest on did not converge or is not finite.
    """
    start = Refit(frozenset(), problem, base or fit(problem, starts=3))
    why = untestable(start)
    if why:
        return Diagnosis("cannot-tell", why)
    progress = progress or unheard
    progress("explanations of the data", 0.0)
    if own := brought(problem.observations, "diagnosed"):
        found: Diagnosis = own(start, set_up, progress)
        return found
    if all(isinstance(o, FrfObservation) for o in problem.observations):
        return told(OfResponses(start, progress), start)
    try:
        problem, fitted, catalogue = with_noise_of_largest(problem, start.fit)
    except NoiseError as fault:
        return Diagnosis("cannot-tell", fault.found)
    return told(Explanations(problem, fitted, progress, catalogue))


def untestable(start: Refit) -> str:
    """Why no test is possible; empty where one is."""
    problem = start.problem
    parameters = counted(len(problem.names), "parameter")
    if start.dof < 3:
        return (
            f"{counted(round(problem.n_effective), 'measured value')} for {parameters}; "
            "at least 3 more values than parameters are needed"
        )
    if start.linear.rank < len(problem.names):
        return (
            f"the data determine only {start.linear.rank} of the model's {parameters}: "
            f"hold some of them fixed or measure more conditions"
        )
    return ""
