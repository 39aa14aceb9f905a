"""Kernels: sources of exact distance on a polyhedral surface, and their initial windows."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...compiled import compiled
from ..intrinsic_mesh import IntrinsicMesh
from .heap_kernels import Queue, push
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


class Search(NamedTuple):
    """What a search knows: distances so far, and windows in lists by halfedge, queued to go on or settled.

    Windows are rows of one array; `following` links those of a list, and those that are free. Row 0 is for scratch. The
    queue holds halfedges, then vertices that paths bend around. `counts` are those at `USED`, `FREE`, ….
    """

    distance: NDArray[np.float64]
    pseudosources: NDArray[np.bool_]
    queue: Queue
    queued: NDArray[np.int64]
    settled: NDArray[np.int64]
    windows: NDArray[np.float64]
    following: NDArray[np.int64]
    counts: NDArray[np.int64]

    @classmethod
    def start(cls, n_faces: int, pseudosources: NDArray[np.bool_], room: int) -> Search:
        """Nothing known yet, and room for so many windows."""
        n = len(pseudosources)
        lists = np.full(3 * n_faces, -1), np.full(3 * n_faces, -1)
        windows, following = np.empty((room, 6)), np.empty(room, dtype=np.int64)
        counts = np.array([1, -1, 0, 0])
        return cls(np.full(n, np.inf), pseudosources, Queue.empty(3 * n_faces + n), *lists, windows, following, counts)

    def larger(self) -> Search:
        """The same with at least the room that was wanted."""
        more = max(len(self.windows), int(self.counts[WANTED]))
        windows = np.concatenate([self.windows, np.empty((more, 6))])
        return self._replace(
            windows=windows, following=np.concatenate([self.following, np.empty(more, dtype=np.int64)])
        )


USED, FREE, MADE, WANTED = range(4)
"""Rows ever used, the first free one of these, windows made so far, and rows that were missing."""


@compiled(nogil=True)
def has_room(counts, size, n):
    """Whether n more windows fit into an array of so many rows; otherwise notes how many were wanted."""
    if counts[USED] + n <= size:
        return True
    counts[WANTED] = n
    return False


@compiled(nogil=True)
def take_row(counts, following):
    """A row for a window; there must be room."""
    row = counts[FREE]
    if row >= 0:
        counts[FREE] = following[row]
    else:
        row = counts[USED]
        counts[USED] += 1
    return row


@compiled(nogil=True)
def free_row(counts, following, row):
    """Give a row back."""
    following[row] = counts[FREE]
    counts[FREE] = row


@compiled(nogil=True)
def propagate_across(faces, search, face, side, kind, t0, t1, point, normal, sigma, slack):
    """Propagate distance across a side of a face, from within, to the faces beyond; nothing where there is no room.

    In the layout of the face: the interval of the side from fraction t0 to t1 sees the source, which is a point whose
    own distance is σ, or a beam along a normal whose distance at a point is σ.
    """
    edge = faces.edges[face, side]
    length = faces.lengths[edge]
    a, b = faces.positions[face, side], faces.positions[face, (side + 1) % 3]
    if not faces.forward[face, side]:
        a, b = b, a
        t0, t1 = 1.0 - t1, 1.0 - t0
    if not t1 - t0 > 1e-12:  # NaN, on faces of no size, ends here too
        return
    begin, end = faces.first_halfedge[edge], faces.first_halfedge[edge + 1]
    distance, _, queue, queued, _, windows, following, counts = search
    if not has_room(counts, len(windows), end - begin):
        return
    w = windows[0]
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
        return
    near = min(arrival(w, w[S0], 0.0), arrival(w, w[S1], 0.0))
    if not near < np.inf:
        return
    for k in range(begin, end):
        halfedge = faces.halfedges[k]
        if halfedge != 3 * face + side:
            row = take_row(counts, following)
            put(w, windows, row)
            following[row] = queued[halfedge]
            queued[halfedge] = row
            counts[MADE] += 1
            if queue.places[halfedge] < 0:
                push(queue, halfedge, near + 1.5 * length)


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
def _first_beam(faces, search, face, start, end, normal, slack):
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
            propagate_across(
                faces, search, face, side, BEAM, t0, t1, start, normal, 0.0, slack
            )  # fmt: skip


@compiled(nogil=True)
def _first_fan(faces, values, search, face, side, point, other, slack):
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
                propagate_across(
                    faces, search, face, far, POINT, t0, t1, point, 0j, 0.0, slack
                )  # fmt: skip


@compiled(nogil=True)
def initial_windows(faces, sources, search, slack):
    """Set distances at the corners of faces with sources, then make the initial windows."""
    for face in range(len(faces.vertices)):
        crossed, _, _, start, end = _segment(faces, sources.values, face)
        if crossed:
            _reach_corners(faces, search.distance, face, start, end)
    for edge in sources.edges:
        for k in range(faces.first_halfedge[edge], faces.first_halfedge[edge + 1]):
            face, side = faces.halfedges[k] // 3, faces.halfedges[k] % 3
            _reach_corners(
                faces, search.distance, face, faces.positions[face, side], faces.positions[face, (side + 1) % 3]
            )  # fmt: skip
    for i in range(len(sources.faces)):
        _reach_corners(faces, search.distance, sources.faces[i], sources.positions[i], sources.positions[i])
    for v in sources.vertices:
        search.distance[v] = 0.0

    for face in range(len(faces.vertices)):
        crossed, first, second, start, end = _segment(faces, sources.values, face)
        if crossed:
            normal = 1j * (end - start) / abs(end - start)
            _first_beam(faces, search, face, start, end, normal, slack)
            _first_beam(faces, search, face, start, end, -normal, slack)
            for side, point, other in ((first, start, end), (second, end, start)):
                _first_fan(
                    faces, sources.values, search, face, side, point, other, slack
                )  # fmt: skip
    for edge in sources.edges:
        for k in range(faces.first_halfedge[edge], faces.first_halfedge[edge + 1]):
            face, side = faces.halfedges[k] // 3, faces.halfedges[k] % 3
            start, end = faces.positions[face, side], faces.positions[face, (side + 1) % 3]
            normal = 1j * (end - start) / abs(end - start)  # faces lie to the left of their sides
            _first_beam(faces, search, face, start, end, normal, slack)
    for i in range(len(sources.faces)):
        face, point = sources.faces[i], sources.positions[i]
        for side in range(3):
            a, b = faces.positions[face, side], faces.positions[face, (side + 1) % 3]
            if ((point - a) * (1j * (b - a)).conjugate()).real > 1e-9 * abs(b - a) ** 2:  # not on that side
                propagate_across(
                    faces, search, face, side, POINT, 0.0, 1.0, point, 0j, 0.0, slack
                )  # fmt: skip
