"""PCD, the Point Cloud Library's format: positions and normals, as text or binary."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..domains.point_cloud import PointCloud
from ..errors import FileFormatError
from .files import PathLike, contents

NUMBERS = {"F": "f", "I": "i", "U": "u"}
"""Types of fields, and their letters for NumPy."""


def read_pcd(path: PathLike) -> PointCloud:
    """Points of a file with DATA ascii or binary; those without a position (NaN), as scanners write them, left out."""
    content = contents(path)
    header: dict[str, list[str]] = {}
    at = 0
    while "DATA" not in header:
        end = content.find(b"\n", at)
        if end < 0:
            raise FileFormatError("there is no line DATA: this is no PCD file, or it is truncated")
        words = content[at:end].decode("ascii", "replace").partition("#")[0].split()
        if words:
            header[words[0].upper()] = words[1:]
        at = end + 1
    table = _table(header, content[at:])
    if not {"x", "y", "z"} <= table.keys():
        raise FileFormatError(f"the fields are {', '.join(table)}, without x, y and z")
    points = np.column_stack([table[axis] for axis in "xyz"])
    known = np.isfinite(points).all(axis=1)
    names = [f"normal_{axis}" for axis in "xyz"]
    normals = np.column_stack([table[name] for name in names]) if set(names) <= table.keys() else None
    whole = normals is not None and np.isfinite(normals[known]).all()
    return PointCloud(points[known], normals[known] if normals is not None and whole else None)


def _table(header: dict[str, list[str]], body: bytes) -> dict[str, NDArray[np.float64]]:
    """Columns of numbers by name of the field."""
    try:
        names, kind = header["FIELDS"], header["DATA"][0].lower()
        counts = [int(word) for word in header.get("COUNT", ["1"] * len(names))]
        n = int(header["POINTS"][0]) if "POINTS" in header else int(header["WIDTH"][0]) * int(header["HEIGHT"][0])
        types = [NUMBERS[letter] + size for letter, size in zip(header["TYPE"], header["SIZE"], strict=True)]
        fields = [(f"{k}", f"<{code}", (count,)) for k, (code, count) in enumerate(zip(types, counts, strict=True))]
        row = np.dtype(fields)
        if len(names) != len(fields) or n < 0:
            raise ValueError
    except (KeyError, ValueError, IndexError, TypeError):
        raise FileFormatError("the header of the PCD file is not complete, or contradicts itself") from None
    if kind == "binary":
        if len(body) < n * row.itemsize:
            raise FileFormatError(f"{n} points take {n * row.itemsize} bytes, and {len(body)} follow")
        rows = np.frombuffer(body, row, n)
        return {name: rows[f"{k}"][:, 0].astype(np.float64) for k, name in enumerate(names)}
    if kind != "ascii":
        raise FileFormatError(f"data are {kind}", remedy="write them as ascii or binary")
    try:
        numbers = np.array([line.split() for line in body.decode("ascii").splitlines() if line.strip()], dtype=float)
        numbers = numbers.reshape(n, sum(counts))
    except (ValueError, UnicodeDecodeError):
        raise FileFormatError(f"there are no {n} lines of {sum(counts)} numbers") from None
    begins = np.concatenate([[0], np.cumsum(counts)])
    return {name: numbers[:, begins[k]] for k, name in enumerate(names)}
