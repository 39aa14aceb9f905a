"""Images: values on a lattice, and where that lies; all formats of fields on grids, voxels and labels.

NRRD headers are parsed by pynrrd and NIfTI by nibabel; data are read here, so that no more is read or unpacked than a
header announces.
"""

from __future__ import annotations

import bz2
import io
import json
import math
import warnings
import zlib
from collections.abc import Callable, Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import FileFormatError
from ..packages import lazy_module, require
from .arrays import read_npy, read_npz
from .files import (
    PathLike,
    companion_contents,
    contents,
    damaged,
    ensure_fits,
    format_for,
    parsed_numbers,
    reading,
    unpacked,
)
from .vtk_xml import read_vti

NIBABEL = ("nibabel", "NIfTI files")
nibabel: Any = lazy_module(*NIBABEL)
nrrd: Any = lazy_module("nrrd", "NRRD files")

CONFIDENCE = "confidence"
NIFTI = (".nii", ".nii.gz")
SHORT = {"RAS": "right-anterior-superior", "LPS": "left-posterior-superior", "LAS": "left-anterior-superior"}
"""Spaces by their short names in NRRD files."""
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


@dataclass(frozen=True, eq=False)
class Image:
    """Values on a lattice of d axes, and where it lies.

    Attributes
    ----------
    values : (n₁, …, n_d) number
        One for each place, indexed [x, y, z].
    axes : (d, d) float
        The step from one place to the next along each axis of the image, in columns.
    origin : (d,) float
        The first place.
    space : str, optional
        What the axes of the world are, as in NRRD files: ``"left-posterior-superior"``.
    confidence : (n₁, …, n_d), optional
        What a field has in addition to its values.
    """

    values: NDArray[Any]
    axes: NDArray[np.float64]
    origin: NDArray[np.float64]
    space: str | None = None
    confidence: NDArray[Any] | None = None

    @property
    def spacing(self) -> NDArray[np.float64]:
        """(d,) distance between places, of an image along x, y, z; raises `FileFormatError` where it is turned."""
        spacing = np.diag(self.axes) if self.axes.ndim == 2 else np.zeros(self.values.ndim)
        if not np.array_equal(self.axes, np.diag(spacing)):
            raise FileFormatError("its axes are not x, y, z", remedy="resample the image along them")
        return spacing


def read_image(path: PathLike, formats: Collection[str], purpose: str) -> Image:
    """An image of real numbers, in one of some formats."""
    read = format_for(path, {ending: READERS[ending] for ending in formats}, purpose)
    with reading(path):
        image = read(path)
        if image.values.dtype.kind not in "biuf":
            raise FileFormatError(f"the values are no real numbers but {image.values.dtype}: it holds no image")
        return image


def _aligned(values: NDArray[Any], origin: Any, spacing: Any, **others: Any) -> Image:
    """An image along x, y, z."""
    steps = np.asarray(spacing, dtype=np.float64)
    steps = np.full(values.ndim, steps) if steps.ndim == 0 else steps
    return Image(values, np.diag(steps), np.asarray(origin, dtype=np.float64), **others)


def _read_npy(path: PathLike) -> Image:
    """An array; origin and spacing from the ``.json`` of the same name, if there is one."""
    values, companion = read_npy(path), Path(path).with_suffix(".json")
    if not companion.exists():
        return _aligned(values, np.zeros(values.ndim), np.ones(values.ndim))
    text = contents(companion)
    with reading(companion):
        about = json.loads(text)
        return _aligned(values, about["origin"], about["spacing"])


def _read_npz(path: PathLike) -> Image:
    found = read_npz(path, (CONFIDENCE,), needed=("values", "origin", "spacing"))
    return _aligned(found.pop("values"), found.pop("origin"), found.pop("spacing"), **found)


def _read_vti(path: PathLike) -> Image:
    values, origin, spacing, confidence = read_vti(path, CONFIDENCE)
    return _aligned(values, origin, spacing, confidence=confidence)


