"""Constrained triangulation of one triangle, with points inside it and straight segments that must become edges."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

Point = tuple[float, float]
Edge = tuple[int, int]

CLOSE = 1e-9
"""Distance, in barycentric coordinates, below which a point lies on a segment."""
FLAT = 1e-14
"""Twice the area below which a triangle is flat, and no flip makes it."""


def turn(a: Point, b: Point, c: Point) -> float:
    """Return twice the signed area of a triangle."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def edges_of(triangle: Sequence[int]) -> tuple[Edge, Edge, Edge]:
    """Return the directed edges of a triangle."""
    u, v, w = triangle
    return (u, v), (v, w), (w, u)


@dataclass(frozen=True)
class _Line:
    """A segment, and the fraction of it that is done, from its start."""

    start: Point
    end: Point
    done: float = 0.0

    def share(self, x: Point) -> float:
        """Return the fraction of the line at which its point nearest to a given point is."""
        (px, py), (qx, qy) = self.start, self.end
        return ((x[0] - px) * (qx - px) + (x[1] - py) * (qy - py)) / ((qx - px) ** 2 + (qy - py) ** 2)

    def meets(self, x: Point) -> bool:
        """Return whether a point lies on the part of the segment that is not yet done."""
        length = ((self.end[0] - self.start[0]) ** 2 + (self.end[1] - self.start[1]) ** 2) ** 0.5
        return abs(turn(self.start, self.end, x)) <= CLOSE * length and self.done < self.share(x) <= 1


