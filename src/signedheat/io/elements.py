"""Conversion between shapes and flat arrays of faces, common to all formats."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..domains.point_cloud import PointCloud
from ..domains.polygon_mesh import PolygonMesh
from ..domains.triangle_mesh import TriangleMesh
from ..errors import FileFormatError
from .files import PathLike, extension

SurfaceShape: TypeAlias = TriangleMesh | PolygonMesh | PointCloud
"""The kinds of shapes that most file formats support."""


def assemble(
    vertices: NDArray[np.float64], corners: NDArray[np.int64], counts: NDArray[np.int64]
) -> TriangleMesh | PolygonMesh:
    """A triangle mesh if all faces are triangles, else a polygon mesh; from all corners and their number per face."""
    if (counts == 3).all():
        return TriangleMesh(vertices, corners.reshape(-1, 3))
    return PolygonMesh(vertices, np.split(corners, np.cumsum(counts)[:-1]))


def faces_of(shape: SurfaceShape) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The inverse of `assemble`: corners of all faces, and the number of corners of each; empty for point clouds."""
    if isinstance(shape, TriangleMesh):
        return shape.faces.ravel(), np.full(shape.n_faces, 3)
    if isinstance(shape, PolygonMesh):
        return shape.corners, np.diff(shape.offsets)
    return np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)


def points_of(shape: SurfaceShape) -> NDArray[np.float64]:
    """(n, 3) vertices of a mesh, or points of a cloud."""
    return shape.points if isinstance(shape, PointCloud) else shape.vertices


def face_lists(shape: SurfaceShape) -> Sequence[Sequence[int]]:
    """Corners of each face, as lists; empty for point clouds."""
    if isinstance(shape, TriangleMesh):
        result: Sequence[Sequence[int]] = shape.faces.tolist()
        return result
    return [] if isinstance(shape, PointCloud) else [polygon.tolist() for polygon in shape.polygons]


def refuse(shape: object, path: PathLike, holds: str, instead: str) -> FileFormatError:
    """The error for a format that does not support a kind of shape."""
    return FileFormatError(
        f"{extension(path)} files hold {holds}, not a {type(shape).__name__}",
        remedy=f"save it as {instead}",
        path=path,
    )
