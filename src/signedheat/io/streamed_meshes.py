"""Writing of meshes that are larger than memory, part by part."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from typing import IO

import numpy as np
from numpy.typing import NDArray

from ..fields.files import save_parts
from .files import PathLike, ensure_writable, replacing

FORMATS = frozenset({".ply"})
"""Extensions of files that can be written so."""
_FACE = np.dtype([("count", "u1"), ("corners", "<i4", 3)])
_ROOM = 12
"""Digits kept free for the number of vertices, and of faces."""


@save_parts.provide
def write_parts(parts: Iterator[tuple[NDArray[np.float64], NDArray[np.int64]]], path: PathLike) -> tuple[int, int]:
    """Write triangles to a binary PLY file as they come, in double precision.

    Parameters
    ----------
    parts : iterable of (n, 3) float and (m, 3) int
        Vertices, and faces, which count the vertices of all parts before.
    path : str or path
        The file, ``.ply``. An existing one survives a failure.

    Returns
    -------
    vertices, faces : int
        How many there were.

    Raises
    ------
    FileFormatError
        If the format is another one, or the file cannot be written.
    """
    ensure_writable(path, FORMATS, "a mesh part by part")
    n_vertices = n_faces = 0
    with (
        replacing(path) as temporary,
        open(temporary, "wb") as file,
        tempfile.TemporaryFile(dir=temporary.parent) as faces,
    ):
        file.write(_header(0, 0))
        for vertices, triangles in parts:
            file.write(np.ascontiguousarray(vertices, dtype="<f8").tobytes())
            rows = np.empty(len(triangles), dtype=_FACE)
            rows["count"], rows["corners"] = 3, triangles
            faces.write(rows.tobytes())
            n_vertices, n_faces = n_vertices + len(vertices), n_faces + len(triangles)
        _append(file, faces)
        file.seek(0)
        file.write(_header(n_vertices, n_faces))
    return n_vertices, n_faces


def _append(file: IO[bytes], rest: IO[bytes]) -> None:
    rest.seek(0)
    shutil.copyfileobj(rest, file, 1 << 24)


def _header(n_vertices: int, n_faces: int) -> bytes:
    """Of the same length whatever the numbers: a comment takes what they leave."""
    free = " " * (2 * _ROOM - len(str(n_vertices)) - len(str(n_faces)))
    lines = ["ply", "format binary_little_endian 1.0", f"comment signedheat{free}", f"element vertex {n_vertices}"]
    lines += [f"property double {name}" for name in "xyz"]
    lines += [f"element face {n_faces}", "property list uchar int vertex_indices", "end_header"]
    return ("\n".join(lines) + "\n").encode()
