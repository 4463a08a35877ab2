"""From a model and its measurements to the verdict: which physical effect is missing.

The method in its order: fit the model as it is; check that the data can tell anything, and that the set-up is as it is
declared; work out how probable every explanation is; say what follows from that.
"""

from __future__ import annotations

from dataclasses import replace

from specan.models.effect import ParameterName
from specan.result import counted
from specan.study.estimation.fit import Fit, fit
from specan.study.estimation.problem import Problem
from specan.study.evidence.diagnosis import told
from specan.study.evidence.explanations import Explanations
from specan.study.evidence.of_responses import OfResponses
from specan.study.localisation.localise import MistakenSetUp, mistaken_set_up
from specan.study.observation import brought
from specan.study.observation.frf import FrfObservation
from specan.study.progress import Progress, unheard
from specan.study.recorded_noise import NoiseError, with_noise_of_largest
from specan.study.selection.refits import Refit
from specan.study.selection.starting_values import InitialFit, initial_fit
from specan.study.verdict import Diagnosis, LackOfFit


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
    if own := brought(problem.observations, "explanations"):
        return told(own(problem, start.fit, progress))
    if not all(isinstance(o, FrfObservation) for o in problem.observations):
        try:
            problem, fitted, catalogue = with_noise_of_largest(problem, start.fit)
        except NoiseError as fault:
            return Diagnosis("cannot-tell", fault.found)
        return told(Explanations(problem, fitted, progress, catalogue))
    near, look = InitialFit(start), brought(problem.observations, "while_recorded")
    mistake = look(problem, start.fit) if look else MistakenSetUp()
    if start.poor_fit and not mistake.text:
        progress("checking positions and signs of the channels against the data", 0.0)
        mistake = set_up or mistaken_set_up(problem)
        if not mistake.text:
            near = initial_fit(start, progress)
            mistake = mistake_beside(near, problem)
    if mistake.text:
        return Diagnosis(
            "cannot-tell",
            f"{mistake.sentence}; correct it, and begin the study again",
            lack_of_fit=LackOfFit(start.fit.reduced_chi2, start.fit.p_value, problem.n_effective),
        )
    return told(OfResponses(near, progress), start)


def mistake_beside(near: InitialFit, problem: Problem) -> MistakenSetUp:
    """A mistake of the set-up in what the effects of a first fit leave, where a lining, say, makes the larger part.

    Data that they meet within the few per cent of a down-weighted view are not looked at again.
    """
    if not near.found or near.left < 1:
        return MistakenSetUp()
    values = {n: v for n, v in near.known[near.found].items() if ParameterName(n).owned_by(near.found)}
    with_effects = problem.with_uses(sorted(near.found))
    found = mistaken_set_up(replace(with_effects, values={**with_effects.values, **values}))
    names = " and ".join(sorted(map(str, near.found)))
    return replace(found, text=f"beside {names}, {found.text}") if found.text else found


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
