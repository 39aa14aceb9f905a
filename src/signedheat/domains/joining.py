"""Several meshes as one shape."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np
from numpy.typing import NDArray

from ..errors import SourceError
from .curves import Curve, SurfacePoints
from .foreign import SurfaceShape, as_shape, as_shapes
from .kinds import ShapeLike
from .point_cloud import PointCloud
from .polygon_mesh import PolygonMesh
from .polyline import Polyline
from .tet_mesh import TetMesh
from .triangle_mesh import TriangleMesh


def joined_shape(shape: ShapeLike | Sequence[ShapeLike]) -> SurfaceShape:
    """The shape itself, or one mesh of several; tets are their boundary.

    Raises
    ------
    SourceError
        If there is no shape, or it is a curve or polyline, or one of several is no mesh.
    """
    shapes = as_shapes(shape)
    if not shapes:
        raise SourceError("there is no shape", remedy="pass at least one")
    if len(shapes) == 1:
        whole = shapes[0]
        if isinstance(whole, TetMesh):
            return whole.boundary
        if not isinstance(whole, TriangleMesh | PolygonMesh | PointCloud):
            if not isinstance(whole, Curve | SurfacePoints | Polyline):
                as_shape(cast("SurfaceShape", whole))  # which refuses paths and bare arrays
            raise SourceError(
                f"distance in space is measured to meshes and points, not to a {type(whole).__name__}",
                remedy="pass a mesh, or a point cloud; curves are measured on their surface",
                element="source 0",
            )
        return whole
    meshes = []
    for index, each in enumerate(shapes):
        if not isinstance(each, TriangleMesh | PolygonMesh):
            raise SourceError(
                f"several meshes make one solid, and shape {index} is a {type(each).__name__}",
                element=f"shape {index}",
            )
        meshes.append(each)
    return TriangleMesh(*joined_triangles(meshes))


def joined_triangles(
    parts: Sequence[TriangleMesh | PolygonMesh], origin: NDArray[np.float64] | float = 0.0
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """(n, 3) vertices, relative to `origin`, and (m, 3) triangles of all meshes together."""
    meshes = [part.triangulation for part in parts]
    starts = np.cumsum([0, *(mesh.n_vertices for mesh in meshes)])
    faces = [mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)]
    return np.concatenate([mesh.vertices - origin for mesh in meshes]), np.concatenate(faces)
