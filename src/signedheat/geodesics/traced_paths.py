"""Shortest paths on a polyhedral surface, traced back through the windows of an exact search for distances.

The windows that have entered a face give the distance of each of its points, and the side through which the shortest
path came. So a path is followed from its end, face by face, straight towards the source of the nearest window.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..arrays import Complexes, Floats, Ints
from ..compiled import compiled
from ..errors import SourceError
from ..mesh.gluing import cross
from ..mesh.intrinsic_mesh import IntrinsicMesh
from ..mesh.surface_points import LocatedPoints, concatenated, locate_points
from .exact_distance import BEAM, KIND, S0, S1, Faces, P, PausedSearch, Q, Search, arrival
from .geodesic_sources import GeodesicSources, PlacedSegments
from .shortest_paths import Places

WINDOWS_AT_ONCE = 1 << 14
"""Number of windows that are made between two checks whether the end is reached."""
AT_END = 1e-9
"""Fraction of an edge, from its end, up to which a path that crosses the edge passes through the vertex instead."""


class SourcesByFace(NamedTuple):
    """k segments and points of a source, sorted by face. A point is a segment of length 0."""

    faces: Ints  # (k,) face of each, ascending
    starts: Complexes  # (k,) start of each, in the layout of the face
    stops: Complexes  # (k,) end of each

    @classmethod
    def of(cls, sources: GeodesicSources) -> SourcesByFace:
        """Sort the segments and points of sources by face."""
        faces = np.concatenate([sources.beam_faces, sources.fan_faces])
        order = np.argsort(faces, kind="stable")
        starts = np.concatenate([sources.beam_starts, sources.fan_points])
        stops = np.concatenate([sources.beam_stops, sources.fan_points])
        return cls(faces[order], starts[order], stops[order])


def traced_path(triangles: IntrinsicMesh, placed: PlacedSegments, ends: LocatedPoints) -> LocatedPoints:
    """Find the shortest path from sources to the nearest of some ends.

    Returns its points in order, one on each edge that it crosses. The last is the end. Raises `SourceError` if no path
    leads to an end.
    """
    paused = PausedSearch.start(triangles, placed, 0.0)
    search, faces, places = paused.search, paused.faces, Places.of(triangles, ends)
    corners = triangles.corner_vertices[places.faces]
    gaps = np.abs(triangles.corner_positions[places.faces] - places.points[:, None])
    late = 1.5 * float(triangles.lengths_of_edges.max())  # by which windows wait longer than vertices
    while not paused.has_ended:
        nearest = float((search.distance[corners] + gaps).min())
        if search.queue.keys[search.queue.items[0]] > nearest + late:
            break
        paused.until(paused.windows + WINDOWS_AT_ONCE)
    sources, best, points = SourcesByFace.of(placed.sources(triangles)), np.inf, ends[np.arange(0)]
    for i in range(len(ends)):
        length, crossed, weights = _trace(faces, search, sources, places, i)
        if length < best:
            best, points = length, concatenated([ends[np.array([i])], locate_points(triangles, crossed, weights)])
    if not len(points):
        raise SourceError(
            f"no path along the surface joins the two points, one of which is in face {ends.faces[0]}: they lie on "
            "different connected components",
            element=f"face {ends.faces[0]}",
        )
    return points[np.arange(len(points))[::-1]]


@compiled
def _trace(
    faces: Faces, search: Search, sources: SourcesByFace, places: Places, end: int
) -> tuple[float, Ints, Floats]:
    """Follow the shortest path from an end, number `end` of `places`, back to the sources.

    Each step leads from the last point, through one of its faces, to the source, corner or side by which it is nearest.
    Returns the length, infinite if there is no path, and for its points (k,) faces and (k, 3) barycentric coordinates.
    """
    # faces that contain the last point, and its position in each
    at_faces = places.faces[places.first[end] : places.first[end + 1]].copy()
    at_points = places.points[places.first[end] : places.first[end + 1]].copy()
    edge, vertex = np.int64(-1), np.int64(-1)  # on which the last point lies
    total, path_faces, shares, steps = np.inf, [0], [0.0], len(faces.edges) + len(search.distance)
    path_faces.pop()
    shares.pop()
    while steps > 0:
        steps -= 1
        # the nearest way on: its length, kind, face, corner or side, and where it leads
        best, kind, face, k, position = np.inf, DONE, 0, 0, 0j
        for i in range(len(at_faces)):
            f, x = at_faces[i], at_points[i]
            for s in range(np.searchsorted(sources.faces, f), np.searchsorted(sources.faces, f, side="right")):
                way = sources.stops[s] - sources.starts[s]
                square = abs(way) ** 2
                share = ((x - sources.starts[s]) * way.conjugate()).real / square if square > 0.0 else 0.0
                foot = sources.starts[s] + min(max(share, 0.0), 1.0) * way
                if abs(x - foot) < best:
                    best, kind, face, position = abs(x - foot), AT_SOURCE, f, foot
            for c in range(3):
                v = faces.vertices[f, c]
                away = search.distance[v] + abs(x - faces.positions[f, c])
                if v != vertex and away < best * (1.0 - 1e-13):
                    best, kind, face, k, position = away, AT_VERTEX, f, c, faces.positions[f, c]
            for side in range(3):
                passed = faces.vertices[f, side] == vertex or faces.vertices[f, (side + 1) % 3] == vertex
                if passed or faces.edges[f, side] == edge:
                    continue
                away, share = _through_side(faces, search, 3 * f + side, x)
                if away < best * (1.0 - 1e-13):
                    best, kind, face, k = away, ACROSS, f, side
                    position = faces.positions[f, side]
                    position += share * (faces.positions[f, (side + 1) % 3] - position)
                    if share < AT_END or share > 1.0 - AT_END:
                        kind, k = AT_VERTEX, (side + np.int64(share > 0.5)) % 3
        if vertex >= 0 and search.distance[vertex] <= best * (1.0 + 1e-13) and search.distance[vertex] == 0.0:
            return total, np.array(path_faces), np.array(shares).reshape(-1, 3)
        if kind == DONE:
            return np.inf, np.array(path_faces), np.array(shares).reshape(-1, 3)
        if total == np.inf:
            total = best
        # record the next point by its barycentric coordinates, which are areas
        corners = faces.positions[face]
        whole = cross(corners[1] - corners[0], corners[2] - corners[0])
        path_faces.append(face)
        for c in range(3):
            if kind == AT_VERTEX:
                shares.append(1.0 if c == k else 0.0)
            elif kind == ACROSS and c == (k + 2) % 3:
                shares.append(0.0)
            else:
                a, b = corners[(c + 1) % 3] - position, corners[(c + 2) % 3] - position
                shares.append(max(cross(a, b) / whole, 0.0))
        if kind == AT_SOURCE:
            return total, np.array(path_faces), np.array(shares).reshape(-1, 3)
        # the faces of the next point
        if kind == AT_VERTEX:
            edge, vertex = np.int64(-1), faces.vertices[face, k]
            around = faces.corners[faces.first_corner[vertex] : faces.first_corner[vertex + 1]]
            at_faces, at_points = around // 3, np.empty(len(around), np.complex128)
            for i in range(len(around)):
                at_points[i] = faces.positions[around[i] // 3, around[i] % 3]
        else:
            edge, vertex = faces.edges[face, k], np.int64(-1)
            share = abs(position - faces.positions[face, k]) / faces.lengths[edge]
            share = share if faces.forward[face, k] else 1.0 - share
            halfedges = faces.halfedges[faces.first_halfedge[edge] : faces.first_halfedge[edge + 1]]
            at_faces, at_points = halfedges // 3, np.empty(len(halfedges), np.complex128)
            for i in range(len(halfedges)):
                f, side = halfedges[i] // 3, halfedges[i] % 3
                a, b = faces.positions[f, side], faces.positions[f, (side + 1) % 3]
                at_points[i] = a + (share if faces.forward[f, side] else 1.0 - share) * (b - a)
    return np.inf, np.array(path_faces), np.array(shares).reshape(-1, 3)


DONE, AT_SOURCE, AT_VERTEX, ACROSS = range(4)
"""Kinds of steps of a path: there is none, or it leads to a source, to a vertex, or across a side."""


@compiled
def _through_side(faces: Faces, search: Search, halfedge: int, x: complex) -> tuple[float, float]:
    """Return the distance of a point x of a face through one of its sides, and the fraction of the side it crosses.

    The side is the given halfedge, and x is in the layout of the face. The distance is infinite if no window has
    entered the face there.
    """
    face, side = halfedge // 3, halfedge % 3
    length = faces.lengths[faces.edges[face, side]]
    a, b = faces.positions[face, side], faces.positions[face, (side + 1) % 3]
    ahead = faces.forward[face, side]
    origin, unit = (a, (b - a) / length) if ahead else (b, (a - b) / length)
    local = (x - origin) * unit.conjugate()  # in the frame of the edge, whose tail is at 0
    along, up = local.real, abs(local.imag)
    best, crossing, row = np.inf, 0.0, search.settled[halfedge]
    while row >= 0:
        w = search.windows[row]
        row = search.following[row]
        # the straight line from x along the beam, or to the centre of the wave, crosses the edge at this position
        if w[KIND] == BEAM:
            position = along - w[P] / w[Q] * up if w[Q] > 0.0 else along
        else:
            position = w[P] + (along - w[P]) * w[Q] / (w[Q] - up) if w[Q] < up else w[P]
        position = min(max(position, w[S0]), w[S1])
        distance = arrival(w, position, 0.0) + np.sqrt((along - position) ** 2 + up**2)
        if distance < best:
            best, crossing = distance, position
    share = crossing / length
    return best, share if ahead else 1.0 - share
