"""The errors that a user can act on, and the exit code that each one becomes on the command line."""

from __future__ import annotations

import difflib
import importlib
from collections.abc import Iterable, Set
from typing import Any, Self


class SpecanError(Exception):
    """Something that specan can explain.

    Parameters
    ----------
    found : str
        What was found, as a sentence without its full stop.
    expected : str, optional
        What was expected instead.
    remedy : str, optional
        What the user can do.
    """

    exit_code = 4

    def __init__(self, found: str, *, expected: str = "", remedy: str = "") -> None:
        self.found, self.expected, self.remedy = found, expected, remedy
        parts = [found, f"expected {expected}" if expected else "", remedy]
        text = "; ".join(part.strip().rstrip(".") for part in parts if part)
        super().__init__(text if text.endswith("?") else text + ".")

    def within(self, where: str) -> Self:
        """The same, with where it was found before it.

        Parameters
        ----------
        where : str
            A file, a line, a table.

        Returns
        -------
        SpecanError
            Of the same class.
        """
        return type(self)(f"{where}: {self.found}", expected=self.expected, remedy=self.remedy)

    def __reduce__(self) -> tuple[object, ...]:
        # Keyword-only arguments do not survive the default pickling, and workers send errors home.
        return (_rebuild, (type(self), self.found, self.expected, self.remedy))


def _rebuild(kind: type[SpecanError], found: str, expected: str, remedy: str) -> SpecanError:
    return kind(found, expected=expected, remedy=remedy)


class RequestError(SpecanError):
    """The request cannot be carried out as asked: an option, a configuration, a rig, an output place."""

    exit_code = 2


class InputError(SpecanError):
    """An input file or channel cannot be used; other inputs are not concerned."""

    exit_code = 3


class NoSignalError(InputError):
    """An input that is whole but holds no time signal: a spectrum, a table. A batch puts it aside, no failure."""


class ComputationError(SpecanError):
    """A computation did not converge or gave something that is not finite."""

    exit_code = 4


def reason_of(fault: BaseException) -> str:
    """What to say of any error: of one that nobody foresaw its kind as well.

    Examples
    --------
    >>> reason_of(InputError("no samples")), reason_of(MemoryError())
    ('no samples.', 'Internal error: MemoryError')
    """
    if isinstance(fault, SpecanError):
        return str(fault)
    said = f"{type(fault).__name__}: {fault}" if str(fault) else type(fault).__name__
    return f"Internal error: {said}"


def nearest(name: str, known: Iterable[str]) -> str:
    """Return "did you mean 'x'?" for the known name closest to `name`, or the known names.

    Examples
    --------
    >>> nearest("torqe", ["torque", "speed"])
    "did you mean 'torque'?"
    """
    known = sorted(known) if isinstance(known, Set) else list(known)
    close = difflib.get_close_matches(name, known, n=1, cutoff=0.6)
    if close:
        return f"did you mean {close[0]!r}?"
    return "known are " + ", ".join(known) if known else "none is known here"


def require_known(
    name: str, known: Iterable[str], found: str, *, expected: str = "", kind: type[SpecanError] = RequestError
) -> None:
    """Refuse a name that is not one of those known, with the nearest of them.

    Raises
    ------
    SpecanError
        Of this kind, which says what was `found`.
    """
    known = list(known)
    if name not in known:
        raise kind(found, expected=expected, remedy=nearest(name, known))


def library(name: str, extra: str) -> Any:
    """A library that only some users need."""
    try:
        return importlib.import_module(name)
    except ImportError:
        raise RequestError(
            f"{name}, which this needs, is not installed", remedy=f'pip install "specan[{extra}]"'
        ) from None
