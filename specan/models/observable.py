"""What is measured of a model: a quantity, and the column or channel that holds it."""

from __future__ import annotations

from dataclasses import dataclass


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
