"""Triangulate closed loops: in a plane, or in a disc where their projections cross themselves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from ..arrays import Bools, Floats, Ints
from ..mesh.components import connected_components
from ..mesh.edges import edge_keys, edge_table
from ..mesh.triangles import side_lengths
from ..parallel import PointTree

LAYER_GROWTH = 0.35
"""Growth of triangles with their distance from the rim, relative to that distance."""
MOST_TIES = 128
"""Maximum number of equally distant points of a loop that are compared, and number of places compared for each."""
Frame = tuple[Floats, Floats]
"""Origin and (3, 2) axes of a plane."""


@dataclass(frozen=True, eq=False)
class Spanned:
    """Triangles in a closed loop in the plane, whose edges were halved until all of them were edges of triangles."""

    # (r,) of each point of the rim, in order: the edge of the loop that it lies on, and the share of its length
    # before it; 0 at the vertices of the loop
    edges: Ints
    shares: Floats
    inner: Ints  # (k,) which of the points inside are used
    faces: Ints  # (m, 3) counterclockwise; the points of the rim come first

    def rim(self, loop: Floats) -> Floats:
        """(r, d) positions of the points of the rim on a loop in any dimension that has as many vertices."""
        ways = np.roll(loop, -1, axis=0) - loop
        return loop[self.edges] + self.shares[:, None] * ways[self.edges]

    def balanced(self) -> Ints:
        """(p, 3) faces whose boundary is the loop, with triangles without area along edges that were halved."""
        whole = self.shares == 0
        n, r = int(whole.sum()), len(self.edges)
        number = np.empty(r + len(self.inner), dtype=np.int64)
        number[:r][whole] = np.arange(n)
        number[:r][~whole] = np.arange(n, r)
        number[r:] = np.arange(r, len(number))
        added = np.flatnonzero(~whole)
        onward = np.where(whole[(added + 1) % r], (self.edges[added] + 1) % n, number[(added + 1) % r])
        fans = np.stack([self.edges[added], onward, number[added]], axis=1)
        return np.concatenate([number[self.faces], fans])


def frame_of(rim: Floats) -> Frame | None:
    """Return the plane of a loop's area through its centre, with axes for which it is counterclockwise; or None."""
    normal = area_vector(rim)
    length = np.linalg.norm(normal)
    if not length > 1e-6 * np.linalg.norm(np.ptp(rim, axis=0)) ** 2:
        return None
    normal /= length
    lengths, middles = side_lengths(rim), 0.5 * (rim + np.roll(rim, -1, axis=0))
    centre = rim[0] + (lengths[:, None] * (middles - rim[0])).sum(axis=0) / lengths.sum()
    around = rim - rim.mean(axis=0)
    around -= np.outer(around @ normal, normal)
    reach = np.linalg.norm(around, axis=1)
    first = around[farthest(rim, reach)]  # this axis turns with the rim
    first = first / np.linalg.norm(first)
    return centre, np.stack([first, np.cross(normal, first)], axis=1)


def farthest(loop: Floats, away: Floats) -> int:
    """Find the point of a closed loop that is farthest away; of equal ones, that after which the loop stays farther."""
    ties = np.flatnonzero(away > (1 - 1e-9) * away.max())[:MOST_TIES]
    if len(ties) == 1:
        return int(ties[0])
    starts = shares_of(loop)[0]
    onward = (starts[ties, None] + np.arange(MOST_TIES) / MOST_TIES) % 1.0
    far = np.interp(onward, starts, np.append(away, away[0])) / max(float(away.max()), 1e-300)
    return int(ties[np.lexsort(np.rint(1e6 * far).T[::-1])[-1]])


def shares_of(loop: Floats) -> tuple[Floats, float]:
    """(n + 1,) share of the length of a closed loop at which each corner comes, and 1; and that length."""
    lengths = side_lengths(loop)
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    return along / along[-1], float(along[-1])


def area_vector(loop: Floats) -> Floats:
    """(3,) the area that a closed loop encloses, along its normal."""
    around = loop - loop.mean(axis=0)
    return 0.5 * np.cross(around, np.roll(around, -1, axis=0)).sum(axis=0)


