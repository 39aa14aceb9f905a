"""Geodesic paths: shortest paths across faces, between points that share no face.

A *sleeve* is a sequence of faces: each is left through a halfedge, and the next one entered through another halfedge of
the same edge. Halfedge ``3 f + k`` of face f runs from corner k to corner k + 1.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from ..arrays import Complexes, Floats, Ints
from ..compiled import compiled
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
from .geodesic_windows import Faces
from .heap_kernels import Queue, pop, push


def join(
    triangles: IntrinsicMesh, located: LocatedPoints, start: Ints, end: Ints, name: str
) -> tuple[LocatedPoints, Ints, Ints, Ints]:
    """Join pairs of points, by geodesic paths where the two share no face, as segments that lie in one face each.

    Returns all points, the given ones first; the two that each segment (s,) joins, in order; and the pair that it
    belongs to. `name` is what the points belong to, for messages.
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


def gaps(triangles: IntrinsicMesh, located: LocatedPoints, closed: bool) -> Ints:
    """Indices of the segments of a curve through points whose two ends share no face."""
    start = np.arange(len(located) if closed else len(located) - 1)
    return np.flatnonzero(shared_faces(triangles, located[start], located[(start + 1) % len(located)]) < 0)


def geodesic_paths(
    triangles: IntrinsicMesh, start: LocatedPoints, end: LocatedPoints, name: str = "curve"
) -> tuple[LocatedPoints, Ints]:
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


def faces_at(triangles: IntrinsicMesh, located: LocatedPoints) -> tuple[Ints, Complexes, Ints]:
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


TIE = 1e-9
"""How much dearer ways are through one edge than through another of the same length: of ways around a symmetric peak,
whose lengths differ by 1e-16, the same one is always found. Any number from 1e-12 to 1e-6 does."""


