"""A constrained triangulation of one triangle: points inside it, and straight segments that must become edges."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from heapq import heappop, heappush
from itertools import pairwise
from math import dist, floor

Point = tuple[float, float]
Cell = tuple[int, int]
Triangle = tuple[int, int, int]
Apex = dict[tuple[int, int], int]
"""The corner opposite each directed edge, in the triangle that runs along it."""

CLOSE = 1e-9
"""Distance, in barycentric coordinates, below which a point counts as lying on a segment."""

FLAT = 1e-14
"""Twice the area below which a triangle is as good as flat, and is not made by a flip."""


def turn(a: Point, b: Point, c: Point) -> float:
    """Twice the signed area of a triangle."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def arrange(points: list[Point], segments: Sequence[tuple[int, int]]) -> list[list[int]]:
    """Subdivide segments where they cross each other or pass through points.

    Crossings are appended to `points`. Returns the points along each segment, from its start to its end.

    Examples
    --------
    >>> corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
    >>> arrange(corners, [(0, 2), (1, 3)]), corners[4]
    ([[0, 4, 2], [1, 4, 3]], (0.5, 0.5))
    """
    buckets = Buckets.of(points, segments)
    for k, (a, b) in enumerate(segments):
        for other in buckets.earlier_segments(k):
            c, d = segments[other]
            if len({a, b, c, d}) == 4:
                cross(points, buckets, a, b, c, d)
    chains = []
    for k, (a, b) in enumerate(segments):
        p, q = points[a], points[b]
        direction = (q[0] - p[0], q[1] - p[1])
        square = direction[0] ** 2 + direction[1] ** 2
        inside = []
        for i in buckets.points_along(k):
            r = points[i]
            along = ((r[0] - p[0]) * direction[0] + (r[1] - p[1]) * direction[1]) / square
            if i not in (a, b) and 0 < along < 1 and abs(turn(p, q, r)) <= CLOSE * square**0.5:
                inside.append((along, i))
        chains.append([a, *(i for _, i in sorted(inside)), b])
    return chains


def cross(points: list[Point], buckets: Buckets, a: int, b: int, c: int, d: int) -> None:
    """Append the point at which two segments cross, unless a point is there already."""
    p, q, r, s = points[a], points[b], points[c], points[d]
    left, right = turn(r, s, p), turn(r, s, q)
    if left * right >= 0 or turn(p, q, r) * turn(p, q, s) >= 0:
        return
    t = left / (left - right)
    x = (p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1]))
    if all(abs(x[0] - points[i][0]) + abs(x[1] - points[i][1]) > CLOSE for i in buckets.points_near(x)):
        buckets.put(len(points), x)
        points.append(x)


@dataclass(frozen=True)
class Buckets:
    """Which points and segments lie in each cell of a square grid about as fine as the segments are long.

    Attributes
    ----------
    size : float
        Side of a cell.
    cells : list of lists of cells
        Those that each segment passes, or comes close to.
    points, segments : dict from cells to lists of int
        What is in each.
    """

    size: float
    cells: list[list[Cell]]
    points: dict[Cell, list[int]]
    segments: dict[Cell, list[int]]

    @classmethod
    def of(cls, points: Sequence[Point], segments: Sequence[tuple[int, int]]) -> Buckets:
        """Sort points and segments into cells: a few for each segment, on average."""
        lengths = [abs(points[b][0] - points[a][0]) + abs(points[b][1] - points[a][1]) for a, b in segments]
        size = max(sum(lengths) / max(len(lengths), 1), 1e-3 / max(len(lengths), 1))
        cells = [cells_along(points[a], points[b], size) for a, b in segments]
        passing = defaultdict(list)
        for k, passed in enumerate(cells):
            for cell in passed:
                passing[cell].append(k)
        buckets = cls(size, cells, defaultdict(list), passing)
        for i, x in enumerate(points):
            buckets.put(i, x)
        return buckets

    def put(self, i: int, x: Point) -> None:
        """Add a point."""
        self.points[floor(x[0] / self.size), floor(x[1] / self.size)].append(i)

    def points_near(self, x: Point) -> list[int]:
        """Points that may lie close to x."""
        return [i for cell in cells_along(x, x, self.size) for i in self.points.get(cell, ())]

    def points_along(self, k: int) -> list[int]:
        """Points that may lie on a segment."""
        return [i for cell in self.cells[k] for i in self.points.get(cell, ())]

    def earlier_segments(self, k: int) -> list[int]:
        """Segments of lower number that may cross a segment, in order."""
        return sorted({other for cell in self.cells[k] for other in self.segments[cell] if other < k})


