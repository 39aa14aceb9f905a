"""Distance on a polyhedral surface from line segments and points in its faces: exact, or within a tolerance.

Windows propagate from face to face in order of distance (Mitchell, Mount & Papadimitriou 1987; Chen & Han 1990), and
windows that a path through a vertex undercuts are dropped (Xin & Wang 2009). A window is an interval of an edge whose
points see one source along straight lines: a point, or, since sources here are segments too, a parallel beam at right
angles to a segment. Each vertex splits windows, so that their number per edge would grow with distance; neighbouring
windows that one circular or straight wave front approximates are therefore merged (Surazhsky et al. 2005), and the work
stays in proportion to the number of faces.
"""

from __future__ import annotations

import heapq

import numpy as np
from numpy.typing import NDArray

from ...compiled import compiled
from ..intrinsic_mesh import IntrinsicMesh
from .initial_windows import Faces, GeodesicSources, initial_windows, propagate_across
from .windows import BEAM, KIND, POINT, S0, S1, SIGMA, P, Q, arrival, hit, merge, outrun, put, ray, trim

_ROUND = 1e-10


_NO_ID, _NO_POINT = np.empty(0, dtype=np.int64), np.empty(0, dtype=np.complex128)


def distance_to_zero_line(
    triangles: IntrinsicMesh, values: NDArray[np.float64], tolerance: float = 1e-4
) -> tuple[NDArray[np.float64], int]:
    """Distance of every vertex to the zero set of a function that is linear in every face; and the number of windows.

    Parameters
    ----------
    triangles : IntrinsicMesh
        Any surface, nonmanifold and nonorientable ones too.
    values : (n,) float
        The function at the vertices; faces with a NaN corner contain no part of the zero set.
    tolerance : float
        Windows are merged where that changes distances by less than this fraction of the edge; 0 is exact.

    Returns
    -------
    (n,) float
        inf where the zero set is not connected to the vertex.
    int
        Number of windows, a measure of the work.
    """
    faces = Faces.of(triangles)
    values = cleared(triangles, values, 1e-7 * float(faces.lengths.mean()))
    return _propagate(
        faces, is_pseudosource(triangles), GeodesicSources(values, _NO_ID, _NO_ID, _NO_ID, _NO_POINT), tolerance
    )


def distance_to_edges_and_points(
    triangles: IntrinsicMesh,
    edges: NDArray[np.int64],
    vertices: NDArray[np.int64],
    faces: NDArray[np.int64],
    positions: NDArray[np.complex128],
    tolerance: float = 1e-4,
) -> tuple[NDArray[np.float64], int]:
    """Distance of every vertex to some edges, vertices, and points inside faces; and the number of windows.

    Points are given by their faces and their `positions` in the layouts of these; a point on an edge has to be given in
    every face at the edge. For the rest see `distance_to_zero_line`.

    Examples
    --------
    >>> triangles = IntrinsicMesh.from_lengths(np.array([[0, 1, 2]]), np.array([[4.0, 5.0, 3.0]]), 3)
    >>> none = np.empty(0, dtype=np.int64)
    >>> distance_to_edges_and_points(triangles, none, np.array([1]), none, np.empty(0, complex))[0].tolist()
    [4.0, 0.0, 5.0]
    """
    pseudosources = is_pseudosource(triangles)
    sources = np.concatenate([np.asarray(vertices, dtype=np.int64), triangles.edges.vertices[edges].ravel()])
    pseudosources[sources] = True
    sources = GeodesicSources(np.ones(triangles.n_vertices), edges, sources, faces, positions)
    return _propagate(Faces.of(triangles), pseudosources, sources, tolerance)


def cleared(triangles: IntrinsicMesh, values: NDArray[np.float64], least: float) -> NDArray[np.float64]:
    """Values moved away from zero by `least`, so that the zero set crosses edges and passes no vertex.

    A vertex with value zero gets the sign that fewer of its neighbours have: where both sides of a source have the same
    sign, the zero set then runs around the source.
    """
    near = np.abs(values) < least
    known = np.where(near | np.isnan(values), 0.0, np.sign(values))
    tail, head = triangles.edges.vertices.T
    around = np.bincount(tail, known[head], len(values)) + np.bincount(head, known[tail], len(values))
    return np.where(near, np.where(around > 0, -least, least), values)


def is_pseudosource(triangles: IntrinsicMesh) -> NDArray[np.bool_]:
    """(n,) vertices that shortest paths can pass through: on a boundary, or with a total angle of more than 2π."""
    angles = np.arctan2(1.0, triangles.corner_cotangents)
    total = np.bincount(triangles.corner_vertices.ravel(), angles.ravel(), triangles.n_vertices)
    special = total > 2 * np.pi + 1e-9
    special[triangles.edges.vertices[triangles.edges.face_counts != 2]] = True
    return special


@compiled(nogil=True)
def _reach(v, length, heap, distance, pseudosources):
    """Record a path of this length to a vertex; if paths can bend around it (a pseudosource), queue it."""
    if length < distance[v] * (1.0 - 1e-14):
        distance[v] = length
        if pseudosources[v]:
            heapq.heappush(heap, (length, -1 - v))


