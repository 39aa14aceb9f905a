"""A constrained triangulation of one triangle: points inside it, and straight segments that must become edges."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

Point = tuple[float, float]

CLOSE = 1e-9
"""Distance, in barycentric coordinates, below which a point counts as lying on a segment."""


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
    for k, (a, b) in enumerate(segments):
        for c, d in segments[:k]:
            if len({a, b, c, d}) == 4:
                cross(points, a, b, c, d)
    chains = []
    for a, b in segments:
        p, q = points[a], points[b]
        direction = (q[0] - p[0], q[1] - p[1])
        square = direction[0] ** 2 + direction[1] ** 2
        inside = []
        for i, r in enumerate(points):
            along = ((r[0] - p[0]) * direction[0] + (r[1] - p[1]) * direction[1]) / square
            if i not in (a, b) and 0 < along < 1 and abs(turn(p, q, r)) <= CLOSE * square**0.5:
                inside.append((along, i))
        chains.append([a, *(i for _, i in sorted(inside)), b])
    return chains


def cross(points: list[Point], a: int, b: int, c: int, d: int) -> None:
    """Append the crossing of segments ab and cd to `points`, unless there is a point already."""
    p, q, r, s = points[a], points[b], points[c], points[d]
    left, right = turn(r, s, p), turn(r, s, q)
    if left * right >= 0 or turn(p, q, r) * turn(p, q, s) >= 0:
        return
    t = left / (left - right)
    x = (p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1]))
    if all(abs(x[0] - y[0]) + abs(x[1] - y[1]) > CLOSE for y in points):
        points.append(x)


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
    apex = {(0, 1): 2, (1, 2): 0, (2, 0): 1}
    on_sides = set()
    for k, side in enumerate(sides):
        tail = k
        for i in side:
            split_edge(apex, tail, (k + 1) % 3, i)
            tail = i
        on_sides.update(side)
    for i in range(3, len(points)):
        if i not in on_sides:
            insert(points, apex, i)
    for a, b in segments:
        force(points, apex, a, b)
    return sorted({rotated(u, v, w) for (u, v), w in apex.items()})


def rotated(u: int, v: int, w: int) -> tuple[int, int, int]:
    """The corners of a triangle in the same cyclic order, the smallest id first."""
    return min((u, v, w), (v, w, u), (w, u, v))


def add(apex: dict[tuple[int, int], int], u: int, v: int, w: int) -> None:
    """Add a triangle: `apex` maps each of its directed edges to the opposite corner."""
    apex[u, v], apex[v, w], apex[w, u] = w, u, v


def split_edge(apex: dict[tuple[int, int], int], u: int, v: int, i: int) -> None:
    """Insert point i on an edge, splitting the triangles on both sides of it."""
    for a, b in ((u, v), (v, u)):
        if (a, b) in apex:
            w = apex.pop((a, b))
            add(apex, a, i, w)
            add(apex, i, b, w)


def insert(points: Sequence[Point], apex: dict[tuple[int, int], int], i: int) -> None:
    """Insert point i into the triangle that contains it, or on the edge that it lies on."""
    x = points[i]
    best, where = -float("inf"), (0, 0, 0)
    for (u, v), w in apex.items():
        depth = min(turn(points[u], points[v], x), turn(points[v], points[w], x), turn(points[w], points[u], x))
        if depth > best:
            best, where = depth, (u, v, w)
    u, v, w = where
    for a, b in ((u, v), (v, w), (w, u)):
        p, q = points[a], points[b]
        length = ((q[0] - p[0]) ** 2 + (q[1] - p[1]) ** 2) ** 0.5
        if (b, a) in apex and turn(p, q, x) <= CLOSE * length:
            split_edge(apex, a, b, i)
            return
    for a, b in ((u, v), (v, w), (w, u)):
        add(apex, a, b, i)


def force(points: Sequence[Point], apex: dict[tuple[int, int], int], a: int, b: int) -> None:
    """Flip the edges that cross segment ab until it is an edge itself (Sloan 1993)."""
    if (a, b) in apex or (b, a) in apex:
        return
    p, q = points[a], points[b]

    def crosses(u: int, v: int) -> bool:
        if a in (u, v) or b in (u, v):
            return False
        r, s = points[u], points[v]
        return turn(p, q, r) * turn(p, q, s) < 0 and turn(r, s, p) * turn(r, s, q) < 0

    queue = deque((u, v) for u, v in apex if u < v and crosses(u, v))
    patience = 100 + len(queue) ** 3
    while queue and patience:
        patience -= 1
        u, v = queue.popleft()
        w, x = apex[u, v], apex[v, u]
        if turn(points[x], points[v], points[w]) <= 0 or turn(points[w], points[u], points[x]) <= 0:
            queue.append((u, v))
            continue
        del apex[u, v], apex[v, u]
        add(apex, w, x, v)
        add(apex, x, w, u)
        if crosses(w, x):
            queue.append((w, x))
