"""Nearest points of a triangle, and the nearest of many triangles by a tree of boxes.

The nearest point of a triangle to a point is called its foot. The feature of a foot is 0 inside the triangle, 1, 2, 3
on its edges (corner 0–1, 1–2, 2–0), and 4, 5, 6 at its corners 0, 1, 2.

Kernels take triangles as ``rows``, (m, 16). Columns 0–2 are the first corner, 3–5 and 6–8 the unit vectors u along the
first side and v across it in the plane. In these axes, with coordinates (p, q), column 9 is the length of side 0–1,
10–11 and 12 are the direction (c, d) and length of side 0–2, and 13–14 and 15 the direction (g, h) and length of side
1–2. Kernels use these letters, and t for the distance of a foot from the beginning of a side.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints, read_only
from ..compiled import compiled
from ..mesh.box_tree import BOXES_PER_LEAF, BoxTree
from ..parallel import in_chunks

LEAST_HEIGHT = 1e-14
"""Height of a triangle, relative to its length, up to which it counts as 0, since rounding would decide its plane."""
POINTS_TOGETHER = 8
"""Number of points that descend a tree together. With 16 a million points take a tenth less time on 20,000 faces, and a
tenth more on 1.3 million, whose boxes are smaller than the distances between 16 random points; with 4 it is half as
much again."""


def triangle_rows(corners: Floats) -> Floats:
    """Return the (m, 16) rows of triangles with (m, 9) coordinates of corners."""
    (rows,) = in_chunks(lambda chunk: (_rows(chunk),), corners)
    return rows


@np.errstate(all="ignore")
def _rows(corners: Floats) -> Floats:
    """Return the (m, 16) rows of triangles with (m, 9) coordinates of corners, without threads."""
    rows = np.empty((len(corners), 16))
    rows[:, :3] = corners[:, :3]
    first, second = (corners[:, k : k + 3].T - corners[:, :3].T for k in (3, 6))  # sides 0–1 and 0–2
    length = np.sqrt(_dot(first, first))
    u = np.where(length > 0.0, first / np.where(length > 0.0, length, 1.0), [[1.0], [0.0], [0.0]])
    p = _dot(second, u)
    v = second - p * u
    flat = ~(np.sqrt(_dot(v, v)) > LEAST_HEIGHT * np.abs(p))
    # a flat triangle gets some plane through its first side
    v = np.where(flat, np.arange(3)[:, None] == np.abs(u).argmin(axis=0), v)
    for _ in range(2):  # twice, since the height of slivers has few accurate digits
        v = v - _dot(v, u) * u
        v /= np.sqrt(_dot(v, v))
    q = np.where(flat, 0.0, _dot(second, v))
    rows[:, 3:6], rows[:, 6:9], rows[:, 9] = u.T, v.T, length
    for k in range(2):  # sides 0–2 and 1–2, which both end at corner 2, (p, q)
        along = p - k * length
        side = np.sqrt(along * along + q * q)
        divisor = np.where(side > 0.0, side, 1.0)
        rows[:, 10 + 3 * k], rows[:, 11 + 3 * k] = np.where(side > 0.0, along / divisor, 1.0), q / divisor
        rows[:, 12 + 3 * k] = side
    return rows


def _dot(a: Floats, b: Floats) -> Floats:
    """Return (n,) scalar products of the columns of two (3, n) arrays."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled
def foot_on_triangle(rows: Floats, f: int, x: float, y: float, z: float) -> tuple[float, int, float, float, float]:
    """Find the foot of a point (x, y, z) on triangle f, the triangle's nearest point.

    Returns the squared distance, the feature of the foot (0 inside, 1 to 3 on edges, 4 to 6 at corners), and its three
    coordinates. A point that is not above the inside has its foot on the nearest side.
    """
    px, py, pz = x - rows[f, 0], y - rows[f, 1], z - rows[f, 2]
    p = px * rows[f, 3] + py * rows[f, 4] + pz * rows[f, 5]
    q = px * rows[f, 6] + py * rows[f, 7] + pz * rows[f, 8]
    length = rows[f, 9]
    r = p - length
    feature = 0
    if not (q > 0.0 and p * rows[f, 11] > q * rows[f, 10] and r * rows[f, 14] < q * rows[f, 13]):
        # side 0–1
        t = p if p > 0.0 else 0.0
        t = t if t < length else length
        best, foot_p, foot_q = (p - t) * (p - t) + q * q, t, 0.0
        feature = 4 if not t > 0.0 else 1 if t < length else 5
        # side 0–2
        side = rows[f, 12]
        t = p * rows[f, 10] + q * rows[f, 11]
        t = t if t > 0.0 else 0.0
        t = t if t < side else side
        a, b = t * rows[f, 10], t * rows[f, 11]
        square = (p - a) * (p - a) + (q - b) * (q - b)
        if square < best:
            best, foot_p, foot_q = square, a, b
            feature = 3 if t < side else 6
        # side 1–2 between its ends, which the other two sides have, too
        side = rows[f, 15]
        t = r * rows[f, 13] + q * rows[f, 14]
        if t > 0.0 and t < side:
            a, b = length + t * rows[f, 13], t * rows[f, 14]
            square = (p - a) * (p - a) + (q - b) * (q - b)
            if square < best:
                foot_p, foot_q = a, b
                feature = 2
    else:
        foot_p, foot_q = p, q
    dx = px - foot_p * rows[f, 3] - foot_q * rows[f, 6]
    dy = py - foot_p * rows[f, 4] - foot_q * rows[f, 7]
    dz = pz - foot_p * rows[f, 5] - foot_q * rows[f, 8]
    return dx * dx + dy * dy + dz * dz, feature, x - dx, y - dy, z - dz


