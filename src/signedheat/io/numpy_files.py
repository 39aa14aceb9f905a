"""NumPy's ``.npy`` and ``.npz``: an array is allocated after its size has been compared with that of its data."""

from __future__ import annotations

import io
import math
from collections.abc import Collection
from typing import IO, Any
from zipfile import ZipFile

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from ..errors import FileFormatError
from .budgets import charge
from .files import PathLike, contents, damaged, reading, replacing

_HEADERS = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}


def read_npy(path: PathLike) -> NDArray[Any]:
    """Read the array of a ``.npy`` file."""
    data = contents(path)
    with reading(path):
        return _array(io.BytesIO(data), len(data))


def read_npz(path: PathLike, wanted: Collection[str], needed: Collection[str] = ()) -> dict[str, NDArray[Any]]:
    """Read arrays of a ``.npz`` file by name.

    Parameters
    ----------
    path : str or path
        The file.
    wanted : collection of str
        Names of arrays to read if the file has them.
    needed : collection of str
        Names of arrays that the file must have.

    Raises
    ------
    FileFormatError
        If the file is damaged or lacks an array that is needed.
    """
    data = contents(path)
    with reading(path), ZipFile(io.BytesIO(data)) as archive:
        members = {info.filename: info for info in archive.infolist()}
        arrays = {}
        for name in (*needed, *wanted):
            if info := members.get(f"{name}.npy"):
                with archive.open(info) as file:
                    arrays[name] = _array(file, info.file_size)
            elif name in needed:
                raise FileFormatError(f"it has no {name}", remedy="check that it is the right file", element=name)
        return arrays


def write_npz(path: PathLike, **arrays: Any) -> None:
    """Write the arrays that are not None; an existing file survives a failure."""
    with replacing(path) as temporary, temporary.open("wb") as file:
        given: dict[str, Any] = {name: np.asarray(values) for name, values in arrays.items() if values is not None}
        np.savez(file, **given)


def names_in_npz(path: PathLike) -> set[str]:
    """List the names of the arrays in a ``.npz`` file."""
    data = contents(path)
    with reading(path), ZipFile(io.BytesIO(data)) as archive:
        return {name.removesuffix(".npy") for name in archive.namelist()}


def _array(file: IO[bytes], size: int) -> NDArray[Any]:
    """Read an array of numbers from a file of `size` bytes."""
    version = npy.read_magic(file)
    if version not in _HEADERS:
        raise FileFormatError(f"its version {version} of NumPy's format is unknown")
    shape, is_fortran, dtype = _HEADERS[version](file)
    if dtype.kind not in "biufc":
        raise FileFormatError(f"the values are not numbers but {dtype}", remedy="save numbers")
    announced, available = math.prod(shape) * dtype.itemsize, size - file.tell()
    if not 0 <= announced <= available or min(shape, default=0) < 0:
        raise damaged(
            f"an array of shape {shape} needs {announced} bytes, of which {available} are there: the file is truncated"
        )
    charge(bytes=announced)
    values = np.empty(shape, dtype, order="F" if is_fortran else "C")
    flat = values.ravel(order="K").view(np.uint8).data if announced else memoryview(b"")
    position = 0
    while position < announced:
        part = file.read(min(announced - position, 1 << 24))
        if not part:
            raise damaged("the data end early")
        flat[position : position + len(part)] = part
        position += len(part)
    return values
