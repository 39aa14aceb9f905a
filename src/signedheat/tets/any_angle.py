"""Kernels: distance in a tet mesh from a surface, along straight lines that bend at the boundary of the mesh.

Where the segment to the nearest point of the surface lies in the mesh, its length is the distance. Elsewhere shortest
paths bend at the boundary. They are found vertex by vertex, in order of distance: each vertex takes over from a
neighbour the triangle, or the bend, that the neighbour's path starts from, if it is visible from the vertex too;
otherwise the path bends at the neighbour (any-angle search, Nash et al. 2007). Bending at vertices only, instead of
anywhere on an edge, costs a length of second order.
"""

from __future__ import annotations

import numpy as np

from ..arrays import Floats, Ints
from ..compiled import compiled
from ..geodesics.heap_kernels import Queue, pop, push
from ..search.nearest_triangles import foot_on_triangle
from .tet_clipping import Planes, beyond
from .visibility import stays_inside


@compiled
def _seen(
    planes: Planes,
    neighbors: Ints,
    tets: Ints,
    points: Floats,
    first_tet: Ints,
    tets_at: Ints,
    v: int,
    target: Floats,
    slack: float,
) -> bool:
    """Whether the segment from vertex v to a target in the mesh lies in the mesh."""
    x, y, z = points[v]
    u, w, t = target
    tet, least = -1, np.inf
    for i in range(first_tet[v], first_tet[v + 1]):  # the tet that the segment starts into
        worst = -np.inf
        for k in range(4):
            if tets[tets_at[i], k] != v:
                worst = max(worst, beyond(planes, tets_at[i], k, u, w, t))
        if worst < least:
            tet, least = tets_at[i], worst
    if least > slack:
        return False
    return stays_inside(planes, neighbors, tet, x, y, z, u, w, t, slack)


@compiled
def nearest_around(
    rows: Floats, triangles_at: Ints, first_triangle: Ints, corners: Ints, near: int, x: float, y: float, z: float
) -> tuple[int, Floats]:
    """The triangle nearest to (x, y, z) of those that share a corner with triangle `near`, and its nearest point."""
    best, found, place = np.inf, near, np.zeros(3)
    for c in range(3):
        for i in range(first_triangle[corners[near, c]], first_triangle[corners[near, c] + 1]):
            square, _, u, v, w = foot_on_triangle(rows, triangles_at[i], x, y, z)
            if square < best:
                best, found = square, triangles_at[i]
                place[0], place[1], place[2] = u, v, w
    return found, place


@compiled
def _length(point: Floats, x: float, y: float, z: float) -> float:
    return np.sqrt((point[0] - x) ** 2 + (point[1] - y) ** 2 + (point[2] - z) ** 2)


@compiled
def any_angle_distance(
    planes: Planes,
    neighbors: Ints,
    tets: Ints,
    points: Floats,
    first_tet: Ints,
    tets_at: Ints,
    rows: Floats,
    corners: Ints,
    first_triangle: Ints,
    triangles_at: Ints,
    owners: Ints,
    nearest: Ints,
    slack: float,
    queue: Queue,
) -> tuple[Floats, Ints, Floats, int]:
    """Distance of every vertex from triangles in the mesh.

    Parameters
    ----------
    planes, neighbors, tets : Planes, (m, 4) int, (m, 4) int
        The faces of the mesh, the tet beyond each, and the vertices of each tet.
    points : (n, 3) float
        Its vertices, relative to the centre of the mesh, as the planes are.
    first_tet : (n + 1,) int
        Where in `tets_at` the tets at each vertex begin.
    tets_at : (4 m,) int
        Tets by vertex.
    rows : (k, 16) float
        The triangles of the surface, as `triangle_rows` gives them, relative to the same centre.
    corners : (k, 3) int
        Vertex ids of the surface: corners that coincide have the same id.
    first_triangle, triangles_at : int arrays
        The triangles at each of these ids: where they begin, and the triangles.
    owners : (k,) int
        The tet that each triangle lies in; −1 for such as lie in several.
    nearest : (n,) int
        The triangle nearest to each vertex, regardless of visibility; −1 for vertices that have no distance.
    slack : float
        Length by which a line may lie outside the mesh.
    queue : Queue
        An empty one of the vertices.

    Returns
    -------
    distance : (n,) float
        inf where no surface is connected, and where there is no distance.
    nearest : (n,) int
        The triangle that it is measured from.
    places : (n, 3) float
        The point of that triangle at which the shortest path starts.
    hidden : int
        Number of vertices from which the nearest point of the surface is not visible.
    """
    n = len(points)
    distance = np.full(n, np.inf)
    bend, places = np.full(n, -1), np.zeros((n, 3))
    known = np.zeros(n, dtype=np.bool_)
    for v in range(n):
        if nearest[v] >= 0:
            x, y, z = points[v]
            square, _, places[v, 0], places[v, 1], places[v, 2] = foot_on_triangle(rows, nearest[v], x, y, z)
            if _seen(planes, neighbors, tets, points, first_tet, tets_at, v, places[v], slack):
                distance[v], known[v] = np.sqrt(square), True
    for i in range(len(rows)):  # a triangle in a tet is visible from the tet's corners, if not the nearest to them
        for k in range(4):
            v = tets[owners[i], k]
            if owners[i] >= 0 and not known[v] and nearest[v] >= 0:
                x, y, z = points[v]
                square, _, a, b, c = foot_on_triangle(rows, i, x, y, z)
                if square < distance[v] ** 2:
                    distance[v], nearest[v] = np.sqrt(square), i
                    places[v, 0], places[v, 1], places[v, 2] = a, b, c
                    push(queue, v, distance[v])
    hidden = 0
    for v in range(n):
        if not known[v] and nearest[v] >= 0:
            hidden += 1
            for i in range(first_tet[v], first_tet[v + 1]):
                for k in range(4):
                    u = tets[tets_at[i], k]
                    if known[u]:
                        push(queue, u, distance[u])
    done = np.zeros(n, dtype=np.bool_)
    while queue.size[0] > 0:
        u = pop(queue)
        done[u] = True
        for i in range(first_tet[u], first_tet[u + 1]):
            for k in range(4):
                v = tets[tets_at[i], k]
                if known[v] or done[v] or nearest[v] < 0:
                    continue
                x, y, z = points[v]
                if bend[u] >= 0:
                    via, near, place, length = bend[u], nearest[u], places[u], distance[bend[u]]
                    target = points[via]
                else:
                    near, place = nearest_around(rows, triangles_at, first_triangle, corners, nearest[u], x, y, z)
                    via, length, target = -1, 0.0, place
                length += _length(target, x, y, z)
                if length >= distance[v]:
                    continue
                if not _seen(planes, neighbors, tets, points, first_tet, tets_at, v, target, slack):
                    via, near, place, length = u, nearest[u], places[u], distance[u] + _length(points[u], x, y, z)
                if length < distance[v]:
                    distance[v], bend[v], nearest[v] = length, via, near
                    for d in range(3):
                        places[v, d] = place[d]
                    push(queue, v, length)
    return distance, nearest, places, hidden
