"""Distance on a polyhedral surface from line segments and points in its faces, exact or within a tolerance.

Windows propagate from face to face in order of distance (Mitchell, Mount & Papadimitriou 1987; Chen & Han 1990), and
windows that a path through a vertex undercuts are dropped (Xin & Wang 2009). A window is an interval of an edge whose
points see one source along straight lines. The source is a point or, since segments are sources, too, a parallel beam
perpendicular to a segment. Each vertex splits windows, so that their number per edge would grow with distance.
Therefore neighbouring windows are merged if one circular or straight wave front approximates them (Surazhsky et al.
2005), and the work stays in proportion to the number of faces.

In the frame of an edge, its tail is at the origin and its head on the positive x axis. Waves arrive from below, from
negative y. A window is a row ``(s0, s1, p, q, sigma, kind)`` with the interval [s0, s1] of the edge and the wave:

* Kind `POINT` is a circular wave from the point (p, q ≤ 0), whose own distance is σ.
* Kind `FOCUS` is a circular wave that contracts to the point (p, q ≥ 0), whose distance would be σ.
* Kind `BEAM` is a straight wave along the unit vector (p, q > 0), whose distance at the tail of the edge is σ.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from ..arrays import Bools, Complexes, Floats, Ints, read_only
from ..compiled import compiled
from ..jobs import report_again
from ..memory import refuse_beyond_memory
from ..mesh.components import grouped
from ..mesh.conforming_refinement import cut_along, flip_new_faces
from ..mesh.intrinsic_mesh import IntrinsicMesh
from .geodesic_sources import GeodesicSources, PlacedSegments, as_curve, nearest_shares, through_vertices, zero_line
from .heap_kernels import Queue, pop, push


def distance_to_zero_line(triangles: IntrinsicMesh, values: Floats, tolerance: float = 1e-4) -> tuple[Floats, int]:
    """Return (n,) distances of vertices to the zero set of a function linear in faces, and the number of windows made.

    `values` are those of the function at vertices, (n,). Each merge of windows changes distances by less than
    `tolerance` times the length of their edge. A search is cut short after `window_limit` windows, and then returns
    that number. Distances it has not found are lengths of paths along edges, which are too long.
    """
    values = cleared(triangles, values, 1e-7 * float(triangles.lengths_of_edges.mean()))
    return distance_to_segments(triangles, zero_line(triangles, values), tolerance)


def distance_to_segments(
    triangles: IntrinsicMesh,
    placed: PlacedSegments,
    tolerance: float = 1e-4,
    reach: float = np.inf,
) -> tuple[Floats, int]:
    """Return (n,) distances of vertices to segments and points, and the number of windows; see `distance_to_zero_line`.

    Distances are infinite beyond `reach`, and the work is in proportion to the number of faces within it.
    """
    limit = window_limit(triangles)
    placed = through_vertices(triangles, placed)
    # a longer search is started anew in Delaunay triangles, since long edges of slivers see every segment of a curve
    many = min(30 * triangles.n_edges + 50_000, limit)
    search = PausedSearch.start(triangles, placed, tolerance, reach).until(many)
    better = None if search.has_ended else in_delaunay_triangles(triangles, placed)
    if better is not None:
        anew = PausedSearch.start(*better, tolerance, reach).until(limit)
        search = anew if anew.has_ended else search
    search = search.until(limit)
    windows = min(search.windows, limit - 1) if search.has_ended else limit
    return search.distance()[: triangles.n_vertices], windows


def cleared(triangles: IntrinsicMesh, values: Floats, least: float) -> Floats:
    """Return (n,) values at vertices, with those near zero replaced by ±`least`, so that no vertex is in the zero set.

    The sign is the one that fewer of the neighbours have.
    """
    near = np.abs(values) < least
    signs = np.where(near | np.isnan(values), 0.0, np.sign(values))
    tail, head = triangles.edges.vertices.T
    around = np.bincount(tail, signs[head], len(values)) + np.bincount(head, signs[tail], len(values))
    return np.where(near, np.where(around > 0, -least, least), values)


def is_pseudosource(triangles: IntrinsicMesh) -> Bools:
    """Return (n,) bool, true for vertices through which shortest paths can pass.

    These are on a boundary or at edges of three or more faces, or their total angle exceeds 2π.
    """
    angles = np.arctan2(1.0, triangles.corner_cotangents)
    total = np.bincount(triangles.corner_vertices.ravel(), angles.ravel(), triangles.n_vertices)
    special = total > 2 * np.pi + 1e-9
    special[triangles.edges.vertices[triangles.edges.face_counts != 2]] = True
    return special


def window_limit(triangles: IntrinsicMesh) -> int:
    """Return the number of windows after which a search is cut short.

    On smooth surfaces there are usually ten for each edge. On small meshes with many sheets there may be far more.
    """
    return min(3000 * triangles.n_faces, 100 * triangles.n_edges + 4_000_000)


@dataclass(frozen=True, eq=False)
class PausedSearch:
    """A search for distances that runs in short calls of compiled kernels, so that it can be ended between them."""

    triangles: IntrinsicMesh
    faces: Faces  # the triangles as plain arrays
    search: Search  # the state of the search, which is changed in place
    tolerance: float  # see `distance_to_zero_line`
    reach: float  # the distance at which the search ends

    @classmethod
    def start(
        cls, triangles: IntrinsicMesh, placed: PlacedSegments, tolerance: float, reach: float = np.inf
    ) -> PausedSearch:
        """Make a search whose first windows and distances are those of the waves that leave the sources.

        It ends at the distance `reach`, and `tolerance` is that of `distance_to_zero_line`.
        """
        sources, pseudosources = placed.sources(triangles), is_pseudosource(triangles)
        pseudosources[sources.vertices] = True
        with np.errstate(all="ignore"):  # on faces of no size: `propagate_across` drops NaN
            waves = first_waves(triangles, sources)
        beyond = triangles.edges.face_counts[triangles.edges.face_edges.ravel()[waves.halfedges]]
        search = Search.start(triangles, pseudosources, 1024 + int(beyond.sum()))
        search.distance[sources.vertices] = 0.0
        reach_corners(triangles, sources, search.distance)
        started = cls(triangles, Faces.of(triangles), search, tolerance, reach)
        start_search(started.faces, waves, search, started.slack)
        return started

    @property
    def slack(self) -> float:
        """Difference, relative to the length of an edge, by which a path must be longer than another to be dropped."""
        return DISTANCE_ROUNDING + 2.0 * self.tolerance

    @property
    def has_ended(self) -> bool:
        """Whether no window and no vertex within reach is left to propagate."""
        return not is_waiting(self.search.queue, self.reach)

    @property
    def windows(self) -> int:
        """Number of windows made so far."""
        return int(self.search.counts[WINDOWS_MADE])

    def until(self, limit: int) -> PausedSearch:
        """Continue this search to its end, or until `limit` windows have been made, and return it."""
        search = self.search
        while not self.has_ended and search.counts[WINDOWS_MADE] < limit:
            report_again()
            if search.counts[MISSING_ROWS]:
                search.larger().counts[MISSING_ROWS] = 0
            most = min(search.counts[WINDOWS_MADE] + (1 << 16), limit)
            continue_search(self.faces, search, self.slack, self.tolerance, self.reach, most)
        return self

    def distance(self) -> Floats:
        """Return (n,) distances of vertices, infinite beyond reach.

        If the search has not reached a vertex, its distance is the length of a path along edges.
        """
        distance = np.maximum(self.search.distance, 0.0)  # merging windows can make distances slightly negative
        if np.isfinite(self.reach) and self.has_ended:
            return np.where(distance <= self.reach, distance, np.inf)
        if self.has_ended and np.isfinite(distance).all():
            return distance
        reached = np.flatnonzero(np.isfinite(distance))
        along = distances_along_edges(self.triangles, reached, distance[reached])
        # a search that has ended has not reached other components, nor what lies beyond edges as short as rounding
        return np.where(np.isinf(distance), along, distance) if self.has_ended else along


def distances_along_edges(triangles: IntrinsicMesh, vertices: Ints, offsets: Floats) -> Floats:
    """Return (n,) lengths of shortest paths along edges from k vertices that are at distances `offsets`, (k,).

    They are infinite for vertices that no path reaches.
    """
    n = triangles.n_vertices
    tails, heads = np.concatenate([triangles.edges.vertices, np.stack([np.full(len(vertices), n), vertices], axis=1)]).T
    graph = shortest_arcs(tails, heads, np.concatenate([triangles.lengths_of_edges, offsets]), n + 1)
    return dijkstra(graph, directed=False, indices=n)[:n]


def shortest_arcs(tails: Ints, heads: Ints, lengths: Floats, n: int) -> csr_matrix:
    """Return the sparse (n, n) matrix of the lengths of arcs between n nodes, the shortest of several between two."""
    order = np.lexsort([lengths, heads, tails])
    tails, heads, lengths = tails[order], heads[order], lengths[order]
    first = np.ones(len(order), dtype=bool)
    first[1:] = (np.diff(tails) != 0) | (np.diff(heads) != 0)
    entries = lengths[first] + 1e-300, (tails[first], heads[first])  # so that arcs of length 0 are not taken for none
    return csr_matrix(entries, shape=(n, n))


def in_delaunay_triangles(
    triangles: IntrinsicMesh, placed: PlacedSegments
) -> tuple[IntrinsicMesh, PlacedSegments] | None:
    """Return the surface with Delaunay triangles, and the sources along their edges.

    Returns None if most edges are Delaunay already, or the sources cannot be moved to edges.
    """
    if not triangles.agree_on_lengths or share_to_flip(triangles) < 0.05:
        return None
    curve = as_curve(triangles, placed)
    if curve is None:
        return None
    finer, merged, _, _ = cut_along(triangles, [curve])
    flipped, merged = flip_new_faces(finer, merged, np.ones(finer.n_faces, dtype=bool))
    return flipped, PlacedSegments.of(flipped, merged.parts([False]))


def share_to_flip(triangles: IntrinsicMesh) -> float:
    """Return the share of edges that are not Delaunay, since their opposite angles in two faces sum to more than π."""
    opposite = np.roll(triangles.corner_cotangents, 1, axis=1)  # the corner facing edge k is k + 2
    sums = np.bincount(triangles.edges.face_edges.ravel(), opposite.ravel(), triangles.n_edges)
    return float(((sums < -1e-9) & (triangles.edges.face_counts == 2)).mean())


DISTANCE_ROUNDING = 1e-10
"""Difference of distances, relative to the length of an edge, up to which it is rounding error."""


@compiled
def _reach(search: Search, v: int, length: float) -> None:
    """Record a path of a given length to vertex v if it is the shortest so far; queue v if paths can bend around it."""
    if length < search.distance[v] * (1.0 - 1e-14):
        search.distance[v] = length
        if search.pseudosources[v]:
            push(search.queue, len(search.queued) + v, length)


@compiled
def _collect(
    search: Search, halfedge: int, at_tail: float, at_head: float, length: float, slack: float, tolerance: float
) -> tuple[Floats, int]:
    """Take the windows queued for a halfedge out of their list, and return those that are nearest to some source.

    `at_tail` and `at_head` are distances of the ends of the edge, and `length` its length. Windows are trimmed where
    others are nearer, sorted along the edge, and merged if that changes distances by at most `tolerance` times the
    length. They are dropped if paths through an end of the edge are shorter by more than `slack`, a length. Returns
    rows of windows, and how many of the rows are used.
    """
    queued, settled, windows, following, counts = (
        search.queued,
        search.settled,
        search.windows,
        search.following,
        search.counts,
    )
    count, before = list_length(following, queued[halfedge]), list_length(following, settled[halfedge])
    # each window is compared with all others: for four windows, this counts as the work of making one
    counts[WINDOWS_MADE] += count * (count + before) // 16
    # what is left of each, sorted by where it begins
    chosen = np.empty((count, 6))
    count, row = 0, queued[halfedge]
    while row >= 0:
        w = windows[row]
        is_left, old = not outrun(w, at_tail, at_head, length, slack), settled[halfedge]
        while is_left and old >= 0:
            trim_by(windows[old], w, DISTANCE_ROUNDING * length)
            is_left, old = w[S1] - w[S0] > 1e-12 * length, following[old]
        if is_left:
            k = count
            while k > 0 and chosen[k - 1, S0] > w[S0]:
                put(chosen[k - 1], chosen, k)
                k -= 1
            put(w, chosen, k)
            count += 1
        after = following[row]
        free_row(counts, following, row)
        row = after
    queued[halfedge] = -1
    # trim and merge successive ones; the first `kept` rows are done
    kept = 0
    for k in range(count):
        if kept > 0:
            trim(chosen[kept - 1], chosen[k])
            if chosen[kept - 1, S1] <= chosen[kept - 1, S0]:
                kept -= 1
        if chosen[k, S1] <= chosen[k, S0]:
            continue
        if tolerance > 0.0 and kept > 0 and merge(chosen[kept - 1], chosen[k], length, tolerance):
            continue
        put(chosen[k], chosen, kept)
        kept += 1
    return chosen, kept


@compiled
def _settle(search: Search, halfedge: int, chosen: Floats, count: int) -> None:
    """Add the first `count` rows of `chosen` to the windows that have crossed a halfedge.

    Windows that crossed it before, and are farther than a new one all along, are dropped.
    """
    settled, windows, following, counts = search.settled, search.windows, search.following, search.counts
    row, before = settled[halfedge], -1
    while row >= 0:
        after, outdone = following[row], False
        for k in range(count):
            outdone = outdone or outdoes(chosen[k], windows[row])
        if not outdone:
            before = row
        elif before < 0:
            settled[halfedge] = after
        else:
            following[before] = after
        if outdone:
            free_row(counts, following, row)
        row = after
    for k in range(count):
        row = take_row(counts, following)
        put(chosen[k], windows, row)
        following[row] = settled[halfedge]
        settled[halfedge] = row


@compiled
def list_length(following: Ints, row: int) -> int:
    """Return the number of windows in the linked list whose first row is `row`, −1 for an empty list."""
    count = 0
    while row >= 0:
        count += 1
        row = following[row]
    return count


@compiled
def is_waiting(queue: Queue, reach: float) -> bool:
    """Return whether something is queued whose distance is at most `reach`."""
    return bool(queue.size[0] > 0 and queue.keys[queue.items[0]] <= reach)


@compiled
def continue_search(faces: Faces, search: Search, slack: float, tolerance: float, reach: float, limit: int) -> None:
    """Propagate in order of distance, up to `reach`, until rows are missing or `limit` windows have been made.

    Windows are dropped if other paths are shorter by more than `slack`, and merged if that changes distances by at most
    `tolerance`, both relative to the length of the edge. If rows for windows are missing, their number is written to
    ``search.counts[MISSING_ROWS]``.
    """
    queue, counts = search.queue, search.counts
    while is_waiting(queue, reach) and counts[WINDOWS_MADE] < limit:
        item = queue.items[0]
        is_halfedge, most = item < len(search.queued), search.most[item]
        if is_halfedge:
            most *= list_length(search.following, search.queued[item])
        if counts[USED_ROWS] + most > len(search.windows):
            counts[MISSING_ROWS] = most
            return
        pop(queue)
        if is_halfedge:
            _cross_face(faces, search, item, slack, tolerance)
        else:
            _bend_around(faces, search, item - len(search.queued), slack)


@compiled
def _bend_around(faces: Faces, search: Search, v: int, slack: float) -> None:
    """Propagate circular waves from vertex v, around which paths can bend, along its edges and across its faces."""
    for k in range(faces.first_corner[v], faces.first_corner[v + 1]):
        face, corner = faces.corners[k] // 3, faces.corners[k] % 3
        source = faces.positions[face, corner]
        for step in range(1, 3):
            end = (corner + step) % 3
            length = search.distance[v] + abs(faces.positions[face, end] - source)
            _reach(search, faces.vertices[face, end], length)
        side = (corner + 1) % 3
        propagate_across(faces, search, face, side, POINT, 0.0, 1.0, source, 0j, search.distance[v], slack)


@compiled
def _cross_face(faces: Faces, search: Search, halfedge: int, slack: float, tolerance: float) -> None:
    """Propagate the windows queued at a halfedge through its face, to the opposite corner and the two other sides."""
    face, side = halfedge // 3, halfedge % 3
    edge = faces.edges[face, side]
    length = faces.lengths[edge]
    tail, head = faces.edge_vertices[edge]
    at_tail, at_head = search.distance[tail], search.distance[head]
    front, n_front = _collect(search, halfedge, at_tail, at_head, length, slack * length, tolerance)
    _settle(search, halfedge, front, n_front)

    # the frame of the edge in the layout of the face, and the position in that frame of the corner across, the apex
    a, b = faces.positions[face, side], faces.positions[face, (side + 1) % 3]
    ahead = faces.forward[face, side]
    origin, unit = (a, (b - a) / length) if ahead else (b, (a - b) / length)
    up = 1j if ahead else -1j  # faces lie to the left of their sides
    apex = (faces.positions[face, (side + 2) % 3] - origin) * unit.conjugate()
    x, y = apex.real, abs(apex.imag)
    beyond, before = (side + 1) % 3, (side + 2) % 3
    tail_side, head_side = (before, beyond) if ahead else (beyond, before)
    for k in range(n_front):
        w = front[k]
        if w[KIND] == FOCUS and w[Q] <= y:
            straighten(w)
        # the rays at both ends of the window, and on which side of the apex they pass
        s0, s1, kind = w[S0], w[S1], w[KIND]
        d0x, d0y = ray(w, s0)
        d1x, d1y = ray(w, s1)
        left = d0x * y - d0y * (x - s0)  # negative: the first ray leaves the apex to its right
        right = d1x * y - d1y * (x - s1)
        # if no ray meets the apex, which may be in a gap between windows, the path goes by way of an end of the window
        if left > 0.0:
            to_apex = arrival(w, s0, 0.0) + np.hypot(x - s0, y)
        elif right < 0.0:
            to_apex = arrival(w, s1, 0.0) + np.hypot(x - s1, y)
        else:
            to_apex = arrival(w, x, y)
        _reach(search, faces.vertices[face, before], to_apex)
        # the wave in the layout of the face, and the parts of the other two sides between the rays, t0 to t1
        way = unit * (w[P] + up * w[Q])
        source, normal = (origin, way) if kind == BEAM else (origin + way, 0j)
        if left < 0.0:  # from the tail towards the apex
            t0 = hit(s0, d0x, d0y, 0.0, 0.0, x, y)
            t1 = hit(s1, d1x, d1y, 0.0, 0.0, x, y) if right < 0.0 else 1.0
            t0, t1 = (1.0 - t1, 1.0 - t0) if ahead else (t0, t1)
            propagate_across(faces, search, face, tail_side, kind, t0, t1, source, normal, w[SIGMA], slack)
        if right > 0.0:  # from the apex towards the head
            t0 = hit(s0, d0x, d0y, x, y, length, 0.0) if left > 0.0 else 0.0
            t1 = hit(s1, d1x, d1y, x, y, length, 0.0)
            t0, t1 = (1.0 - t1, 1.0 - t0) if ahead else (t0, t1)
            propagate_across(faces, search, face, head_side, kind, t0, t1, source, normal, w[SIGMA], slack)


POINT, BEAM, FOCUS = 1.0, 0.0, -1.0
"""Kinds of waves. The values are signs by which `arrival` multiplies the distance from the point of a circular wave."""

S0, S1, P, Q, SIGMA, KIND = range(6)
"""Columns of the row of a window.

