"""Several meshes as one shape."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias, cast

import numpy as np

from .arrays import Floats, Ints
from .errors import SourceError
from .foreign import SurfaceShape, as_shape, as_shapes, refuse_arrays
from .grids.polyline import Polyline
from .kinds import ShapeLike
from .surfaces.point_cloud import PointCloud
from .surfaces.polygon_mesh import PolygonMesh
from .surfaces.surface_curves import Curve, SurfacePoints
from .surfaces.triangle_mesh import TriangleMesh
from .tets.tet_mesh import TetMesh

Body: TypeAlias = tuple[Floats, Ints]
"""(n, 3) vertices and (m, 3) faces."""


def joined_shape(shape: ShapeLike | Sequence[ShapeLike]) -> SurfaceShape:
    """Join several meshes to one shape; return a single shape as it is, and of tets their boundary."""
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
    refuse_arrays(shapes)
    meshes = []
    for index, part in enumerate(shapes):
        if not isinstance(part, TriangleMesh | PolygonMesh):
            raise SourceError(
                f"only meshes can be joined, and shape {index} is a {type(part).__name__}", element=f"shape {index}"
            )
        meshes.append(part)
    return TriangleMesh(*joined_triangles(meshes))


def joined_triangles(parts: Sequence[TriangleMesh | PolygonMesh], origin: Floats | float = 0.0) -> Body:
    """Return the vertices, relative to `origin`, and the triangles of all meshes together."""
    meshes = [part.triangulation for part in parts]
    return concatenated([(mesh.vertices - origin, mesh.faces) for mesh in meshes])


def concatenated(bodies: Sequence[Body]) -> Body:
    """Concatenate the vertices and faces of several bodies without merging any."""
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in bodies)])
    faces = [own + start for (_, own), start in zip(bodies, starts, strict=False)]
    return np.concatenate([vertices for vertices, _ in bodies]), np.concatenate(faces)


def placed(body: Body, matrix: Floats) -> Body:
    """Move a body by a (4, 3) matrix that multiplies rows from the right; a mirrored body keeps its outside."""
    vertices, faces = body
    return vertices @ matrix[:3] + matrix[3], faces if np.linalg.det(matrix[:3]) >= 0 else faces[:, ::-1]
