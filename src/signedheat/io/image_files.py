"""Images, which are values on a lattice in space, in all formats of fields on grids, voxels and labels.

No more is read or unpacked than a header announces. NIfTI is read by nibabel.
"""

from __future__ import annotations

import bz2
import gzip
import io
import math
from collections.abc import Callable, Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats
from ..errors import FileFormatError, quoted
from ..packages import lazy_module
from ..validation import json_numbers
from .budgets import charge, charge_words
from .files import (
    PathLike,
    companion_contents,
    contents,
    damaged,
    format_for,
    reading,
)
from .numerals import integer, integers, json_of, parsed_numbers, typed_numbers, vector
from .numpy_files import read_npy, read_npz
from .sandbox import parsed
from .vtk_xml import read_vti

NIBABEL = ("nibabel", "NIfTI files")
nibabel: Any = lazy_module(*NIBABEL)

CONFIDENCE = "confidence"
"""Name of the array in a file that has the confidence of a field in its values."""
NIFTI = (".nii", ".nii.gz")
SPACE_NAMES = {"RAS": "right-anterior-superior", "LPS": "left-posterior-superior", "LAS": "left-anterior-superior"}
"""Full names of spaces by their short names in NRRD files."""
JOINED = {"datafile": "data file", "lineskip": "line skip", "byteskip": "byte skip", "centerings": "centers"}
"""Names of fields of NRRD files by their synonyms."""
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

COPIES = 2
"""Number of times that the values of an image are in memory while they are read or checked, as measured."""


@dataclass(frozen=True, eq=False)
class Image:
    """Values on a lattice of d axes in space."""

    values: NDArray[Any]  # (n₁, …, n_d) values, indexed [x, y, z]
    axes: Floats  # (d, d) steps from value to value along each axis of the image, in columns
    origin: Floats  # (d,) position of the first value
    space: str | None = None  # meaning of the axes of the world, as in NRRD files: ``"left-posterior-superior"``
    confidence: NDArray[Any] | None = None  # (n₁, …, n_d) confidence of a field in its values

    @property
    def spacing(self) -> Floats:
        """(d,) steps between values along x, y, z; raises `FileFormatError` if the image is rotated."""
        spacing = np.diag(self.axes) if self.axes.ndim == 2 else np.zeros(self.values.ndim)
        if not np.array_equal(self.axes, np.diag(spacing)):
            raise FileFormatError("its axes are not x, y, z", remedy="resample the image along them")
        return spacing


def read_image(path: PathLike, formats: Collection[str], purpose: str) -> Image:
    """Read an image of real numbers in one of some formats; `purpose` is what it is read as, for messages."""
    read = format_for(path, {ending: IMAGE_READERS[ending] for ending in formats}, purpose)
    with reading(path):
        image = read(path)
        charge(bytes=COPIES * image.values.nbytes)
        if image.values.dtype.kind not in "biuf":
            raise FileFormatError(f"the values are not real numbers but {image.values.dtype}: this is not an image")
        return image


def _aligned(values: NDArray[Any], origin: Any, spacing: Any, **others: Any) -> Image:
    """Make an image whose axes are x, y, z; the spacing is a number, or (d,) numbers."""
    steps = np.asarray(spacing, dtype=np.float64)
    steps = np.full(values.ndim, steps) if steps.ndim == 0 else steps
    return Image(values, np.diag(steps), np.asarray(origin, dtype=np.float64), **others)


def _read_npy(path: PathLike) -> Image:
    """Read an array, with origin and spacing from the ``.json`` file of the same name, otherwise 0 and 1."""
    values, companion = read_npy(path), Path(path).with_suffix(".json")
    if not companion.exists():
        return _aligned(values, np.zeros(values.ndim), np.ones(values.ndim))
    with reading(companion):
        about = json_of(contents(companion))
        origin = vector(about["origin"], "origin", values.ndim)
        spacing = json_numbers(about["spacing"], "spacing", FileFormatError)
        return _aligned(values, origin, spacing)