@compiled
def middle(faces: Faces, h: int) -> complex:
    """Midpoint of a halfedge, in the layout of its face."""
    return 0.5 * (faces.positions[h // 3, h % 3] + faces.positions[h // 3, (h % 3 + 1) % 3])


@compiled
def toll(e: int) -> float:
    """What a way through an edge costs in addition to its length: evenly spread numbers, by the golden ratio."""
    return 1.0 + TIE * ((e * 0.6180339887498949) % 1.0)


@compiled
def find_sleeve(
    faces: Faces,
    starts: Ints,
    start_points: Complexes,
    ends: Ints,
    end_points: Complexes,
    cost: Floats,
    leave: Ints,
    enter: Ints,
    queue: Queue,
) -> tuple[Ints, Ints]:
    """The faces between two sets of faces on the shortest path through midpoints of edges (Dijkstra).

    Returns the halfedges through which all faces but the last are left, and those through which all but the first are
    entered; empty if there is no path. `cost`, `leave`, `enter` and `queue` are work space, restored before returning.
    """
    edge_of, touched = faces.edges.ravel(), [0]
    touched.pop()
    for s in range(len(starts)):
        for k in range(3):
            h, e = 3 * starts[s] + k, edge_of[3 * starts[s] + k]
            d = abs(middle(faces, h) - start_points[s]) * toll(e)
            if d < cost[e]:
                cost[e], leave[e], enter[e] = d, h, -1
                touched.append(e)
                push(queue, e, d)
    best, last = np.inf, np.int64(-1)
    while queue.size[0] > 0:
        e = pop(queue)
        d = cost[e]
        if d >= best:
            break
        for k in range(faces.first_halfedge[e], faces.first_halfedge[e + 1]):
            h = faces.halfedges[k]
            if h == leave[e]:
                continue
            here = middle(faces, h)
            for s in range(len(ends)):
                if ends[s] == h // 3 and d + abs(here - end_points[s]) < best:
                    best, last = d + abs(here - end_points[s]), h
            for turn in range(1, 3):
                out = h - h % 3 + (h + turn) % 3
                to = edge_of[out]
                there = d + abs(middle(faces, out) - here) * toll(to)
                if there < cost[to]:
                    cost[to], leave[to], enter[to] = there, out, h
                    touched.append(to)
                    push(queue, to, there)
    n, h = 0, last
    while h >= 0:
        n, h = n + 1, enter[edge_of[h]]
    left, entered = np.empty(n, np.int64), np.empty(n, np.int64)
    while n > 0:
        n -= 1
        e = edge_of[last]
        entered[n], left[n] = last, leave[e]
        last = enter[e]
    for e in touched:
        cost[e], queue.places[e] = np.inf, -1
    queue.size[0] = 0
    return left, entered


@compiled
def unfold(faces: Faces, left: Ints, entered: Ints) -> tuple[Complexes, Ints, Complexes]:
    """Unfold a sleeve into the plane of its first face: tail and head of each halfedge left, and the last face.

    Also whether each face, the last one included, is turned over in that plane.
    """
    portals, over = np.empty((len(left), 2), np.complex128), np.zeros(len(left) + 1, np.int64)
    placed = faces.positions[left[0] // 3].copy()
    for i in range(len(left)):
        k, face, side = left[i] % 3, entered[i] // 3, entered[i] % 3
        portals[i, 0], portals[i, 1] = placed[k], placed[(k + 1) % 3]
        same = np.int64(faces.forward[left[i] // 3, k] == faces.forward[face, side])
        over[i + 1] = over[i] ^ same
        a, b = portals[i, 1 - same], portals[i, same]
        placed[side], placed[(side + 1) % 3] = a, b
        placed[(side + 2) % 3] = on_base(
            faces.positions[face], side, over[i + 1], faces.positions[face, (side + 2) % 3], a, b
        )
    return portals, over, placed


@compiled
def on_base(corners: Complexes, side: int, over: int, point: complex, a: complex, b: complex) -> complex:
    """Where a point of a face is if a side of the face is from a to b, and the face perhaps turned over."""
    base = corners[(side + 1) % 3] - corners[side]
    ratio = (point - corners[side]) / base if abs(base) > 0 else 0j
    return a + (np.conj(ratio) if over else ratio) * (b - a)


@compiled
def turns(a: complex, b: complex) -> float:
    """Cross product of plane vectors: positive where b is counter-clockwise of a."""
    return a.real * b.imag - a.imag * b.real


@compiled
def funnel(portals: Complexes, over: Ints, start: complex, end: complex) -> tuple[list[int], list[int], float]:
    """Shortest path inside an unfolded sleeve, by the simple stupid funnel algorithm.

    Returns the portals at which the path bends, whether it bends at their tail (0) or head (1), and its length.
    """
    bends, ends = [0], [0]
    bends.pop()
    ends.pop()
    rims, at = np.full(2, start), np.full(2, -1)  # of the funnel, right and left, and the portals they come from
    apex, total, i = start, 0.0, 0
    while i <= len(portals):
        for side in range(2):
            other, sign = 1 - side, 1.0 - 2.0 * side
            place = portals[i, side ^ over[i]] if i < len(portals) else end
            if sign * turns(rims[side] - apex, place - apex) < 0:
                continue
            if apex == rims[side] or sign * turns(rims[other] - apex, place - apex) < 0:
                if i < len(portals):
                    rims[side], at[side] = place, i
                continue
            i = at[other]
            bends.append(i)
            ends.append(other ^ over[i])
            total += abs(rims[other] - apex)
            apex = rims[side] = rims[other]
            at[side] = i
            break
        i += 1
    return bends, ends, total + abs(end - apex)


@compiled
def other_way(
    faces: Faces, left: Ints, entered: Ints, portals: Complexes, bend: int, point: complex
) -> tuple[Ints, Ints]:
    """The sleeve that passes the vertex of a bend on its other side; empty where no faces connect there."""
    first = last = bend
    while first > 0 and (portals[first - 1, 0] == point or portals[first - 1, 1] == point):
        first -= 1
    while last + 1 < len(left) and (portals[last + 1, 0] == point or portals[last + 1, 1] == point):
        last += 1
    goal, at_tail = entered[last] // 3, portals[first, 0] == point
    # walk around the vertex in all directions, breadth first: halfedges through which faces are left, and entered
    out, into, before = [turned(left[first], at_tail)], [left[first]], [-1]
    tail_there = [np.int64(not at_tail)]
    k = 0
    while k < len(out):
        h = out[k]
        e = faces.edges[h // 3, h % 3]
        for across in faces.halfedges[faces.first_halfedge[e] : faces.first_halfedge[e + 1]]:
            if across // 3 == h // 3 or is_among(into, across, 0, len(into)) or is_among(left, across, first, last + 1):
                continue
            if across // 3 == goal:
                return spliced(left, entered, first, last, out, into, before, k, across)
            same = faces.forward[h // 3, h % 3] == faces.forward[across // 3, across % 3]
            at_tail = (tail_there[k] == 1) == same
            out.append(turned(across, at_tail))
            into.append(across)
            before.append(k)
            tail_there.append(np.int64(not at_tail))
        k += 1
    return left[:0], entered[:0]


@compiled
def is_among(values: Sequence[int] | Ints, value: int, begin: int, end: int) -> bool:
    """Whether a value is among some of others."""
    for k in range(begin, end):
        if values[k] == value:
            return True
    return False


@compiled
def spliced(
    left: Ints,
    entered: Ints,
    first: int,
    last: int,
    out: list[int],
    into: list[int],
    before: list[int],
    k: int,
    across: int,
) -> tuple[Ints, Ints]:
    """A sleeve whose crossings `first` to `last` are exchanged for those of a walk, which ends at its entry k."""
    n, j = 1, k
    while before[j] >= 0:
        n, j = n + 1, before[j]
    size = first + n + len(left) - 1 - last
    new_left, new_entered = np.empty(size, np.int64), np.empty(size, np.int64)
    for i in range(first):
        new_left[i], new_entered[i] = left[i], entered[i]
    for i in range(last + 1, len(left)):
        new_left[first + n + i - last - 1], new_entered[first + n + i - last - 1] = left[i], entered[i]
    for i in range(first + n - 1, first - 1, -1):
        new_left[i], new_entered[i] = out[k], across
        across, k = into[k], before[k]
    return new_left, new_entered


@compiled
def turned(h: int, at_tail: bool) -> int:
    """The other halfedge of the face at the tail of a halfedge, or at its head."""
    return h - h % 3 + (h + 2) % 3 if at_tail else h - h % 3 + (h + 1) % 3


@compiled
def point_in(faces: Ints, points: Complexes, face: int) -> complex:
    """The point listed for a face, in its layout."""
    for s in range(len(faces)):
        if faces[s] == face:
            return points[s]
    return points[0]


@compiled
def path_in(
    faces: Faces, left: Ints, entered: Ints, starts: Ints, start_points: Complexes, ends: Ints, end_points: Complexes
) -> tuple[Complexes, complex, complex, list[int], list[int], float]:
    """The shortest path in a sleeve: its portals, its two ends, the bends as `funnel` returns them, and its length."""
    portals, over, placed = unfold(faces, left, entered)
    last = entered[-1] // 3
    begin, end = point_in(starts, start_points, left[0] // 3), point_in(ends, end_points, last)
    end = on_base(faces.positions[last], 0, over[-1], end, placed[0], placed[1])
    bends, at, length = funnel(portals, over, begin, end)
    return portals, begin, end, bends, at, length


@compiled
def straighten(
    faces: Faces, left: Ints, entered: Ints, starts: Ints, start_points: Complexes, ends: Ints, end_points: Complexes
) -> tuple[Ints, Floats]:
    """The shortest path in a sleeve, improved as long as passing a vertex on its other side makes it shorter.

    Returns the halfedges crossed and the fraction along each.
    """
    portals, begin, end, bends, at, length = path_in(faces, left, entered, starts, start_points, ends, end_points)
    k = 0
    while k < len(bends):
        point = portals[bends[k], at[k]]
        try_left, try_entered = other_way(faces, left, entered, portals, bends[k], point)
        k += 1
        if len(try_left) == 0:
            continue
        found = path_in(faces, try_left, try_entered, starts, start_points, ends, end_points)
        if found[5] < length * (1 - 1e-12):
            left, entered, k = try_left, try_entered, 0
            portals, begin, end, bends, at, length = found
    fractions = np.empty(len(left))
    here, k = begin, 0
    for i in range(len(left)):
        if k < len(bends) and bends[k] == i:
            fractions[i], here = at[k], portals[i, at[k]]
            k += 1
            continue
        there = portals[bends[k], at[k]] if k < len(bends) else end
        along, span, away = there - here, portals[i, 1] - portals[i, 0], here - portals[i, 0]
        across = turns(along, span)
        share = (
            turns(along, away) / across if across != 0 else (np.conj(span) * away).real / max(abs(span) ** 2, 1e-300)
        )
        fractions[i] = min(max(share, 0.0), 1.0)
    return left, fractions


@compiled
def shortest_lines(
    faces: Faces,
    queue: Queue,
    starts: Ints,
    start_points: Complexes,
    start_at: Ints,
    ends: Ints,
    end_points: Complexes,
    end_at: Ints,
) -> tuple[Ints, Floats, Ints]:
    """Shortest paths for many pairs of points: halfedges crossed, fractions along them, their number for each pair.

    The faces at the i-th start are ``starts[start_at[i] : start_at[i + 1]]``, and `start_points` has its position in
    the layout of each; likewise for ends; `queue` is an empty one of edges. The number is −1 where there is no path.
    """
    n_edges = len(queue.places)
    cost = np.full(n_edges, np.inf)
    leave, enter = np.empty(n_edges, np.int64), np.empty(n_edges, np.int64)
    counts = np.empty(len(start_at) - 1, np.int64)
    sides, fractions = [0], [0.0]
    sides.pop()
    fractions.pop()
    for job in range(len(counts)):
        some, others = slice(start_at[job], start_at[job + 1]), slice(end_at[job], end_at[job + 1])
        places = starts[some], start_points[some], ends[others], end_points[others]
        left, entered = find_sleeve(faces, *places, cost, leave, enter, queue)
        if len(left) == 0:
            counts[job] = -1
            continue
        crossed, where = straighten(faces, left, entered, *places)
        counts[job] = len(crossed)
        for k in range(len(crossed)):
            sides.append(crossed[k])
            fractions.append(where[k])
    return np.array(sides), np.array(fractions), counts
