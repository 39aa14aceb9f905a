"""Nearest places on triangles: of one, of all through a tree of boxes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled
from .box_tree import LEAF, BoxTree

# Feature codes of a foot: 0 inside the face; 1, 2, 3 on its edges (corner 0–1, 1–2, 2–0); 4, 5, 6 its corners 0, 1, 2.


@compiled
def triangle_rows(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """(m, 16) what `foot_on_triangle` needs of (m, 9) corners: a corner, two sides, their products and inverses.

    Triangles with no area, or so little that rounding hides it, get none: their feet are on their sides.
    """
    rows = np.zeros((len(corners), 16))
    for f in range(len(corners)):
        uu = uv = vv = 0.0
        for d in range(3):
            a = corners[f, d]
            u, v = corners[f, 3 + d] - a, corners[f, 6 + d] - a
            rows[f, d], rows[f, 3 + d], rows[f, 6 + d] = a, u, v
            uu += u * u
            uv += u * v
            vv += v * v
        ww = uu - 2.0 * uv + vv
        area = uu * vv - uv * uv
        rows[f, 9], rows[f, 10], rows[f, 11] = uu, uv, vv
        rows[f, 12] = 1.0 / uu if uu > 0.0 else 0.0
        rows[f, 13] = 1.0 / vv if vv > 0.0 else 0.0
        rows[f, 14] = 1.0 / ww if ww > 0.0 else 0.0
        rows[f, 15] = 1.0 / area if area > 1e-14 * uu * vv else 0.0
    return rows


@compiled
def foot_on_triangle(
    rows: NDArray[np.float64], f: int, x: float, y: float, z: float
) -> tuple[float, int, float, float, float]:
    """Squared distance to triangle f, feature code, and the three coordinates of the foot.

    Inside, where the foot of the perpendicular is; else the nearest on three sides, each found as a fraction.
    """
    px, py, pz = x - rows[f, 0], y - rows[f, 1], z - rows[f, 2]
    pu = px * rows[f, 3] + py * rows[f, 4] + pz * rows[f, 5]
    pv = px * rows[f, 6] + py * rows[f, 7] + pz * rows[f, 8]
    uu, uv, vv = rows[f, 9], rows[f, 10], rows[f, 11]
    s, t = (vv * pu - uv * pv) * rows[f, 15], (uu * pv - uv * pu) * rows[f, 15]
    feature = 0
    if not (s > 0.0 and t > 0.0 and s + t < 1.0):
        s, t = pu * rows[f, 12], 0.0
        s = s if s > 0.0 else 0.0
        s = s if s < 1.0 else 1.0
        best = s * (s * uu - 2.0 * pu)
        feature = 1 if s > 0.0 else 4
        feature = feature if s < 1.0 else 5
        r = pv * rows[f, 13]
        r = r if r > 0.0 else 0.0
        r = r if r < 1.0 else 1.0
        square = r * (r * vv - 2.0 * pv)
        if square < best:
            best, s, t = square, 0.0, r
            feature = 3 if r < 1.0 else 6
        qw = pv - pu - uv + uu
        r = qw * rows[f, 14]
        if r > 0.0 and r < 1.0:
            square = uu - 2.0 * pu - r * qw
            if square < best:
                s, t = 1.0 - r, r
                feature = 2
    dx = px - s * rows[f, 3] - t * rows[f, 6]
    dy = py - s * rows[f, 4] - t * rows[f, 7]
    dz = pz - s * rows[f, 5] - t * rows[f, 8]
    return dx * dx + dy * dy + dz * dz, feature, x - dx, y - dy, z - dz


@compiled
def barycentric_on_triangles(
    rows: NDArray[np.float64], faces: NDArray[np.int32], points: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(n, 3) barycentric coordinates of the place of a triangle that is nearest to each point."""
    weights = np.zeros((len(points), 3))
    for p in range(len(points)):
        f = faces[p]
        _, feature, x, y, z = foot_on_triangle(rows, f, points[p, 0], points[p, 1], points[p, 2])
        x, y, z = x - rows[f, 0], y - rows[f, 1], z - rows[f, 2]
        pu = x * rows[f, 3] + y * rows[f, 4] + z * rows[f, 5]
        pv = x * rows[f, 6] + y * rows[f, 7] + z * rows[f, 8]
        uu, uv, vv = rows[f, 9], rows[f, 10], rows[f, 11]
        s, t = 0.0, 0.0
        if feature == 0:
            s, t = (vv * pu - uv * pv) * rows[f, 15], (uu * pv - uv * pu) * rows[f, 15]
        elif feature == 1 or feature == 5:
            s = pu * rows[f, 12] if feature == 1 else 1.0
        elif feature == 3 or feature == 6:
            t = pv * rows[f, 13] if feature == 3 else 1.0
        elif feature == 2:
            t = (pv - pu - uv + uu) * rows[f, 14]
            s = 1.0 - t
        s, t = min(max(s, 0.0), 1.0), min(max(t, 0.0), 1.0)
        weights[p, 0], weights[p, 1], weights[p, 2] = max(1.0 - s - t, 0.0), s, t
    return weights


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
