"""Closest points on triangles in space."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled
from .box_tree import LEAF, BoxTree
from .point_triangle import foot_on_triangle, triangle_rows


def nearest_on_triangles(
    triangles: NDArray[np.float64], tree: BoxTree, points: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Closest triangle to each of (k, 3) points, and barycentric coordinates of the closest point in it.

    Examples
    --------
    >>> triangle = np.array([[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]])
    >>> tree = BoxTree.of(triangle.min(axis=1), triangle.max(axis=1))
    >>> nearest_on_triangles(triangle, tree, np.array([[0.5, -1.0, 3.0], [2.0, 2.0, 0.0]]))
    (array([0, 0]), array([[0.5, 0.5, 0. ],
           [0. , 0.5, 0.5]]))
    """
    corners = np.ascontiguousarray(triangles, dtype=np.float64)
    found, squares = np.empty(len(points), dtype=np.int32), np.empty(len(points))
    no_discs = np.full((len(tree.bounds), 8), -1.0)
    descend(
        triangle_rows(corners.reshape(-1, 9)), tree.bounds, no_discs, tree.items, points, len(points), found, squares
    )
    return found.astype(np.int64), _weights(corners, found, points)


@compiled
def descend(
    rows: NDArray[np.float64],
    bounds: NDArray[np.float64],
    discs: NDArray[np.float64],
    items: NDArray[np.int64],
    points: NDArray[np.float64],
    run: int,
    out_faces: NDArray[np.int32],
    out_squares: NDArray[np.float64],
) -> None:
    """Nearest face of each point, and the square of its distance, down a tree of boxes.

    Every `run` points the search starts anew, in between from the face before. Where a node has a disc
    (`FaceTree.discs`) that is farther than its box, it counts. All in one function, since calls cost as much as boxes.

    Parameters
    ----------
    rows : (m, 16) float
        The faces, as `triangle_rows` gives them; there is at least one.
    bounds, items : arrays
        Of a `BoxTree`.
    discs : (2 · leaves, 8) float
        See `FaceTree.discs`.
    points : (n, 3) float
        Positions.
    run : int
        See above.
    out_faces, out_squares : (n,)
        What is found.
    """
    leaves = len(bounds) // 2
    stack, gaps = np.empty(64, dtype=np.int64), np.empty(64)
    face = np.int64(0)
    for p in range(len(points)):
        x, y, z = points[p, 0], points[p, 1], points[p, 2]
        best, depth, node = np.inf, 0, np.int64(1)
        if p % run != 0:
            best, _, _, _, _ = foot_on_triangle(rows, face, x, y, z)
        while node > 0:
            while 0 < node < leaves:
                near, gap, other = np.int64(0), np.inf, np.inf
                for child in range(2 * node, 2 * node + 2):
                    a = max(bounds[child, 0] - x, x - bounds[child, 3], 0.0)
                    b = max(bounds[child, 1] - y, y - bounds[child, 4], 0.0)
                    c = max(bounds[child, 2] - z, z - bounds[child, 5], 0.0)
                    square = a * a + b * b + c * c
                    if square < best and discs[child, 7] >= 0.0:
                        px, py, pz = x - discs[child, 0], y - discs[child, 1], z - discs[child, 2]
                        along = px * discs[child, 3] + py * discs[child, 4] + pz * discs[child, 5]
                        height = max(abs(along) - discs[child, 7], 0.0)
                        beside = np.sqrt(max(px * px + py * py + pz * pz - along * along, 0.0)) - discs[child, 6]
                        flat = height * height + (beside * beside if beside > 0.0 else 0.0)
                        square = max(square, flat)
                    if square < gap:
                        near, gap, other = child, square, gap
                    else:
                        other = square
                if not gap < best:
                    node = np.int64(0)
                    break
                if other < best:
                    stack[depth], gaps[depth] = near ^ 1, other
                    depth += 1
                node = near
            if node >= leaves:
                for k in range((node - leaves) * LEAF, (node - leaves + 1) * LEAF):
                    if items[k] >= 0:
                        square, _, _, _, _ = foot_on_triangle(rows, items[k], x, y, z)
                        if square < best:
                            best, face = square, items[k]
            node = np.int64(0)
            while depth > 0 and node == 0:
                depth -= 1
                if gaps[depth] < best:
                    node = stack[depth]
        out_faces[p], out_squares[p] = face, best


@compiled
def _weights(
    triangles: NDArray[np.float64], faces: NDArray[np.int32], points: NDArray[np.float64]
) -> NDArray[np.float64]:
    weights = np.empty((len(points), 3))
    for p in range(len(points)):
        _, u, v, w = place_on_triangle(triangles[faces[p]], points[p, 0], points[p, 1], points[p, 2])
        weights[p, 0], weights[p, 1], weights[p, 2] = u, v, w
    return weights


@compiled
def place_on_triangle(triangle, x, y, z):
    """Squared distance of (x, y, z) from a triangle, and barycentric coordinates of its closest point.

    The foot of the perpendicular if that lies inside, otherwise the closest point of the three sides. Scalars instead
    of arrays, because arrays would be allocated for every triangle.
    """
    ax, ay, az = triangle[0]
    bx, by, bz = triangle[1, 0] - ax, triangle[1, 1] - ay, triangle[1, 2] - az
    cx, cy, cz = triangle[2, 0] - ax, triangle[2, 1] - ay, triangle[2, 2] - az
    px, py, pz = x - ax, y - ay, z - az
    nx, ny, nz = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
    square = nx * nx + ny * ny + nz * nz
    if square > 0.0:
        v = (nx * (py * cz - pz * cy) + ny * (pz * cx - px * cz) + nz * (px * cy - py * cx)) / square
        w = (nx * (by * pz - bz * py) + ny * (bz * px - bx * pz) + nz * (bx * py - by * px)) / square
        if v >= 0.0 and w >= 0.0 and v + w <= 1.0:
            height = nx * px + ny * py + nz * pz
            return height * height / square, 1.0 - v - w, v, w
    first, s = _on_side(px, py, pz, bx, by, bz)
    second, t = _on_side(px - bx, py - by, pz - bz, cx - bx, cy - by, cz - bz)
    third, r = _on_side(px - cx, py - cy, pz - cz, -cx, -cy, -cz)
    if first <= second and first <= third:
        return first, 1.0 - s, s, 0.0
    if second <= third:
        return second, 0.0, 1.0 - t, t
    return third, r, 0.0, 1.0 - r


@compiled
def _on_side(px, py, pz, dx, dy, dz):
    """Squared distance of p from the segment from 0 to d, and the fraction of the segment at the closest point."""
    length = dx * dx + dy * dy + dz * dz
    s = min(max((px * dx + py * dy + pz * dz) / length, 0.0), 1.0) if length > 0.0 else 0.0
    ex, ey, ez = px - s * dx, py - s * dy, pz - s * dz
    return ex * ex + ey * ey + ez * ez, s