@compiled
def away_from_triangle(rows: Floats, f: int, points: Floats, at: int, out: Floats) -> None:
    """Write squared distances of points to triangle f, and the vectors from their feet, to ``out[at]``, (4, n).

    `points` are the coordinates of the points, (3, n). This is `foot_on_triangle` without branches: the least distance
    from the three sides, or 0 in the plane if the point is beyond none of them. The compiler vectorises the loop over
    points if it does not know their number.
    """
    ax, ay, az = rows[f, 0], rows[f, 1], rows[f, 2]
    ux, uy, uz = rows[f, 3], rows[f, 4], rows[f, 5]
    vx, vy, vz = rows[f, 6], rows[f, 7], rows[f, 8]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    first, second, third = rows[f, 9], rows[f, 12], rows[f, 15]
    c, d, g, h = rows[f, 10], rows[f, 11], rows[f, 13], rows[f, 14]
    for k in range(points.shape[1]):
        x, y, z = points[0, k] - ax, points[1, k] - ay, points[2, k] - az
        p, q = x * ux + y * uy + z * uz, x * vx + y * vy + z * vz
        up = x * nx + y * ny + z * nz
        # vector (a, b) in the plane from the foot on side 0–1, and in `beyond` whether the point is beyond that side
        t = p if p > 0.0 else 0.0
        t = t if t < first else first
        a, b = p - t, q
        square = a * a + b * b
        beyond = -q
        # side 0–2
        out_of = q * c - p * d
        beyond = beyond if beyond > out_of else out_of
        t = p * c + q * d
        t = t if t > 0.0 else 0.0
        t = t if t < second else second
        i, j = p - t * c, q - t * d
        other = i * i + j * j
        nearer = other < square
        a, b, square = i if nearer else a, j if nearer else b, other if nearer else square
        # side 1–2
        r = p - first
        out_of = r * h - q * g
        beyond = beyond if beyond > out_of else out_of
        t = r * g + q * h
        t = t if t > 0.0 else 0.0
        t = t if t < third else third
        i, j = r - t * g, q - t * h
        other = i * i + j * j
        nearer = other < square
        a, b, square = i if nearer else a, j if nearer else b, other if nearer else square
        is_over = beyond < 0.0
        a, b, square = 0.0 if is_over else a, 0.0 if is_over else b, 0.0 if is_over else square
        out[at, 0, k] = square + up * up
        out[at, 1, k] = up * nx + a * ux + b * vx
        out[at, 2, k] = up * ny + a * uy + b * vy
        out[at, 3, k] = up * nz + a * uz + b * vz


@compiled
def barycentric_on_triangles(rows: Floats, faces: NDArray[np.int32], points: Floats) -> Floats:
    """Return (n, 3) barycentric coordinates of the foot of points[k] on triangle faces[k], for n points."""
    weights = np.zeros((len(points), 3))
    for k in range(len(points)):
        f = np.int64(faces[k])
        _, feature, _, _, _ = foot_on_triangle(rows, f, points[k, 0], points[k, 1], points[k, 2])
        x, y, z = points[k, 0] - rows[f, 0], points[k, 1] - rows[f, 1], points[k, 2] - rows[f, 2]
        p = x * rows[f, 3] + y * rows[f, 4] + z * rows[f, 5]
        q = x * rows[f, 6] + y * rows[f, 7] + z * rows[f, 8]
        second, third = 0.0, 0.0  # weights of corners 1 and 2
        if feature == 0:
            third = q / (rows[f, 11] * rows[f, 12])
            second = p / rows[f, 9] - rows[f, 10] * rows[f, 12] / rows[f, 9] * third
            # beyond a side by rounding, which slivers magnify
            feature = 3 if second < 0.0 else 2 if second + third > 1.0 else 0
        if feature == 1 or feature == 5:
            second = p / rows[f, 9] if feature == 1 else 1.0
        elif feature == 3 or feature == 6:
            second, third = 0.0, (p * rows[f, 10] + q * rows[f, 11]) / rows[f, 12] if feature == 3 else 1.0
        elif feature == 2:
            third = ((p - rows[f, 9]) * rows[f, 13] + q * rows[f, 14]) / rows[f, 15]
            second = 1.0 - third
        third = min(max(third, 0.0), 1.0)
        second = min(max(second, 0.0), 1.0 - third)
        weights[k, 0], weights[k, 1], weights[k, 2] = max(1.0 - second - third, 0.0), second, third
    return weights


