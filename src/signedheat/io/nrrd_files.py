"""NRRD images: headers by pynrrd, data here, so that no more is read or unpacked than the header announces."""

from __future__ import annotations

import bz2
import io
import math
import warnings
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import FileFormatError
from ..packages import lazy_module
from .files import PathLike, contents, contents_beside, damaged, ensure_fits, numbers, unpacked

nrrd = lazy_module("nrrd", "NRRD files")

_CODES = {
    name: code
    for names, code in (
        ("signed char,int8,int8_t", "i1"),
        ("uchar,unsigned char,uint8,uint8_t", "u1"),
        ("short,short int,signed short,signed short int,int16,int16_t", "i2"),
        ("ushort,unsigned short,unsigned short int,uint16,uint16_t", "u2"),
        ("int,signed int,int32,int32_t", "i4"),
        ("uint,unsigned int,uint32,uint32_t", "u4"),
        ("longlong,long long,long long int,signed long long,signed long long int,int64,int64_t", "i8"),
        ("ulonglong,unsigned long long,unsigned long long int,uint64,uint64_t", "u8"),
        ("float", "f4"),
        ("double", "f8"),
    )
    for name in names.split(",")
}


def read_image(path: PathLike) -> tuple[NDArray[Any], dict[str, Any]]:
    """Values, indexed [x, y, z], and the header.

    A file that the header names must lie in the same folder or below it.

    Raises
    ------
    FileFormatError
        If it is damaged, truncated, packed in a way that is not known, or names a file elsewhere.
    MemoryLimitError
        If it announces more than fits into memory.
    """
    data = contents(path)
    file = io.BytesIO(data)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # about fields that nobody needs
        header = dict(nrrd.read_header(file))
    rest = data[file.tell() :]
    beside = header.get("data file", header.get("datafile"))
    if beside is not None:
        if beside.startswith("LIST") or "%" in beside:
            raise FileFormatError("its data are in several files", remedy="save it as one")
        rest = contents_beside(path, beside)
    sizes = [int(n) for n in header["sizes"]]
    code = _CODES.get(header["type"])
    if code is None or len(sizes) != header["dimension"] or min(sizes, default=0) < 1:
        raise damaged(f"its type '{header['type']}', dimension {header['dimension']} and sizes {sizes} make no image")
    dtype = np.dtype(code).newbyteorder(">" if header.get("endian") == "big" else "<")
    for _ in range(header.get("line skip") or header.get("lineskip") or 0):
        rest = rest.partition(b"\n")[2]
        if not rest:
            break
    values = _values(rest, header, math.prod(sizes), dtype, path)
    return values.reshape(sizes, order="F"), header


def write_image(
    path: PathLike,
    values: NDArray[Any],
    axes: NDArray[np.float64],
    origin: NDArray[np.float64],
    space: str | None = None,
    **keys: str,
) -> None:
    """Write values, indexed [x, y, z]; the columns of `axes` are the steps along x, y, z. `keys` go into the header."""
    header = {
        **({"space dimension": values.ndim} if space is None else {"space": space}),
        "space directions": axes.T,
        "space origin": origin,
        "kinds": ["domain"] * values.ndim,
        "encoding": "raw",
        **keys,
    }
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # pynrrd 1.1 dates its files by a function that will go
        nrrd.write(str(path), values, header, index_order="F")


def _values(data: bytes, header: dict[str, Any], count: int, dtype: np.dtype[Any], path: PathLike) -> NDArray[Any]:
    """The values in a row; they are `count`."""
    encoding, size = str(header["encoding"]).lower(), count * dtype.itemsize
    skip = header.get("byte skip", header.get("byteskip", 0))
    if encoding in ("ascii", "text", "txt"):
        words = data[max(skip, 0) :].split()
        if len(words) < count:
            raise _truncated(len(words), count)
        return numbers(words[:count], "values").astype(dtype.newbyteorder("="))
    ensure_fits(size, path)
    if encoding in ("gzip", "gz"):
        data = unpacked(data, zlib.decompressobj(zlib.MAX_WBITS | 16), size + max(skip, 0))
    elif encoding in ("bzip2", "bz2"):
        data = unpacked(data, bz2.BZ2Decompressor(), size + max(skip, 0))
    elif encoding != "raw":
        raise FileFormatError(f"packed by '{encoding}'", remedy="save it as raw or gzip")
    start = len(data) - size if skip == -1 else max(skip, 0)
    if start < 0 or len(data) - start < size:
        raise _truncated(max(len(data) - start, 0), size)
    return np.frombuffer(data, dtype, count, start).astype(dtype.newbyteorder("="))


def _truncated(there: int, announced: int) -> FileFormatError:
    return damaged(f"it announces {announced}, and {there} are there: it is truncated")
