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

from .errors import SignedHeatError
from .jobs import MOST_THREADS, Announcement, interruptible, stop_if_abandoned
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
"""Number of entries of arrays up to which a kernel is too short for anybody to interrupt it."""
WORD = re.compile(r"\w+")
DAMAGE = OSError, EOFError, pickle.UnpicklingError
"""Errors of a cache whose files are damaged or cannot be written. Kernels raise none of them."""
BASELINE = "x86-64-v3"
"""Processors that the kernels of wheels are compiled for: level 3 of the x86-64 ABI, most made since 2013."""
BASELINE_FEATURES = "avx", "avx2", "bmi", "bmi2", "cx16", "f16c", "fma", "lzcnt", "movbe", "popcnt", "sahf", "xsave"
"""What LLVM calls the features of level 3, without those that AVX implies."""
CARRIED = Path(__file__).parent / "kernels"
"""Folder of the kernels that a wheel carries, which `make wheel` fills."""
_names: dict[Callable[..., Any], str] = {}
"""Names of the folders of the functions of which dispatchers are being made."""
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
    """Make a function a kernel: ``@compiled``, or ``@compiled(fastmath=True)`` with options of ``numba.njit``."""
    if function is not None:
        return Kernel(function, options)
    return lambda function: Kernel(function, options)


def cache_folder() -> Path:
    """Return the folder for compiled code: what NUMBA_CACHE_DIR names, or else a folder in the user's cache."""
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
    """Let Numba keep the compiled code of a function in the folder `name` if its dispatcher is made meanwhile."""
    config = numba.config
    before, config.CACHE_LOCATOR_CLASSES = config.CACHE_LOCATOR_CLASSES, f"{__name__}.{KernelLocator.__name__}"
    _names[function] = name
    try:
        yield
    finally:
        del _names[function]
        config.CACHE_LOCATOR_CLASSES = before


def has_code(name: str) -> bool:
    """Tell whether code of this processor is kept by a name."""
    return any(any((root / name / _processor()).glob("*.nbi")) for root in _roots(name))


class KernelLocator:
    """The first folder that can be written to, as Numba's cache asks for it."""

    def __init__(self, folder: Path, file: str) -> None:
        self._folder = folder
        self._py_file = file  # Numba's warnings name it

    @classmethod
    def from_function(cls, function: Callable[..., Any], file: str) -> KernelLocator | None:
        """Return a locator, or None if no folder can be written to."""
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
        """Return what the code is made of."""
        return self._folder.parent.name

    def get_disambiguator(self) -> str:
        """Return nothing: each function has a folder of its own."""
        return ""


def _roots(name: str) -> Iterator[Path]:
    """Yield the folders for compiled code, the best first."""
    yield cache_folder()
    yield _folder_beside_the_source()
    if (CARRIED / name).is_dir() and _kind_of_code() is not None:
        yield Path(_folder_of_this_process().name)


def _folder_beside_the_source() -> Path:
    return Path(__file__).parent / "__pycache__" / "kernels"


@cache
def _folder_of_this_process() -> tempfile.TemporaryDirectory[str]:
    """Make a folder that is removed at the end."""
    return tempfile.TemporaryDirectory(prefix="signedheat-")


@cache
def _processor() -> str:
    """Return a name for the code of this processor, or of that which Numba's settings ask for."""
    config, host = numba.config, (llvmlite.get_host_cpu_name(), llvmlite.get_host_cpu_features().flatten())
    code = *host, config.CPU_NAME, config.CPU_FEATURES, config.ENABLE_AVX
    return hashlib.sha256(repr(code).encode()).hexdigest()[:8]


@cache
def _kind_of_code() -> tuple[str, str, str] | None:
    """Return how Numba describes code of this processor, or None where `BASELINE` does not run or is not wanted."""
    config = numba.config
    if config.CPU_NAME is not None or config.CPU_FEATURES is not None or not config.ENABLE_AVX:
        return None
    features = llvmlite.get_host_cpu_features()
    if not all(features.get(feature) for feature in BASELINE_FEATURES):
        return None
    return numba_registry.cpu_target.target_context.codegen().magic_tuple()


def _unpack(carried: Path, folder: Path) -> None:
    """Copy the code of a kernel from a wheel, and list it as code of this processor.

    The lists have the format of the version of Numba that wrote them: it is part of the name of the folder.
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
    """Write a file atomically, since other processes may do so, too."""
    with tempfile.NamedTemporaryFile(dir=path.parent, delete=False) as file:
        file.write(content)
    os.replace(file.name, path)


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

    class Part(numba.types.Dispatcher):  # type: ignore[misc]
        """The type of a kernel in compiled code, which compiles it for all numbers of a type, not for literals."""

        def get_call_type(self, context: Any, args: Any, kws: Any) -> Any:
            any_number = numba.types.unliteral
            named = {name: any_number(value) for name, value in dict(kws).items()}
            return super().get_call_type(context, tuple(map(any_number, args)), named)

    extending.register_model(Part)(extending.models.OpaqueModel)
    extending.typeof_impl.register(Kernel)(lambda kernel, _: Part(kernel.part))
