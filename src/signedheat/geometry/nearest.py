"""Closest points on triangles in space."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled
from .box_tree import LEAF, BoxTree
from .point_triangle import barycentric_on_triangles, foot_on_triangle, triangle_rows


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
    rows = triangle_rows(np.ascontiguousarray(triangles, dtype=np.float64).reshape(-1, 9))
    found, squares = np.empty(len(points), dtype=np.int32), np.empty(len(points))
    no_discs = np.full((len(tree.bounds), 8), -1.0)
    descend(rows, tree.bounds, no_discs, tree.items, points, len(points), found, squares)
    return found.astype(np.int64), barycentric_on_triangles(rows, found, points)


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
