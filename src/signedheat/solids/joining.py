"""Several meshes as one shape."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np
from numpy.typing import NDArray

from ..domains.curves import Curve, SurfacePoints
from ..domains.foreign import as_shape, as_shapes
from ..domains.kinds import ShapeLike
from ..domains.point_cloud import PointCloud
from ..domains.polygon_mesh import PolygonMesh
from ..domains.polyline import Polyline
from ..domains.tet_mesh import TetMesh
from ..domains.triangle_mesh import TriangleMesh
from ..errors import SourceError

Shape = TriangleMesh | PolygonMesh | PointCloud


def joined_shape(shape: ShapeLike | Sequence[ShapeLike]) -> Shape:
    """One shape of several meshes."""
    shapes = as_shapes(shape)
    if not shapes:
        raise SourceError("there is no shape", remedy="pass at least one")
    if len(shapes) == 1:
        whole = shapes[0]
        if isinstance(whole, TetMesh):
            return whole.boundary
        if not isinstance(whole, TriangleMesh | PolygonMesh | PointCloud):
            if not isinstance(whole, Curve | SurfacePoints | Polyline):
                as_shape(cast("Shape", whole))  # which refuses paths and bare arrays
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
        meshes.append(each.triangulation)
    starts = np.cumsum([0, *(mesh.n_vertices for mesh in meshes)])
    faces = [mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)]
    return TriangleMesh(np.concatenate([mesh.vertices for mesh in meshes]), np.concatenate(faces))


def joined_triangles(
    parts: Sequence[TriangleMesh | PolygonMesh], origin: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices around `origin` and triangles of meshes."""
    meshes = [part.triangulation for part in parts]
    starts = np.cumsum([0, *(mesh.n_vertices for mesh in meshes)])
    faces = [mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)]
    return np.concatenate([mesh.vertices - origin for mesh in meshes]), np.concatenate(faces)
