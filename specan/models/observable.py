"""What is measured of a model: a quantity, and the column or channel, or the transfer function, that holds it."""

from __future__ import annotations

from dataclasses import dataclass

KIND = "transfer"  # kind of measurement that holds it


@dataclass(frozen=True)
class Observable:
    """What is measured: a quantity of the model and the column or channel that holds it.

    Attributes
    ----------
    name, quantity : str
        Its name, and the model's quantity that predicts it.
    unit : str
        SI unit of that quantity; results are printed in it.
    doc : str
        What it is, in a sentence.
    column, column_unit : str
        Header of a table's column and the unit of its values; by default made of name and unit.
    kind : str
        Kind of measurement that holds it: ``table``, ``frf``, ``orders``, ``transfer``, or one that an entry point
        brings.
    response, reference : str
        Of a transfer function, the channels whose quotient it is; empty where the measurement leaves no choice.
    averages : float
        Number of averages behind its lines, where files do not say it; 0 where it is not known.
    reading_of : str
        Another observable from whose reading it is worked out: it has the same relative uncertainty where
        the rig states none of its own.

    Examples
    --------
    >>> Observable("drag", "drag_torque", "N*m", "Drag.").header
    'drag_Nm'
    """

    name: str
    quantity: str
    unit: str
    doc: str
    column: str = ""
    column_unit: str = ""
    kind: str = "table"
    reading_of: str = ""
    response: str = ""
    reference: str = ""
    averages: float = 0.0

    @property
    def header(self) -> str:
        """Header under which a table holds it."""
        if self.column:
            return self.column
        unit = self.unit.replace("*", "").replace("/", "_per_").replace("^", "")
        return self.name if self.unit == "1" else f"{self.name}_{unit}"


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
