"""The identity of a parameter: the quantity or use of an effect that owns it, its name there, and an element."""

from __future__ import annotations


class ParameterName(str):
    """Full name of a parameter or of one element of it: ``wall-impedance@z1.beta[31.5]``.

    It is the text that study files, histories and tables keep, and can stand wherever that text does. This is the
    only place that knows how the text is made up.

    Parameters
    ----------
    text : str
        As a file or a table has it.

    Examples
    --------
    >>> name = ParameterName("wall-impedance@z1.beta[31.5]")
    >>> name.owner, name.own, name.element
    ('wall-impedance@z1', 'beta', '31.5')
    >>> name.whole
    'wall-impedance@z1.beta'
    >>> ParameterName.of("gain-error", "gain", "Channel 3")
    'gain-error.gain[Channel 3]'
    """

    __slots__ = ()

    @classmethod
    def of(cls, owner: object, own: str, element: str = "") -> ParameterName:
        """Name out of its parts; `owner` is a use of an effect or the name of a quantity."""
        return cls(f"{owner}.{own}[{element}]" if element else f"{owner}.{own}")

    def at(self, element: str) -> ParameterName:
        """Name of one element of the parameter; itself for no element."""
        whole = self.partition("[")[0]
        return ParameterName(f"{whole}[{element}]" if element else whole)

    @property
    def whole(self) -> ParameterName:
        """The parameter that an element belongs to."""
        return ParameterName(self.partition("[")[0])

    @property
    def owner(self) -> str:
        """Use of an effect as it is written (``wall-impedance@z1``), or a quantity."""
        return self.partition("[")[0].rpartition(".")[0]

    @property
    def own(self) -> str:
        """Name that the owner gives it."""
        return self.partition("[")[0].rpartition(".")[2]

    @property
    def element(self) -> str:
        """Element of a parameter that is a vector over channels, recordings or the like; empty else."""
        return self.partition("[")[2].removesuffix("]")