def cells_along(p: Point, q: Point, size: float) -> list[Cell]:
    """Cells of a square grid within twice `CLOSE` of a segment, column by column.

    Examples
    --------
    >>> cells_along((0.5, 0.5), (2.5, 0.75), 1.0)
    [(0, 0), (1, 0), (2, 0)]
    """
    (x, y), (u, v) = (p, q) if p[0] <= q[0] else (q, p)
    margin = 2 * CLOSE
    found = []
    for column in range(floor((x - margin) / size), floor((u + margin) / size) + 1):
        begin, end = max(x, column * size - margin), min(u, (column + 1) * size + margin)
        low, high = (y, v) if u == x else (y + (v - y) * (at - x) / (u - x) for at in (begin, end))
        low, high = sorted((min(max(low, min(y, v)), max(y, v)), min(max(high, min(y, v)), max(y, v))))
        if u - x <= 2 * margin:  # as good as vertical
            low, high = min(y, v), max(y, v)
        rows = range(floor((low - margin) / size), floor((high + margin) / size) + 1)
        found += [(column, row) for row in rows]
    return found


def triangulate(
    points: Sequence[Point], sides: Sequence[Sequence[int]], segments: Sequence[tuple[int, int]]
) -> list[tuple[int, int, int]]:
    """Triangulate points in a triangle so that every given segment is an edge.

    Parameters
    ----------
    points : sequence of points
        The first three are the corners, counter-clockwise.
    sides : three sequences of int
        Points on each side, from its tail to its head, without the corners.
    segments : sequence of pairs
        Pairs of points. Segments meet at points only, and no point lies in the interior of one.

    Examples
    --------
    >>> triangulate([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.5, 0.0)], [[3], [], []], [(3, 2)])
    [(0, 3, 2), (1, 2, 3)]
    """
    apex: Apex = {(0, 1): 2, (1, 2): 0, (2, 0): 1}
    on_sides = set()
    for k, side in enumerate(sides):
        tail = k
        for i in side:
            split_edge(apex, tail, (k + 1) % 3, i)
            tail = i
        on_sides.update(side)
    corner = (0, *next((v, w) for (u, v), w in apex.items() if u == 0))
    for i in range(3, len(points)):
        if i not in on_sides:
            corner = insert(points, apex, i, corner)
    leaving = dict(apex.keys())
    for a, b in segments:
        force(points, apex, leaving, a, b)
    return sorted({rotated(u, v, w) for (u, v), w in apex.items()})


def paths_along(
    points: Sequence[Point], triangles: Sequence[Triangle], chains: Sequence[Sequence[int]]
) -> list[list[int]]:
    """The chains, with segments that are no edges replaced by the shortest ways along edges.

    Segments become edges, except where points nearer to each other than `CLOSE` are in their way, which such a way
    goes through.

    Examples
    --------
    >>> paths_along([(0.0, 0.0), (1.0, 0.0), (0.5, 1e-12), (0.5, -1.0)], [(0, 2, 3), (2, 1, 3)], [[0, 1]])
    [[0, 2, 1]]
    """
    around = defaultdict(set)
    for triangle in triangles:
        for u, v in edges_of(triangle):
            around[u].add(v)
            around[v].add(u)
    return [
        [chain[0], *(i for a, b in pairwise(chain) for i in ([b] if b in around[a] else way(points, around, a, b)))]
        for chain in chains
    ]


def way(points: Sequence[Point], around: dict[int, set[int]], a: int, b: int) -> list[int]:
    """Points on the shortest way along edges from one to another, without the first (Dijkstra)."""
    waiting, before = [(0.0, a, a)], dict[int, int]()
    while waiting:
        length, u, came_from = heappop(waiting)
        if u in before:
            continue
        before[u] = came_from
        if u == b:
            break
        for v in around[u]:
            heappush(waiting, (length + dist(points[u], points[v]), v, u))
    path = [b]
    while before[path[-1]] != a:
        path.append(before[path[-1]])
    return path[::-1]


def rotated(u: int, v: int, w: int) -> tuple[int, int, int]:
    """The corners of a triangle in the same cyclic order, the smallest id first."""
    return min((u, v, w), (v, w, u), (w, u, v))


def add(apex: Apex, u: int, v: int, w: int) -> None:
    """Add a triangle, known to each of its directed edges by the corner opposite."""
    apex[u, v], apex[v, w], apex[w, u] = w, u, v


