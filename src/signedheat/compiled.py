"""Kernels: functions that Numba compiles at their first call, so that importing them does not import Numba.

Numba's own cache keeps compiled code on disk, and recognises a kernel by the text of its file. But a kernel also
contains the kernels that it calls, and constants of other files. Therefore the cache's folder is named by a digest of
all of these. It is made of the imported code, since files may have been edited before a kernel is first called.
"""

from __future__ import annotations

import hashlib
import logging
import os
import re
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from functools import cache, cached_property, update_wrapper
from pathlib import Path
from pickle import UnpicklingError
from threading import RLock
from types import CodeType
from typing import Any, Generic, ParamSpec, TypeVar, overload

import numpy as np

from .errors import SignedHeatError
from .jobs import MOST_THREADS, Announcement, interruptible, stop_if_abandoned
from .packages import lazy_module

numba: Any = lazy_module("numba", "compiled kernels")
extending: Any = lazy_module("numba.extending", "compiled kernels")

logger: logging.Logger = logging.getLogger("signedheat")
OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
"""Options of ``numba.njit``: division by zero raises nothing, and no wrapper for calls from C is compiled."""
SHORT = 1 << 13
"""Number of entries of arrays up to which a kernel is too short for anybody to interrupt it."""
WORD = re.compile(r"\w+")
DAMAGE = OSError, EOFError, UnpicklingError
"""Errors of a cache whose files are damaged or cannot be written. Kernels raise none of them."""
_lock = RLock()
Parameters = ParamSpec("Parameters")
Returned = TypeVar("Returned")
made: list[Kernel[..., Any]] = []
"""The kernels that this process has used."""
announce: Announcement = Announcement(
    "compiling what this needs, once, for up to a minute (signedheat warmup compiles all)", everywhere=True
)


class Kernel(Generic[Parameters, Returned]):
    """A function that Numba compiles at its first call, with a cache on disk. Kernels may call kernels."""

    is_kept: bool = True
    """Whether compiled code is kept on disk: False once the cache is damaged or the disk is full."""

    def __init__(self, function: Callable[Parameters, Returned], options: dict[str, Any]) -> None:
        update_wrapper(self, function)
        self.function = function
        self.options: dict[str, Any] = {**OPTIONS, **options}
        self._is_warm = False

    def __call__(self, *arguments: Parameters.args, **named: Parameters.kwargs) -> Returned:
        try:
            if self._is_warm and _entries(arguments) <= SHORT:
                stop_if_abandoned()
                return self.dispatcher(*arguments, **named)
            returned = interruptible(self._compiled_call, *arguments, **named)
            self._is_warm = True
            return returned
        except Exception as error:
            for each in _chain(error):
                if isinstance(each, KeyboardInterrupt):  # Numba and Python raise SystemErrors because of it
                    raise each from None
            if not Kernel.is_kept or not any(isinstance(each, DAMAGE) for each in _chain(error)):
                raise
            logger.warning("the cache of compiled kernels is not used any more: %s", error)
        with _lock:
            Kernel.is_kept = False
            while made:
                kernel = vars(made.pop())
                kernel.pop("dispatcher", None)
                kernel.pop("part", None)
        return interruptible(self._compiled_call, *arguments, **named)

    def _compiled_call(self, *arguments: Parameters.args, **named: Parameters.kwargs) -> Returned:
        """Compile what is not, and call it: neither may be interrupted, nor may the import of Numba."""
        return self.dispatcher(*arguments, **named)

    @cached_property
    def dispatcher(self) -> Callable[Parameters, Returned]:
        """The compiled function, or the function itself if ``NUMBA_DISABLE_JIT`` is set."""
        return self._dispatcher(called_by_python=True)

    @cached_property
    def part(self) -> Callable[Parameters, Returned]:
        """The function as compiled code calls it: what lets Python call it takes up to half as long to compile."""
        return self.dispatcher if "dispatcher" in vars(self) else self._dispatcher(called_by_python=False)

    def _dispatcher(self, called_by_python: bool) -> Callable[Parameters, Returned]:
        options = {**self.options, "no_cpython_wrapper": not called_by_python}
        with _lock:
            _prepare()
            made.append(self)
            if numba.config.DISABLE_JIT:
                return self.function
            if Kernel.is_kept and Path(self.function.__code__.co_filename).is_file():  # not code typed into a console
                folder = cache_folder() / (_digest(self) + ("" if called_by_python else "_part"))
                if not any(folder.glob("*/*.nbi")):
                    announce()
                wanted, numba.config.CACHE_DIR = numba.config.CACHE_DIR, str(folder)
                try:
                    return _of_numbers(numba.njit(cache=True, **options)(self.function))
                except RuntimeError as error:  # no folder can be written to
                    logger.info("compiled in every process: %s", error)
                finally:
                    numba.config.CACHE_DIR = wanted
            announce()
            return _of_numbers(numba.njit(**options)(self.function))


