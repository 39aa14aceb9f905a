"""Kernels: functions that Numba compiles at their first call, so that importing them does not import Numba."""

from __future__ import annotations

import gc
import logging
import os
import sys
from collections.abc import Callable
from contextlib import nullcontext
from functools import cached_property, partial, update_wrapper
from pathlib import Path
from threading import RLock
from typing import Any, overload

from .errors import SignedHeatError
from .kernel_cache import KernelCache, digest_of
from .packages import lazy_module

numba = lazy_module("numba", "compiled kernels")
kernel_compiler = lazy_module("signedheat.kernel_compiler", "compiled kernels")
extending = lazy_module("numba.extending", "compiled kernels")
types = lazy_module("numba.core.types", "compiled kernels")

logger = logging.getLogger("signedheat")
_LOCK = RLock()
MOST_THREADS = 1024
TRIED = (0, 59), (0, 68)
"""Versions of Numba, first to last, with which `kernel_compiler` has been tried; others compile in their own steps."""
DEFAULTS = {"error_model": "numpy", "no_cfunc_wrapper": True}
"""Options that save compiling: dividing by zero is no exception, and C does not call kernels."""


class Announcement:
    """Tells on a terminal, once in a process, that something is being compiled, which takes a while at first use."""

    def __init__(self) -> None:
        self.is_wanted = True

    def __call__(self, name: str) -> None:
        logger.info("compiling %s", name)
        if self.is_wanted and sys.stderr is not None and sys.stderr.isatty():
            self.is_wanted = False
            sys.stderr.write("\r\x1b[2Ksignedheat: compiling what this needs, once (signedheat warmup compiles all)\n")


announce = Announcement()


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
        self.options = {**DEFAULTS, **options}

    def __call__(self, *arguments: Any) -> Any:
        return self.dispatcher(*arguments)

    @cached_property
    def dispatcher(self) -> Callable[..., Any]:
        """The compiled function; the function itself if ``NUMBA_DISABLE_JIT`` is set."""
        return self._made(self.options)

    @cached_property
    def inner(self) -> Callable[..., Any]:
        """The same for other kernels, which alone can call it: without the conversion of Python's objects."""
        code = self.function.__code__
        if self.function.__name__ in (*code.co_names, *code.co_freevars):  # it calls itself, which is one function
            return self.dispatcher
        made = self._made({**self.options, "no_cpython_wrapper": True})
        template: Any = getattr(made, "get_call_template", None)
        if template is not None:  # Numba would compile `f(0)` and `f(1)` apart
            made.get_call_template = lambda args, kws: template(  # type: ignore[attr-defined]
                tuple(map(types.unliteral, args)), {name: types.unliteral(kind) for name, kind in kws.items()}
            )
        return made

    def _made(self, options: dict[str, Any]) -> Callable[..., Any]:
        with _LOCK:
            made = _compiler()(**options, pipeline_class=kernel_compiler.Pipeline)(self.function)
            if not hasattr(made, "_cache"):  # compiling is disabled
                return made  # type: ignore[no-any-return]
            made.compile = alone(made.compile)
            if Path(self.function.__code__.co_filename).is_file():  # what was typed in is not kept on disk
                name = f"{self.function.__module__}.{self.function.__qualname__}".replace("<locals>", "")
                made._cache = KernelCache(name, digest_of(self.function, options, _parts), announce)
            return made  # type: ignore[no-any-return]


def alone(function: Callable[..., Any]) -> Callable[..., Any]:
    """A function during which garbage is not searched for: an eighth of the time that compiling takes."""

    def called(*arguments: Any) -> Any:
        was_on = gc.isenabled()
        gc.disable()
        try:
            with kernel_compiler.our_steps() if _are_ours() else nullcontext():
                return function(*arguments)
        finally:
            if was_on:
                gc.enable()

    return called


def _are_ours() -> bool:
    return bool(TRIED[0] <= numba.version_info[:2] <= TRIED[1])


def _parts(value: Any) -> tuple[Callable[..., Any], dict[str, Any]] | None:
    return (value.function, value.options) if isinstance(value, Kernel) else None


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
    """``numba.njit`` with our own steps, after registering `Kernel` with Numba so that compiled code can call kernels.

    Raises
    ------
    SignedHeatError
        If ``NUMBA_NUM_THREADS`` is no number of threads.
    """
    threads = os.environ.get("NUMBA_NUM_THREADS")
    if threads is not None and not (threads.isdecimal() and 0 < int(threads) <= MOST_THREADS):
        raise SignedHeatError(
            f"the environment variable NUMBA_NUM_THREADS is {threads!r}, which is no number of threads",
            remedy="unset it, or set it to 1 or more",
            element="NUMBA_NUM_THREADS",
        )
    if Kernel not in extending.typeof_impl.registry:
        extending.typeof_impl.register(Kernel)(lambda kernel, _: types.Dispatcher(kernel.inner))
    if not _are_ours():
        return numba.njit
    return partial(numba.njit, pipeline_class=kernel_compiler.Pipeline)