def split_edge(apex: Apex, u: int, v: int, i: int) -> None:
    """Put a point on an edge, in the triangles on both of its sides."""
    for a, b in ((u, v), (v, u)):
        if (a, b) in apex:
            w = apex.pop((a, b))
            add(apex, a, i, w)
            add(apex, i, b, w)


def insert(points: Sequence[Point], apex: Apex, i: int, begin: Triangle) -> Triangle:
    """Put a point into the triangle that has it, or on its edge; a triangle beside it."""
    u, v, w = locate(points, apex, points[i], begin)
    for a, b in ((u, v), (v, w), (w, u)):
        p, q = points[a], points[b]
        length = ((q[0] - p[0]) ** 2 + (q[1] - p[1]) ** 2) ** 0.5
        if (b, a) in apex and turn(p, q, points[i]) <= CLOSE * length:
            split_edge(apex, a, b, i)
            return a, i, apex[a, i]
    for a, b in ((u, v), (v, w), (w, u)):
        add(apex, a, b, i)
    return u, v, i


def locate(points: Sequence[Point], apex: Apex, x: Point, begin: Triangle) -> Triangle:
    """The triangle that a point lies in: a walk over the edges that hide it, or, where that goes round, a search."""
    here = begin
    for _ in range(len(apex)):
        depths = [(turn(points[a], points[b], x), a, b) for a, b in edges_of(here)]
        depth, a, b = min(depths)
        if depth >= 0 or (b, a) not in apex:
            break
        here = (b, a, apex[b, a])
    if depth >= 0:
        return here
    each = ((u, v, w) for (u, v), w in apex.items())
    return max(each, key=lambda triangle: min(turn(points[a], points[b], x) for a, b in edges_of(triangle)))


def edges_of(triangle: Triangle) -> tuple[tuple[int, int], ...]:
    """The directed edges of a triangle."""
    u, v, w = triangle
    return (u, v), (v, w), (w, u)


def force(points: Sequence[Point], apex: Apex, leaving: dict[int, int], a: int, b: int) -> None:
    """Flip the edges that cross a segment until it is an edge itself (Sloan 1993)."""
    if (a, b) in apex or (b, a) in apex:
        return
    p, q = points[a], points[b]

    def crosses(u: int, v: int) -> bool:
        if a in (u, v) or b in (u, v):
            return False
        r, s = points[u], points[v]
        return turn(p, q, r) * turn(p, q, s) < 0 and turn(r, s, p) * turn(r, s, q) < 0

    remaining = crossed_edges(apex, leaving, a, b, crosses)
    patience = 100 + len(remaining) ** 2
    flipped = True
    while remaining and flipped and patience:
        patience -= 1
        flipped, waiting = False, []
        for u, v in reversed(remaining):  # there and back: flips at one end make room for the next
            w, x = apex[u, v], apex[v, u]
            if min(turn(points[x], points[v], points[w]), turn(points[w], points[u], points[x])) <= FLAT:
                waiting.append((u, v))
                continue
            del apex[u, v], apex[v, u]
            add(apex, w, x, v)
            add(apex, x, w, u)
            leaving.update({u: x, v: w, w: x, x: w})
            flipped = True
            if crosses(w, x):
                waiting.append((w, x))
        remaining = waiting


def crossed_edges(
    apex: Apex, leaving: dict[int, int], a: int, b: int, crosses: Callable[[int, int], bool]
) -> list[tuple[int, int]]:
    """Edges that a segment crosses: met on the way from triangle to triangle, or, where that is lost, searched for."""
    found = []
    edge = next((edge for edge in link(apex, a, leaving[a]) if crosses(*edge)), None)
    while edge is not None:
        u, v = edge
        found.append((min(u, v), max(u, v)))
        w = apex.get((v, u))
        if w == b:
            return found
        edge = None if w is None else next((e for e in ((u, w), (w, v)) if crosses(*e)), None)
    return [(u, v) for u, v in apex if u < v and crosses(u, v)]


def link(apex: Apex, a: int, first: int) -> Iterator[tuple[int, int]]:
    """Directed edges opposite a vertex, in the triangles around it: counter-clockwise from one, then the rest."""
    u = first
    while (a, u) in apex:
        yield u, apex[a, u]
        u = apex[a, u]
        if u == first:
            return
    u = first
    while (u, a) in apex:
        yield apex[u, a], u
        u = apex[u, a]
