"""Defects of a shape: open, nonmanifold and inconsistent edges, degenerate and duplicate elements."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..geometry.components import connected_components
from ..operators.tetrahedral import FLAT
from .point_cloud import PointCloud
from .polygon_mesh import PolygonMesh
from .tet_mesh import TetMesh
from .triangle_mesh import TriangleMesh


@dataclass(frozen=True)
class SurfaceReport:
    """Counts of the elements and defects of a surface. No defect is an error: every such surface has a signed distance.

    Attributes
    ----------
    n_vertices, n_faces, n_edges : int
        Numbers of elements; an edge joins two different vertices.
    corners_per_face : (int, int)
        Least and greatest number of corners.
    components : int
        Connected components through shared vertices, unreferenced vertices not counted.
    open_edges, borders : int
        Edges with a single face; boundary curves, that is connected sets of open edges.
    nonmanifold_edges, nonmanifold_vertices : int
        Edges with more than two faces; vertices at which the faces do not form a single fan or disk.
    inconsistent_edges : int
        Edges whose two faces run along them in the same direction, so that one of the faces is flipped.
    degenerate_faces, duplicate_faces : int
        Faces without area, or with a repeated vertex; faces with the same vertices as an earlier one.
    duplicate_vertices, unreferenced_vertices : int
        Vertices at exactly the position of an earlier one; vertices without a face.
    area : float
        Total area.
    lower, upper : tuple of float
        Corners of the bounding box of the faces.
    """

    n_vertices: int
    n_faces: int
    n_edges: int
    corners_per_face: tuple[int, int]
    components: int
    open_edges: int
    borders: int
    nonmanifold_edges: int
    nonmanifold_vertices: int
    inconsistent_edges: int
    degenerate_faces: int
    duplicate_faces: int
    duplicate_vertices: int
    unreferenced_vertices: int
    area: float
    lower: tuple[float, ...]
    upper: tuple[float, ...]

    @property
    def is_closed(self) -> bool:
        """Whether no edge is open."""
        return self.open_edges == 0

    @property
    def is_manifold(self) -> bool:
        """Whether every edge has at most two faces, and the faces at every vertex form a single fan or disk."""
        return self.nonmanifold_edges == 0 and self.nonmanifold_vertices == 0


@dataclass(frozen=True)
class CloudReport:
    """Counts and properties of a point cloud.

    Attributes
    ----------
    n_points : int
        Number of points.
    has_normals, has_areas : bool
        Whether the points have normals, and areas.
    duplicate_points : int
        Points at exactly the position of an earlier one.
    lower, upper : tuple of float
        Corners of the bounding box.
    """

    n_points: int
    has_normals: bool
    has_areas: bool
    duplicate_points: int
    lower: tuple[float, ...]
    upper: tuple[float, ...]


@dataclass(frozen=True)
class TetReport:
    """Counts of the elements and defects of a tet mesh.

    Attributes
    ----------
    n_vertices, n_tets, parts : int
        Numbers of vertices, of tets, and of connected components through shared faces.
    inside_out_tets : int
        Tets that were given with negative volume; `TetMesh` has turned them.
    flat_tets : int
        Tets with nearly zero volume.
    nonmanifold_faces : int
        Faces with more than two tets.
    boundary_faces : int
        Faces with a single tet.
    volume : float
        Sum of the tets' volumes.
    lower, upper : (3,) float
        Corners of the bounding box.
    """

    n_vertices: int
    n_tets: int
    parts: int
    inside_out_tets: int
    flat_tets: int
    nonmanifold_faces: int
    boundary_faces: int
    volume: float
    lower: tuple[float, ...]
    upper: tuple[float, ...]


def inspect(shape: TriangleMesh | PolygonMesh | PointCloud | TetMesh) -> SurfaceReport | CloudReport | TetReport:
    """Count the elements and defects of a shape, in O(n log n) time.

    Parameters
    ----------
    shape : TriangleMesh, PolygonMesh, PointCloud or TetMesh
        Any shape, however broken.

    Returns
    -------
    SurfaceReport, CloudReport or TetReport

    Examples
    --------
    >>> report = inspect(TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], [[0, 1, 2], [1, 2, 3]]))
    >>> report.open_edges, report.inconsistent_edges, report.borders
    (4, 1, 1)
    """
    if isinstance(shape, PointCloud):
        return CloudReport(
            n_points=shape.n_points,
            has_normals=shape.normals is not None,
            has_areas=shape.areas is not None,
            duplicate_points=_n_repeated(shape.points),
            lower=_tuple(shape.bounds[0]),
            upper=_tuple(shape.bounds[1]),
        )
    return _inspect_tets(shape) if isinstance(shape, TetMesh) else _inspect_surface(shape)


def _inspect_tets(mesh: TetMesh) -> TetReport:
    counts = mesh.faces.tet_counts
    return TetReport(
        n_vertices=mesh.n_vertices,
        n_tets=mesh.n_tets,
        parts=int(mesh.parts.max()) + 1,
        inside_out_tets=len(mesh.reoriented),
        flat_tets=int((mesh.geometry.thickness < FLAT).sum()),
        nonmanifold_faces=int((counts > 2).sum()),
        boundary_faces=int((counts == 1).sum()),
        volume=float(mesh.tet_volumes.sum()),
        lower=_tuple(mesh.bounds[0]),
        upper=_tuple(mesh.bounds[1]),
    )


def _inspect_surface(mesh: TriangleMesh | PolygonMesh) -> SurfaceReport:
    polygons = mesh if isinstance(mesh, PolygonMesh) else PolygonMesh(mesh.vertices, mesh.faces)
    tail, head, face = polygons.corners, polygons.next_corners, polygons.corner_polygons
    sides = np.diff(polygons.offsets)
    n_vertices = polygons.n_vertices

    proper = np.flatnonzero(tail != head)
    low, high = np.minimum(tail, head)[proper], np.maximum(tail, head)[proper]
    order = np.argsort(low * n_vertices + high, kind="stable")
    proper, low, high = proper[order], low[order], high[order]
    is_first = np.ones(len(proper), dtype=bool)
    is_first[1:] = (low[1:] != low[:-1]) | (high[1:] != high[:-1])
    edge = np.cumsum(is_first) - 1
    n_edges = int(edge[-1]) + 1 if len(edge) else 0
    faces_of_edge = np.bincount(edge, minlength=n_edges)
    along = np.bincount(edge, weights=tail[proper] == low, minlength=n_edges)
    of_single_face = faces_of_edge[edge] == 1

    referenced = np.unique(tail)
    areas = np.linalg.norm(polygons.polygon_area_vectors, axis=1)
    by_face = np.lexsort((tail, face))
    repeats = np.zeros(len(tail), dtype=bool)
    repeats[1:] = (tail[by_face][1:] == tail[by_face][:-1]) & (face[by_face][1:] == face[by_face][:-1])
    degenerate = areas <= _roundoff(polygons)
    degenerate[face[by_face][repeats]] = True
    return SurfaceReport(
        n_vertices=n_vertices,
        n_faces=polygons.n_polygons,
        n_edges=n_edges,
        corners_per_face=(int(sides.min()), int(sides.max())),
        components=_n_components(n_vertices, tail, head, referenced),
        open_edges=int((faces_of_edge == 1).sum()),
        borders=_n_components(n_vertices, low[of_single_face], high[of_single_face]),
        nonmanifold_edges=int((faces_of_edge > 2).sum()),
        nonmanifold_vertices=_n_nonmanifold_vertices(polygons, proper, edge, faces_of_edge),
        inconsistent_edges=int(((faces_of_edge == 2) & (along != 1)).sum()),
        degenerate_faces=int(degenerate.sum()),
        duplicate_faces=_n_repeated_faces(tail[by_face], polygons.offsets),
        duplicate_vertices=_n_repeated(polygons.vertices),
        unreferenced_vertices=n_vertices - len(referenced),
        area=float(areas.sum()),
        lower=_tuple(mesh.bounds[0]),
        upper=_tuple(mesh.bounds[1]),
    )


def _roundoff(polygons: PolygonMesh) -> NDArray[np.float64]:
    """(p,) areas up to which a polygon counts as degenerate, for the rounding of its coordinates."""
    corners = np.abs(polygons.vertices[polygons.corners] - polygons.polygon_centroids[polygons.corner_polygons])
    radius = np.maximum.reduceat(corners.max(axis=1), polygons.offsets[:-1])
    coordinates = np.abs(polygons.vertices[polygons.corners]).max(axis=1)
    return 4 * np.finfo(float).eps * radius * np.maximum.reduceat(coordinates, polygons.offsets[:-1])


def _n_nonmanifold_vertices(
    polygons: PolygonMesh, halfedges: NDArray[np.int64], edge: NDArray[np.int64], faces_of_edge: NDArray[np.int64]
) -> int:
    """Number of vertices whose faces form more than one fan; corners that meet along an edge belong to one fan.

    `halfedges` are sorted by `edge`.
    """
    tail = polygons.corners
    following = np.arange(1, len(tail) + 1)
    following[polygons.offsets[1:] - 1] = polygons.offsets[:-1]
    ends = np.stack([halfedges, following[halfedges]], axis=1)  # the corners at tail and head
    flipped = tail[ends[:, 0]] > tail[ends[:, 1]]
    ends[flipped] = ends[flipped, ::-1]
    same = edge[1:] == edge[:-1]
    one, other = ends[:-1][same].ravel(), ends[1:][same].ravel()
    fans = connected_components(len(tail), one, other)
    pairs = np.unique(np.stack([tail, fans], axis=1), axis=0)
    crowded = faces_of_edge[edge] > 2
    bad = np.bincount(pairs[:, 0], minlength=polygons.n_vertices) > 1
    bad[tail[ends[crowded].ravel()]] = True
    return int(bad.sum())


def _n_repeated_faces(sorted_corners: NDArray[np.int64], offsets: NDArray[np.int64]) -> int:
    sides = np.diff(offsets)
    repeated = 0
    for count in np.unique(sides):
        which = np.flatnonzero(sides == count)
        rows = sorted_corners[offsets[which][:, None] + np.arange(count)]
        repeated += _n_repeated(rows)
    return repeated


def _n_repeated(rows: NDArray[Any]) -> int:
    """Number of rows that equal an earlier one."""
    ordered = rows[np.lexsort(rows.T)]
    return int((ordered[1:] == ordered[:-1]).all(axis=1).sum())


def _n_components(n_nodes: int, one: NDArray[Any], other: NDArray[Any], nodes: NDArray[Any] | None = None) -> int:
    """Components of a graph, counted over some nodes: those of its edges by default."""
    return len(np.unique(connected_components(n_nodes, one, other)[one if nodes is None else nodes]))


def _tuple(values: NDArray[np.float64]) -> tuple[float, ...]:
    return tuple(float(value) for value in values)
