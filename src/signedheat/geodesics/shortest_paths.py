"""Locally shortest paths across faces, between points that are not in a common face.

A *sleeve* is a sequence of neighbouring faces. A path leaves each of them through a halfedge, and enters the next one
through another halfedge of the same edge. Halfedge ``3 f + k`` of face f runs from corner k to corner k + 1.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.sparse.csgraph import dijkstra

from ..arrays import Complexes, Floats, Ints
from ..compiled import compiled
from ..errors import SourceError
from ..mesh.gluing import cross, following, preceding
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
from .exact_distance import Faces, shortest_arcs
from .heap_kernels import Queue, pop, push


def join(
    triangles: IntrinsicMesh, located: LocatedPoints, start: Ints, end: Ints, name: str
) -> tuple[LocatedPoints, Ints, Ints, Ints]:
    """Join pairs of points by segments in one face each, along geodesic paths if the two are not in a common face.

    `start` and `end` are indices of points, (p,). Returns all points, the given ones first, (s,) starts and (s,) ends
    of segments as indices of points, pair after pair, and (s,) the pair of each segment. `name` is for error messages.
    """
    apart = np.flatnonzero(shared_faces(triangles, located[start], located[end]) < 0)
    added = np.zeros(len(start), dtype=np.int64)
    middle = located[apart[:0]]
    if len(apart):
        middle, added[apart] = geodesic_paths(triangles, located[start[apart]], located[end[apart]], name)
    numbers, last = len(located) + np.arange(len(middle)), np.cumsum(added)
    starts = np.insert(numbers, last - added, start)  # before the points that are added to each pair
    ends = np.insert(numbers, last, end)  # after them
    return concatenated([located, middle]), starts, ends, np.repeat(np.arange(len(start)), added + 1)


def gaps(triangles: IntrinsicMesh, located: LocatedPoints, closed: bool) -> Ints:
    """Return the indices of those segments of a curve through points whose two ends are not in a common face."""
    start = np.arange(len(located) if closed else len(located) - 1)
    return np.flatnonzero(shared_faces(triangles, located[start], located[(start + 1) % len(located)]) < 0)


def geodesic_paths(
    triangles: IntrinsicMesh, start: LocatedPoints, end: LocatedPoints, name: str = "curve"
) -> tuple[LocatedPoints, Ints]:
    """Find locally shortest paths between p pairs of points.

    Returns the points at which the paths cross edges or pass vertices, path after path, and (p,) their number on each.
    """
    starts, ends = Places.of(triangles, start), Places.of(triangles, end)
    sides, fractions, counts = _shortest_lines(Faces.of(triangles), Routes.on(triangles), starts, ends)
    located = locate_points(triangles, sides // 3, barycentric_on_sides(sides % 3, fractions), name)
    blocked = np.flatnonzero(counts < 0)
    if not len(blocked):
        return located, counts
    parts, begin = [], np.cumsum(np.maximum(counts, 0)) - np.maximum(counts, 0)
    for k in range(len(counts)):
        if counts[k] >= 0:
            parts.append(located[np.arange(begin[k], begin[k] + counts[k])])
            continue
        pair = np.array([k])
        parts.append(path_through_vertices(triangles, start[pair], end[pair], name))
        counts[k] = len(parts[-1])
    return concatenated(parts), counts


class Places(NamedTuple):
    """The faces that contain each of n points; those of point i are ``faces[first[i] : first[i + 1]]``."""

    faces: Ints  # (k,) ids of faces
    points: Complexes  # (k,) position of the point in the layout of each face
    first: Ints  # (n + 1,) offsets of the faces of each point

    @classmethod
    def of(cls, triangles: IntrinsicMesh, located: LocatedPoints) -> Places:
        """Find all faces that contain each point, such as both faces at a point on an edge."""
        owners, faces = incident_faces(triangles, located)
        order = np.lexsort([faces, owners])
        owners, faces = owners[order], faces[order]
        weights = barycentric_in(triangles, faces, located[owners])
        points = (weights * triangles.corner_positions[faces]).sum(axis=1)
        return cls(faces, points, np.searchsorted(owners, np.arange(len(located) + 1)))


class Routes(NamedTuple):
    """Arrays for Dijkstra's algorithm on the midpoints of edges, which are reset after each search."""

    cost: Floats  # (e,) length of the shortest path to the midpoint of each edge so far
    # (e,) halfedges by which that path leaves its last face, and by which it entered it
    leave: Ints
    enter: Ints
    queue: Queue  # of edges
    middles: Complexes  # (3m,) midpoint of each halfedge, in the layout of its face
    tolls: Floats  # (e,) factors slightly above 1, all different, by which costs to each edge are multiplied

    @classmethod
    def on(cls, triangles: IntrinsicMesh) -> Routes:
        """Make the arrays for searches on a mesh, with all costs infinite."""
        n, corners = triangles.n_edges, triangles.corner_positions
        sides = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64)
        middles = 0.5 * (corners + np.roll(corners, -1, axis=1))
        multiples = np.arange(n) * 0.6180339887498949  # of the golden ratio, whose fractions are spread evenly
        tolls = 1.0 + TOLL_RANGE * (multiples - np.floor(multiples))
        return cls(np.full(n, np.inf), *sides, Queue.empty(n), middles.ravel(), tolls)


