"""Run parsers of other packages in separate processes.

A malicious file may make a parser crash, hang, use all memory or access the network. Therefore the process has limits
on memory and processor time, no network where the system permits that, and returns only numbers.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tempfile
from contextlib import suppress
from math import prod
from signal import Signals
from typing import Any, BinaryIO, cast

import numpy as np

from ..errors import FileFormatError, MemoryLimitError, SignedHeatError
from ..packages import ensure_installed, missing_package
from . import budgets, parsers
from .files import PathLike, size_of

PARSER_PROGRAM = (
    "import json, sys; sys.path[:] = json.loads(sys.argv.pop(1)); file = sys.argv.pop(1); "
    "exec(compile(open(file, encoding='utf-8').read(), file, 'exec'))"
)
"""Program of the process: it starts isolated from the current folder, then takes over the import path."""
LEAST_MEMORY, MEMORY_PER_BYTE = 1 << 29, 100
"""Memory limit of a parser in bytes: a constant part, and a factor of the size of the file."""
ARRAY_TYPE = re.compile(r"[<>|][biuf][1248]")
"""Matches NumPy types that a parser may return."""
ALONE = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "RAYON_NUM_THREADS"), "1")
"""Environment variables that limit threads to one, since idle threads take memory."""


def parsed(
    function: str,
    path: PathLike,
    package: str,
    purpose: str,
    *,
    bytes_per_byte: int = MEMORY_PER_BYTE,
    least_seconds: int | None = None,
    **options: object,
) -> dict[str, Any]:
    """Parse a file by a function of `parsers` in a process of its own, and return arrays and other values by name.

    Parameters
    ----------
    function : str
        Name of the function.
    path : str or path
        The file.
    package : str
        The package that the function needs.
    purpose : str
        What the package is for, for messages.
    bytes_per_byte : int
        Memory that the process may use for each byte of the file, besides `LEAST_MEMORY`.
    least_seconds : int, optional
        Processor time that it may use for any file; large files have more. The budget of the file limits both further.
    **options : object
        Further arguments of the function, which JSON must be able to hold.
    """
    size = size_of(path)
    ensure_installed(package, purpose)
    left, seconds = budgets.left(path, least_seconds or budgets.LEAST_SECONDS)
    memory = int(min(LEAST_MEMORY + bytes_per_byte * size, left))
    folders = json.dumps([os.path.abspath(folder) for folder in sys.path if folder])
    order = [function, os.path.abspath(path), json.dumps(options), str(memory), str(seconds)]
    with tempfile.TemporaryFile() as messages:
        process = subprocess.Popen(
            [sys.executable, "-I", "-c", PARSER_PROGRAM, folders, str(parsers.__file__), *order],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=messages,
            env={**os.environ, **ALONE, "RUST_BACKTRACE": "0"},
        )
        with process:
            try:
                values = _answer(cast("BinaryIO", process.stdout), left)
                with suppress(subprocess.TimeoutExpired):
                    process.wait(1.0)
            finally:
                process.kill()
        if values is None:
            messages.seek(0)
            lines = messages.read().decode("utf-8", errors="replace").splitlines()
            said = [line for line in lines if line.strip() and not line.startswith("note:")]
            raise _died(package, process.returncode, said[-1] if said else "", seconds)
    if "refused" in values:
        cause, remedy = values["refused"]
        raise FileFormatError(cause, remedy=remedy)
    if "error" in values:
        raise _failed(package, purpose, values, memory)
    return values


def _answer(stream: BinaryIO, left: float) -> dict[str, Any] | None:
    """Read the values and arrays that a parser returns, by name; return None if they are incomplete or malformed.

    Raise `MemoryLimitError` if the arrays have more than `left` bytes.
    """
    try:
        about = json.loads(stream.readline(1 << 24))  # longer than any answer without its arrays
        if "values" not in about:
            return dict(about)
        values = dict(about["values"])
        shapes = [(str(name), str(code), [int(n) for n in shape]) for name, code, shape in about["arrays"]]
    except (ValueError, KeyError, TypeError):
        return None
    for name, code, shape in shapes:
        if not ARRAY_TYPE.fullmatch(code) or min(shape, default=0) < 0:
            return None
        left -= prod(shape) * np.dtype(code).itemsize
        if left < 0:
            raise MemoryLimitError("what it holds does not fit in memory", remedy="free some memory")
        values[name] = np.empty(shape, dtype=code)
        rest = memoryview(values[name].reshape(-1).view(np.uint8))
        while rest:
            count = stream.readinto(rest)  # type: ignore[attr-defined]
            if not count:
                return None
            rest = rest[count:]
    return values


def _died(package: str, status: int, last_message: str, seconds: int) -> SignedHeatError:
    """Return the error for a parser that ended without an answer.

    `status` is the exit status, or minus the number of the signal that ended it; `last_message` is its last message.
    """
    number = -status if status < 0 else 0
    name = Signals(number).name if number else f"status {status}"
    if name == "SIGKILL":
        cause = f"{package} was killed while reading it, probably because memory ran out"
        return MemoryLimitError(cause, remedy="check that it is not damaged, or free some memory")
    if name == "SIGXCPU":
        cause = f"{package} needs more than {seconds} s of processor time for it"
    else:
        cause = f"{package} crashed on it ({name}{': ' if last_message else ''}{last_message:.200})"
    return FileFormatError(cause, remedy="write it again, or in another format")


def _failed(package: str, purpose: str, values: dict[str, Any], memory: int) -> SignedHeatError:
    """Return the error for a parser that raised an exception, whose class and message `values` has."""
    kind, message = values["error"], " ".join(str(values["message"]).split())
    if kind == "MemoryError":
        cause = f"{package} needs more than {memory / 1e9:.2g} GB for it"
        return MemoryLimitError(cause, remedy="check that it is not damaged, or free some memory")
    if kind == "ModuleNotFoundError":
        return missing_package(values["package"] or package, purpose)
    cause = f"{package} cannot read it ({message or kind:.200})"
    return FileFormatError(cause, remedy="write it again, or in another format")
