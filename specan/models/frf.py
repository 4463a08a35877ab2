"""A transfer function as what is measured of a user's own model."""

from __future__ import annotations

from dataclasses import dataclass

KIND = "transfer"  # kind of measurement that holds it


@dataclass(frozen=True)
class Frf:
    """An observable that is a complex function of frequency: response over reference, exp(+j w t).

    Attributes
    ----------
    unit : str
        Of the quotient: ``um/N``. The measurement is converted to it.
    response, reference : str
        Channels of a recording, or nodes of a file of transfer functions (``2Z``). Without a name of its own, the
        response is called like the observable, and the reference is the only one that there is.
    uncertainty_percent, uncertainty : float, optional
        Standard uncertainty of the real and of the imaginary part of one line, in percent of the magnitude and in
        `unit`: for files that do not tell their own (by a column, or by coherence and number of averages).
    averages : float, optional
        Number of independent averages behind a line, for files that hold a coherence and do not say it.

    Examples
    --------
    >>> from specan.models import Model
    >>> def receptance(frequency, mass=2.0, stiffness=5e4, damping=12.0):
    ...     s = 2j * np.pi * frequency
    ...     return 1e6 / (mass * s**2 + damping * s + stiffness)
    >>> model = Model.from_function(
    ...     receptance, conditions={"frequency": ("Hz", 5, 60)},
    ...     observables={"receptance": Frf("um/N", response="2Z", reference="1Z")},
    ... )
    >>> import numpy as np
    >>> found = model.assemble().evaluate({"frequency": np.array([0.0, 25.0])})
    >>> found["receptance"].round(2).tolist()
    [(20+0j), (163.89-473.83j)]
    """

    unit: str
    response: str = ""
    reference: str = ""
    uncertainty_percent: float | None = None
    uncertainty: float | None = None
    averages: float | None = None