def weights_in(triangles: Floats, points: Floats) -> Floats:
    """Return (n, 3) barycentric coordinates of (n, 3) points in (n, 3, 3) triangles, point k in triangle k."""
    rows = triangle_rows(np.ascontiguousarray(triangles, dtype=np.float64).reshape(-1, 9))
    return barycentric_on_triangles(rows, np.arange(len(rows), dtype=np.int32), read_only(points))


@dataclass(frozen=True, eq=False)
class TriangleTree:
    """Triangles in a tree of boxes, for finding the triangle nearest to a point."""

    rows: Floats  # (m, 16) the triangles in the form of `triangle_rows`
    tree: BoxTree  # the tree of their bounding boxes

    @classmethod
    def of(cls, triangles: Floats) -> TriangleTree:
        """Build the tree of (m, 3, 3) triangles."""
        rows = triangle_rows(np.ascontiguousarray(triangles, dtype=np.float64).reshape(-1, 9))
        return cls(rows, BoxTree.around(triangles))

    @cached_property
    def _no_discs(self) -> Floats:
        """Rows that say that no node has a disc, (2 · leaves, 8) float."""
        return np.full((len(self.tree.bounds), 8), -1.0)

    def nearest(self, points: Floats) -> tuple[Ints, Floats]:
        """Return (k,) the nearest triangle of each of (k, 3) points, and (k, 3) barycentric coordinates of the foot."""
        points = read_only(np.ascontiguousarray(points))
        faces, _ = nearest_faces(self.rows, self.tree, self._no_discs, points, POINTS_TOGETHER * max(len(points), 1))
        return faces.astype(np.int64), barycentric_on_triangles(self.rows, faces, points)


def nearest_faces(
    rows: Floats, tree: BoxTree, discs: Floats, points: Floats, run: int
) -> tuple[NDArray[np.int32], Floats]:
    """Return (n,) the nearest triangle of each of (n, 3) points, and (n,) the squares of their distances.

    `discs` are those of `FaceTree.discs`. The search for a point starts with the triangle of the point before, except
    after every `run` points, so that it does not matter how points are divided among threads.
    """
    return _descend(rows, tree, discs, read_only(points), run, np.empty(min(max(len(points), 1), POINTS_TOGETHER)))