def _of_numbers(dispatcher: Any) -> Any:
    """Make a dispatcher compile for all numbers of a type when another kernel calls it with a literal number."""
    compile_for = dispatcher.compile

    def compile_once(signature: Any) -> Any:
        if isinstance(signature, tuple):
            written = numba.types.IntegerLiteral, numba.types.BooleanLiteral
            signature = tuple(numba.types.unliteral(k) if isinstance(k, written) else k for k in signature)
        return compile_for(signature)

    dispatcher.compile = compile_once
    return dispatcher


@overload
def compiled(function: Callable[Parameters, Returned]) -> Kernel[Parameters, Returned]: ...
@overload
def compiled(**options: Any) -> Callable[[Callable[Parameters, Returned]], Kernel[Parameters, Returned]]: ...
def compiled(function: Callable[..., Any] | None = None, **options: Any) -> Any:
    """Make a function a kernel: ``@compiled``, or ``@compiled(fastmath=True)`` with options of ``numba.njit``."""
    if function is not None:
        return Kernel(function, options)
    return lambda function: Kernel(function, options)


def cache_folder() -> Path:
    """Return the folder for compiled code; if it is not writable, Numba uses that of the source, or its own cache."""
    wanted = os.environ.get("NUMBA_CACHE_DIR")
    if wanted:
        return Path(wanted) / "signedheat"
    with suppress(RuntimeError):  # if there is no home folder
        base = {
            "win32": os.environ.get("LOCALAPPDATA") or Path.home() / "AppData/Local",
            "darwin": Path.home() / "Library/Caches",
        }.get(sys.platform, os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
        return Path(base) / "signedheat" / "kernels"
    return Path(__file__).parent / "__pycache__"


def _digest(kernel: Kernel[..., Any]) -> str:
    """Digest Numba's version and the code, options, constants and classes of a kernel and of those that it calls.

    Named tuples count since Numba's cache holds them by their modules, and fails if they have moved.
    """
    digest, seen, waiting = hashlib.sha256(repr(numba.version_info).encode()), set(), [kernel]
    while waiting:
        current = waiting.pop()
        if current in seen:
            continue
        seen.add(current)
        function = current.function
        digest.update(repr((current.__module__, current.options, _spelled(function.__code__))).encode())
        mentioned = [*function.__annotations__.values(), *function.__code__.co_names]
        digest.update("".join(_named_tuples(mentioned, function.__globals__)).encode())
        cells = zip(function.__code__.co_freevars, function.__closure__ or (), strict=True)
        names = {name: function.__globals__.get(name) for name in function.__code__.co_names}
        for name, value in {**names, **{name: cell.cell_contents for name, cell in cells}}.items():
            if isinstance(value, Kernel):
                waiting.append(value)
            elif isinstance(value, np.ndarray):
                digest.update(f"{name}{value.dtype}{value.shape}".encode() + value.tobytes())
            elif isinstance(value, bool | int | float | complex | str | tuple | np.generic):
                digest.update(f"{name}={value!r}".encode())
    return digest.hexdigest()[:16]


def _named_tuples(mentioned: Iterable[Any], names: dict[str, Any]) -> Iterator[str]:
    """Yield the module, name and fields of each named tuple that is mentioned, and of those that it contains."""
    for word in WORD.findall(" ".join(map(str, mentioned))):
        value = names.get(word)
        if isinstance(value, type) and hasattr(value, "_fields"):
            yield f"{value.__module__}.{value.__qualname__}{value.__annotations__}"
            yield from _named_tuples(value.__annotations__.values(), vars(sys.modules[value.__module__]))


def _spelled(value: Any) -> Any:
    """Return code and constants as values whose text is the same in every process; sort sets, which have no order."""
    if isinstance(value, CodeType):
        return value.co_code, value.co_names, [_spelled(constant) for constant in value.co_consts]
    return sorted(map(repr, value)) if isinstance(value, frozenset) else value


def _entries(arguments: Iterable[Any]) -> int:
    """Count the entries of all arrays among the arguments of a kernel, also in tuples."""
    count = 0
    for value in arguments:
        if isinstance(value, np.ndarray):
            count += value.size
        elif isinstance(value, tuple):
            count += _entries(value)
    return count


def _chain(error: BaseException | None) -> Iterator[BaseException]:
    while error is not None:
        yield error
        error = error.__cause__ or error.__context__


@cache
def _prepare() -> None:
    """Register kernels as a type of Numba, so that compiled code can call them; check the number of threads."""
    threads = os.environ.get("NUMBA_NUM_THREADS")
    if threads is not None and not (threads.isdecimal() and 0 < int(threads) <= MOST_THREADS):
        raise SignedHeatError(
            f"the environment variable NUMBA_NUM_THREADS is {threads!r}, which is no number of threads",
            remedy="unset it, or set it to 1 or more",
            element="NUMBA_NUM_THREADS",
        )
    extending.typeof_impl.register(Kernel)(lambda kernel, _: numba.typeof(kernel.part))