def _read_npz(path: PathLike) -> Image:
    """Read values with their origin, spacing and, if the archive has it, confidence."""
    arrays = read_npz(path, (CONFIDENCE,), needed=("values", "origin", "spacing"))
    return _aligned(arrays.pop("values"), arrays.pop("origin"), arrays.pop("spacing"), **arrays)


def _read_vti(path: PathLike) -> Image:
    """Read the values that the file says to show, and an array named `CONFIDENCE` if there is one."""
    values, origin, spacing, confidence = read_vti(path, CONFIDENCE)
    return _aligned(values, origin, spacing, confidence=confidence)


def _read_nrrd(path: PathLike) -> Image:
    """Read an image whose header may name another file with its data, in the same folder or below it."""
    header, rest = _nrrd_header(contents(path))
    companion = header.get("data file")
    if companion is not None:
        if companion.startswith("LIST") or "%" in companion:
            raise FileFormatError("its data are in several files", remedy="save it as one")
        rest = companion_contents(path, companion)
    sizes = integers(header["sizes"].split(), "sizes").tolist()
    code = _CODES.get(header["type"].lower())
    if code is None or integer(header["dimension"], "dimension") != len(sizes) or min(sizes, default=0) < 1:
        raise damaged(
            f"its type '{header['type']}', dimension {header['dimension']} and sizes {sizes} do not describe an image"
        )
    dtype = np.dtype(code).newbyteorder(">" if header.get("endian") == "big" else "<")
    begin, lines = 0, integer(header.get("line skip", "0"), "line skip")
    if lines > rest.count(b"\n"):
        raise _truncated(rest.count(b"\n"), lines)
    for _ in range(lines):
        begin = rest.index(b"\n", begin) + 1
    values = _nrrd_values(rest[begin:], header, math.prod(sizes), dtype).reshape(sizes, order="F")
    spacings = parsed_numbers(header.get("spacings", "1 " * values.ndim).split(), "spacings")
    steps = (
        _nrrd_vectors(header["space directions"])
        if "space directions" in header
        else np.diag(np.where(np.isnan(spacings), 1.0, spacings))
    )
    origin = _nrrd_vectors(header.get("space origin", f"({','.join('0' * values.ndim)})"))[0]
    space = header.get("space")
    return Image(values, steps.T, origin, None if space is None else SPACE_NAMES.get(space, space.lower()))


def _nrrd_header(data: bytes) -> tuple[dict[str, str], bytes]:
    """Return the fields of the header by name, in lower case and without synonyms (`JOINED`), and the data after it."""
    if not data.startswith(b"NRRD"):
        raise damaged("it does not begin with NRRD")
    fields: dict[str, str] = {}
    lines = io.BytesIO(data)
    for line in lines:
        name, separator, value = line.decode("utf-8", errors="replace").strip().partition(":")
        if not name:
            break
        if separator and not name.startswith("#") and not value.startswith("="):  # "name:=value" is a remark
            fields[JOINED.get(name.lower(), name.lower())] = value.strip()
    return fields, data[lines.tell() :]


def _nrrd_vectors(text: str) -> Floats:
    """Parse (n, d) vectors like ``(1,0,0) (0,1,0)``; the word ``none``, for axes outside of space, gives NaN."""
    rows = [part.strip(" (").split(",") for part in text.replace("none", "(nan)").split(")")[:-1]]
    if not rows:
        raise damaged(f"{quoted(text)} are no vectors")
    width = max(map(len, rows))
    return parsed_numbers([row if len(row) == width else width * ["nan"] for row in rows], "vectors")