def path_through_vertices(
    triangles: IntrinsicMesh, start: LocatedPoints, end: LocatedPoints, name: str
) -> LocatedPoints:
    """Find a path between two points that are connected only through vertices at which fans of faces touch.

    `start` and `end` are one point each. Returns the points between them. Raises `SourceError` if there is no path.
    """
    # the shortest path along edges, with the points as nodes n and n + 1, joined to the corners of their faces
    edges, n = triangles.edges, triangles.n_vertices
    arcs, lengths = [edges.vertices], [triangles.lengths_of_edges]
    for node, place in ((n, start), (n + 1, end)):
        faces, points, _ = Places.of(triangles, place)
        corners = triangles.corner_vertices[faces].ravel()
        arcs.append(np.stack([np.full(len(corners), node), corners], axis=1))
        lengths.append(np.abs(triangles.corner_positions[faces] - points[:, None]).ravel())
    tails, heads = np.concatenate(arcs).T
    graph = shortest_arcs(tails, heads, np.concatenate(lengths), n + 2)
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
    # its vertices at which it goes on in another component of faces; within components, paths are geodesics
    chain = concatenated([start, points_at_vertices(triangles, np.array(path[-2:0:-1])), end])
    step = np.arange(len(chain) - 1)
    part = triangles.face_components[shared_faces(triangles, chain[step], chain[step + 1])]
    turning = np.concatenate([[0], 1 + np.flatnonzero(np.diff(part)), [len(chain) - 1]])
    step = np.arange(len(turning) - 1)
    located, _, ends, _ = join(triangles, chain[turning], step, step + 1, name)
    return located[ends[:-1]]


TOLL_RANGE = 1e-9
"""Range of the relative extra costs of edges (`Routes.tolls`). Lengths of paths around a symmetric peak differ by
1e-16, and with tolls the same path is always found. Any number from 1e-12 to 1e-6 works."""


