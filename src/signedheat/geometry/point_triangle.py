"""Kernels: the place of a triangle that is nearest to a point, and which of its features it lies on."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled

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