@compiled(nogil=True)
def _collect(state, latest, halfedge, at_tail, at_head, length, slack, tolerance):
    """The windows queued for a halfedge, in order along it, trimmed against each other and merged where possible."""
    windows, following, _ = state
    count, number = 0, latest[halfedge]
    while number >= 0:
        count += 1
        number = following[number]
    chosen = np.empty((count, 6))
    count, number = 0, latest[halfedge]
    while number >= 0:
        if not outrun(windows[number], at_tail, at_head, length, slack):
            k = count
            while k > 0 and chosen[k - 1, S0] > windows[number, S0]:
                put(chosen[k - 1], chosen, k)
                k -= 1
            put(windows[number], chosen, k)
            count += 1
        number = following[number]
    latest[halfedge] = -1
    if tolerance == 0.0:
        return chosen, count
    kept = 0
    for k in range(count):
        if kept > 0:
            trim(chosen[kept - 1], chosen[k])
            if chosen[kept - 1, S1] <= chosen[kept - 1, S0]:
                kept -= 1
        if chosen[k, S1] <= chosen[k, S0]:
            continue
        if kept > 0 and merge(chosen[kept - 1], chosen[k], length, tolerance):
            continue
        put(chosen[k], chosen, kept)
        kept += 1
    return chosen, kept


@compiled(nogil=True)
def _propagate(faces, pseudosources, sources, tolerance):
    n = len(pseudosources)
    distance = np.full(n, np.inf)
    heap = [(0.0, 0)]
    heap.pop()
    state = (np.empty((1024, 6)), np.empty(1024, dtype=np.int64), len(heap))  # len(heap) is 0; a literal compiles twice
    latest = np.full(3 * len(faces.vertices), -1, dtype=np.int64)  # window queued for each halfedge; others follow it
    slack = _ROUND + 2.0 * tolerance
    state = initial_windows(faces, sources, state, heap, latest, distance, slack)
    for v in range(n):
        if pseudosources[v] and distance[v] < np.inf:
            heapq.heappush(heap, (distance[v], -1 - v))

    while len(heap) > 0:
        key, halfedge = heapq.heappop(heap)
        if halfedge < 0:  # a pseudosource
            v = -1 - halfedge
            if key > distance[v]:
                continue
            for k in range(faces.first_corner[v], faces.first_corner[v + 1]):
                face, corner = faces.corners[k] // 3, faces.corners[k] % 3
                source = faces.positions[face, corner]
                for step in range(1, 3):
                    other = (corner + step) % 3
                    length = key + abs(faces.positions[face, other] - source)
                    _reach(faces.vertices[face, other], length, heap, distance, pseudosources)
                side = (corner + 1) % 3
                state = propagate_across(
                    faces, state, heap, latest, distance, face, side, POINT, 0.0, 1.0, source, 0j, key, slack
                )  # fmt: skip
            continue

        face, side = halfedge // 3, halfedge % 3
        edge = faces.edges[face, side]
        length = faces.lengths[edge]
        tail, head = faces.edge_vertices[edge]
        here, n_here = _collect(
            state, latest, halfedge, distance[tail], distance[head], length, slack * length, tolerance
        )
        a, b = faces.positions[face, side], faces.positions[face, (side + 1) % 3]
        ahead = faces.forward[face, side]
        origin, unit = (a, (b - a) / length) if ahead else (b, (a - b) / length)
        up = 1j if ahead else -1j  # faces lie to the left of their sides
        apex = (faces.positions[face, (side + 2) % 3] - origin) * unit.conjugate()
        cx, cy = apex.real, abs(apex.imag)
        tail_side, head_side = ((side + 2) % 3, (side + 1) % 3) if ahead else ((side + 1) % 3, (side + 2) % 3)
        for k in range(n_here):
            w = here[k]
            s0, s1 = w[S0], w[S1]
            d0x, d0y = ray(w, s0)
            d1x, d1y = ray(w, s1)
            left = d0x * cy - d0y * (cx - s0)  # negative: the ray leaves the apex to its right
            right = d1x * cy - d1y * (cx - s1)
            if (
                left > 0.0
            ):  # the apex lies outside the visible sector, perhaps in a gap between windows: by way of a window's end
                to_apex = arrival(w, s0, 0.0) + np.hypot(cx - s0, cy)
            elif right < 0.0:
                to_apex = arrival(w, s1, 0.0) + np.hypot(cx - s1, cy)
            else:
                to_apex = arrival(w, cx, cy)
            _reach(faces.vertices[face, (side + 2) % 3], to_apex, heap, distance, pseudosources)
            turned = unit * (w[P] + up * w[Q])
            source, normal = (origin, turned) if w[KIND] == BEAM else (origin + turned, 0j)
            if left < 0.0:  # visible on the side from tail to apex
                t0 = hit(s0, d0x, d0y, 0.0, 0.0, cx, cy)
                t1 = hit(s1, d1x, d1y, 0.0, 0.0, cx, cy) if right < 0.0 else 1.0
                t0, t1 = (1.0 - t1, 1.0 - t0) if ahead else (t0, t1)
                state = propagate_across(
                    faces, state, heap, latest, distance, face, tail_side, w[KIND], t0, t1, source, normal, w[SIGMA],
                    slack,
                )  # fmt: skip
            if right > 0.0:  # visible on the side from apex to head
                t0 = hit(s0, d0x, d0y, cx, cy, length, 0.0) if left > 0.0 else 0.0
                t1 = hit(s1, d1x, d1y, cx, cy, length, 0.0)
                t0, t1 = (1.0 - t1, 1.0 - t0) if ahead else (t0, t1)
                state = propagate_across(
                    faces, state, heap, latest, distance, face, head_side, w[KIND], t0, t1, source, normal, w[SIGMA],
                    slack,
                )  # fmt: skip
    return distance, state[2]
