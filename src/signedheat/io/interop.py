"""Conversion of shapes from and to the objects of other packages, each imported only where it is used.

Vertices and faces keep their number and order in both directions.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..domains.exchange import shape_from, shape_to
from ..domains.point_cloud import PointCloud
from ..domains.polygon_mesh import PolygonMesh
from ..domains.triangle_mesh import TriangleMesh
from ..errors import GeometryError
from ..packages import lazy_module
from .elements import SurfaceShape, faces_of, points_of

meshio = lazy_module("meshio", "objects of meshio")
pyvista = lazy_module("pyvista", "objects of PyVista")
trimesh = lazy_module("trimesh", "objects of trimesh")

_SIDES = {"triangle": 3, "quad": 4}


def from_trimesh(kind: type, thing: Any) -> Any:
    """From a `trimesh.Trimesh` or `trimesh.PointCloud`."""
    faces = getattr(thing, "faces", np.empty((0, 3), dtype=np.int64))
    corners = np.asarray(faces, dtype=np.int64)
    return _build(kind, np.asarray(thing.vertices), corners.ravel(), np.full(len(corners), 3))


def to_trimesh(shape: SurfaceShape) -> Any:
    """As a `trimesh.Trimesh` (not processed: nothing is merged) or `trimesh.PointCloud`."""
    if isinstance(shape, PointCloud):
        return trimesh.PointCloud(np.array(shape.points))
    if isinstance(shape, PolygonMesh):
        raise GeometryError(
            "trimesh holds triangles only, and this is a PolygonMesh",
            remedy="use to_pyvista or to_meshio",
        )
    return trimesh.Trimesh(np.array(shape.vertices), np.array(shape.faces), process=False)


def from_pyvista(kind: type, thing: Any) -> Any:
    """From a `pyvista.PolyData`; points with point data ``Normals`` have normals."""
    if getattr(thing, "n_strips", 0):
        raise GeometryError(
            "the mesh holds triangle strips",
            remedy="call its triangulate() first",
        )
    faces = np.asarray(thing.faces, dtype=np.int64)
    starts, at = [], 0
    while at < len(faces):
        starts.append(at)
        at += 1 + int(faces[at])
    counts = faces[np.array(starts, dtype=np.int64)]
    normals = thing.point_data.get("Normals") if kind is PointCloud else None
    return _build(kind, np.asarray(thing.points), np.delete(faces, starts), counts, normals)


def to_pyvista(shape: SurfaceShape) -> Any:
    """As a `pyvista.PolyData`; normals of points are point data ``Normals``."""
    points, (corners, counts) = np.array(points_of(shape)), faces_of(shape)
    if isinstance(shape, PointCloud):
        cloud = pyvista.PolyData(points)
        if shape.normals is not None:
            cloud.point_data["Normals"] = np.array(shape.normals)
        return cloud
    return pyvista.PolyData(points, np.insert(corners, np.cumsum(counts) - counts, counts))


def from_meshio(kind: type, thing: Any) -> Any:
    """From a `meshio.Mesh`: its triangles, quadrilaterals and polygons, block after block."""
    blocks = [block.data for block in thing.cells if block.type in _SIDES or block.type.startswith("polygon")]
    corners = [np.asarray(face, dtype=np.int64) for block in blocks for face in block]
    counts = np.array([len(face) for face in corners], dtype=np.int64)
    flat = np.concatenate(corners) if corners else np.empty(0, dtype=np.int64)
    data = thing.point_data
    normals = np.stack([data[name] for name in ("nx", "ny", "nz")], axis=1) if "nx" in data else data.get("Normals")
    return _build(kind, thing.points, flat, counts, normals if kind is PointCloud else None)


def to_meshio(shape: SurfaceShape) -> Any:
    """As a `meshio.Mesh`; normals of points are point data ``nx``, ``ny``, ``nz``."""
    if isinstance(shape, PointCloud):
        normals = {} if shape.normals is None else dict(zip(("nx", "ny", "nz"), shape.normals.T.copy(), strict=True))
        return meshio.Mesh(np.array(shape.points), [("vertex", np.arange(shape.n_points)[:, None])], point_data=normals)
    corners, counts = faces_of(shape)
    starts = np.cumsum(counts) - counts
    change = np.flatnonzero(np.diff(counts, prepend=-1))  # a block has faces of one kind; the order is kept
    cells = []
    for first, last in zip(change, [*change[1:], len(counts)], strict=True):
        sides = int(counts[first])
        name = next((name for name, n in _SIDES.items() if n == sides), "polygon")
        cells.append((name, corners[starts[first] : starts[first] + sides * (last - first)].reshape(-1, sides)))
    return meshio.Mesh(np.array(points_of(shape)), cells)


def _build(
    kind: type,
    points: NDArray[Any],
    corners: NDArray[np.int64],
    counts: NDArray[np.int64],
    normals: NDArray[Any] | None = None,
) -> Any:
    if kind is PointCloud:
        return PointCloud(points, normals)
    if kind is PolygonMesh:
        return PolygonMesh(points, np.split(corners, np.cumsum(counts)[:-1]) if len(counts) else [])
    wrong = np.flatnonzero(counts != 3)
    if len(wrong):
        raise GeometryError(
            f"face {wrong[0]} has {counts[wrong[0]]} corners, not 3",
            remedy="use PolygonMesh instead",
            element=f"face {wrong[0]}",
        )
    return TriangleMesh(points, corners.reshape(-1, 3))


_FROM = {"trimesh": from_trimesh, "pyvista": from_pyvista, "meshio": from_meshio}
_TO = {"trimesh": to_trimesh, "pyvista": to_pyvista, "meshio": to_meshio}


@shape_from.provide
def _(package: str, kind: type, thing: Any) -> Any:
    return _FROM[package](kind, thing)


@shape_to.provide
def _(package: str, shape: Any) -> Any:
    return _TO[package](shape)