@compiled
def _descend(
    rows: Floats, tree: BoxTree, discs: Floats, points: Floats, run: int, best: Floats
) -> tuple[NDArray[np.int32], Floats]:
    """Return (n,) the nearest triangle of each point and (n,) its squared distance, by descending a tree.

    `discs` are those of `FaceTree.discs`, and `run` that of `nearest_faces`. Successive points descend together, as
    many as the work array `best` is long, which has their least squared distances so far. The compiler must not know
    this number. A node is visited if one of these points may have something nearer in it. Loops over points have no
    branches, so that the compiler vectorises them.
    """
    bounds, items = tree.bounds, tree.items
    out_faces, out_squares = np.empty(len(points), dtype=np.int32), np.empty(len(points))
    leaves, together, middle = len(bounds) // 2, len(best), len(best) // 2
    coordinates, which = np.empty((3, together)), np.zeros(together, dtype=np.int64)
    # nodes still to be visited, and how near the triangles in them can be to each point, squared
    stack, gaps = np.empty(66, dtype=np.int64), np.zeros((66, together))
    for begin in range(0, len(points), together):
        last = which[together - 1]
        for k in range(together):
            p = min(begin + k, len(points) - 1)
            coordinates[0, k], coordinates[1, k], coordinates[2, k] = points[p, 0], points[p, 1], points[p, 2]
            best[k], which[k], gaps[0, k] = np.inf, last, 0.0
        # the face found last is measured before the root is visited, so that there is a bound on distances
        stack[0], depth, begun = 1, 1, begin % run == 0
        while depth > 0:
            node, first, end = np.int64(0), np.int64(0), np.int64(0)  # the range of faces to be measured
            if begun:
                depth -= 1
                node, interested = stack[depth], 0
                for k in range(together):
                    interested += 1 if gaps[depth, k] < best[k] else 0
                if interested == 0:
                    continue
            while 0 < node < leaves:  # down to a leaf, or to where nothing is near enough
                kept = 0  # 1 if the first child may have something nearer, plus 2 if the second may
                for side in range(2):
                    # squared distances of the points from the box of the child
                    child, row = 2 * node + side, depth + side
                    ax, ay, az = bounds[child, 0], bounds[child, 1], bounds[child, 2]
                    bx, by, bz = bounds[child, 3], bounds[child, 4], bounds[child, 5]
                    interested = 0
                    for k in range(together):
                        x, y, z = coordinates[0, k], coordinates[1, k], coordinates[2, k]
                        dx = ax - x if ax - x > x - bx else x - bx
                        dx = dx if dx > 0.0 else 0.0
                        dy = ay - y if ay - y > y - by else y - by
                        dy = dy if dy > 0.0 else 0.0
                        dz = az - z if az - z > z - bz else z - bz
                        dz = dz if dz > 0.0 else 0.0
                        square = dx * dx + dy * dy + dz * dz
                        gaps[row, k] = square
                        interested += 1 if square < best[k] else 0
                    # its faces also lie in a disc, a flat cylinder, that may be farther away
                    if interested > 0 and discs[child, 7] >= 0.0:
                        ax, ay, az = discs[child, 0], discs[child, 1], discs[child, 2]
                        nx, ny, nz = discs[child, 3], discs[child, 4], discs[child, 5]
                        radius, thick = discs[child, 6], discs[child, 7]
                        interested = 0
                        for k in range(together):
                            x, y, z = coordinates[0, k] - ax, coordinates[1, k] - ay, coordinates[2, k] - az
                            along = x * nx + y * ny + z * nz
                            height = abs(along) - thick
                            height = height if height > 0.0 else 0.0
                            across = x * x + y * y + z * z - along * along
                            outside = np.sqrt(across if across > 0.0 else 0.0) - radius
                            outside = outside if outside > 0.0 else 0.0
                            flat = height * height + outside * outside
                            square = gaps[row, k]
                            square = flat if flat > square else square
                            gaps[row, k] = square
                            interested += 1 if square < best[k] else 0
                    kept += 1 + side if interested > 0 else 0
                node = 2 * node + 1 if kept == 2 else 2 * node if kept > 0 else np.int64(0)
                if kept == 3:  # first the one that is nearer to the middle one of the points
                    if gaps[depth, middle] <= gaps[depth + 1, middle]:
                        for k in range(together):
                            gaps[depth, k] = gaps[depth + 1, k]
                    else:
                        node += 1
                    stack[depth] = node ^ 1
                    depth += 1
            if node > 0:
                first, end = (node - leaves) * BOXES_PER_LEAF, (node - leaves + 1) * BOXES_PER_LEAF
            elif not begun:
                end = np.int64(1)  # a single item stands for the face found last
            for item in range(first, end):
                f = items[item] if begun else last
                if f < 0:
                    continue
                ax, ay, az = rows[f, 0], rows[f, 1], rows[f, 2]
                ux, uy, uz = rows[f, 3], rows[f, 4], rows[f, 5]
                vx, vy, vz = rows[f, 6], rows[f, 7], rows[f, 8]
                nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
                first_length, second_length, third_length = rows[f, 9], rows[f, 12], rows[f, 15]
                c, d, g, h = rows[f, 10], rows[f, 11], rows[f, 13], rows[f, 14]
                for k in range(together):  # as in `away_from_triangle`
                    x, y, z = coordinates[0, k] - ax, coordinates[1, k] - ay, coordinates[2, k] - az
                    p, q, up = x * ux + y * uy + z * uz, x * vx + y * vy + z * vz, x * nx + y * ny + z * nz
                    r = p - first_length
                    beyond = -q if -q > q * c - p * d else q * c - p * d
                    beyond = beyond if beyond > r * h - q * g else r * h - q * g
                    t = p if p > 0.0 else 0.0
                    t = t if t < first_length else first_length
                    square = (p - t) * (p - t) + q * q
                    t = p * c + q * d
                    t = t if t > 0.0 else 0.0
                    t = t if t < second_length else second_length
                    square_to_side = (p - t * c) * (p - t * c) + (q - t * d) * (q - t * d)
                    square = square_to_side if square_to_side < square else square
                    t = r * g + q * h
                    t = t if t > 0.0 else 0.0
                    t = t if t < third_length else third_length
                    square_to_side = (r - t * g) * (r - t * g) + (q - t * h) * (q - t * h)
                    square = square_to_side if square_to_side < square else square
                    square = up * up + (0.0 if beyond < 0.0 else square)
                    nearer = square < best[k]
                    best[k] = square if nearer else best[k]
                    which[k] = f if nearer else which[k]
            begun = True
        for k in range(min(together, len(points) - begin)):
            out_faces[begin + k], out_squares[begin + k] = which[k], best[k]
    return out_faces, out_squares