def _nrrd_values(data: bytes, header: dict[str, str], count: int, dtype: np.dtype[Any]) -> NDArray[Any]:
    """Return the first `count` values of the data, which are encoded as the header says."""
    encoding, size = header["encoding"].lower(), count * dtype.itemsize
    skip = integer(header.get("byte skip", "0"), "byte skip", -1)
    if encoding in ("ascii", "text", "txt"):
        charge_words(data)
        words = data[max(skip, 0) :].split()
        if len(words) < count:
            raise _truncated(len(words), count)
        return typed_numbers(words[:count], dtype.newbyteorder("="), "values")
    packed = encoding in ("gzip", "gz", "bzip2", "bz2")
    charge(bytes=COPIES * size + packed * (size + max(skip, 0)))
    if encoding in ("gzip", "gz"):
        data = gzip.GzipFile(fileobj=io.BytesIO(data)).read(size + max(skip, 0))
    elif encoding in ("bzip2", "bz2"):
        data = bz2.BZ2File(io.BytesIO(data)).read(size + max(skip, 0))
    elif encoding != "raw":
        raise FileFormatError(f"packed by '{encoding}'", remedy="save it as raw or gzip")
    start = len(data) - size if skip == -1 else max(skip, 0)
    if start < 0 or len(data) - start < size:
        raise _truncated(max(len(data) - start, 0), size)
    return np.frombuffer(data, dtype, count, start).astype(dtype.newbyteorder("="))


def _truncated(there: int, announced: int) -> FileFormatError:
    """Return the error for a file that has fewer values, bytes or lines than its header announces."""
    return damaged(f"it announces {announced}, and {there} are there: it is truncated")


def write_nrrd(
    path: PathLike, values: NDArray[Any], axes: Floats, origin: Floats, space: str | None = None, **keys: str
) -> None:
    """Write an image.

    Parameters
    ----------
    path : str or path
        The file.
    values : (n₁, …, n_d) float
        The values, indexed [x, y, z].
    axes : (d, d) float
        The steps from value to value along each axis, in columns.
    origin : (d,) float
        The position of the first value.
    space : str, optional
        The meaning of the axes of the world, such as ``"left-posterior-superior"``.
    **keys : str
        Further lines of the header, by name.
    """
    data = np.asfortranarray(values).astype(values.dtype.newbyteorder("<"), copy=False)
    header = {
        "type": next(name for name, code in _CODES.items() if code == data.dtype.str[1:]),
        "dimension": values.ndim,
        **({"space dimension": values.ndim} if space is None else {"space": space}),
        "sizes": " ".join(map(str, values.shape)),
        "space directions": " ".join(map(_nrrd_vector, axes.T.tolist())),
        "kinds": " ".join(["domain"] * values.ndim),
        "endian": "little",
        "encoding": "raw",
        "space origin": _nrrd_vector(origin.tolist()),
    }
    fields = [f"{name}: {value}" for name, value in header.items()]
    fields += [f"{name}{': ' if name == 'content' else ':='}{value}" for name, value in keys.items()]
    with open(path, "wb") as file:
        file.write("\n".join(["NRRD0005", *fields, "", ""]).encode())
        file.write(data.tobytes(order="F"))


def _nrrd_vector(numbers: list[float]) -> str:
    """Format a vector like ``(1.0,0.0,0.0)``."""
    return f"({','.join(map(repr, numbers))})"


def _read_nifti(path: PathLike) -> Image:
    """Read an image without further axes of length 1, such as that of time."""
    parts = parsed("nifti", path, *NIBABEL, bytes_per_byte=4000)  # gzip may pack a thousand bytes into one
    values, affine = parts["values"], parts["affine"]
    while values.ndim > 3 and values.shape[-1] == 1:
        values = values[..., 0]
    return Image(values, affine[:3, :3], affine[:3, 3], "right-anterior-superior")


IMAGE_READERS: dict[str, Callable[[PathLike], Image]] = {
    ".npy": _read_npy,
    ".npz": _read_npz,
    ".nrrd": _read_nrrd,
    ".vti": _read_vti,
    **dict.fromkeys(NIFTI, _read_nifti),
}