S0 and S1 are positions along its edge at which it begins and ends. P and Q are the direction of a straight wave, or the
centre of a circular one, in the frame of the edge. SIGMA is the distance at the origin or at the centre."""


@compiled
def put(window: Floats, rows: Floats, k: int) -> None:
    """Write a window to row k, entry by entry, since assignments to slices of arrays take long to compile."""
    for i in range(6):
        rows[k, i] = window[i]


@compiled
def arrival(w: Floats, x: float, y: float) -> float:
    """Return the distance of a point (x, y), in the frame of the edge of a window, from the source of the window."""
    if w[KIND] == BEAM:
        return w[SIGMA] + w[P] * x + w[Q] * y
    return w[SIGMA] + w[KIND] * np.sqrt((x - w[P]) ** 2 + (y - w[Q]) ** 2)


@compiled
def ray(w: Floats, x: float) -> tuple[float, float]:
    """Return a vector, of any length, in the direction in which the wave of a window crosses point x of its edge."""
    if w[KIND] == BEAM:
        return w[P], w[Q]
    return w[KIND] * (x - w[P]), -w[KIND] * w[Q]


@compiled
def outrun(w: Floats, at_tail: float, at_head: float, length: float, slack: float) -> bool:
    """Return whether paths through an end of the edge are shorter, by more than `slack`, at all points of a window.

    `at_tail` and `at_head` are the distances of the ends, and `length` is that of the edge.
    """
    if at_tail + w[S1] < arrival(w, w[S1], 0.0) - slack:
        return True
    return at_head + length - w[S0] < arrival(w, w[S0], 0.0) - slack


@compiled
def trim(a: Floats, b: Floats) -> None:
    """Trim two overlapping windows in place to the parts in which each has the smaller distance; a begins first.

    No window is divided: if b is nearer in the middle of a, both stay. The nearer one at both ends of their common part
    keeps it; if these differ, bisection finds where the distances are equal.
    """
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
    """Shorten window w, in place, where it is not nearer by more than `slack` than an older window.

    It is shortened at one end only, or removed, but no gap is cut into its middle. `first` and `last` say whether w is
    not nearer at the ends of the common part; if these differ, bisection finds where that changes.
    """
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
    """Return whether window w covers an older one, and is as near at both ends and in the middle of that."""
    if w[S0] > old[S0] or w[S1] < old[S1]:
        return False
    for k in range(3):
        x = old[S0] + 0.5 * k * (old[S1] - old[S0])
        if arrival(w, x, 0.0) > arrival(old, x, 0.0):
            return False
    return True


NEAREST_FOCUS = 4.0
"""Windows are not merged if their wave contracts to a focus nearer than this, in lengths of the edge."""


@compiled
def merge(a: Floats, b: Floats, length: float, tolerance: float) -> bool:
    """Merge window b into a, in place, if they are neighbours and one wave approximates both; return whether it does.

    The error at the ends and between the windows is at most `tolerance` times the `length` of the edge.
    """
    if abs(a[S1] - b[S0]) > 1e-6 * length:
        return False
    s0, between, s1 = a[S0], a[S1], b[S1]
    # the merged wave has the rays of a at its beginning and of b at its end: its centre is where these meet, or it is a
    # beam where they are nearly parallel
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
        to_centre = (s1 - s0) * by / turn  # along the ray, so that it is negative if the centre is a source
        if 0.0 < to_centre < NEAREST_FOCUS * length:
            return False
        merged[P], merged[Q] = s0 + to_centre * ax, to_centre * ay
        merged[KIND] = POINT if to_centre < 0.0 else FOCUS
        merged[SIGMA] = begin + to_centre
    # errors are 0 at the beginning; the middle of their range is taken off all distances
    error, end_error = arrival(merged, between, 0.0) - middle, arrival(merged, s1, 0.0) - end
    if max(abs(error), abs(end_error)) > tolerance * length:
        return False
    merged[SIGMA] -= 0.5 * (max(error, end_error, 0.0) + min(error, end_error, 0.0))
    for i in range(6):
        a[i] = merged[i]
    return True


@compiled
def straighten(w: Floats) -> None:
    """Replace the wave of a window by a straight one, in place, that is not nearer at the ends of the window.

    This is for waves that would contract to their focus in the face ahead.
    """
    x, y = ray(w, 0.5 * (w[S0] + w[S1]))
    norm = np.sqrt(x * x + y * y)
    begin, end = arrival(w, w[S0], 0.0), arrival(w, w[S1], 0.0)
    w[P], w[Q], w[KIND] = x / norm, y / norm, BEAM
    w[SIGMA] = max(begin - w[S0] * w[P], end - w[S1] * w[P])


@compiled
def hit(x0: float, dx: float, dy: float, ax: float, ay: float, bx: float, by: float) -> float:
    """Return the fraction, from 0 to 1, of segment ab at which the ray from (x0, 0) along (dx, dy) meets its line."""
    ex, ey = bx - ax, by - ay
    det = dx * ey - dy * ex
    if det == 0.0:
        return 0.0
    return min(max((dy * (ax - x0) - dx * ay) / det, 0.0), 1.0)


class Faces(NamedTuple):
    """An intrinsic mesh as plain arrays, with lists of the halfedges of each edge and of the corners at each vertex."""

    vertices: Ints  # (m, 3) vertex at each corner
    positions: Complexes  # (m, 3) position of each corner in the layout of the face
    edges: Ints  # (m, 3) edge along each side
    forward: Bools  # (m, 3) whether the side runs along that edge from tail to head
    edge_vertices: Ints  # (e, 2) tail and head of each edge
    lengths: Floats  # (e,) length of each edge
    halfedges: Ints  # (3m,) those of edge e are halfedges[first_halfedge[e] : first_halfedge[e + 1]]
    first_halfedge: Ints  # (e + 1,) offsets of the halfedges of each edge
    corners: Ints  # (3m,) corners 3 f + k; those at vertex v are corners[first_corner[v] : first_corner[v + 1]]
    first_corner: Ints  # (n + 1,) offsets of the corners at each vertex

    @classmethod
    def of(cls, triangles: IntrinsicMesh) -> Faces:
        """Make the arrays and lists for an intrinsic mesh."""
        table, (first_halfedge, halfedges) = triangles.edges, triangles.edges.halfedges
        first_corner, corners = grouped(triangles.corner_vertices.ravel(), triangles.n_vertices)
        corner_vertices, ends = (np.ascontiguousarray(ids) for ids in (triangles.corner_vertices, table.vertices))
        corners_and_edges = read_only(corner_vertices), triangles.corner_positions, table.face_edges, table.forward
        lists = halfedges, first_halfedge, corners, first_corner
        return cls(*corners_and_edges, ends, triangles.lengths_of_edges, *lists)


class Search(NamedTuple):
    """State of a search, with distances so far, and lists of windows that wait at each halfedge or have crossed it.

    Windows are rows of one array, in linked lists. One more list has the free rows. Row 0 is a work array. Items of the
    queue are the 3m halfedges, followed by the n vertices, of which only those around which paths bend are queued.
    """

    distance: Floats  # (n,) shortest distance of each vertex so far, or infinity
    pseudosources: Bools  # (n,) whether paths can bend around each vertex
    queue: Queue  # items in order of the distance at which they propagate
    queued: Ints  # (3m,) first row of the windows that wait at each halfedge, or −1
    settled: Ints  # (3m,) first row of the windows that have crossed each halfedge, or −1
    windows: Floats  # (r, 6) rows of windows
    following: Ints  # (r,) the next row of the same list, or −1
    counts: Ints  # (4,) numbers at the indices `USED_ROWS` and following
    most: Ints  # (3m + n,) largest number of windows that each item makes; for a halfedge, from each of its windows

    @classmethod
    def start(cls, triangles: IntrinsicMesh, pseudosources: Bools, room: int) -> Search:
        """Return the state before the first wave, with room for `room` windows."""
        n, m = triangles.n_vertices, triangles.n_faces
        queue, lists = Queue.empty(3 * m + n), (np.full(3 * m, -1), np.full(3 * m, -1))
        windows, following = np.empty((room, 6)), np.empty(room, dtype=np.int64)
        counts = np.array([1, -1, 0, 0])  # the work row is in use, no row is free
        # waves go on into the faces at other sides; from a vertex, at opposite sides, k + 1 of corner k
        faces_at_sides = triangles.edges.face_counts[triangles.edges.face_edges]
        of_vertices = np.bincount(triangles.corner_vertices.ravel(), np.roll(faces_at_sides, -1, axis=1).ravel(), n)
        most = np.concatenate([np.repeat(1 + faces_at_sides.sum(axis=1), 3), of_vertices.astype(np.int64)])
        return cls(np.full(n, np.inf), pseudosources, queue, *lists, windows, following, counts, most)

    def larger(self) -> Search:
        """Enlarge the arrays of windows in place by at least the missing rows; a copy would need twice the memory."""
        room = len(self.windows) + max(len(self.windows) // 2, int(self.counts[MISSING_ROWS]))
        refuse_beyond_memory(
            "exact distance along the surface",
            room - len(self.windows),
            lambda number: 56.0 * number,  # bytes of a row of windows, and of the link to the next
            lambda _: "use a coarser mesh, and merge faces that lie on each other",
        )
        for array in (self.windows, self.following):
            array.resize((room, *array.shape[1:]), refcheck=False)
        return self


USED_ROWS, FIRST_FREE, WINDOWS_MADE, MISSING_ROWS = range(4)
"""Indices in `Search.counts` of the number of rows ever used, the first free row, and the numbers of windows made and
of missing rows."""


@compiled
def take_row(counts: Ints, following: Ints) -> int:
    """Take a free row for a new window, and return it; there must be room."""
    row = counts[FIRST_FREE]
    if row >= 0:
        counts[FIRST_FREE] = following[row]
    else:
        row = counts[USED_ROWS]
        counts[USED_ROWS] += 1
    return int(row)


@compiled
def free_row(counts: Ints, following: Ints, row: int) -> None:
    """Add a row to the list of free rows."""
    following[row] = counts[FIRST_FREE]
    counts[FIRST_FREE] = row


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
    """Propagate a wave across a side of a face, between fractions t0 and t1 of it, to the faces beyond.

    A circular wave comes from `point`, or contracts to it. A beam passes `point` in the direction of the unit vector
    `normal`. Both are in the layout of the face, and `sigma` is the distance at `point`. Nothing is propagated if paths
    through an end of the edge are shorter by more than `slack`, relative to its length.
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
    queue, queued, windows, following, counts = (
        search.queue,
        search.queued,
        search.windows,
        search.following,
        search.counts,
    )
    # the window in the frame of the edge, in the work row
    w = windows[0]
    w[S0], w[S1], w[KIND] = t0 * length, t1 * length, kind
    unit = (b - a) / length
    if kind == BEAM:
        in_frame = normal * unit.conjugate()
        w[P], w[Q] = in_frame.real, abs(in_frame.imag)
        w[SIGMA] = sigma - ((point - a) * normal.conjugate()).real
    else:
        in_frame = (point - a) * unit.conjugate()
        w[P], w[Q], w[SIGMA] = in_frame.real, -kind * abs(in_frame.imag), sigma
    tail, head = faces.edge_vertices[edge]
    if outrun(w, search.distance[tail], search.distance[head], length, slack * length):
        return
    near = min(arrival(w, w[S0], 0.0), arrival(w, w[S1], 0.0))
    if not near < np.inf:
        return
    # it waits at all other halfedges of the edge, long enough for others to arrive there with which it can be merged
    for k in range(begin, end):
        halfedge = faces.halfedges[k]
        if halfedge != 3 * face + side:
            row = take_row(counts, following)
            put(w, windows, row)
            following[row] = queued[halfedge]
            queued[halfedge] = row
            counts[WINDOWS_MADE] += 1
            if queue.places[halfedge] < 0:
                push(queue, halfedge, near + 1.5 * length)


