"""Kernels: sources of exact distance on a polyhedral surface, and their initial windows."""

from __future__ import annotations

import heapq
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...compiled import compiled
from ..intrinsic_mesh import IntrinsicMesh
from .windows import BEAM, KIND, POINT, S0, S1, SIGMA, P, Q, arrival, clip, outrun, put


class Faces(NamedTuple):
    """An intrinsic mesh as plain arrays, with the halfedges of each edge and the corners at each vertex in lists."""

    vertices: NDArray[np.int64]
    positions: NDArray[np.complex128]
    edges: NDArray[np.int64]
    forward: NDArray[np.bool_]
    edge_vertices: NDArray[np.int64]
    lengths: NDArray[np.float64]
    halfedges: NDArray[np.int64]
    first_halfedge: NDArray[np.int64]
    corners: NDArray[np.int64]
    first_corner: NDArray[np.int64]

    @classmethod
    def of(cls, triangles: IntrinsicMesh) -> Faces:
        """The arrays of an intrinsic mesh."""
        table = triangles.edges
        at_edge, at_vertex = table.face_edges.ravel(), triangles.corner_vertices.ravel()
        edge_counts = np.bincount(at_edge, minlength=triangles.n_edges)
        vertex_counts = np.bincount(at_vertex, minlength=triangles.n_vertices)
        return cls(
            triangles.corner_vertices,
            triangles.corner_positions,
            table.face_edges,
            table.forward,
            table.vertices,
            triangles.lengths_of_edges,
            np.argsort(at_edge, kind="stable"),
            np.concatenate([[0], np.cumsum(edge_counts)]),
            np.argsort(at_vertex, kind="stable"),
            np.concatenate([[0], np.cumsum(vertex_counts)]),
        )


class GeodesicSources(NamedTuple):
    """Where distance is zero: on the zero set of vertex values, on edges, at vertices, and at points inside faces."""

    values: NDArray[np.float64]
    edges: NDArray[np.int64]
    vertices: NDArray[np.int64]
    faces: NDArray[np.int64]
    positions: NDArray[np.complex128]


@compiled(nogil=True)
def propagate_across(faces, state, heap, latest, distance, face, side, kind, t0, t1, point, normal, sigma, slack):
    """Propagate distance across a side of a face, from within, to the faces beyond; returns the windows.

    In the layout of the face: the interval of the side from fraction t0 to t1 sees the source, which is a point whose
    own distance is σ, or a beam along a normal whose distance at a point is σ.
    """
    windows, following, count = state
    edge = faces.edges[face, side]
    length = faces.lengths[edge]
    a, b = faces.positions[face, side], faces.positions[face, (side + 1) % 3]
    if not faces.forward[face, side]:
        a, b = b, a
        t0, t1 = 1.0 - t1, 1.0 - t0
    if t1 - t0 <= 1e-12:
        return state
    begin, end = faces.first_halfedge[edge], faces.first_halfedge[edge + 1]
    if count + end - begin >= len(windows):
        more, links = np.empty((2 * len(windows), 6)), np.empty(2 * len(windows), dtype=np.int64)
        for k in range(count):
            put(windows[k], more, k)
            links[k] = following[k]
        windows, following = more, links
    w = windows[count]
    w[S0], w[S1], w[KIND] = t0 * length, t1 * length, kind
    unit = (b - a) / length
    if kind == BEAM:
        turned = normal * unit.conjugate()
        w[P], w[Q] = turned.real, abs(turned.imag)
        w[SIGMA] = sigma - ((point - a) * normal.conjugate()).real
    else:
        turned = (point - a) * unit.conjugate()
        w[P], w[Q], w[SIGMA] = turned.real, -kind * abs(turned.imag), sigma
    tail, head = faces.edge_vertices[edge]
    if outrun(w, distance[tail], distance[head], length, slack * length):
        return windows, following, count
    near = min(arrival(w, w[S0], 0.0), arrival(w, w[S1], 0.0))
    first = count
    for k in range(begin, end):
        halfedge = faces.halfedges[k]
        if halfedge != 3 * face + side:
            put(windows[first], windows, count)
            following[count] = latest[halfedge]
            if latest[halfedge] < 0:
                heapq.heappush(heap, (near + 1.5 * length, halfedge))
            latest[halfedge] = count
            count += 1
    return windows, following, count


@compiled(nogil=True)
def _segment(faces, values, face):
    """Whether the zero set crosses a face, the two sides that it crosses, and where."""
    first, second, start, end = -1, -1, 0j, 0j
    for side in range(3):
        a, b = values[faces.vertices[face, side]], values[faces.vertices[face, (side + 1) % 3]]
        if (a < 0.0 < b) or (b < 0.0 < a):
            t = a / (a - b)
            place = faces.positions[face, side] * (1.0 - t) + faces.positions[face, (side + 1) % 3] * t
            if first < 0:
                first, start = side, place
            else:
                second, end = side, place
    return second >= 0 and abs(end - start) > 0.0, first, second, start, end


@compiled(nogil=True)
def _reach_corners(faces, distance, face, start, end):
    """Distance of the corners of a face to a segment or a point in it."""
    along = end - start
    square = abs(along) ** 2
    for k in range(3):
        v, r = faces.vertices[face, k], faces.positions[face, k] - start
        t = min(max((r * along.conjugate()).real / square, 0.0), 1.0) if square > 0.0 else 0.0
        distance[v] = min(distance[v], abs(r - t * along))


