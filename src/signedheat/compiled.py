"""Kernels: functions that Numba compiles at their first call, so that importing them does not import Numba.

Numba's own cache keeps compiled code on disk, and recognises a kernel by the text of its file. But a kernel also
contains the kernels that it calls, and constants of other files. Therefore it is kept by a digest of all of these.
It is made of the imported code, since files may have been edited before a kernel is first called. Numba finds the
folder by its documented setting CACHE_LOCATOR_CLASSES, which names `KernelLocator` while a dispatcher is made.

A wheel may carry kernels, compiled for `BASELINE`. They are copied to the cache where the processor can run them, and
listed there as Numba would list its own, so that nothing else in the process is compiled differently.
"""

from __future__ import annotations

import hashlib
import logging
import os
import pickle
import re
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from functools import cache, cached_property, update_wrapper
from pathlib import Path
from threading import RLock
from types import CodeType
from typing import Any, Generic, ParamSpec, TypeVar, overload

import numpy as np

from .jobs import Announcement, interruptible, stop_if_abandoned, wanted_threads
from .packages import lazy_module

numba: Any = lazy_module("numba", "compiled kernels")
extending: Any = lazy_module("numba.extending", "compiled kernels")
numba_registry: Any = lazy_module("numba.core.registry", "compiled kernels")
numba_serialize: Any = lazy_module("numba.core.serialize", "compiled kernels")
llvmlite: Any = lazy_module("llvmlite.binding", "compiled kernels")

logger: logging.Logger = logging.getLogger("signedheat")
OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
"""Options of ``numba.njit``: division by zero raises nothing, and no wrapper for calls from C is compiled."""
SHORT = 1 << 13
"""Number of entries of all array arguments up to which a kernel is called directly. Above it, the call runs on another
thread, so that Ctrl-C can interrupt the wait for it."""
WORD = re.compile(r"\w+")
DAMAGE = OSError, EOFError, pickle.UnpicklingError
"""Errors of a cache whose files are damaged or cannot be written. Kernels raise none of them."""
BASELINE = "x86-64-v3"
"""Processors that the kernels of wheels are compiled for, level 3 of the x86-64 ABI. Most made since 2013 are."""
BASELINE_FEATURES = "avx", "avx2", "bmi", "bmi2", "cx16", "f16c", "fma", "lzcnt", "movbe", "popcnt", "sahf", "xsave"
"""LLVM's names for the features of level 3, without those that AVX implies."""
CARRIED = Path(__file__).parent / "kernels"
"""Folder of the kernels that a wheel carries, which `make wheel` fills."""
OWN_FOLDER = "signedheat-{}-"
"""Beginning of the name of the temporary folder of a process, with its id, for kernels that can be kept nowhere."""
_names: dict[Callable[..., Any], str] = {}
"""Cache folder of each function whose dispatcher is being made (`kept_as`)."""
_lock = RLock()
Parameters = ParamSpec("Parameters")
Returned = TypeVar("Returned")
made: list[Kernel[..., Any]] = []
"""Kernels that this process has used so far."""
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
            for cause in _chain(error):
                if isinstance(cause, KeyboardInterrupt):  # Numba and Python raise SystemErrors because of it
                    raise cause from None
            if not Kernel.is_kept or not any(isinstance(cause, DAMAGE) for cause in _chain(error)):
                raise
            logger.warning("the cache of compiled kernels is not used any more: %s", error)
            if not any(isinstance(cause, OSError) for cause in _chain(error)):
                _remove(self)  # so that the next process compiles it again, and keeps that
        with _lock:
            Kernel.is_kept = False
            while made:
                kernel = vars(made.pop())
                kernel.pop("dispatcher", None)
                kernel.pop("part", None)
        return interruptible(self._compiled_call, *arguments, **named)

    def _compiled_call(self, *arguments: Parameters.args, **named: Parameters.kwargs) -> Returned:
        """Compile the function if necessary, and call it. Neither may be interrupted, nor may the import of Numba."""
        return self.dispatcher(*arguments, **named)

    @cached_property
    def dispatcher(self) -> Callable[Parameters, Returned]:
        """The compiled function that Python calls, or the function itself if ``NUMBA_DISABLE_JIT`` is set."""
        return self._dispatcher(called_by_python=True)

    @cached_property
    def part(self) -> Callable[Parameters, Returned]:
        """The compiled function that other kernels call.

        It has no wrapper for calls from Python, which would take up to half as long to compile as the function.
        """
        return self.dispatcher if "dispatcher" in vars(self) else self._dispatcher(called_by_python=False)

    def _dispatcher(self, called_by_python: bool) -> Callable[Parameters, Returned]:
        """Make Numba's dispatcher, with a cache on disk if possible, and announce that it compiles if it will."""
        options = {**self.options, "no_cpython_wrapper": not called_by_python}
        with _lock:
            _prepare()
            made.append(self)
            if numba.config.DISABLE_JIT:
                return self.function
            if Kernel.is_kept and Path(self.function.__code__.co_filename).is_file():  # not code typed into a console
                name = _digest(self) + ("" if called_by_python else "_part")
                try:
                    with kept_as(self.function, name):
                        dispatcher = numba.njit(cache=True, **options)(self.function)
                    if not has_code(name):
                        announce()
                    return dispatcher
                except RuntimeError as error:  # no folder can be written to
                    logger.info("compiled in every process: %s", error)
            announce()
            return numba.njit(**options)(self.function)


