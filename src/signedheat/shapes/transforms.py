"""Affine maps of shapes, and several meshes joined into one."""

from __future__ import annotations

from collections.abc import Sequence
from functools import singledispatch
from os import PathLike
from typing import TypeAlias, cast

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats, Ints
from ..errors import GeometryError, SourceError, UnsupportedTypeError
from ..grids.polyline import Polyline
from ..surfaces.digital_surface import DigitalSurface
from ..surfaces.point_cloud import PointCloud
from ..surfaces.polygon_mesh import PolygonMesh
from ..surfaces.surface_curves import Curve, SurfacePoints
from ..surfaces.triangle_mesh import TriangleMesh
from ..tets.tet_mesh import TetMesh
from ..validation import LARGEST_COORDINATE, SMALLEST_EXTENT, numbers, public_call
from .foreign import (
    ForeignShape,
    Represented,
    SurfaceShape,
    as_shape,
    as_shapes,
    converted,
    refuse_arrays,
    what_to_pass,
)
from .kinds import ShapeLike


@public_call
def transform(
    shape: TriangleMesh | PolygonMesh | PointCloud | DigitalSurface | TetMesh | ForeignShape, matrix: ArrayLike
) -> TriangleMesh | PolygonMesh | PointCloud | TetMesh | Represented:
    """Move, rotate, scale or shear a shape by an affine map.

    The faces of a mirrored shape are flipped, so that its normals still point outward. A solid keeps its completion.

    Parameters
    ----------
    shape : TriangleMesh, PolygonMesh, PointCloud, DigitalSurface, TetMesh or Solid
        The shape.
    matrix : (4, 4) or (3, 4) float
        Matrix M of the map ``x → M[:3, :3] x + M[:3, 3]``. A fourth row must be 0 0 0 1.

    Returns
    -------
    TriangleMesh, PolygonMesh, PointCloud, TetMesh or Solid
        The transformed shape, of the same type. A `DigitalSurface` becomes a `PolygonMesh`.

    Raises
    ------
    GeometryError
        If the matrix has another shape or last row, a number beyond 1e40, or no inverse.

    See Also
    --------
    as_shape : Convert objects of other packages.
    read : Read a shape or a solid.

    Examples
    --------
    >>> mesh = TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    >>> transform(mesh, np.diag([25.4, 25.4, 25.4, 1])).bounds[1].tolist()
    [25.4, 25.4, 0.0]
    >>> transform(mesh, np.diag([-1.0, 1, 1, 1])).faces.tolist()
    [[2, 1, 0]]
    """
    whole = numbers(matrix, "matrix")
    if whole.shape == (4, 4) and np.array_equal(whole[3], [0, 0, 0, 1]):
        whole = whole[:3]
    if whole.shape != (3, 4) or not (np.abs(whole) <= LARGEST_COORDINATE).all():
        raise GeometryError(
            f"a transform is a matrix of 4 × 4 numbers up to {LARGEST_COORDINATE:g} with the last row 0 0 0 1, "
            "or of 3 × 4",
            element=f"matrix of shape {whole.shape}",
        )
    linear = whole[:, :3] / max(float(np.abs(whole[:, :3]).max()), SMALLEST_EXTENT)
    if abs(np.linalg.det(linear)) <= 1e-12 * np.linalg.norm(linear) ** 3:
        raise GeometryError("the transform flattens the shape", remedy="check the matrix", element="matrix")
    is_known = transformed.dispatch(type(shape)) is not transformed.dispatch(object)
    return transformed(shape if is_known else converted(shape), whole[:, :3], whole[:, 3])


@singledispatch
def transformed(
    shape: object, linear: Floats, move: Floats
) -> TriangleMesh | PolygonMesh | PointCloud | TetMesh | Represented:
    """Transform a shape by ``x → linear x + move``, (3, 3) and (3,). Every type of shape registers a function."""
    remedy = what_to_pass(shape) if isinstance(shape, np.ndarray | str | PathLike) else "transform what it is made of"
    raise UnsupportedTypeError(f"a {type(shape).__name__} cannot be transformed", remedy=remedy)


@transformed.register
def _(shape: TriangleMesh, linear: Floats, move: Floats) -> TriangleMesh:
    faces = shape.faces if np.linalg.det(linear) > 0 else shape.faces[:, ::-1]
    return TriangleMesh(shape.vertices @ linear.T + move, faces)


@transformed.register
def _(shape: PolygonMesh, linear: Floats, move: Floats) -> PolygonMesh:
    polygons = [list(polygon) for polygon in shape.polygons]
    if np.linalg.det(linear) < 0:
        polygons = [polygon[::-1] for polygon in polygons]
    return PolygonMesh(shape.vertices @ linear.T + move, polygons)


