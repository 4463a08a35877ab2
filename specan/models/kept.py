"""What models keep between evaluations to be faster, and how it is forgotten."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Sequence
from functools import wraps
from typing import Any, TypeVar, cast

FunctionT = TypeVar("FunctionT", bound=Callable[..., Any])
Item = TypeVar("Item")
Result = TypeVar("Result")
_CLEAR: list[Callable[[], None]] = []


def forgotten_by(clear: Callable[[], None]) -> None:
    """Have `forget` clear what is kept; it depends on what came before, if in the last digits only."""
    _CLEAR.append(clear)


def forget() -> None:
    """Clear it all."""
    for clear in _CLEAR:
        clear()


def each_anew(work: Callable[[Item], Result], items: Sequence[Item]) -> list[Result]:
    """``[work(item) for item in items]``, none of which rests on what was kept for another one."""
    found = []
    for item in items:
        forget()
        found.append(work(item))
    forget()
    return found


def kept(most: int) -> Callable[[FunctionT], FunctionT]:
    """Keep the latest results of a function of numbers, arrays and objects.

    Examples
    --------
    >>> asked = []
    >>> @kept(2)
    ... def double(x):
    ...     asked.append(x)
    ...     return 2 * x
    >>> double(1.0), double(1.0), len(asked)
    (2.0, 2.0, 1)
    """

    def decorate(function: FunctionT) -> FunctionT:
        found: OrderedDict[tuple[bytes, ...], tuple[Any, Any]] = OrderedDict()
        forgotten_by(found.clear)

        @wraps(function)
        def wrapped(*given: Any) -> Any:
            import numpy as np

            key = tuple(np.asarray(value).tobytes() for value in given)  # of an object its address
            if key in found:
                found.move_to_end(key)
            else:
                while len(found) >= most:
                    found.popitem(last=False)
                found[key] = given, function(*given)  # kept too, so that no other object comes to lie there
            return found[key][1]

        return cast(FunctionT, wrapped)

    return decorate