@overload
def compiled(function: Callable[Parameters, Returned]) -> Kernel[Parameters, Returned]: ...
@overload
def compiled(**options: Any) -> Callable[[Callable[Parameters, Returned]], Kernel[Parameters, Returned]]: ...
def compiled(function: Callable[..., Any] | None = None, **options: Any) -> Any:
    """Decorate a function with ``@compiled``, or ``@compiled(fastmath=True)``, so that Numba compiles it at first use.

    Options are those of ``numba.njit``.
    """
    if function is not None:
        return Kernel(function, options)
    return lambda function: Kernel(function, options)


def cache_folder() -> Path:
    """Return the folder for compiled code, which is in ``NUMBA_CACHE_DIR``, if that is set, or in the user's cache."""
    wanted = os.environ.get("NUMBA_CACHE_DIR")
    if wanted:
        return Path(wanted) / "signedheat"
    with suppress(RuntimeError):  # if there is no home folder
        base = {
            "win32": os.environ.get("LOCALAPPDATA") or Path.home() / "AppData/Local",
            "darwin": Path.home() / "Library/Caches",
        }.get(sys.platform, os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
        return Path(base) / "signedheat" / "kernels"
    return _folder_beside_the_source()


@contextmanager
def kept_as(function: Callable[..., Any], name: str) -> Iterator[None]:
    """Within a ``with`` block, let dispatchers made for a function keep their code in the folder `name`."""
    config = numba.config
    before, config.CACHE_LOCATOR_CLASSES = config.CACHE_LOCATOR_CLASSES, f"{__name__}.{KernelLocator.__name__}"
    _names[function] = name
    try:
        yield
    finally:
        del _names[function]
        config.CACHE_LOCATOR_CLASSES = before


def has_code(name: str) -> bool:
    """Whether compiled code for this processor is in a cache folder with this name."""
    return any(any((root / name / _processor()).glob("*.nbi")) for root in _roots(name))


class KernelLocator:
    """Numba's interface to find the cache folder of a kernel. It chooses the first one that can be written to."""

    def __init__(self, folder: Path, file: str) -> None:
        self._folder = folder
        self._py_file = file  # Numba's warnings name it

    @classmethod
    def from_function(cls, function: Callable[..., Any], file: str) -> KernelLocator | None:
        """Return the locator of a function's cache, or None if no folder can be written to."""
        name = _names[function]
        for root in _roots(name):
            locator = cls(root / name / _processor(), file)
            try:
                locator.ensure_cache_path()
            except OSError:
                continue
            if not any(locator._folder.glob("*.nbi")):
                _unpack(CARRIED / name, locator._folder)
            return locator
        return None

    def ensure_cache_path(self) -> None:
        """Make the folder, and raise an `OSError` if it cannot be written to."""
        os.makedirs(self._folder, exist_ok=True)
        tempfile.TemporaryFile(dir=self._folder).close()

    def get_cache_path(self) -> str:
        """Return the folder."""
        return str(self._folder)

    def get_source_stamp(self) -> str:
        """Return the digest of the code, which is the name of the kernel's folder."""
        return self._folder.parent.name

    def get_disambiguator(self) -> str:
        """Return an empty text, since each function has a folder of its own."""
        return ""


def _roots(name: str) -> Iterator[Path]:
    """Yield the folders in which a kernel's folder `name` may lie, the preferred one first."""
    yield cache_folder()
    yield _folder_beside_the_source()
    if (CARRIED / name).is_dir() and _kind_of_code() is not None:
        yield Path(_folder_of_this_process().name)


def _folder_beside_the_source() -> Path:
    return Path(__file__).parent / "__pycache__" / "kernels"


@cache
def _folder_of_this_process() -> tempfile.TemporaryDirectory[str]:
    """Make a temporary folder that is removed when the process ends, unless it is killed."""
    return tempfile.TemporaryDirectory(prefix=OWN_FOLDER.format(os.getpid()))


def remove_folders_of(process: int) -> None:
    """Remove the temporary folder of a process, given by its id, that was killed."""
    for folder in Path(tempfile.gettempdir()).glob(OWN_FOLDER.format(process) + "*"):
        shutil.rmtree(folder, ignore_errors=True)


@cache
def _processor() -> str:
    """Return a short digest of the processor that code is compiled for, the host or the one of Numba's settings."""
    config, host = numba.config, (llvmlite.get_host_cpu_name(), llvmlite.get_host_cpu_features().flatten())
    code = *host, config.CPU_NAME, config.CPU_FEATURES, config.ENABLE_AVX
    return hashlib.sha256(repr(code).encode()).hexdigest()[:8]


@cache
def _kind_of_code() -> tuple[str, str, str] | None:
    """Return Numba's tuple that identifies code for this processor.

    It is None if the processor does not run code for `BASELINE`, or if Numba's settings ask for another processor.
    """
    config = numba.config
    if config.CPU_NAME is not None or config.CPU_FEATURES is not None or not config.ENABLE_AVX:
        return None
    features = llvmlite.get_host_cpu_features()
    if not all(features.get(feature) for feature in BASELINE_FEATURES):
        return None
    return numba_registry.cpu_target.target_context.codegen().magic_tuple()


def _unpack(carried: Path, folder: Path) -> None:
    """Copy a kernel's compiled code from the folder of a wheel, `carried`, to a cache folder, for this processor.

    Index files have a format that depends on Numba's version, which is part of the name of the folder.
    """
    kind = _kind_of_code() if carried.is_dir() else None
    if kind is None:
        return
    try:
        for path in carried.glob("*/*.nbi"):
            with path.open("rb") as index:
                version, (stamp, files) = pickle.load(index), pickle.load(index)
            files = {(types, kind, code): file for (types, made, code), file in files.items() if made[0] == kind[0]}
            for file in files.values():
                _replace(folder / file, (path.parent / file).read_bytes())
            _replace(folder / path.name, pickle.dumps(version) + numba_serialize.dumps((stamp, files)))
    except Exception as error:  # a damaged file raises errors of many types
        logger.info("the kernels of the wheel are not used: %s", error)


def _replace(path: Path, content: bytes) -> None:
    """Write a file atomically, since other processes may write it at the same time."""
    with tempfile.NamedTemporaryFile(dir=path.parent, delete=False) as file:
        file.write(content)
    os.replace(file.name, path)


def _digest(kernel: Kernel[..., Any]) -> str:
    """Return a digest of everything that the compiled code of a kernel depends on.

    This is Numba's version and, for the kernel and all kernels that it calls, code, options, constants and named
    tuples. Numba's cache refers to named tuples by their modules, and fails if they have moved.
    """
    digest = hashlib.sha256(repr(numba.version_info).encode())
    for current in _with_called(kernel):
        function = current.function
        digest.update(repr((current.__module__, current.options, _spelled(function.__code__))).encode())
        mentioned = [*function.__annotations__.values(), *function.__code__.co_names]
        digest.update("".join(_named_tuples(mentioned, function.__globals__)).encode())
        for name, value in _values(function):
            if isinstance(value, np.ndarray):
                digest.update(f"{name}{value.dtype}{value.shape}".encode() + value.tobytes())
            elif isinstance(value, bool | int | float | complex | str | tuple | np.generic):
                digest.update(f"{name}={value!r}".encode())
    return digest.hexdigest()[:16]


def _with_called(kernel: Kernel[..., Any]) -> Iterator[Kernel[..., Any]]:
    """Yield a kernel, and all kernels that it calls, directly or through others."""
    seen, waiting = set(), [kernel]
    while waiting:
        current = waiting.pop()
        if current not in seen:
            seen.add(current)
            yield current
            waiting += [value for _, value in _values(current.function) if isinstance(value, Kernel)]


def _values(function: Callable[..., Any]) -> Iterator[tuple[str, Any]]:
    """Yield the global names and the variables of enclosing functions that a function uses, with their values."""
    for name in function.__code__.co_names:
        yield name, function.__globals__.get(name)
    for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
        yield name, cell.cell_contents


def _remove(kernel: Kernel[..., Any]) -> None:
    """Remove the cache folders of a kernel and of the kernels that it calls, one of which has a damaged file."""
    for current in _with_called(kernel):
        for name in (_digest(current), f"{_digest(current)}_part"):
            for root in _roots(name):
                shutil.rmtree(root / name / _processor(), ignore_errors=True)


def _named_tuples(mentioned: Iterable[Any], names: dict[str, Any]) -> Iterator[str]:
    """Yield a text with module, name and fields of each named tuple among words, and of those that it contains.

    `mentioned` are annotations and names that occur in code, and `names` the values that they may refer to.
    """
    for word in WORD.findall(" ".join(map(str, mentioned))):
        value = names.get(word)
        if isinstance(value, type) and hasattr(value, "_fields"):
            yield f"{value.__module__}.{value.__qualname__}{value.__annotations__}"
            yield from _named_tuples(value.__annotations__.values(), vars(sys.modules[value.__module__]))


def _spelled(value: Any) -> Any:
    """Return a code object or constant as a value whose ``repr`` is the same in every process, with sets sorted."""
    if isinstance(value, CodeType):
        return value.co_code, value.co_names, [_spelled(constant) for constant in value.co_consts]
    return sorted(map(repr, value)) if isinstance(value, frozenset) else value


def _entries(arguments: Iterable[Any]) -> int:
    """Count the entries of all arrays among the arguments of a kernel, also in tuples.

    The count tells whether a call is so short that it needs no thread of its own to be interruptible.
    """
    count = 0
    for value in arguments:
        if isinstance(value, np.ndarray):
            count += value.size
        elif isinstance(value, tuple):
            count += _entries(value)
    return count


def _chain(error: BaseException | None) -> Iterator[BaseException]:
    """Yield an error, its cause or context, the cause of that, and so on."""
    while error is not None:
        yield error
        error = error.__cause__ or error.__context__


@cache
def _prepare() -> None:
    """Register kernels as a type of Numba, so that compiled code can call them, and check ``NUMBA_NUM_THREADS``."""
    wanted_threads()

    class Part(numba.types.Dispatcher):  # type: ignore[misc]
        """Numba's type of a kernel. It is compiled for types of arguments only, not for each literal constant."""

        def get_call_type(self, context: Any, args: Any, kws: Any) -> Any:
            any_number = numba.types.unliteral
            named = {name: any_number(value) for name, value in dict(kws).items()}
            return super().get_call_type(context, tuple(map(any_number, args)), named)

    extending.register_model(Part)(extending.models.OpaqueModel)
    extending.typeof_impl.register(Kernel)(lambda kernel, _: Part(kernel.part))