@transformed.register
def _(shape: DigitalSurface, linear: Floats, move: Floats) -> PolygonMesh:
    return transformed(shape.squares, linear, move)  # type: ignore[return-value]


@transformed.register
def _(shape: PointCloud, linear: Floats, move: Floats) -> PointCloud:
    """Transform points, and the disks around them that their normals and areas describe."""
    if shape.points.shape[1] != 3:
        raise GeometryError(
            f"a cloud of points with {shape.points.shape[1]} coordinates cannot be transformed by a matrix for 3",
            remedy="multiply the points by one of your own",
            element="points",
        )
    # normals become those of the transformed tangent planes, and areas those of the transformed disks in them
    normals, areas = shape.normals, shape.areas
    if normals is not None:
        cofactors = normals @ (abs(np.linalg.det(linear)) * np.linalg.inv(linear))
        lengths = np.linalg.norm(cofactors, axis=1)
        normals, areas = cofactors / lengths[:, None], None if areas is None else areas * lengths
    elif areas is not None:
        areas = areas * abs(np.linalg.det(linear)) ** (2 / 3)
    return PointCloud(shape.points @ linear.T + move, normals, areas, shape.n_neighbors)


@transformed.register
def _(shape: TetMesh, linear: Floats, move: Floats) -> TetMesh:
    tets = shape.tets if np.linalg.det(linear) > 0 else shape.tets[:, [1, 0, 2, 3]]
    return TetMesh(shape.vertices @ linear.T + move, tets)


Body: TypeAlias = tuple[Floats, Ints]
"""Vertices, (n, 3), and faces, (m, 3), of a triangle mesh."""


MEASURED_OTHERWISE = {
    "PointCloud": "join points to one cloud",
    "DigitalSurface": "pass its smooth_surface",
    "Polyline": "measure to lines in the plane by signed_distance(lines), and move them by morphology.dilate or erode",
    "Curve": "measure along its surface, by signed_distance(curve, surface)",
    "SurfacePoints": "measure along their surface, by signed_distance(points, surface)",
}
"""What to do instead, by the kind of a source that distance in space is not measured to."""


def joined_shape(shape: ShapeLike | Sequence[ShapeLike]) -> SurfaceShape:
    """Join several meshes into a triangle mesh; return a single mesh or cloud as it is. Tets become their boundary."""
    shapes = [part.boundary if isinstance(part, TetMesh) else part for part in as_shapes(shape)]
    if not shapes:
        raise SourceError("no shape was given", remedy="pass at least one")
    if len(shapes) == 1 and isinstance(shapes[0], TriangleMesh | PolygonMesh | PointCloud):
        return shapes[0]
    refuse_arrays(shapes)
    meshes = []
    for index, part in enumerate(shapes):
        if not isinstance(part, TriangleMesh | PolygonMesh):
            if not isinstance(part, Curve | SurfacePoints | Polyline):
                as_shape(cast("SurfaceShape", part))  # which refuses paths and bare arrays
            raise SourceError(
                f"distance in space is measured to meshes or to one point cloud, and source {index} is a "
                f"{type(part).__name__}",
                remedy=MEASURED_OTHERWISE.get(type(part).__name__, "pass meshes"),
                element=f"source {index}",
            )
        meshes.append(part)
    return TriangleMesh(*joined_triangles(meshes))


def joined_triangles(parts: Sequence[TriangleMesh | PolygonMesh], origin: Floats | float = 0.0) -> Body:
    """Return the vertices, relative to `origin`, and the triangles of several meshes, without merging vertices."""
    meshes = [part.triangulation for part in parts]
    return concatenated([(mesh.vertices - origin, mesh.faces) for mesh in meshes])


def concatenated(bodies: Sequence[Body]) -> Body:
    """Join bodies, which are (n, 3) vertices and (m, 3) faces each, to a single one, without merging vertices."""
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in bodies)])
    faces = [own + start for (_, own), start in zip(bodies, starts, strict=False)]
    return np.concatenate([vertices for vertices, _ in bodies]), np.concatenate(faces)


def placed(body: Body, matrix: Floats) -> Body:
    """Transform a body by a (4, 3) matrix M, ``x → x M[:3] + M[3]``; the faces of a mirrored body are flipped."""
    vertices, faces = body
    return vertices @ matrix[:3] + matrix[3], faces if np.linalg.det(matrix[:3]) >= 0 else faces[:, ::-1]
