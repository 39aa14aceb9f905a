"""Kernels: functions that Numba compiles at their first call, so that importing them does not import Numba."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property, update_wrapper
from pathlib import Path
from threading import RLock
from typing import Any, overload

from .packages import lazy_module

numba = lazy_module("numba", "compiled kernels")
extending = lazy_module("numba.extending", "compiled kernels")
types = lazy_module("numba.core.types", "compiled kernels")

_LOCK = RLock()

prange = range
"""A range whose iterations may run in parallel, in kernels compiled with ``parallel=True``."""


class Kernel:
    """A function that Numba compiles at its first call, with a cache on disk. Kernels may call kernels.

    Examples
    --------
    >>> @compiled
    ... def twice(x):
    ...     return 2 * x
    >>> twice(1.5)
    3.0
    """

    def __init__(self, function: Callable[..., Any], options: dict[str, Any]) -> None:
        update_wrapper(self, function)
        self.function = function
        self.options = options

    def __call__(self, *arguments: Any) -> Any:
        return self.dispatcher(*arguments)

    @cached_property
    def dispatcher(self) -> Callable[..., Any]:
        """The compiled function; the function itself if ``NUMBA_DISABLE_JIT`` is set."""
        with _LOCK:
            compiler = _compiler()
            if "prange" in self.function.__globals__:
                self.function.__globals__["prange"] = _parallel_range()
            kept = Path(self.function.__code__.co_filename).is_file()  # what was typed in has no place on disk
            return compiler(cache=kept, **self.options)(self.function)  # type: ignore[no-any-return]


@overload
def compiled(function: Callable[..., Any]) -> Kernel: ...
@overload
def compiled(**options: Any) -> Callable[[Callable[..., Any]], Kernel]: ...
def compiled(function: Callable[..., Any] | None = None, **options: Any) -> Any:
    """Make a function a kernel: ``@compiled``, or ``@compiled(nogil=True)`` with options of ``numba.njit``."""
    if function is not None:
        return Kernel(function, options)
    return lambda function: Kernel(function, options)


def _compiler() -> Any:
    """``numba.njit``, after registering `Kernel` with Numba so that compiled code can call kernels."""
    if Kernel not in extending.typeof_impl.registry:
        extending.typeof_impl.register(Kernel)(lambda kernel, _: types.Dispatcher(kernel.dispatcher))
    return numba.njit


def _parallel_range() -> Any:
    return numba.prange