@compiled
def _find_sleeve(faces: Faces, routes: Routes, starts: Places, ends: Places, pair: int) -> tuple[Ints, Ints]:
    """Find the sleeve of the shortest path through midpoints of edges between the two points of a pair.

    A path goes straight from a point to the midpoint of a side of its face, on through midpoints, and straight to the
    other point; `routes` are found by Dijkstra's algorithm. Returns (k,) halfedges by which it leaves faces, and (k,)
    halfedges by which it enters the next; empty if there is no path.
    """
    # from the first point to the sides of its faces
    cost, leave, enter, queue, middles, tolls = routes
    edge_of, touched = faces.edges.ravel(), [0]
    touched.pop()
    for place in range(starts.first[pair], starts.first[pair + 1]):
        for k in range(3):
            halfedge, edge = 3 * starts.faces[place] + k, edge_of[3 * starts.faces[place] + k]
            length = abs(middles[halfedge] - starts.points[place]) * tolls[edge]
            if length < cost[edge]:
                cost[edge], leave[edge], enter[edge] = length, halfedge, -1
                touched.append(edge)
                push(queue, edge, length)
    # from edge to edge; `best` is the shortest path to the second point so far, and `last` where it enters its face
    best, last = np.inf, np.int64(-1)
    while queue.size[0] > 0:
        edge = pop(queue)
        length = cost[edge]
        if length >= best:
            break
        for k in range(faces.first_halfedge[edge], faces.first_halfedge[edge + 1]):
            halfedge = faces.halfedges[k]
            if halfedge == leave[edge]:
                continue
            entry = middles[halfedge]
            for place in range(ends.first[pair], ends.first[pair + 1]):
                if ends.faces[place] == halfedge // 3 and length + abs(entry - ends.points[place]) < best:
                    best, last = length + abs(entry - ends.points[place]), halfedge
            for way_out in (following(halfedge), preceding(halfedge)):
                next_edge = edge_of[way_out]
                through_here = length + abs(middles[way_out] - entry) * tolls[next_edge]
                if through_here < cost[next_edge]:
                    cost[next_edge], leave[next_edge], enter[next_edge] = through_here, way_out, halfedge
                    touched.append(next_edge)
                    push(queue, next_edge, through_here)
    # back along this path
    count, halfedge = 0, last
    while halfedge >= 0:
        count, halfedge = count + 1, enter[edge_of[halfedge]]
    left, entered = np.empty(count, np.int64), np.empty(count, np.int64)
    while count > 0:
        count -= 1
        edge = edge_of[last]
        entered[count], left[count] = last, leave[edge]
        last = enter[edge]
    for edge in touched:
        cost[edge], queue.places[edge] = np.inf, -1
    queue.size[0] = 0
    return left, entered