@compiled
def start_search(faces: Faces, waves: Waves, search: Search, slack: float) -> None:
    """Make the windows of the first waves, and queue vertices with a known distance around which paths can bend."""
    for i in range(len(waves.halfedges)):
        face, side = waves.halfedges[i] // 3, waves.halfedges[i] % 3
        kind, t0, t1 = waves.kinds[i], waves.begins[i], waves.ends[i]
        propagate_across(faces, search, face, side, kind, t0, t1, waves.points[i], waves.normals[i], 0.0, slack)
    for v in range(len(search.distance)):
        if search.pseudosources[v] and search.distance[v] < np.inf:
            push(search.queue, len(search.queued) + v, search.distance[v])


class Waves(NamedTuple):
    """w waves that leave sources, each through a part of one side of a face, as arguments of `propagate_across`."""

    halfedges: Ints  # (w,) 3 f + k for side k of face f
    kinds: Floats  # (w,) POINT or BEAM
    # (w,) fractions of the side between which they pass
    begins: Floats
    ends: Floats
    points: Complexes  # (w,) point from which a circular wave comes, or which a beam passes
    normals: Complexes  # (w,) direction of a beam


def reach_corners(triangles: IntrinsicMesh, sources: GeodesicSources, distance: Floats) -> None:
    """Lower (n,) distances of the corners of faces, in place, to those from the segments and points in the faces."""
    faces = np.concatenate([sources.beam_faces, sources.fan_faces])
    starts = np.concatenate([sources.beam_starts, sources.fan_points])[:, None]
    steps = np.concatenate([sources.beam_stops, sources.fan_points])[:, None] - starts
    _, gaps = nearest_shares(triangles.corner_positions[faces] - starts, steps)
    np.minimum.at(distance, triangles.corner_vertices[faces], gaps)