@dataclass(frozen=True, eq=False)
class Triangulation:
    """Triangles on points of a triangle, whose corners are the first three points, counter-clockwise."""

    points: list[Point]  # positions
    # the corner opposite each directed edge, in the triangle that runs along it
    apex: dict[Edge, int] = field(default_factory=dict)
    leaving: dict[int, int] = field(default_factory=dict)  # the end of one of the directed edges that leave each point
    # the points after the first along edges that are part of a segment: several where other segments cross them
    parts: dict[Edge, list[int]] = field(default_factory=dict)

    @classmethod
    def of(cls, points: Sequence[Point], sides: Sequence[Sequence[int]]) -> Triangulation:
        """Make one triangle with points on its sides, listed for each side from tail to head, without corners."""
        triangulation = cls(list(points))
        triangulation.add(0, 1, 2)
        for k, side in enumerate(sides):
            tail = k
            for i in side:
                triangulation.split(tail, (k + 1) % 3, i)
                tail = i
        return triangulation

    @property
    def triangles(self) -> list[tuple[int, int, int]]:
        """All triangles, counter-clockwise, the least corner first, in order."""
        return sorted((u, v, w) for (u, v), w in self.apex.items() if u < v and u < w)

    def add(self, u: int, v: int, w: int) -> None:
        """Add a triangle."""
        self.apex.update({(u, v): w, (v, w): u, (w, u): v})
        self.leaving.update({u: v, v: w, w: u})

    def split(self, u: int, v: int, i: int) -> None:
        """Put a point on an edge, in the triangles on both of its sides."""
        for a, b in ((u, v), (v, u)):
            if (a, b) in self.apex:
                w = self.apex.pop((a, b))
                self.add(a, i, w)
                self.add(i, b, w)

    def insert(self, x: Point) -> int:
        """Put a point into the triangle that contains it, or on its edge; return the number of the point."""
        triangle = self.locate(x)
        i = len(self.points)
        self.points.append(x)
        for a, b in edges_of(triangle):
            p, q = self.points[a], self.points[b]
            length = ((q[0] - p[0]) ** 2 + (q[1] - p[1]) ** 2) ** 0.5
            if (b, a) in self.apex and turn(p, q, x) <= CLOSE * length:
                self.split(a, b, i)
                return i
        for a, b in edges_of(triangle):
            self.add(a, b, i)
        return i

    def locate(self, x: Point) -> Sequence[int]:
        """Find the triangle that contains a point by a walk over the edges that hide it, or by a search."""
        points, apex = self.points, self.apex
        last = next(reversed(apex))
        triangle: Sequence[int] = (*last, apex[last])
        for _ in range(len(apex)):
            depth, a, b = min((turn(points[a], points[b], x), a, b) for a, b in edges_of(triangle))
            if depth >= 0 or (b, a) not in apex:
                break
            triangle = (b, a, apex[b, a])
        if depth >= 0:
            return triangle
        return max(self.triangles, key=lambda corners: min(turn(points[a], points[b], x) for a, b in edges_of(corners)))

    def around(self, a: int) -> Iterator[Edge]:
        """Yield the directed edges opposite a point in the triangles around it, counter-clockwise from one of them."""
        apex, first = self.apex, self.leaving[a]
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

    def connect(self, a: int, b: int) -> list[int]:
        """Make a segment edges, through points nearer than rounding; return the points along it, with crossings."""
        way, line, patience = [a], _Line(self.points[a], self.points[b]), 100 + len(self.apex)
        while way[-1] != b and patience:
            patience -= 1
            tail = way[-1]
            head, crossed = self.aim(tail, b, line)
            if crossed is not None:
                head = self.clear(tail, b, crossed, line)
            if head >= 0:
                self.parts.setdefault((tail, head), [head])
                self.parts.setdefault((head, tail), [tail])
                way.append(head)
                line = replace(line, done=max(line.done, line.share(self.points[head])))
        return way

    def along(self, way: Sequence[int]) -> list[int]:
        """Return the points along a way, with those that were put on it later."""
        points = [way[0]]
        for edge in pairwise(way):
            parts = self.parts[edge]
            points += parts if len(parts) == 1 else self.along([edge[0], *parts])[1:]
        return points

    def aim(self, a: int, b: int, line: _Line) -> tuple[int, Edge | None]:
        """Return the neighbour of a that a segment to b meets first; or −1, and the edge that the segment crosses."""
        p, q = self.points[a], line.end
        met, nearest, crossed, most = -1, 2.0, None, -float("inf")
        for u, w in self.around(a):
            if b in (u, w):
                return b, None
            for i in (u, w):
                if line.meets(self.points[i]) and line.share(self.points[i]) < nearest:
                    met, nearest = i, line.share(self.points[i])
            inside = min(turn(p, self.points[u], q), turn(p, q, self.points[w]))
            if inside > most:
                crossed, most = (u, w), inside
        return met, None if met >= 0 else crossed

    def clear(self, a: int, b: int, edge: Edge, line: _Line) -> int:
        """Flip the edges that the segment from a to b crosses, up to the point that it meets first (Sloan 1993).

        Returns that point; where rounding is in the way, a point near the segment; or −1 where the segment crosses
        another one, at a new point.
        """
        points, apex = self.points, self.apex
        p, q = points[a], line.end
        (u, w), goal, waiting = edge, -1, []
        while goal < 0 and (w, u) in apex:
            if (u, w) in self.parts:
                self._cross(p, q, u, w)
                return -1
            waiting.append((u, w))
            z = apex[w, u]
            goal = z if z == b or line.meets(points[z]) else -1
            u, w = (u, z) if turn(p, q, points[z]) > 0 else (z, w)
        moved = goal >= 0
        while moved and (a, goal) not in apex and (goal, a) not in apex:
            moved, left = False, []
            for u, v in reversed(waiting):  # back and forth: flips at one end make room for the next
                w, x = apex[u, v], apex[v, u]
                if min(turn(points[x], points[v], points[w]), turn(points[w], points[u], points[x])) <= FLAT:
                    left.append((u, v))
                    continue
                del apex[u, v], apex[v, u]
                self.add(w, x, v)
                self.add(x, w, u)
                moved = True
                if self._crosses(a, goal, w, x):
                    left.append((w, x))
            waiting = left
        if moved:
            return goal
        met, crossed = self.aim(a, b, line)
        return met if crossed is None else min(crossed, key=lambda i: abs(turn(p, q, points[i])))

    def _cross(self, p: Point, q: Point, u: int, w: int) -> None:
        """Put a point where a segment crosses an edge along another one."""
        r, s = self.points[u], self.points[w]
        right, left = turn(p, q, r), turn(p, q, s)
        t = right / (right - left)
        i = len(self.points)
        self.points.append((r[0] + t * (s[0] - r[0]), r[1] + t * (s[1] - r[1])))
        self.split(u, w, i)
        self.parts[u, w], self.parts[w, u] = [i, w], [i, u]
        self.parts.update({(u, i): [i], (i, w): [w], (w, i): [i], (i, u): [u]})

    def _crosses(self, a: int, b: int, u: int, v: int) -> bool:
        """Return whether two segments cross, away from their ends."""
        if a in (u, v) or b in (u, v):
            return False
        p, q, r, s = (self.points[i] for i in (a, b, u, v))
        return turn(p, q, r) * turn(p, q, s) < 0 and turn(r, s, p) * turn(r, s, q) < 0
