"""Kernels: the initial windows of exact distance on a polyhedral surface."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled
from ..memory import refuse_beyond_memory
from ..mesh.components import grouped
from ..mesh.intrinsic_mesh import IntrinsicMesh
from .geodesic_sources import GeodesicSources
from .geodesic_windows import BEAM, KIND, POINT, S0, S1, SIGMA, P, Q, arrival, clip, outrun, put
from .heap_kernels import Queue, push

BYTES_PER_WINDOW = 56.0


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
        table, (first_halfedge, halfedges) = triangles.edges, triangles.edges.halfedges
        first_corner, corners = grouped(triangles.corner_vertices.ravel(), triangles.n_vertices)
        return cls(
            triangles.corner_vertices,
            triangles.corner_positions,
            table.face_edges,
            table.forward,
            table.vertices,
            triangles.lengths_of_edges,
            halfedges,
            first_halfedge,
            corners,
            first_corner,
        )


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
        """The same with at least the room that was wanted, in place: a copy would need twice the memory."""
        room = len(self.windows) + max(len(self.windows) // 2, int(self.counts[WANTED]))
        refuse_beyond_memory(
            "exact distance along the surface",
            room - len(self.windows),
            lambda number: BYTES_PER_WINDOW * number,
            lambda _: "use a coarser mesh, and merge faces that lie on each other",
        )
        for array in (self.windows, self.following):
            array.resize((room, *array.shape[1:]), refcheck=False)
        return self


USED, FREE, MADE, WANTED = range(4)
"""Rows ever used, the first free one of these, windows made so far, and rows that were missing."""


@compiled
def has_room(counts: NDArray[np.int64], size: int, n: int) -> bool:
    """Whether n more windows fit into an array of so many rows; otherwise notes how many were wanted."""
    if counts[USED] + n <= size:
        return True
    counts[WANTED] = n
    return False


@compiled
def take_row(counts: NDArray[np.int64], following: NDArray[np.int64]) -> int:
    """A row for a window; there must be room."""
    row = counts[FREE]
    if row >= 0:
        counts[FREE] = following[row]
    else:
        row = counts[USED]
        counts[USED] += 1
    return int(row)


@compiled
def free_row(counts: NDArray[np.int64], following: NDArray[np.int64], row: int) -> None:
    """Give a row back."""
    following[row] = counts[FREE]
    counts[FREE] = row


@compiled
def propagate_across(
    faces: Faces,
    search: Search,
    face: int,
    side: int,
    kind: float,
    t0: float,
    t1: float,
    point: complex,
    normal: complex,
    sigma: float,
    slack: float,
) -> None:
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


@compiled
def _reach_corners(faces: Faces, distance: NDArray[np.float64], face: int, start: complex, end: complex) -> None:
    """Distance of the corners of a face to a segment or a point in it."""
    along = end - start
    square = abs(along) ** 2
    for k in range(3):
        v, r = faces.vertices[face, k], faces.positions[face, k] - start
        t = min(max((r * along.conjugate()).real / square, 0.0), 1.0) if square > 0.0 else 0.0
        distance[v] = min(distance[v], abs(r - t * along))


@compiled
def _first_beam(faces: Faces, search: Search, face: int, start: complex, end: complex, slack: float) -> None:
    """Parallel beam from a segment in a face, to the left of it, to the sides of the face that it meets."""
    along = (end - start) / abs(end - start)
    normal = 1j * along
    for side in range(3):
        a, b = faces.positions[face, side], faces.positions[face, (side + 1) % 3]
        foot = ((a - start) * along.conjugate()).real
        rate = ((b - a) * along.conjugate()).real
        height = ((a - start) * normal.conjugate()).real
        climb = ((b - a) * normal.conjugate()).real
        if abs(height) + abs(climb) <= 1e-9 * abs(b - a):  # the segment lies on this side, and the beam leaves it
            continue
        t0, t1 = clip(0.0, 1.0, -foot, -rate)
        t0, t1 = clip(t0, t1, foot - abs(end - start), rate)
        t0, t1 = clip(t0, t1, -height, -climb)
        if t1 > t0:
            propagate_across(faces, search, face, side, BEAM, t0, t1, start, normal, 0.0, slack)


@compiled
def _first_fan(
    faces: Faces, search: Search, face: int, point: complex, first: complex, second: complex, slack: float
) -> None:
    """Circular waves from a point in a face, in directions of more than 90° from two given ones."""
    for side in range(3):
        a, b = faces.positions[face, side], faces.positions[face, (side + 1) % 3]
        if ((point - a) * (1j * (b - a)).conjugate()).real <= 1e-9 * abs(b - a) ** 2:  # the point lies on this side
            continue
        t0, t1 = clip(0.0, 1.0, ((a - point) * first.conjugate()).real, ((b - a) * first.conjugate()).real)
        t0, t1 = clip(t0, t1, ((a - point) * second.conjugate()).real, ((b - a) * second.conjugate()).real)
        if t1 > t0:
            propagate_across(faces, search, face, side, POINT, t0, t1, point, 0j, 0.0, slack)


@compiled
def initial_windows(faces: Faces, sources: GeodesicSources, search: Search, slack: float) -> None:
    """Set distances at the corners of faces with sources, then make the initial windows."""
    for v in sources.vertices:
        search.distance[v] = 0.0
    for i in range(len(sources.beam_faces)):
        _reach_corners(faces, search.distance, sources.beam_faces[i], sources.beam_starts[i], sources.beam_stops[i])
    for i in range(len(sources.fan_faces)):
        _reach_corners(faces, search.distance, sources.fan_faces[i], sources.fan_points[i], sources.fan_points[i])
    for i in range(len(sources.beam_faces)):
        _first_beam(faces, search, sources.beam_faces[i], sources.beam_starts[i], sources.beam_stops[i], slack)
    for i in range(len(sources.fan_faces)):
        point, first, second = sources.fan_points[i], sources.fan_firsts[i], sources.fan_seconds[i]
        _first_fan(faces, search, sources.fan_faces[i], point, first, second, slack)