def first_waves(triangles: IntrinsicMesh, sources: GeodesicSources) -> Waves:
    """Return the waves that leave sources through sides of their faces.

    These are beams to the left of segments, as wide as the segment, and circular waves from points, in the directions
    that are more than 90° from both directions of the fan.
    """
    # beams: how far along the segment, and to its left, each side begins, and how fast that changes along the side
    faces, starts = sources.beam_faces, sources.beam_starts[:, None]
    lengths = np.abs(sources.beam_stops[:, None] - starts)
    along = (sources.beam_stops[:, None] - starts) / lengths
    tails, steps = triangles.corner_positions[faces] - starts, triangles.edge_vectors[faces]
    foot, rate, height, climb = (dot(v, way) for way in (along, 1j * along) for v in (tails, steps))
    apart = np.abs(height) + np.abs(climb) > 1e-9 * np.abs(steps)  # no beam from a segment on this side crosses it
    beams = parts_within(apart, (-foot, -rate), (foot - lengths, rate), (-height, -climb))

    # fans: how far each side begins along both directions, and how fast that changes along the side
    points = sources.fan_points[:, None]
    tails, steps = triangles.corner_positions[sources.fan_faces] - points, triangles.edge_vectors[sources.fan_faces]
    apart = dot(-tails, 1j * steps) > 1e-9 * np.abs(steps) ** 2
    ways = sources.fan_firsts[:, None], sources.fan_seconds[:, None]
    fans = parts_within(apart, *((dot(tails, way), dot(steps, way)) for way in ways))

    parts = []
    for kind, owners, (rows, sides, begins, ends), points, normals in (
        (BEAM, faces, beams, sources.beam_starts, 1j * along[:, 0]),
        (POINT, sources.fan_faces, fans, sources.fan_points, np.zeros_like(sources.fan_points)),
    ):
        parts.append((3 * owners[rows] + sides, np.full(len(rows), kind), begins, ends, points[rows], normals[rows]))
    return Waves(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))


def dot(a: Complexes, b: Complexes) -> Floats:
    """Return scalar products of plane vectors, given as complex numbers."""
    return (a * np.conj(b)).real


def parts_within(chosen: Bools, *bounds: tuple[Floats, Floats]) -> tuple[Ints, Ints, Floats, Floats]:
    """Return the parts of sides of faces on which linear inequalities hold.

    A part has the fractions s of a side, from 0 to 1, with ``a + b s ≤ 0`` for all bounds (a, b), where a, b and
    `chosen` are (k, 3). Returns rows, sides, and first and last fractions, for chosen sides with such a part.
    """
    begins, ends = np.zeros(chosen.shape), np.ones(chosen.shape)
    for at_tail, slope in bounds:
        zero = -at_tail / np.where(slope != 0, slope, 1.0)
        begins = np.where(slope < 0, np.maximum(begins, zero), begins)
        ends = np.where(slope > 0, np.minimum(ends, zero), np.where((slope == 0) & (at_tail > 0), -1.0, ends))
    rows, sides = np.nonzero(chosen & (ends > begins))
    return rows, sides, begins[rows, sides], ends[rows, sides]
