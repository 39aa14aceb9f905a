"""Compiled kernels on disk: found by what they were compiled from, so that they are never stale.

A file holds one kernel for one signature. Its name has a digest of the code of the kernel and of all kernels that it
calls, of the versions of Python and Numba and of the processor. Files are written whole and renamed, and begin with a
checksum: any number of processes may write and read them at once, and what is damaged is compiled again. There is no
index. Folders: `NUMBA_CACHE_DIR` if it is set; otherwise the user's cache, and if that cannot be written to, the
package's own ``__pycache__``. Where nothing can be written, kernels are compiled in every process.
"""

from __future__ import annotations

import hashlib
import os
import secrets
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from types import CodeType
from typing import Any

import numpy as np

from .packages import lazy_module

numba = lazy_module("numba", "compiled kernels")
caching = lazy_module("numba.core.caching", "compiled kernels")
kernel_compiler = lazy_module("signedheat.kernel_compiler", "compiled kernels")
serialize = lazy_module("numba.core.serialize", "compiled kernels")

FORMAT = 9
"""To be raised when the same kernels are compiled otherwise."""
DAYS = 30
"""After so many, files of other versions of a kernel are removed when one is written."""


class KernelCache:
    """The versions of one kernel on disk, in the place of Numba's own cache of a dispatcher.

    Parameters
    ----------
    name : str
        Of the kernel, with its module.
    digest : str
        Of all code that it is compiled from.
    missed : callable
        Called with the name whenever something has to be compiled.
    """

    def __init__(self, name: str, digest: str, missed: Callable[[str], None]) -> None:
        self.name, self.digest, self._missed = name, digest, missed

    @property
    def cache_path(self) -> str:
        """The folder to which files are written first."""
        return str(next(folders()))

    def load_overload(self, signature: Any, context: Any) -> Any:
        """What was compiled for a signature, or None."""
        context.refresh()
        for folder in folders():
            try:
                data = (folder / self._file_name(signature, context.codegen())).read_bytes()
                if hashlib.sha256(data[32:]).digest() == data[:32]:
                    return _restored(context, serialize.loads(data[32:]))
            except Exception:  # whatever is wrong with a file of the cache: it is compiled again
                continue
        self._missed(self.name)
        return None

    def save_overload(self, signature: Any, result: Any) -> None:
        """Keep what was compiled, unless it refers to this process alone; that no folder can be written is no error."""
        if any(not lifted.can_cache for lifted in result.lifted) or result.library.has_dynamic_globals:
            return
        data = serialize.dumps(result._replace(type_annotation="")._reduce())
        for folder in folders():
            if _written(folder / self._file_name(signature, result.codegen), hashlib.sha256(data).digest() + data):
                self._remove_others(folder)
                return

    def _file_name(self, signature: Any, codegen: Any) -> str:
        key = repr(
            (FORMAT, str(signature), codegen.magic_tuple(), str(numba.version_info), sys.implementation.cache_tag)
        )
        return f"{self.name}-{self.digest[:16]}-{hashlib.sha256(key.encode()).hexdigest()[:16]}.nbc"

    def _remove_others(self, folder: Path) -> None:
        old = time.time() - 86400 * DAYS
        for path in folder.glob(f"{self.name}-*.nbc"):
            with suppress(OSError):
                if f"-{self.digest[:16]}-" not in path.name and path.stat().st_mtime < old:
                    path.unlink()

    def enable(self) -> None:
        """Nothing: asked for by Numba."""

    disable = flush = enable


def folders() -> Iterator[Path]:
    """Where files are looked for, and written to the first that can be."""
    wanted = os.environ.get("NUMBA_CACHE_DIR")
    if wanted:
        yield Path(wanted) / "signedheat"
        return
    with suppress(RuntimeError):  # no home
        base = {
            "win32": os.environ.get("LOCALAPPDATA") or Path.home() / "AppData/Local",
            "darwin": Path.home() / "Library/Caches",
        }.get(sys.platform, os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
        if Path(base).is_absolute():
            yield Path(base) / "signedheat" / "kernels"
    yield Path(__file__).parent / "__pycache__"


def _restored(context: Any, kept: Any) -> Any:
    if kept[0][1] == "bitcode":
        return kernel_compiler.restored(context, kept)
    return caching.CompileResultCacheImpl.__new__(caching.CompileResultCacheImpl).rebuild(context, kept)


def _written(path: Path, data: bytes) -> bool:
    """Write a file whole or not at all; returns whether."""
    temporary = path.with_name(f".{secrets.token_hex(8)}.tmp")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            temporary.write_bytes(data)
            os.replace(temporary, path)
        finally:
            with suppress(OSError):
                temporary.unlink()
    except OSError:
        return False
    return True


def digest_of(function: Callable[..., Any], options: dict[str, Any], called: Callable[[Any], Any]) -> str:
    """A digest of all that a kernel is compiled from: its code and options, constants, and the kernels that it calls.

    Parameters
    ----------
    function : function
        What is compiled.
    options : dict
        How it is compiled.
    called : callable
        The function and options of a value, if it is a kernel, or else None.

    Examples
    --------
    >>> def double(x):
    ...     return 2 * x
    >>> digest_of(double, {}, lambda value: None) == digest_of(double, {"nogil": True}, lambda value: None)
    False
    """
    digest, seen, waiting = hashlib.sha256(), set(), [(function, options)]
    while waiting:
        one, how = waiting.pop()
        if one in seen:
            continue
        seen.add(one)
        digest.update(_text((one.__module__, one.__qualname__, sorted(how.items()), one.__defaults__)).encode())
        for code in _codes(one.__code__):
            own = [c for c in code.co_consts if not isinstance(c, CodeType)]
            digest.update(code.co_code + _text((own, code.co_names, code.co_varnames, code.co_freevars)).encode())
            values = [(name, one.__globals__[name]) for name in code.co_names if name in one.__globals__]
            cells = zip(one.__code__.co_freevars, one.__closure__ or (), strict=False)
            for name, value in [*values, *((name, cell.cell_contents) for name, cell in cells)]:
                kernel = called(value)
                if kernel is not None:
                    waiting.append(kernel)
                elif isinstance(value, np.ndarray):
                    digest.update(f"{name}{value.dtype.str}{value.shape}".encode() + value.tobytes())
                elif isinstance(value, int | float | complex | str | tuple | np.generic):
                    digest.update(f"{name}={_text(value)}".encode())
    return digest.hexdigest()


def _text(value: Any) -> str:
    """A value as text that is the same in every process: sets have no order of their own."""
    if isinstance(value, tuple | list):
        return f"({', '.join(map(_text, value))})"
    if isinstance(value, set | frozenset):
        return f"{{{', '.join(sorted(map(_text, value)))}}}"
    return repr(value)


def _codes(code: CodeType) -> Iterator[CodeType]:
    """The code of a function and of those within it."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _codes(constant)