@compiled(nogil=True)
def _first_beam(faces, state, heap, latest, distance, face, start, end, normal, slack):
    """Parallel beam from a segment in a face, along one of its normals, to the sides of the face that it meets."""
    along = (end - start) / abs(end - start)
    for side in range(3):
        a, b = faces.positions[face, side], faces.positions[face, (side + 1) % 3]
        foot = ((a - start) * along.conjugate()).real
        rate = ((b - a) * along.conjugate()).real
        height = ((a - start) * normal.conjugate()).real
        climb = ((b - a) * normal.conjugate()).real
        t0, t1 = clip(0.0, 1.0, -foot, -rate)
        t0, t1 = clip(t0, t1, foot - abs(end - start), rate)
        t0, t1 = clip(t0, t1, -height, -climb)
        if t1 > t0:
            state = propagate_across(
                faces, state, heap, latest, distance, face, side, BEAM, t0, t1, start, normal, 0.0, slack
            )  # fmt: skip
    return state


@compiled(nogil=True)
def _first_fan(faces, values, state, heap, latest, distance, face, side, point, other, slack):
    """Circular waves from the end of a segment, between its beam and the beam of the next segment, across the side."""
    here = (other - point) / abs(other - point)
    edge = faces.edges[face, side]
    alone = faces.first_halfedge[edge + 1] - faces.first_halfedge[edge] == 1
    for k in range(faces.first_halfedge[edge], faces.first_halfedge[edge + 1]):
        beyond, there = faces.halfedges[k] // 3, faces.halfedges[k] % 3
        if beyond == face and not alone:
            continue
        # the fan in this face: between the beam of its own segment and that of the face beyond, unfolded next to it
        back = here
        if not alone:
            _, one, _, p, q = _segment(faces, values, beyond)
            back = q - p if one == there else p - q
            back /= abs(back)
            a, b = faces.positions[beyond, there], faces.positions[beyond, (there + 1) % 3]
            back *= (b - a).conjugate() / abs(b - a)
            same = faces.forward[beyond, there] == faces.forward[face, side]
            back = back.conjugate() if same else -back
            a, b = faces.positions[face, side], faces.positions[face, (side + 1) % 3]
            back *= (b - a) / abs(b - a)
        for step in range(1, 3):
            far = (side + step) % 3
            a, b = faces.positions[face, far], faces.positions[face, (far + 1) % 3]
            t0, t1 = clip(0.0, 1.0, ((a - point) * here.conjugate()).real, ((b - a) * here.conjugate()).real)
            t0, t1 = clip(t0, t1, ((a - point) * back.conjugate()).real, ((b - a) * back.conjugate()).real)
            if t1 > t0:
                state = propagate_across(
                    faces, state, heap, latest, distance, face, far, POINT, t0, t1, point, 0j, 0.0, slack
                )  # fmt: skip
    return state


@compiled(nogil=True)
def initial_windows(faces, sources, state, heap, latest, distance, slack):
    """Set distances at the corners of faces with sources, then make the initial windows."""
    for face in range(len(faces.vertices)):
        crossed, _, _, start, end = _segment(faces, sources.values, face)
        if crossed:
            _reach_corners(faces, distance, face, start, end)
    for edge in sources.edges:
        for k in range(faces.first_halfedge[edge], faces.first_halfedge[edge + 1]):
            face, side = faces.halfedges[k] // 3, faces.halfedges[k] % 3
            _reach_corners(
                faces, distance, face, faces.positions[face, side], faces.positions[face, (side + 1) % 3]
            )  # fmt: skip
    for i in range(len(sources.faces)):
        _reach_corners(faces, distance, sources.faces[i], sources.positions[i], sources.positions[i])
    for v in sources.vertices:
        distance[v] = 0.0

    for face in range(len(faces.vertices)):
        crossed, first, second, start, end = _segment(faces, sources.values, face)
        if crossed:
            normal = 1j * (end - start) / abs(end - start)
            state = _first_beam(faces, state, heap, latest, distance, face, start, end, normal, slack)
            state = _first_beam(faces, state, heap, latest, distance, face, start, end, -normal, slack)
            for side, point, other in ((first, start, end), (second, end, start)):
                state = _first_fan(
                    faces, sources.values, state, heap, latest, distance, face, side, point, other, slack
                )  # fmt: skip
    for edge in sources.edges:
        for k in range(faces.first_halfedge[edge], faces.first_halfedge[edge + 1]):
            face, side = faces.halfedges[k] // 3, faces.halfedges[k] % 3
            start, end = faces.positions[face, side], faces.positions[face, (side + 1) % 3]
            normal = 1j * (end - start) / abs(end - start)  # faces lie to the left of their sides
            state = _first_beam(faces, state, heap, latest, distance, face, start, end, normal, slack)
    for i in range(len(sources.faces)):
        face, point = sources.faces[i], sources.positions[i]
        for side in range(3):
            a, b = faces.positions[face, side], faces.positions[face, (side + 1) % 3]
            if ((point - a) * (1j * (b - a)).conjugate()).real > 1e-9 * abs(b - a) ** 2:  # not on that side
                state = propagate_across(
                    faces, state, heap, latest, distance, face, side, POINT, 0.0, 1.0, point, 0j, 0.0, slack
                )  # fmt: skip
    return state
