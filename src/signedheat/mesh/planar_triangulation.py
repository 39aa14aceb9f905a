"""Constrained triangulations of polygons, and of triangles with points and segments in them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..arrays import Bools, Floats, Ints
from ..compiled import compiled
from .components import connected_components

FLAT_HEIGHT = 1e-13
"""Height of a triangle, relative to the size of the face, below which it counts as flat, and no flip may make it."""
DELAUNAY_SINE = 1e-10
"""Sine of the excess over π of two opposite angles, up to which an edge counts as Delaunay, and is not flipped."""

FLIP_TRIES = 64
"""Number of attempts to flip, per edge that a segment crosses, after which rounding is assumed to prevent the flips. In
all cases without rounding ten sufficed, even across a thousand edges."""
ROUNDS = 100
"""Number of attempts to continue along a segment, in addition to the number of triangles, after which it ends early. It
also ends after so many crossings with other segments, in addition to their number."""


class Planar(NamedTuple):
    """A triangulation in the plane, with n points and t triangles; edge k of a triangle begins at its vertex k.

    In the kernels, s is the triangle across edge k of triangle t, and j the same edge as one of s. That edge runs from
    a to b in t, where c is the third vertex, and d is that of s; u, v, w and z are other vertices.
    """

    x: Floats  # (n, 2) positions of points
    tri: Ints  # (t, 3) vertices of triangles, counter-clockwise
    adj: Ints  # (t, 3) triangle across each edge, or −1
    fixed: Bools  # (t, 3) whether each edge is part of a segment
    at: Ints  # (n,) a triangle at each vertex
    flat: float  # height below which a triangle is flat
    near: float  # distance up to which a point lies on a segment
    room: Ints  # (2,) number of points and of triangles in use; the arrays may be longer, for points at crossings
    parents: Ints  # (n, 2) ends of the edge that each point at a crossing divides


@compiled
def triangulate_faces(
    points: Floats, starts: Ints, members: Ints, corners: Ints, segment_starts: Ints, segments: Ints
) -> tuple[Ints, Ints, Ints]:
    """Triangulate m faces in space with points on their sides and inside, so that given segments become edges.

    The points of face f are the ids ``members[starts[f] : starts[f + 1]]`` of (n, 3) points, first those on its
    boundary, in order from its first corner. A row of `corners`, (m, 3), has the indices in this list of the second and
    third corner, and the number of points on the boundary. Its segments are rows ``segment_starts[f]`` to
    ``segment_starts[f + 1]`` of `segments`, which join two points by their indices in the list. Returns (k, 3)
    triangles, (k,) the face of each, ascending, and (k, 3) the triangle across each edge, −1 across segments and sides.
    """
    m = len(corners)
    total = np.int64(0)
    for f in range(m):
        total += max(2 * (starts[f + 1] - starts[f]) - corners[f, 2] - 2, 0)
    triangles, owners, across = (
        np.empty((total, 3), np.int64),
        np.empty(total, np.int64),
        np.empty((total, 3), np.int64),
    )
    filled = 0
    for f in range(m):
        begin, n, rim = starts[f], starts[f + 1] - starts[f], corners[f, 2]
        # in the plane: the boundary, the points inside, the segments, and then Delaunay edges
        x = _flattened(points, members[begin : begin + n], corners[f])
        size = _size(x)
        mesh = _rim(x, corners[f], FLAT_HEIGHT * size, FLAT_HEIGHT * size)
        for i in range(rim, n):
            _insert(mesh, i)
        for s in range(segment_starts[f], segment_starts[f + 1]):
            _connect(mesh, segments[s, 0], np.zeros(1), segments[s, 0], segments[s, 1], [0])
        _improve(mesh)
        # back to ids of points, and to numbers of triangles of all faces
        last, tri, adj, fixed = mesh.room[1], mesh.tri, mesh.adj, mesh.fixed
        for t in range(last):
            for k in range(3):
                triangles[filled + t, k] = members[begin + tri[t, k]]
                across[filled + t, k] = filled + adj[t, k] if adj[t, k] >= 0 and not fixed[t, k] else -1
            owners[filled + t] = f
        filled += last
    return triangles[:filled], owners[:filled], across[:filled]


@compiled
def triangulate_crossing(
    x: Floats, corners: Ints, segments: Ints, near: float
) -> tuple[Floats, Ints, Ints, Ints, Ints, Ints]:
    """Triangulate a triangle in the plane with (n, 2) points on its sides and inside, and segments that may cross.

    `corners` has the indices of the second and third corner, and the number of points on the boundary, which come
    first. `segments` join two points, (s, 2). A point lies on a segment up to a distance `near`. Returns

    * (n + c, 2) the points, followed by those at which segments cross,
    * (c, 2) the ends of the edge, a part of an earlier segment, that each crossing divides,
    * (k, 3) triangles, and (k, 3) the triangle across each edge, −1 across segments and sides,
    * the points along each segment, one segment after the other, and (s + 1,) offsets of these.

    If rounding prevents a segment, its points end before its second end.
    """
    n, size = len(x), _size(x)
    mesh = _rim(x, corners, FLAT_HEIGHT * size, near)
    for i in range(corners[2], n):
        _insert(mesh, i)
    ways, starts = [0], np.zeros(len(segments) + 1, np.int64)
    ways.clear()
    for s in range(len(segments)):
        begin, b = segments[s]
        # `done` is how far the segment has come, see `_share`, and `last` how far at the last crossing
        a, done, last, most = begin, np.zeros(1), -1.0, mesh.room[0] + s + ROUNDS
        ways.append(a)
        for _ in range(ROUNDS + mesh.room[1]):
            points = mesh.room[0]
            a = _connect(mesh, begin, done, a, b, ways)
            if a == b or mesh.room[0] > most:  # it crosses each of the s segments before it once, but for rounding
                break
            if points == len(mesh.x):
                mesh = _with_room(mesh)
                continue
            if mesh.room[0] > points and done[0] > last:  # else the point that was added before was not met
                last = done[0]
                continue
            # rounding prevents flips: continue through a neighbour beside the segment
            goal = _beside(mesh, begin, done, a, b)
            if goal < 0:
                break
            _fix(mesh, a, goal)
            done[0] = max(done[0], _share(mesh.x, begin, b, goal))
            ways.append(goal)
            a = goal
        starts[s + 1] = len(ways)
    total, last = mesh.room
    return mesh.x[:total], mesh.parents[n:total], mesh.tri[:last], _across(mesh), np.array(ways), starts


@compiled
def _triangulate_apart(x: Floats, corners: Ints, segments: Ints) -> tuple[Ints, Ints]:
    """Triangulate a triangle with points and segments, as `triangulate_crossing`, if segments meet at ends only.

    Returns (k, 3) constrained Delaunay triangles, and (k, 3) the triangle across each edge; empty arrays if a segment
    crosses another or passes through a point.
    """
    none, size = np.empty((0, 3), np.int64), _size(x)
    mesh = _rim(x, corners, FLAT_HEIGHT * size, FLAT_HEIGHT * size)
    for i in range(corners[2], len(x)):
        _insert(mesh, i)
    for s in range(len(segments)):
        begin, end = segments[s]
        way = [begin]
        if _connect(mesh, begin, np.zeros(1), begin, end, way) != end or len(way) != 2:
            return none, none
    _improve(mesh)
    return mesh.tri[: mesh.room[1]], _across(mesh)


AROUND = np.array([[-3.0, -2.0], [3.0, -2.0], [0.0, 3.0]])
"""Corners of a triangle that contains a set of points, relative to the center of their box and its longest side."""


def triangulate_polygon(points: Floats, n: int) -> Ints | None:
    """Return (k, 3) constrained Delaunay triangles of a counter-clockwise polygon through the first n of (p, 2) points.

    Other points inside the polygon become vertices, too. The result is None if the polygon crosses or touches itself,
    or runs clockwise.
    """
    size = float(np.ptp(points, axis=0).max())
    if not size > 0 or len(np.unique(points[:n], axis=0)) < n:
        return None
    exponent = int(np.frexp(size)[1])
    points, size = np.ldexp(points, -exponent), float(np.ldexp(size, -exponent))
    around = 0.5 * (points.min(axis=0) + points.max(axis=0)) + size * AROUND
    # in rounds of about twice as many points each, so that rows of points take no time that is quadratic
    order = np.argsort(-np.random.default_rng(0).geometric(0.5, len(points)), kind="stable")
    rank = np.argsort(order)
    sides = 3 + np.stack([rank[:n], np.roll(rank[:n], -1)], axis=1)
    triangles, across = _triangulate_apart(np.concatenate([around, points[order]]), np.array([1, 2, 3]), sides)
    if not len(triangles):
        return None
    # regions between the sides; the inside is to the left of all sides
    rows, beyond = np.nonzero(across >= 0)
    regions = connected_components(len(triangles), rows, across[rows, beyond])
    tails = np.append([-1, -2, -3], order)[triangles]
    heads = np.roll(tails, -1, axis=1)
    forth = (tails >= 0) & (tails < n) & (heads == (tails + 1) % n)
    back = (heads >= 0) & (heads < n) & (tails == (heads + 1) % n)
    left, right = (np.unique(regions[on.any(axis=1)]) for on in (forth, back))
    faces = tails[np.isin(regions, left)]
    return None if int(forth.sum()) != n or np.isin(left, right).any() or faces.min() < 0 else faces


@compiled
def _size(x: Floats) -> float:
    """Return the longer side of the box of (n, 2) points."""
    size = 0.0
    for d in range(2):
        least, most = np.inf, -np.inf
        for i in range(len(x)):
            least, most = min(least, x[i, d]), max(most, x[i, d])
        size = max(size, most - least)
    return size


@compiled
def _across(mesh: Planar) -> Ints:
    """Return (t, 3) the triangle across each edge, or −1 across segments and sides."""
    across = np.empty((mesh.room[1], 3), np.int64)
    for t in range(len(across)):
        for k in range(3):
            across[t, k] = -1 if mesh.fixed[t, k] else mesh.adj[t, k]
    return across


@compiled
def _with_room(mesh: Planar) -> Planar:
    """Return a triangulation with room for twice as many points."""
    x, tri, adj, fixed, at, flat, near, room, parents = mesh
    n, more = len(x), len(x) + 4
    return Planar(
        np.concatenate((x, np.empty((more, 2)))),
        np.concatenate((tri, np.empty((2 * more, 3), np.int64))),
        np.concatenate((adj, np.full((2 * more, 3), -1, np.int64))),
        np.concatenate((fixed, np.zeros((2 * more, 3), np.bool_))),
        np.concatenate((at, np.zeros(more, np.int64))),
        flat,
        near,
        room,
        np.concatenate((parents, np.empty((n + more - len(parents), 2), np.int64))),
    )


@compiled
def _flattened(points: Floats, members: Ints, corners: Ints) -> Floats:
    """Project the points of a face along the axis nearest to its normal; return (n, 2) counter-clockwise coordinates.

    They are relative to the first corner. `members` are the ids of the points, and `corners` the indices among these of
    the second and third corner.
    """
    a, b, c = members[0], members[corners[0]], members[corners[1]]
    normal = np.empty(3)
    for d in range(3):
        p, q = (d + 1) % 3, (d + 2) % 3
        normal[d] = (points[b, p] - points[a, p]) * (points[c, q] - points[a, q])
        normal[d] -= (points[b, q] - points[a, q]) * (points[c, p] - points[a, p])
    axis = int(np.argmax(np.abs(normal)))
    p, q = (axis + 1) % 3, (axis + 2) % 3
    if normal[axis] < 0.0:
        p, q = q, p
    x = np.empty((len(members), 2))
    for i in range(len(members)):
        x[i, 0] = points[members[i], p] - points[a, p]
        x[i, 1] = points[members[i], q] - points[a, q]
    return x


@compiled
def _turn(x: Floats, a: int, b: int, c: int) -> float:
    """Return twice the signed area of triangle abc, which is positive if c is to the left of ab."""
    return (x[b, 0] - x[a, 0]) * (x[c, 1] - x[a, 1]) - (x[b, 1] - x[a, 1]) * (x[c, 0] - x[a, 0])


@compiled
def _length(x: Floats, a: int, b: int) -> float:
    """Return the distance between points a and b."""
    return np.sqrt((x[b, 0] - x[a, 0]) ** 2 + (x[b, 1] - x[a, 1]) ** 2)


@compiled
def _rim(x: Floats, corners: Ints, flat: float, near: float) -> Planar:
    """Start a triangulation of a triangle, with the points on its boundary only.

    `x` are all (n, 2) points, first those on the boundary, in order from the first corner. `corners` are the indices of
    the second and third corner, and the number of points on the boundary. `flat` and `near` are those of `Planar`.
    """
    n, rim = len(x), corners[2]
    count = 2 * n - rim - 2
    tri, adj = np.empty((count, 3), np.int64), np.full((count, 3), -1, np.int64)
    fixed, at = np.zeros((count, 3), np.bool_), np.zeros(n, np.int64)
    mesh = Planar(x, tri, adj, fixed, at, flat, near, np.array([n, 1]), np.empty((0, 2), np.int64))
    tri[0, 0], tri[0, 1], tri[0, 2] = 0, corners[0], corners[1]
    at[0] = at[corners[0]] = at[corners[1]] = 0
    for side in range(3):
        begin = 0 if side == 0 else corners[side - 1]
        end = corners[side] if side < 2 else rim
        for i in range(begin + 1, end):
            edge = _edge(mesh, i - 1, end % rim)
            _split(mesh, edge // 3, edge % 3, i)
    return mesh


@compiled
def _point_to(tri: Ints, adj: Ints, t: int, tail: int, neighbour: int) -> None:
    """Set the neighbour of triangle t across its edge that begins at vertex `tail`; do nothing if t is −1."""
    if t >= 0:
        for k in range(3):
            if tri[t, k] == tail:
                adj[t, k] = neighbour


@compiled
def _split(mesh: Planar, t: int, k: int, i: int) -> int:
    """Split triangle t at vertex i on its edge k; return the new triangle, with the part of the edge after i."""
    tri, adj, fixed, at, new = mesh.tri, mesh.adj, mesh.fixed, mesh.at, mesh.room[1]
    a, b = (k + 1) % 3, (k + 2) % 3
    u, v, w = tri[t, k], tri[t, a], tri[t, b]
    beyond = adj[t, a]
    tri[new, 0], tri[new, 1], tri[new, 2] = i, v, w
    adj[new, 0], adj[new, 1], adj[new, 2] = -1, beyond, t
    _point_to(tri, adj, beyond, w, new)
    tri[t, a] = i
    adj[t, k], adj[t, a] = -1, new
    fixed[new, 0], fixed[new, 1], fixed[new, 2] = fixed[t, k], fixed[t, a], False
    fixed[t, a] = False
    at[i], at[v], at[w], at[u] = t, new, t, t
    mesh.room[1] += 1
    return new


@compiled
def _split_both(mesh: Planar, t: int, k: int, i: int) -> None:
    """Split triangle t, and its neighbour across edge k, at vertex i on this edge."""
    tri, adj = mesh.tri, mesh.adj
    a, b, s = tri[t, k], tri[t, (k + 1) % 3], adj[t, k]
    j = _place(tri, s, b)
    first, second = _split(mesh, t, k, i), _split(mesh, s, j, i)
    # (i, b, c) and (i, a, d); t is (a, i, c), s is (b, i, d)
    _point_to(tri, adj, t, a, second)
    _point_to(tri, adj, second, i, t)
    _point_to(tri, adj, s, b, first)
    _point_to(tri, adj, first, i, s)


@compiled
def _flip(mesh: Planar, t: int, k: int) -> int:
    """Flip edge k of triangle t, from a to b with apexes c and d.

    Triangle t becomes (c, a, d), and its neighbour (d, b, c), which is returned.
    """
    tri, adj, fixed, at = mesh.tri, mesh.adj, mesh.fixed, mesh.at
    s = adj[t, k]
    a, b, c = tri[t, k], tri[t, (k + 1) % 3], tri[t, (k + 2) % 3]
    j = _place(tri, s, b)
    d = tri[s, (j + 2) % 3]
    # triangles across the other four edges, and whether these are fixed
    bc, ca, ad, db = adj[t, (k + 1) % 3], adj[t, (k + 2) % 3], adj[s, (j + 1) % 3], adj[s, (j + 2) % 3]
    fbc, fca, fad, fdb = fixed[t, (k + 1) % 3], fixed[t, (k + 2) % 3], fixed[s, (j + 1) % 3], fixed[s, (j + 2) % 3]
    tri[t, 0], tri[t, 1], tri[t, 2] = c, a, d
    adj[t, 0], adj[t, 1], adj[t, 2] = ca, ad, s
    fixed[t, 0], fixed[t, 1], fixed[t, 2] = fca, fad, False
    tri[s, 0], tri[s, 1], tri[s, 2] = d, b, c
    adj[s, 0], adj[s, 1], adj[s, 2] = db, bc, t
    fixed[s, 0], fixed[s, 1], fixed[s, 2] = fdb, fbc, False
    _point_to(tri, adj, ad, d, t)
    _point_to(tri, adj, bc, c, s)
    at[a], at[b], at[c], at[d] = t, s, t, t
    return s


@compiled
def _insert(mesh: Planar, i: int) -> None:
    """Insert point i as a vertex into the triangle or edge that contains it, and flip edges to Delaunay."""
    x, tri, adj, at = mesh.x, mesh.tri, mesh.adj, mesh.at
    t, k, depth = _locate(mesh, i)
    a, b, c = tri[t, k], tri[t, (k + 1) % 3], tri[t, (k + 2) % 3]
    s = adj[t, k]
    if s >= 0 and depth <= mesh.near * _length(x, a, b):  # on an edge: four triangles
        _split_both(mesh, t, k, i)
    else:  # inside: three triangles, (a, b, i), (b, c, i) and (c, a, i)
        bc, ca = adj[t, (k + 1) % 3], adj[t, (k + 2) % 3]
        first = mesh.room[1]
        second = first + 1
        tri[t, 0], tri[t, 1], tri[t, 2] = a, b, i
        adj[t, 0], adj[t, 1], adj[t, 2] = s, first, second
        tri[first, 0], tri[first, 1], tri[first, 2] = b, c, i
        adj[first, 0], adj[first, 1], adj[first, 2] = bc, second, t
        tri[second, 0], tri[second, 1], tri[second, 2] = c, a, i
        adj[second, 0], adj[second, 1], adj[second, 2] = ca, t, first
        _point_to(tri, adj, bc, c, first)
        _point_to(tri, adj, ca, a, second)
        at[i], at[a], at[b], at[c] = t, t, t, first
        mesh.room[1] += 2
    _legalize(mesh, i)


@compiled
def _legalize(mesh: Planar, i: int) -> None:
    """Flip edges opposite the new vertex i until they are Delaunay."""
    tri, adj, fixed, at = mesh.tri, mesh.adj, mesh.fixed, mesh.at
    first = at[i]
    t = first
    while True:
        k = _place(tri, t, i)
        edge = (k + 1) % 3
        if adj[t, edge] >= 0 and not fixed[t, edge] and _bad(mesh, t, edge):
            _flip(mesh, t, edge)  # t is (i, a, d), which is checked again
            first = t
            continue
        t = adj[t, (k + 2) % 3]  # across the edge back to i, counter-clockwise
        if t == first or t < 0:
            return


@compiled
def _improve(mesh: Planar) -> None:
    """Flip edges in place until all that are not fixed are Delaunay."""
    adj, fixed = mesh.adj, mesh.fixed
    for _ in range(64):  # most faces need three passes
        flips = 0
        for t in range(mesh.room[1]):
            for k in range(3):
                if adj[t, k] > t and not fixed[t, k] and _bad(mesh, t, k):
                    _flip(mesh, t, k)
                    flips += 1
        if flips == 0:
            return


@compiled
def _bad(mesh: Planar, t: int, k: int) -> bool:
    """Return whether edge k of triangle t is not Delaunay and can be flipped.

    It is not Delaunay if the opposite angles, at c and d, sum to more than π, so that the sine of the sum is negative.
    """
    x, tri, adj, flat = mesh.x, mesh.tri, mesh.adj, mesh.flat
    s = adj[t, k]
    a, b, c = tri[t, k], tri[t, (k + 1) % 3], tri[t, (k + 2) % 3]
    j = _place(tri, s, b)
    d = tri[s, (j + 2) % 3]
    if not _convex(x, a, b, c, d, flat):
        return False
    acx, acy, bcx, bcy = x[a, 0] - x[c, 0], x[a, 1] - x[c, 1], x[b, 0] - x[c, 0], x[b, 1] - x[c, 1]
    adx, ady, bdx, bdy = x[a, 0] - x[d, 0], x[a, 1] - x[d, 1], x[b, 0] - x[d, 0], x[b, 1] - x[d, 1]
    cos_c, sin_c = acx * bcx + acy * bcy, acx * bcy - acy * bcx
    cos_d, sin_d = adx * bdx + ady * bdy, bdx * ady - bdy * adx
    scale = np.sqrt((acx**2 + acy**2) * (bcx**2 + bcy**2) * (adx**2 + ady**2) * (bdx**2 + bdy**2))
    return sin_c * cos_d + cos_c * sin_d < -DELAUNAY_SINE * scale


@compiled
def _convex(x: Floats, a: int, b: int, c: int, d: int, flat: float) -> bool:
    """Return whether edge ab can be flipped to cd, apexes c on its left and d on its right, without a flat triangle."""
    least = flat * _length(x, c, d)
    return _turn(x, c, a, d) > least and _turn(x, d, b, c) > least


@compiled
def _locate(mesh: Planar, i: int) -> tuple[int, int, float]:
    """Return the triangle t that contains point i, an edge 0–2 of t, and twice the signed area of this edge with i.

    Of the edges of t it is the one with the least such area, which is 0 if i lies on it.
    """
    x, tri, adj, count = mesh.x, mesh.tri, mesh.adj, mesh.room[1]
    t = count - 1
    for _ in range(count):  # walk across the edge that the point is farthest beyond
        k, depth = _side(x, tri, t, i)
        if depth >= 0.0 or adj[t, k] < 0:
            break
        t = adj[t, k]
    if depth >= 0.0:
        return t, k, depth
    # rounding puts the point outside: take the triangle that it is least outside of
    best, most = 0, -np.inf
    for t in range(count):
        k, depth = _side(x, tri, t, i)
        if depth > most:
            best, most = t, depth
    k, depth = _side(x, tri, best, i)
    return best, k, depth


@compiled
def _side(x: Floats, tri: Ints, t: int, i: int) -> tuple[int, float]:
    """Return the edge, 0 to 2, of triangle t with which point i spans the least signed area, and twice this area."""
    side, depth = 0, np.inf
    for k in range(3):
        turn = _turn(x, tri[t, k], tri[t, (k + 1) % 3], i)
        if turn < depth:
            side, depth = k, turn
    return side, depth


@compiled
def _edge(mesh: Planar, u: int, v: int) -> int:
    """Return the edge from u to v, as 3 t + k for edge k of triangle t; −1 if there is none."""
    tri, adj, at = mesh.tri, mesh.adj, mesh.at
    first = at[u]
    t, back = first, False
    while t >= 0:  # counter-clockwise around u, and from a side of the polygon on clockwise from the first triangle
        k = _place(tri, t, u)
        if tri[t, (k + 1) % 3] == v:
            return 3 * t + k
        t = adj[t, k if back else (k + 2) % 3]
        if t < 0 and not back:
            back, t = True, adj[first, _place(tri, first, u)]
        if t == first:
            break
    return -1


@compiled
def _connect(mesh: Planar, begin: int, done: Floats, a: int, b: int, way: list[int]) -> int:
    """Make edges along a segment from `begin` to b, continuing at its point a, by flips (Sloan 1993).

    Points on the segment are appended to `way`. ``done[0]`` is how far there are edges, as `_share` measures it.
    Returns the last point: b, or an earlier one if rounding does not allow to continue, or if the segment crosses
    another. There a point is added if there is room.
    """
    while a != b:
        t, k, goal = _aim(mesh, begin, done, a, b)
        if goal < 0:
            if t < 0:
                return a
            goal = _clear(mesh, t, k, begin, done, a, b)
            if goal < 0 or goal == a:
                return a
        _fix(mesh, a, goal)
        done[0] = max(done[0], _share(mesh.x, begin, b, goal))
        way.append(goal)
        a = goal
    return a


@compiled
def _fix(mesh: Planar, a: int, b: int) -> None:
    """Mark the edge between a and b, in both of its triangles, as part of a segment."""
    for tail, head in ((a, b), (b, a)):
        edge = _edge(mesh, tail, head)
        if edge >= 0:
            mesh.fixed[edge // 3, edge % 3] = True


@compiled
def _aim(mesh: Planar, begin: int, done: Floats, a: int, b: int) -> tuple[int, int, int]:
    """Find where a segment from `begin` to b continues after its point a, with edges up to ``done[0]`` so far.

    Returns the triangle at a that it enters, the edge of this by which it leaves, and the neighbour of a that it meets
    first, or −1. The triangle is −1 if there is none.
    """
    x, tri, adj, at = mesh.x, mesh.tri, mesh.adj, mesh.at
    first = at[a]
    t, back = first, False
    crossed, edge, most, met = -1, -1, -np.inf, -1
    while t >= 0:  # around a, as in `_edge`
        k = _place(tri, t, a)
        u, w = tri[t, (k + 1) % 3], tri[t, (k + 2) % 3]
        if u == b or w == b:
            return t, k, b
        for i in (u, w):
            if (met < 0 or _share(x, begin, b, i) < _share(x, begin, b, met)) and _meets(mesh, begin, done, b, i):
                met = i
        inside = min(-_turn(x, a, b, u), _turn(x, a, b, w))  # positive if the segment runs between u and w
        if inside > most:
            crossed, edge, most = t, (k + 1) % 3, inside
        t = adj[t, k if back else (k + 2) % 3]
        if t < 0 and not back:
            back, t = True, adj[first, _place(tri, first, a)]
        if t == first:
            break
    return crossed, edge, met


@compiled
def _share(x: Floats, a: int, b: int, i: int) -> float:
    """Return how far along segment ab the projection of point i lies, times the length of the segment."""
    return (x[i, 0] - x[a, 0]) * (x[b, 0] - x[a, 0]) + (x[i, 1] - x[a, 1]) * (x[b, 1] - x[a, 1])


@compiled
def _meets(mesh: Planar, begin: int, done: Floats, b: int, i: int) -> bool:
    """Return whether point i is on the segment from `begin` to b, farther along than its edges so far, ``done[0]``."""
    x = mesh.x
    if not done[0] < _share(x, begin, b, i) <= _share(x, begin, b, b):  # else it would not end
        return False
    return abs(_turn(x, begin, b, i)) <= mesh.near * _length(x, begin, b)


@compiled
def _beside(mesh: Planar, begin: int, done: Floats, a: int, b: int) -> int:
    """Return the neighbour of a through which a segment to b continues if rounding prevents flips, or −1.

    The segment runs from `begin`, and has edges up to ``done[0]`` so far, see `_share`.
    """
    x = mesh.x
    t, k, goal = _aim(mesh, begin, done, a, b)
    if goal >= 0 or t < 0:
        return goal
    u, w = mesh.tri[t, k], mesh.tri[t, (k + 1) % 3]
    return u if abs(_turn(x, a, b, u)) <= abs(_turn(x, a, b, w)) else w


@compiled
def _place(tri: Ints, t: int, a: int) -> int:
    """Return the corner, 0 to 2, of triangle t at vertex a."""
    k = 0
    while tri[t, k] != a:
        k += 1
    return k


@compiled
def _clear(mesh: Planar, t: int, k: int, begin: int, done: Floats, a: int, b: int) -> int:
    """Flip the edges that a segment crosses, the first of which is edge k of triangle t.

    The segment runs from `begin` to b, and has edges up to its point a, which is ``done[0]`` along it. Returns the
    point of the segment to which there is now an edge from a, or −1 if rounding prevents it. If the segment crosses
    another, a point is added there, nothing is flipped, and a is returned.
    """
    x, tri, adj, fixed, flat = mesh.x, mesh.tri, mesh.adj, mesh.fixed, mesh.flat
    tails, heads = [tri[t, k]], [tri[t, (k + 1) % 3]]
    while True:  # edges across the segment: tails on its right, heads on its left
        if adj[t, k] < 0 or len(tails) > 3 * mesh.room[1]:  # through flat triangles it may go round and round
            return -1
        if fixed[t, k]:
            return a if _cross(mesh, t, k, a, b) else -1
        u = tri[t, k]
        s = adj[t, k]
        j = (_place(tri, s, u) + 2) % 3  # edge j of triangle s is edge k of t the other way, and z is opposite
        z = tri[s, (j + 2) % 3]
        turn = _turn(x, a, b, z)
        if z == b or _meets(mesh, begin, done, b, z):
            break
        t, k = s, ((j + 1) % 3 if turn > 0.0 else (j + 2) % 3)  # (u, z) or (z, head)
        tails.append(tri[t, k])
        heads.append(tri[t, (k + 1) % 3])
    # flip them in turn; those that cannot be flipped yet, and new ones that cross the segment, queue up again
    at, left = 0, FLIP_TRIES * (len(tails) + 4)
    while at < len(tails):
        left -= 1
        if left < 0:
            return -1
        u, w = tails[at], heads[at]
        at += 1
        edge = _edge(mesh, u, w)
        t, k = edge // 3, edge % 3
        c = tri[t, (k + 2) % 3]
        s = adj[t, k]
        j = _place(tri, s, w)
        d = tri[s, (j + 2) % 3]
        if not _convex(x, u, w, c, d, flat):
            tails.append(u)
            heads.append(w)
            continue
        _flip(mesh, t, k)
        if c not in (a, z) and d not in (a, z) and _turn(x, a, z, c) * _turn(x, a, z, d) < 0.0:
            right = _turn(x, a, z, c) < 0.0
            tails.append(c if right else d)
            heads.append(d if right else c)
    return z


@compiled
def _cross(mesh: Planar, t: int, k: int, a: int, b: int) -> bool:
    """Add a point where segment ab crosses edge k of triangle t; return False if it does not, or there is no room."""
    x, i = mesh.x, mesh.room[0]
    u, w = mesh.tri[t, k], mesh.tri[t, (k + 1) % 3]
    right, left = _turn(x, a, b, u), _turn(x, a, b, w)
    if i == len(x) or not right <= 0.0 <= left or right == left:
        return False
    share = right / (right - left)
    for d in range(2):
        x[i, d] = x[u, d] + share * (x[w, d] - x[u, d])
    mesh.parents[i, 0], mesh.parents[i, 1] = u, w
    mesh.room[0] += 1
    _split_both(mesh, t, k, i)
    return True