@compiled
def unfold(faces: Faces, left: Ints, entered: Ints) -> tuple[Complexes, Ints, Complexes]:
    """Unfold a sleeve of k + 1 faces, with (k,) halfedges `left` and `entered`, into the plane of its first face.

    Returns (k, 2) the ends of its portals, the edges between faces, (k + 1,) 1 for faces that are reversed and 0 for
    others, and (3,) the corners of the last face.
    """
    portals, over = np.empty((len(left), 2), np.complex128), np.zeros(len(left) + 1, np.int64)
    placed = faces.positions[left[0] // 3].copy()
    for i in range(len(left)):
        k, face, side = left[i] % 3, entered[i] // 3, entered[i] % 3
        portals[i, 0], portals[i, 1] = placed[k], placed[(k + 1) % 3]
        same = np.int64(faces.forward[left[i] // 3, k] == faces.forward[face, side])  # then one face is reversed
        over[i + 1] = over[i] ^ same
        a, b = portals[i, 1 - same], portals[i, same]
        placed[side], placed[(side + 1) % 3] = a, b
        placed[(side + 2) % 3] = on_base(
            faces.positions[face], side, over[i + 1], faces.positions[face, (side + 2) % 3], a, b
        )
    return portals, over, placed


@compiled
def on_base(corners: Complexes, side: int, over: int, point: complex, a: complex, b: complex) -> complex:
    """Return the position of a point of a face after the face is moved so that one of its sides runs from a to b.

    `corners` are its corners, (3,), and `over` is 1 if the face is reversed, else 0.
    """
    base = corners[(side + 1) % 3] - corners[side]
    ratio = (point - corners[side]) / base if abs(base) > 0 else 0j
    return a + (np.conj(ratio) if over else ratio) * (b - a)


@compiled
def funnel(portals: Complexes, over: Ints, start: complex, end: complex) -> tuple[list[int], list[int], float]:
    """Find the shortest path in an unfolded sleeve between two points.

    The (k, 2) portals, and (k,) whether they are turned `over`, are those of `unfold`. A funnel from the last bend, its
    apex, to the right and left rim is narrowed by each portal; where the rims cross, the path bends. Returns the
    portals at which the path bends, for each the end at which it does (0 for the tail, 1 for the head), and the length
    of the path.
    """
    bends, ends = [0], [0]
    bends.pop()
    ends.pop()
    rims, rim_portals = np.full(2, start), np.full(2, -1)  # right and left, and the portals that they come from
    apex, total, i = start, 0.0, 0
    while i <= len(portals):
        for side in range(2):
            opposite, sign = 1 - side, 1.0 - 2.0 * side
            point = portals[i, side ^ over[i]] if i < len(portals) else end
            if sign * cross(rims[side] - apex, point - apex) < 0:  # outside the funnel on this side
                continue
            if apex == rims[side] or sign * cross(rims[opposite] - apex, point - apex) < 0:
                if i < len(portals):
                    rims[side], rim_portals[side] = point, i
                continue
            # beyond the opposite rim: bend there, and begin anew from its portal on
            i = rim_portals[opposite]
            bends.append(i)
            ends.append(opposite ^ over[i])
            total += abs(rims[opposite] - apex)
            apex = rims[side] = rims[opposite]
            rim_portals[side] = i
            break
        i += 1
    return bends, ends, total + abs(end - apex)


@compiled
def other_way(
    faces: Faces, left: Ints, entered: Ints, portals: Complexes, bend: int, point: complex
) -> tuple[Ints, Ints]:
    """Return the sleeve that passes the vertex at a bend on its other side, or empty arrays if no faces connect there.

    The sleeve leaves faces through the halfedges `left`, and enters the next through `entered`; its portals are those
    of `unfold`. `bend` is the portal at which the path bends, and `point` the position of the vertex.
    """
    first = last = bend  # portals that end at the vertex
    while first > 0 and (portals[first - 1, 0] == point or portals[first - 1, 1] == point):
        first -= 1
    while last + 1 < len(left) and (portals[last + 1, 0] == point or portals[last + 1, 1] == point):
        last += 1
    goal, at_tail = entered[last] // 3, portals[first, 0] == point
    # Walk around the vertex in all directions, breadth first. Each face reached is stored with its two halfedges at the
    # vertex, by which it is entered and left, whether the vertex is the tail of the second, and the face before it.
    way_out = preceding(left[first]) if at_tail else following(left[first])
    ways_in, ways_out, tail_there, before = [left[first]], [way_out], [not at_tail], [-1]
    k = 0
    while k < len(ways_out):
        h = ways_out[k]
        e = faces.edges[h // 3, h % 3]
        for across in faces.halfedges[faces.first_halfedge[e] : faces.first_halfedge[e + 1]]:
            if across // 3 == h // 3 or across in ways_in or (left[first : last + 1] == across).any():
                continue
            if across // 3 == goal:
                new_left, new_entered = [h], [across]
                while before[k] >= 0:  # back to the first face
                    new_entered.append(ways_in[k])
                    k = before[k]
                    new_left.append(ways_out[k])
                return (
                    np.concatenate((left[:first], np.array(new_left)[::-1], left[last + 1 :])),
                    np.concatenate((entered[:first], np.array(new_entered)[::-1], entered[last + 1 :])),
                )
            same_way = faces.forward[h // 3, h % 3] == faces.forward[across // 3, across % 3]
            at_tail = tail_there[k] == same_way
            ways_in.append(across)
            ways_out.append(preceding(across) if at_tail else following(across))
            tail_there.append(not at_tail)
            before.append(k)
        k += 1
    return left[:0], entered[:0]


@compiled
def _point_in(places: Places, pair: int, face: int) -> complex:
    """Return the position of point number `pair` in the layout of a face that contains it."""
    for s in range(places.first[pair], places.first[pair + 1]):
        if places.faces[s] == face:
            return places.points[s]
    return places.points[places.first[pair]]


@compiled
def _path_in(
    faces: Faces, left: Ints, entered: Ints, starts: Places, ends: Places, pair: int
) -> tuple[Complexes, complex, complex, list[int], list[int], float]:
    """Unfold a sleeve, and return its portals, the two ends of the shortest path in it, and the result of `funnel`."""
    portals, over, placed = unfold(faces, left, entered)
    last = entered[-1] // 3
    begin, end = _point_in(starts, pair, left[0] // 3), _point_in(ends, pair, last)
    end = on_base(faces.positions[last], 0, over[-1], end, placed[0], placed[1])
    bends, bend_ends, length = funnel(portals, over, begin, end)
    return portals, begin, end, bends, bend_ends, length


@compiled
def _straighten(
    faces: Faces, left: Ints, entered: Ints, starts: Places, ends: Places, pair: int
) -> tuple[Ints, Floats]:
    """Shorten the path in a sleeve by passing the vertices of its bends on their other sides, where that helps.

    The sleeve leaves faces through the halfedges `left`, enters the next through `entered`, and joins the `pair` of
    points from `starts` and `ends`. Returns (k,) the halfedges that the path crosses, and (k,) the fractions of them at
    which it does.
    """
    portals, begin, end, bends, bend_ends, length = _path_in(faces, left, entered, starts, ends, pair)
    k = 0
    while k < len(bends):  # from the first bend on again whenever one has helped
        point = portals[bends[k], bend_ends[k]]
        try_left, try_entered = other_way(faces, left, entered, portals, bends[k], point)
        k += 1
        if len(try_left) == 0:
            continue
        path = _path_in(faces, try_left, try_entered, starts, ends, pair)
        if path[5] < length * (1 - 1e-12):
            left, entered, k = try_left, try_entered, 0
            portals, begin, end, bends, bend_ends, length = path
    # where the straight lines between bends cross the portals
    fractions = np.empty(len(left))
    last_bend, k = begin, 0
    for i in range(len(left)):
        if k < len(bends) and bends[k] == i:
            fractions[i], last_bend = bend_ends[k], portals[i, bend_ends[k]]
            k += 1
            continue
        next_bend = portals[bends[k], bend_ends[k]] if k < len(bends) else end
        along, span, away = next_bend - last_bend, portals[i, 1] - portals[i, 0], last_bend - portals[i, 0]
        across = cross(along, span)
        share = (
            cross(along, away) / across if across != 0 else (np.conj(span) * away).real / max(abs(span) ** 2, 1e-300)
        )
        fractions[i] = min(max(share, 0.0), 1.0)
    return left, fractions


@compiled
def _shortest_lines(faces: Faces, routes: Routes, starts: Places, ends: Places) -> tuple[Ints, Floats, Ints]:
    """Find shortest paths between p pairs of points, the i-th of `starts` and of `ends`.

    Returns the halfedges that the paths cross, path after path, the fractions of them at which they do, and (p,) the
    number of crossings on each path, −1 if none exists.
    """
    counts = np.empty(len(starts.first) - 1, np.int64)
    sides, fractions = [0], [0.0]
    sides.pop()
    fractions.pop()
    for pair in range(len(counts)):
        left, entered = _find_sleeve(faces, routes, starts, ends, pair)
        if len(left) == 0:
            counts[pair] = -1
            continue
        crossed, where = _straighten(faces, left, entered, starts, ends, pair)
        counts[pair] = len(crossed)
        for k in range(len(crossed)):
            sides.append(crossed[k])
            fractions.append(where[k])
    return np.array(sides), np.array(fractions), counts
