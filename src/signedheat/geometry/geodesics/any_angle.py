"""Kernels: distance in tets along straight lines from a surface, bent where they meet walls.

Where the segment to the nearest point of the surface lies in the mesh, its length is the distance. Elsewhere shortest
lines bend at the boundary. They are found vertex by vertex, in order of distance: each takes over from a neighbour the
piece of the surface or the bend that the neighbour sees, if it sees it too, and else bends at the neighbour (any-angle
search, Nash et al. 2007). Bending at vertices instead of anywhere on an edge costs a length of second order.
"""

from __future__ import annotations

import heapq
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...compiled import compiled
from ..nearest import place_on_triangle


class FacePlanes(NamedTuple):
    """What lines need to know of tets to walk through them; see `sources.clipping.Planes` for the last three."""

    tets: NDArray[np.int64]
    neighbors: NDArray[np.int64]
    tet_faces: NDArray[np.int64]
    normals: NDArray[np.float64]
    offsets: NDArray[np.float64]
    signs: NDArray[np.float64]


@compiled(nogil=True)
def _beyond(planes, tet, k, x, y, z):
    """How far a point lies outside the face opposite corner k of a tet."""
    f = planes.tet_faces[tet, k]
    height = planes.normals[f, 0] * x + planes.normals[f, 1] * y + planes.normals[f, 2] * z - planes.offsets[f]
    return planes.signs[tet, k] * height


@compiled(nogil=True)
def _seen(planes, points, first_tet, tets_at, v, target, slack):
    """Whether the segment from vertex v to a target lies in the mesh; the target does."""
    x, y, z = points[v]
    u, w, t = target
    tet, least = -1, np.inf
    for i in range(first_tet[v], first_tet[v + 1]):  # the tet that the segment starts into
        worst = -np.inf
        for k in range(4):
            if planes.tets[tets_at[i], k] != v:
                worst = max(worst, _beyond(planes, tets_at[i], k, u, w, t))
        if worst < least:
            tet, least = tets_at[i], worst
    if least > slack:
        return False
    for _ in range(len(planes.tets)):
        leave, at = -1, np.inf
        for k in range(4):
            there = _beyond(planes, tet, k, u, w, t)
            if there > slack:
                here = _beyond(planes, tet, k, x, y, z)
                if there > here and -here / (there - here) < at:
                    leave, at = k, -here / (there - here)
        if leave < 0:
            return True
        tet = planes.neighbors[tet, leave]
        if tet < 0:
            return False
    return False


@compiled(nogil=True)
def _foot(triangles, triangles_at, first_triangle, corners, near, x, y, z):
    """The nearest point on the triangles that share a corner with one: its triangle, and where it is."""
    best, found, place = np.inf, near, np.zeros(3)
    for c in range(3):
        for i in range(first_triangle[corners[near, c]], first_triangle[corners[near, c] + 1]):
            square, a, b, g = place_on_triangle(triangles[triangles_at[i]], x, y, z)
            if square < best:
                best, found = square, triangles_at[i]
                for d in range(3):
                    place[d] = a * triangles[found, 0, d] + b * triangles[found, 1, d] + g * triangles[found, 2, d]
    return found, place


@compiled(nogil=True)
def _length(point, x, y, z):
    return np.sqrt((point[0] - x) ** 2 + (point[1] - y) ** 2 + (point[2] - z) ** 2)


@compiled(nogil=True)
def any_angle_distance(
    planes, points, first_tet, tets_at, triangles, corners, first_triangle, triangles_at, owners, nearest, slack
):
    """Distance of every vertex from triangles in the mesh.

    Parameters
    ----------
    planes : FacePlanes
        The mesh.
    points : (n, 3) float
        Its vertices, measured from the middle of the mesh, as the planes are.
    first_tet : (n + 1,) int
        Where in `tets_at` the tets at each vertex begin.
    tets_at : (4 m,) int
        Tets by vertex.
    triangles : (k, 3, 3) float
        The surface, measured from the same middle.
    corners : (k, 3) int
        Which of its corners coincide.
    first_triangle, triangles_at : int arrays
        Triangles by corner.
    owners : (k,) int
        The tet that each lies in.
    nearest : (n,) int
        The triangle nearest to each vertex; −1 for vertices that have no distance.
    slack : float
        A line may lie so far outside.

    Returns
    -------
    distance : (n,) float
        inf where no surface is connected, and where there is no distance.
    nearest : (n,) int
        The triangle that it is measured from.
    feet : (n, 3) float
        The place on it.
    hidden : int
        Number of vertices that do not see what is nearest to them.
    """
    n = len(points)
    distance = np.full(n, np.inf)
    bend, feet = np.full(n, -1), np.zeros((n, 3))
    known = np.zeros(n, dtype=np.bool_)
    for v in range(n):
        if nearest[v] >= 0:
            x, y, z = points[v]
            square, a, b, g = place_on_triangle(triangles[nearest[v]], x, y, z)
            t = triangles[nearest[v]]
            for d in range(3):
                feet[v, d] = a * t[0, d] + b * t[1, d] + g * t[2, d]
            if _seen(planes, points, first_tet, tets_at, v, feet[v], slack):
                distance[v], known[v] = np.sqrt(square), True
    heap = [(0.0, 0)]
    heap.pop()
    for i in range(len(triangles)):  # what lies in a tet is seen from its corners, though it may not be the nearest
        for k in range(4):
            v = planes.tets[owners[i], k]
            if not known[v] and nearest[v] >= 0:
                x, y, z = points[v]
                square, a, b, g = place_on_triangle(triangles[i], x, y, z)
                if square < distance[v] ** 2:
                    distance[v], nearest[v] = np.sqrt(square), i
                    for d in range(3):
                        feet[v, d] = a * triangles[i, 0, d] + b * triangles[i, 1, d] + g * triangles[i, 2, d]
                    heapq.heappush(heap, (distance[v], v))
    hidden = 0
    for v in range(n):
        if not known[v] and nearest[v] >= 0:
            hidden += 1
            for i in range(first_tet[v], first_tet[v + 1]):
                for k in range(4):
                    u = planes.tets[tets_at[i], k]
                    if known[u]:
                        heapq.heappush(heap, (distance[u], u))
    done = np.zeros(n, dtype=np.bool_)
    while len(heap) > 0:
        key, u = heapq.heappop(heap)
        if done[u] or key > distance[u]:
            continue
        done[u] = True
        for i in range(first_tet[u], first_tet[u + 1]):
            for k in range(4):
                v = planes.tets[tets_at[i], k]
                if known[v] or done[v] or nearest[v] < 0:
                    continue
                x, y, z = points[v]
                if bend[u] >= 0:
                    via, near, foot, length = bend[u], nearest[u], feet[u], distance[bend[u]]
                    target = points[via]
                else:
                    near, foot = _foot(triangles, triangles_at, first_triangle, corners, nearest[u], x, y, z)
                    via, length, target = -1, 0.0, foot
                length += _length(target, x, y, z)
                if length >= distance[v]:
                    continue
                if not _seen(planes, points, first_tet, tets_at, v, target, slack):
                    via, near, foot, length = u, nearest[u], feet[u], distance[u] + _length(points[u], x, y, z)
                if length < distance[v]:
                    distance[v], bend[v], nearest[v] = length, via, near
                    for d in range(3):
                        feet[v, d] = foot[d]
                    heapq.heappush(heap, (length, v))
    return distance, nearest, feet, hidden
