"""Mistakes in a user's own effect or model file, told with file and line."""

from __future__ import annotations

import traceback
from collections.abc import Callable
from typing import Any

from specan.errors import RequestError

PREFIX = "specan_user_"  # of the module names under which users' files are loaded


_ARRAYS = "functions receive arrays, one value a row: use numpy's, np.sqrt for math.sqrt and np.where for if"


def _wants_single_values(fault: BaseException) -> bool:
    """Whether a function of single numbers was given an array."""
    text = str(fault)
    return any(w in text for w in ("truth value of an array", "0-dimensional arrays", "length-1 arrays"))


def users_mistake(fault: Exception, function: Callable[..., Any], name: str) -> RequestError | None:
    """An exception of a quantity or an effect as a mistake in the user's file that it comes from; None if from none.

    Parameters
    ----------
    fault : Exception
        What it raised.
    function : callable
    name : str
        Identifier of the quantity or effect, for the message.
    """
    code = getattr(function, "__code__", None)
    if code is None or not str(getattr(function, "__module__", "")).startswith(PREFIX):
        return None
    lines = [f.lineno for f in traceback.extract_tb(fault.__traceback__) if f.filename == code.co_filename]
    return RequestError(
        f"{code.co_filename}, line {lines[-1] if lines else code.co_firstlineno}: {name!r} fails "
        f"({type(fault).__name__}: {fault})",
        remedy=_ARRAYS if _wants_single_values(fault) else "correct that line",
    )


class Instead:
    """What is called in place of a user's own function; messages name that one's file and line."""

    def __init__(self, function: Callable[..., Any], own: Callable[..., Any]) -> None:
        self._called = function
        self.function = getattr(own, "function", own)
        self.__code__ = getattr(own, "__code__", None)
        self.__module__ = str(own.__module__)

    def __call__(self, *given: Any, **parameters: Any) -> Any:
        """Its value."""
        return self._called(*given, **parameters)


def place_of(function: Any) -> str:
    """File and line of a function, for messages."""
    function = getattr(function, "function", function)
    code = getattr(function, "__code__", None)
    return f"{code.co_filename}, line {code.co_firstlineno}" if code else repr(function)