def spanned(loop: Floats, inner: Floats) -> Spanned | None:
    """Make Delaunay triangles of a polygon in the plane and the `inner` points within it; None if it crosses itself."""
    count = len(loop)
    edges, shares = np.arange(count), np.zeros(count)
    for _ in range(8):  # until all edges of the rim, halved, are edges of the triangulation
        n = len(edges)
        rim = loop[edges] + shares[:, None] * (np.roll(loop, -1, axis=0) - loop)[edges]
        points = np.concatenate([rim, inner])
        faces = counterclockwise(points)
        after = (np.arange(n) + 1) % n
        missing = ~np.isin(edge_keys(np.arange(n), after), edge_keys(faces.ravel(), np.roll(faces, -1, axis=1).ravel()))
        if not missing.any():
            kept = _to_the_left(faces, n)
            if kept is None:
                return None
            used = np.unique(kept[kept >= n])
            number = np.zeros(len(points), dtype=np.int64)
            number[:n], number[used] = np.arange(n), n + np.arange(len(used))
            return Spanned(edges, shares, used - n, number[kept])
        split = np.flatnonzero(missing)
        ends = np.where(shares[after[split]] == 0, 1.0, shares[after[split]])
        middles = 0.5 * (shares[split] + ends)
        edges, shares = np.insert(edges, split + 1, edges[split]), np.insert(shares, split + 1, middles)
    return None


def _to_the_left(faces: Ints, n: int) -> Ints | None:
    """Return the triangles to the left of the loop through points 0 to n − 1; None if it crosses itself."""
    table = edge_table(faces)
    tails, heads = table.vertices.T
    with_loop = (tails < n) & (heads == (tails + 1) % n)
    on_loop = with_loop | ((heads < n) & (tails == (heads + 1) % n))
    inner_pairs = table.pairs[~on_loop[table.face_edges.ravel()[table.pairs[:, 0]]]]
    regions = connected_components(len(faces), *inner_pairs.T // 3)
    at_loop = on_loop[table.face_edges]
    on_left = at_loop & (with_loop[table.face_edges] == table.forward)  # faces are left of the edges they run along
    left, right = regions[on_left.any(axis=1)], regions[(at_loop & ~on_left).any(axis=1)]
    if int(on_left.sum()) != n or np.isin(left, right).any():
        return None
    return faces[np.isin(regions, left)]


def counterclockwise(points: Floats) -> Ints:
    """Delaunay triangles of points in the plane, moved a little so that rounding does not choose among equal ones."""
    numbers = np.arange(len(points))[:, None]
    moves = (numbers * 0.5 * (5**0.5 - 1) * np.array([1.0, 2**0.5])) % 1.0 - 0.5
    size = float(np.ptp(points, axis=0).max())
    moved = points + 1e-9 * size * moves  # to choose among equal triangles; rounding is 1e-15
    faces = scipy.spatial.Delaunay(moved).simplices.astype(np.int64)
    a, b, c = moved[faces].transpose(1, 0, 2)
    clockwise = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) < (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    faces[clockwise] = faces[clockwise][:, ::-1]
    return faces


def points_inside(polygon: Floats) -> Floats:
    """Points within a polygon of few sides, as dense as its corners at its rim, and sparser away from it."""
    steps = side_lengths(polygon)
    size = float(np.quantile(steps, 0.9))
    low, high = polygon.min(axis=0), polygon.max(axis=0)
    tree = PointTree(polygon)
    layers = [np.zeros((0, 2))]
    begin = 0.75 * size
    while begin < 0.5 * float((high - low).max()):
        step = size if len(layers) == 1 else LAYER_GROWTH * begin + size
        end = begin + 2.0 * step
        rows = np.arange(low[1], high[1] + step, step * 0.75**0.5)
        columns = np.arange(low[0], high[0] + step, step)
        shifted = np.add.outer(0.5 * step * (np.arange(len(rows)) % 2), columns)
        points = np.stack([shifted.ravel(), np.repeat(rows, len(columns))], axis=1)
        away = tree.query(points)[0]
        layers.append(points[(away >= begin) & (away < end)])
        begin = end + 0.5 * step
    points = np.concatenate(layers)
    return points[_inside(points, polygon)]


def _inside(points: Floats, polygon: Floats) -> Bools:
    """(k,) whether points lie inside a polygon: by the parity of crossings."""
    x, y = points.T
    (ax, ay), (bx, by) = polygon.T[..., None], np.roll(polygon, -1, axis=0).T[..., None]
    rise = np.where(by == ay, 1.0, by - ay)  # level sides are not crossed
    crosses = ((ay > y) != (by > y)) & (x < ax + (y - ay) * (bx - ax) / rise)
    return np.logical_xor.reduce(crosses, axis=0)


def points_in_disc(n: int) -> Floats:
    """Points within the unit circle, as dense as n points around it at its rim, and sparser away from it."""
    rings, radius, step, turn = [np.zeros((1, 2))], 1.0, 2 * np.pi / n, 0.0
    while (radius := radius - step * 0.87) >= step:
        count = max(int(np.ceil(2 * np.pi * radius / step)), 5)
        turn += np.pi / count
        angles = turn + 2 * np.pi * np.arange(count) / count
        rings.append(radius * np.stack([np.cos(angles), np.sin(angles)], axis=1))
        step *= 1 + LAYER_GROWTH
    return np.concatenate(rings)
