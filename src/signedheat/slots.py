"""Functions that lower floors call and higher floors provide, so that imports point downwards only."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Generic, ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")


class Slot(Generic[P, R]):
    """A function that a lower floor declares and calls, and a higher floor provides when it is imported.

    Calling an empty slot imports all floors first, which fills it.

    Examples
    --------
    >>> save: Slot[[str], int] = Slot("save")
    >>> @save.provide
    ... def _(path: str) -> int:
    ...     return len(path)
    >>> save("ball.stl")
    8
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self._function: Callable[P, R] | None = None

    def provide(self, function: Callable[P, R]) -> Callable[P, R]:
        """Fill the slot with a function; usable as a decorator."""
        self._function = function
        return function

    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> R:
        if self._function is None:
            import_module(f"{__package__}.public")  # imports every floor
        if self._function is None:
            raise RuntimeError(f"nothing provides {self.name}")
        return self._function(*args, **kwargs)
