"""Windows on the edges of a polyhedral surface, and how they propagate; the initial ones among them.

In the frame of an edge, its tail is at the origin, its head on the positive x axis; waves arrive from below. A window
is a row ``(s0, s1, p, q, sigma, kind)``: the interval [s0, s1] of the edge, and the wave. Kind `POINT`: circular waves
from the point (p, q ≤ 0), whose own distance is σ; kind `FOCUS`: circular waves that contract to the point (p, q ≥ 0),
whose distance would be σ; kind `BEAM`: straight waves along the direction (p, q > 0), σ their distance at the tail.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..arrays import Bools, Complexes, Floats, Ints
from ..compiled import compiled
from ..memory import refuse_beyond_memory
from ..mesh.components import grouped
from ..mesh.intrinsic_mesh import IntrinsicMesh
from .geodesic_sources import GeodesicSources
from .heap_kernels import Queue, push

POINT, BEAM, FOCUS = 1.0, 0.0, -1.0
S0, S1, P, Q, SIGMA, KIND = range(6)


@compiled
def put(window: Floats, rows: Floats, k: int) -> None:
    """Write a window to row k, entry by entry, since assignments to slices of arrays take long to compile."""
    for i in range(6):
        rows[k, i] = window[i]


@compiled
def arrival(w: Floats, x: float, y: float) -> float:
    """Return the distance from the source of a window to a point in the frame of its edge."""
    if w[KIND] == BEAM:
        return w[SIGMA] + w[P] * x + w[Q] * y
    return w[SIGMA] + w[KIND] * np.sqrt((x - w[P]) ** 2 + (y - w[Q]) ** 2)


@compiled
def ray(w: Floats, x: float) -> tuple[float, float]:
    """Return the direction of propagation at a point of the edge, of any length."""
    if w[KIND] == BEAM:
        return w[P], w[Q]
    return w[KIND] * (x - w[P]), -w[KIND] * w[Q]


@compiled
def outrun(w: Floats, at_tail: float, at_head: float, length: float, slack: float) -> bool:
    """Return whether paths through an end of the edge are shorter everywhere in the window."""
    if at_tail + w[S1] < arrival(w, w[S1], 0.0) - slack:
        return True
    return at_head + length - w[S0] < arrival(w, w[S0], 0.0) - slack


@compiled
def trim(a: Floats, b: Floats) -> None:
    """Trim two overlapping windows, of which a begins first, to where each has the smaller distance."""
    if b[S0] >= a[S1]:
        return
    low, high = b[S0], min(a[S1], b[S1])
    first = arrival(a, low, 0.0) - arrival(b, low, 0.0)
    last = arrival(a, high, 0.0) - arrival(b, high, 0.0)
    inside = b[S1] < a[S1]
    if first <= 0.0 and last <= 0.0:
        b[S0] = high
    elif first >= 0.0 and last >= 0.0:
        if not inside:
            a[S1] = low
    else:
        ahead = first < 0.0
        for _ in range(30):
            middle = 0.5 * (low + high)
            if (arrival(a, middle, 0.0) < arrival(b, middle, 0.0)) == ahead:
                low = middle
            else:
                high = middle
        if ahead:
            b[S0] = high
            if not inside:
                a[S1] = high
        elif inside:
            b[S1] = high


@compiled
def trim_by(old: Floats, w: Floats, slack: float) -> None:
    """Trim a window to where it is nearer than an older one by more than `slack`; its middle is not cut out."""
    low, high = max(old[S0], w[S0]), min(old[S1], w[S1])
    if not high > low:
        return
    first = arrival(old, low, 0.0) - arrival(w, low, 0.0) <= slack
    last = arrival(old, high, 0.0) - arrival(w, high, 0.0) <= slack
    if first and last:
        middle = 0.5 * (low + high)
        if arrival(old, middle, 0.0) - arrival(w, middle, 0.0) > slack:
            return
        if low <= w[S0]:
            w[S0] = high
        elif high >= w[S1]:
            w[S1] = low
        return
    if (first and low > w[S0]) or (last and high < w[S1]) or not (first or last):
        return
    for _ in range(30):
        middle = 0.5 * (low + high)
        if (arrival(old, middle, 0.0) - arrival(w, middle, 0.0) <= slack) == first:
            low = middle
        else:
            high = middle
    if first:
        w[S0] = low
    else:
        w[S1] = high


@compiled
def outdoes(w: Floats, old: Floats) -> bool:
    """Return whether a window covers another one and is nearer at its ends and in its middle."""
    if w[S0] > old[S0] or w[S1] < old[S1]:
        return False
    for k in range(3):
        x = old[S0] + 0.5 * k * (old[S1] - old[S0])
        if arrival(w, x, 0.0) > arrival(old, x, 0.0):
            return False
    return True


@compiled
def merge(a: Floats, b: Floats, length: float, tolerance: float) -> bool:
    """Merge window b into a if they are neighbours and one wave approximates both; return whether it was done."""
    if abs(a[S1] - b[S0]) > 1e-6 * length:
        return False
    s0, between, s1 = a[S0], a[S1], b[S1]
    ax, ay = ray(a, s0)
    bx, by = ray(b, s1)
    a_norm, b_norm = np.sqrt(ax * ax + ay * ay), np.sqrt(bx * bx + by * by)
    if ay <= 1e-9 * a_norm or by <= 1e-9 * b_norm:
        return False
    ax, ay, bx, by = ax / a_norm, ay / a_norm, bx / b_norm, by / b_norm
    turn = ax * by - ay * bx
    begin, end = arrival(a, s0, 0.0), arrival(b, s1, 0.0)
    middle = 0.5 * (arrival(a, between, 0.0) + arrival(b, between, 0.0))
    merged = np.empty(6)
    merged[S0], merged[S1] = s0, s1
    if abs(turn) * 1e6 * length <= (s1 - s0) * by:
        x, y = ax + bx, ay + by
        norm = np.sqrt(x * x + y * y)
        merged[P], merged[Q], merged[KIND] = x / norm, y / norm, BEAM
        merged[SIGMA] = begin - s0 * x / norm
    else:
        away = (s1 - s0) * by / turn
        if 0.0 < away < 4.0 * length:
            return False
        merged[P], merged[Q] = s0 + away * ax, away * ay
        merged[KIND] = POINT if away < 0.0 else FOCUS
        merged[SIGMA] = begin + away
    error, other = arrival(merged, between, 0.0) - middle, arrival(merged, s1, 0.0) - end
    if max(abs(error), abs(other)) > tolerance * length:
        return False
    merged[SIGMA] -= 0.5 * (max(error, other, 0.0) + min(error, other, 0.0))
    for i in range(6):
        a[i] = merged[i]
    return True


@compiled
def straighten(w: Floats) -> None:
    """Replace a wave that would pass its focus in the face ahead by a straight one, nowhere nearer at the edge."""
    x, y = ray(w, 0.5 * (w[S0] + w[S1]))
    norm = np.sqrt(x * x + y * y)
    begin, end = arrival(w, w[S0], 0.0), arrival(w, w[S1], 0.0)
    w[P], w[Q], w[KIND] = x / norm, y / norm, BEAM
    w[SIGMA] = max(begin - w[S0] * w[P], end - w[S1] * w[P])


@compiled
def clip(s0: float, s1: float, at_start: float, slope: float) -> tuple[float, float]:
    """Return the part of [s0, s1] where ``at_start + slope s ≤ 0``."""
    if slope > 0.0:
        s1 = min(s1, -at_start / slope)
    elif slope < 0.0:
        s0 = max(s0, -at_start / slope)
    elif at_start > 0.0:
        s1 = s0 - 1.0
    return s0, s1


@compiled
def hit(x0: float, dx: float, dy: float, ax: float, ay: float, bx: float, by: float) -> float:
    """Return the fraction of the way from a to b at which the ray from (x0, 0) along (dx, dy) meets their line."""
    ex, ey = bx - ax, by - ay
    det = dx * ey - dy * ex
    if det == 0.0:
        return 0.0
    return min(max((dy * (ax - x0) - dx * ay) / det, 0.0), 1.0)


BYTES_PER_WINDOW = 56.0
"""Size of a row of windows, and of the link to the next."""


class Faces(NamedTuple):
    """An intrinsic mesh as plain arrays, with the halfedges of each edge and the corners at each vertex in lists."""

    vertices: Ints
    positions: Complexes
    edges: Ints
    forward: Bools
    edge_vertices: Ints
    lengths: Floats
    halfedges: Ints
    first_halfedge: Ints
    corners: Ints
    first_corner: Ints

    @classmethod
    def of(cls, triangles: IntrinsicMesh) -> Faces:
        """Collect the arrays of an intrinsic mesh."""
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
    """The state of a search: distances so far, and windows in lists by halfedge, queued to go on or settled.

    Windows are rows of one array; `following` links those of a list, and those that are free. Row 0 is for scratch. The
    queue holds halfedges, followed by vertices that paths bend around. `counts` are those at `USED`, `FREE`, ….
    """

    distance: Floats
    pseudosources: Bools
    queue: Queue
    queued: Ints
    settled: Ints
    windows: Floats
    following: Ints
    counts: Ints

    @classmethod
    def start(cls, n_faces: int, pseudosources: Bools, room: int) -> Search:
        """Start with nothing known, and room for this many windows."""
        n = len(pseudosources)
        lists = np.full(3 * n_faces, -1), np.full(3 * n_faces, -1)
        windows, following = np.empty((room, 6)), np.empty(room, dtype=np.int64)
        counts = np.array([1, -1, 0, 0])
        return cls(np.full(n, np.inf), pseudosources, Queue.empty(3 * n_faces + n), *lists, windows, following, counts)

    def larger(self) -> Search:
        """Enlarge this search to at least the room that was wanted, in place: a copy would need twice the memory."""
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
"""Rows ever used, the first free row among them, windows made so far, and rows that were missing."""


@compiled
def has_room(counts: Ints, size: int, n: int) -> bool:
    """Return whether n more windows fit into an array of this many rows; otherwise note how many were wanted."""
    if counts[USED] + n <= size:
        return True
    counts[WANTED] = n
    return False


@compiled
def take_row(counts: Ints, following: Ints) -> int:
    """Take a row for a window; there must be room."""
    row = counts[FREE]
    if row >= 0:
        counts[FREE] = following[row]
    else:
        row = counts[USED]
        counts[USED] += 1
    return int(row)


@compiled
def free_row(counts: Ints, following: Ints, row: int) -> None:
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
    """Propagate distance across a side of a face, from within, to the faces beyond; do nothing where there is no room.

    In the layout of the face, the interval of the side from fraction t0 to t1 sees the source, which is a point whose
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
def _reach_corners(faces: Faces, distance: Floats, face: int, start: complex, end: complex) -> None:
    """Lower the distance of the corners of a face to that from a segment or a point in it."""
    along = end - start
    square = abs(along) ** 2
    for k in range(3):
        v, r = faces.vertices[face, k], faces.positions[face, k] - start
        t = min(max((r * along.conjugate()).real / square, 0.0), 1.0) if square > 0.0 else 0.0
        distance[v] = min(distance[v], abs(r - t * along))


@compiled
def _first_beam(faces: Faces, search: Search, face: int, start: complex, end: complex, slack: float) -> None:
    """Send a parallel beam from a segment in a face, to the left of it, to the sides of the face that it meets."""
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
    """Send circular waves from a point in a face, in directions of more than 90° from two given ones."""
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
