"""Geodesic paths: shortest paths across faces, between points that share no face."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from ..errors import SourceError
from ..mesh.intrinsic_mesh import IntrinsicMesh
from ..mesh.surface_points import (
    LocatedPoints,
    barycentric_in,
    barycentric_on_sides,
    concatenated,
    incident_faces,
    locate_points,
    points_at_vertices,
    shared_faces,
)
from .heap_kernels import Queue
from .initial_windows import Faces
from .path_kernels import shortest_lines


def join(
    triangles: IntrinsicMesh, located: LocatedPoints, start: NDArray[np.int64], end: NDArray[np.int64], name: str
) -> tuple[LocatedPoints, NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Join pairs of points, by geodesic paths where the two share no face, as segments that lie in one face each.

    `name` is what the points belong to, for messages.

    Returns
    -------
    located : LocatedPoints
        All points, the given ones first.
    start, end : (s,) int
        The points that each segment joins, in order.
    pairs : (s,) int
        The pair that each segment belongs to.
    """
    apart = np.flatnonzero(shared_faces(triangles, located[start], located[end]) < 0)
    added = np.zeros(len(start), dtype=np.int64)
    middle = located[apart[:0]]
    if len(apart):
        middle, added[apart] = geodesic_paths(triangles, located[start[apart]], located[end[apart]], name)
    pair = np.repeat(np.arange(len(start)), added + 1)
    step = np.arange(len(pair)) - np.repeat(np.cumsum(added + 1) - added - 1, added + 1)
    after = len(located) + np.repeat(np.cumsum(added) - added, added + 1) + step
    starts = np.where(step == 0, start[pair], after - 1)
    ends = np.where(step == added[pair], end[pair], after)
    return concatenated([located, middle]), starts, ends, pair


def gaps(triangles: IntrinsicMesh, located: LocatedPoints, closed: bool) -> NDArray[np.int64]:
    """Indices of the segments of a curve through points whose two ends share no face."""
    start = np.arange(len(located) if closed else len(located) - 1)
    return np.flatnonzero(shared_faces(triangles, located[start], located[(start + 1) % len(located)]) < 0)


def geodesic_paths(
    triangles: IntrinsicMesh, start: LocatedPoints, end: LocatedPoints, name: str = "curve"
) -> tuple[LocatedPoints, NDArray[np.int64]]:
    """Points at which the shortest paths between k starts and ends cross edges or pass vertices.

    Paths are locally shortest: none becomes shorter by passing a vertex on its other side. The first guess is the
    shortest path through midpoints of edges; its faces are unfolded, the shortest path inside them is found (funnel
    algorithm), and wherever it bends around a vertex the other side is tried. `name` is what the points belong to, for
    messages.

    Returned: located, counts (k,).
    """
    starts, ends = faces_at(triangles, start), faces_at(triangles, end)
    queue = Queue.empty(triangles.n_edges)
    sides, fractions, counts = shortest_lines(Faces.of(triangles), queue, *starts, *ends)
    located = locate_points(triangles, sides // 3, barycentric_on_sides(sides % 3, fractions), name)
    blocked = np.flatnonzero(counts < 0)
    if not len(blocked):
        return located, counts
    parts, begin = [], np.cumsum(np.maximum(counts, 0)) - np.maximum(counts, 0)
    for k in range(len(counts)):
        if counts[k] >= 0:
            parts.append(located[np.arange(begin[k], begin[k] + counts[k])])
            continue
        here = np.array([k])
        parts.append(path_through_vertices(triangles, start[here], end[here], name))
        counts[k] = len(parts[-1])
    return concatenated(parts), counts


def faces_at(
    triangles: IntrinsicMesh, located: LocatedPoints
) -> tuple[NDArray[np.int64], NDArray[np.complex128], NDArray[np.int64]]:
    """All faces that contain each point, its position in their layouts, and where the faces of each point begin."""
    which, faces = incident_faces(triangles, located)
    order = np.lexsort([faces, which])
    which, faces = which[order], faces[order]
    weights = barycentric_in(triangles, faces, located[which])
    points = (weights * triangles.corner_positions[faces]).sum(axis=1)
    return faces, points, np.searchsorted(which, np.arange(len(located) + 1))


def path_through_vertices(
    triangles: IntrinsicMesh, start: LocatedPoints, end: LocatedPoints, name: str
) -> LocatedPoints:
    """The path between two points that are connected only through vertices at which fans of faces touch."""
    edges, n = triangles.edges, triangles.n_vertices
    arcs, lengths = [edges.vertices], [triangles.lengths_of_edges]
    for node, place in ((n, start), (n + 1, end)):
        faces, points, _ = faces_at(triangles, place)
        corners = triangles.corner_vertices[faces].ravel()
        arcs.append(np.stack([np.full(len(corners), node), corners], axis=1))
        lengths.append(np.abs(triangles.corner_positions[faces] - points[:, None]).ravel())
    tails, heads = np.concatenate(arcs).T
    graph = csr_matrix((np.concatenate(lengths) + 1e-300, (tails, heads)), shape=(n + 2, n + 2))
    before = dijkstra(graph, directed=False, indices=n, return_predecessors=True)[1]
    path = [n + 1]
    while path[-1] != n and before[path[-1]] >= 0:
        path.append(before[path[-1]])
    if path[-1] != n:
        raise SourceError(
            f"{name}: no way along the surface joins the point in face {start.faces[0]} to the point "
            f"in face {end.faces[0]}: they lie on different connected components",
            remedy="make them two curves",
            element=f"face {start.faces[0]}",
        )
    chain = concatenated([start, points_at_vertices(triangles, np.array(path[-2:0:-1])), end])
    step = np.arange(len(chain) - 1)
    part = triangles.face_components[shared_faces(triangles, chain[step], chain[step + 1])]
    turning = np.concatenate([[0], 1 + np.flatnonzero(np.diff(part)), [len(chain) - 1]])
    step = np.arange(len(turning) - 1)
    located, _, ends, _ = join(triangles, chain[turning], step, step + 1, name)
    return located[ends[:-1]]
