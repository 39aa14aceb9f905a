"""Wavefront OBJ, and the point clouds of the published demo (``.pc``), which are OBJ without faces."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from ..domains.point_cloud import PointCloud
from ..errors import FileFormatError
from .elements import SurfaceShape, assemble, face_lists, points_of, refuse
from .files import PathLike, damaged, ensure_fits, numbers, reading, text

BYTES = 400
"""Measured: what each line takes while it is read."""


def read_obj(path: PathLike) -> SurfaceShape:
    """The faces of an OBJ file, or its points if it has none; texture coordinates and normals of faces are ignored."""
    lines = _lines_by_keyword(path)
    vertices = _coordinates(lines.get("v", []), "vertices")
    if "f" in lines:
        corners, counts = _elements(lines["f"], len(vertices))
        return assemble(vertices, corners, counts)
    if "l" in lines:
        raise FileFormatError(
            f"there are {len(lines['l'])} line elements and no face",
            remedy="read them with sh.io.read_curves(path, mesh)",
        )
    normals = _coordinates(lines["vn"], "normals") if "vn" in lines else None
    return PointCloud(vertices, normals)


def read_obj_lines(path: PathLike) -> tuple[NDArray[np.float64], list[NDArray[np.int64]]]:
    """The ``l`` elements of an OBJ file: all vertices, and the vertex ids along each line, from 0."""
    with reading(path):
        lines = _lines_by_keyword(path)
        vertices = _coordinates(lines.get("v", []), "vertices")
        corners, counts = _elements(lines.get("l", []), len(vertices))
        return vertices, np.split(corners, np.cumsum(counts)[:-1]) if len(counts) else []


def write_obj(shape: SurfaceShape, path: PathLike) -> bytes:
    """OBJ text; points become ``v`` lines, with ``vn`` lines if they have normals."""
    rows = ["v {!r} {!r} {!r}".format(*p) for p in points_of(shape).tolist()]
    if isinstance(shape, PointCloud) and shape.normals is not None:
        rows += ["vn {!r} {!r} {!r}".format(*n) for n in shape.normals.tolist()]
    rows += ["f " + " ".join([str(i + 1) for i in face]) for face in face_lists(shape)]
    return ("\n".join(rows) + "\n").encode()


def write_pc(shape: SurfaceShape, path: PathLike) -> bytes:
    """Oriented points, as OBJ text."""
    if not isinstance(shape, PointCloud):
        raise refuse(shape, path, "points", ".obj or .ply")
    return write_obj(shape, path)


def _lines_by_keyword(path: PathLike) -> dict[str, list[list[str]]]:
    lines: dict[str, list[list[str]]] = {"v": [], "vn": [], "f": [], "l": []}
    content = text(path)
    ensure_fits(BYTES * sum(content.count(f"\n{keyword} ") for keyword in lines), path)
    for line in re.sub(r"\\[ \t]*\r?\n", " ", content).splitlines():
        words = line.partition("#")[0].split()
        if words and words[0] in lines:
            lines[words[0]].append(words[1:])
    if not lines["v"]:
        raise FileFormatError("there is no line 'v x y z': this holds no shape in OBJ format")
    return {keyword: rest for keyword, rest in lines.items() if rest}


def _coordinates(rows: list[list[str]], what: str) -> NDArray[np.float64]:
    """(n, 3) numbers, three from each line; further ones (weights, colours) are ignored."""
    short = next((k for k, row in enumerate(rows) if len(row) < 3), None)
    if short is not None:
        raise FileFormatError(
            f"number {short} of the {what} has {len(rows[short])} coordinates instead of 3",
            remedy="it may be truncated, so write or download it again",
            element=f"number {short}",
        )
    return numbers([row[:3] for row in rows], what).reshape(-1, 3)


def _elements(words: list[list[str]], n_vertices: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Vertex ids from 0 of all elements, and their number in each; ``v/vt/vn`` means v, and −1 the last vertex."""
    counts = np.array([len(element) for element in words], dtype=np.int64)
    flat = [word for element in words for word in element]
    if any("/" in word for word in flat):
        flat = [word.partition("/")[0] for word in flat]
    ids = numbers(flat, "vertex ids", int)
    if (ids == 0).any():
        raise damaged("a face names vertex 0, but OBJ counts from 1: the file is damaged")
    return np.where(ids > 0, ids - 1, ids + n_vertices), counts