def _read_nrrd(path: PathLike) -> Image:
    """A file that the header names must lie in the same folder or below it."""
    data = contents(path)
    file = io.BytesIO(data)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # about fields that nobody needs
        header = dict(nrrd.read_header(file))
    rest = data[file.tell() :]
    companion = header.get("data file", header.get("datafile"))
    if companion is not None:
        if companion.startswith("LIST") or "%" in companion:
            raise FileFormatError("its data are in several files", remedy="save it as one")
        rest = companion_contents(path, companion)
    sizes = [int(n) for n in header["sizes"]]
    code = _CODES.get(header["type"])
    if code is None or len(sizes) != header["dimension"] or min(sizes, default=0) < 1:
        raise damaged(f"its type '{header['type']}', dimension {header['dimension']} and sizes {sizes} make no image")
    dtype = np.dtype(code).newbyteorder(">" if header.get("endian") == "big" else "<")
    for _ in range(header.get("line skip") or header.get("lineskip") or 0):
        rest = rest.partition(b"\n")[2]
        if not rest:
            break
    values = _nrrd_values(rest, header, math.prod(sizes), dtype, path).reshape(sizes, order="F")
    spacings = np.nan_to_num(np.asarray(header.get("spacings", np.ones(values.ndim)), dtype=np.float64), nan=1.0)
    steps = np.atleast_2d(np.asarray(header.get("space directions", np.diag(spacings)), dtype=np.float64))
    origin = np.asarray(header.get("space origin", np.zeros(values.ndim)), dtype=np.float64)
    space = header.get("space")
    return Image(values, steps.T, origin, None if space is None else SHORT.get(str(space), str(space).lower()))


def _nrrd_values(data: bytes, header: dict[str, Any], count: int, dtype: np.dtype[Any], path: PathLike) -> NDArray[Any]:
    """The values in a row; they are `count`."""
    encoding, size = str(header["encoding"]).lower(), count * dtype.itemsize
    skip = header.get("byte skip", header.get("byteskip", 0))
    if encoding in ("ascii", "text", "txt"):
        words = data[max(skip, 0) :].split()
        if len(words) < count:
            raise _truncated(len(words), count)
        return parsed_numbers(words[:count], "values").astype(dtype.newbyteorder("="))
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


def write_nrrd(
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


def _read_nifti(path: PathLike) -> Image:
    data = contents(path)
    require(*NIBABEL)
    packed = data[:2] == b"\x1f\x8b"
    head = unpacked(data, zlib.decompressobj(zlib.MAX_WBITS | 16), 540) if packed else data[:540]
    second = 540 in (int.from_bytes(head[:4], "little"), int.from_bytes(head[:4], "big"))
    kind = nibabel.Nifti2Image if second else nibabel.Nifti1Image
    logger = nibabel.imageglobals.logger
    was, logger.disabled = logger.disabled, True  # what it mends in headers it would write to standard error
    try:
        header = kind.header_class.from_fileobj(io.BytesIO(head), check=False)
        size = int(header["vox_offset"]) + int(np.prod(header.get_data_shape())) * header.get_data_dtype().itemsize
        ensure_fits(size, path)
        if packed:
            data = unpacked(data, zlib.decompressobj(zlib.MAX_WBITS | 16), size)
        if len(data) < size:
            raise _truncated(len(data), size)
        image = kind.from_bytes(data)
        values, affine = np.asarray(image.dataobj), np.asarray(image.affine, dtype=np.float64)
    finally:
        logger.disabled = was
    while values.ndim > 3 and values.shape[-1] == 1:
        values = values[..., 0]
    return Image(values, affine[:3, :3], affine[:3, 3], "right-anterior-superior")


READERS: dict[str, Callable[[PathLike], Image]] = {
    ".npy": _read_npy,
    ".npz": _read_npz,
    ".nrrd": _read_nrrd,
    ".vti": _read_vti,
    **dict.fromkeys(NIFTI, _read_nifti),
}
