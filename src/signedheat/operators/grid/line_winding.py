"""Winding numbers of closed surfaces: how often lines of nodes pass through faces before they reach a node."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...compiled import compiled

BESIDE = (3.1e-8, 7.3e-8)
"""Cells by which lines run beside the nodes: shapes that are aligned with these have edges and vertices there."""


def closed_winding_numbers(corners: NDArray[np.float64], shape: tuple[int, ...]) -> NDArray[np.int16] | None:
    """(*shape) winding number of closed surfaces around the nodes of a grid in space: exact, whole numbers.

    Lines along the last axis pass from before the surface to behind it. On which side of an edge a line runs, all faces
    on that edge agree, so that a line leaves as often as it enters.

    Parameters
    ----------
    corners : (m, 3, 3) float
        Of triangles with outward normals, in cells from the first node; every edge has as many faces one way as the
        other.
    shape : tuple of int
        Nodes along each axis.

    Returns
    -------
    (*shape) int, or None
        None if some line leaves more or less often than it enters: the surface is not closed, or rounding has it so.

    Examples
    --------
    >>> corners = np.array([[0.5, 0.5, 0.5], [2.5, 0.5, 0.5], [0.5, 2.5, 0.5], [0.5, 0.5, 2.5]])
    >>> faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    >>> winding = closed_winding_numbers(corners[faces], (4, 4, 4))
    >>> winding[1, 1].tolist(), int(winding.sum())
    ([0, 1, 0, 0], 1)
    >>> closed_winding_numbers(corners[faces[:3]], (4, 4, 4)) is None
    True
    """
    result = np.zeros(shape, dtype=np.int16)
    rest = np.zeros(shape[:2], dtype=np.int32)
    _count_passages(np.ascontiguousarray(corners).reshape(-1, 9), BESIDE[0], BESIDE[1], result, rest)
    return None if rest.any() else result


@compiled(nogil=True, error_model="numpy")
def _count_passages(
    corners: NDArray[np.float64], beside_x: float, beside_y: float, result: NDArray[np.int16], rest: NDArray[np.int32]
) -> None:
    n0, n1, n2 = result.shape
    for f in range(len(corners)):
        ax, ay, az = corners[f, 0] - beside_x, corners[f, 1] - beside_y, corners[f, 2]
        bx, by, bz = corners[f, 3] - beside_x, corners[f, 4] - beside_y, corners[f, 5]
        cx, cy, cz = corners[f, 6] - beside_x, corners[f, 7] - beside_y, corners[f, 8]
        i0 = max(0, np.int64(np.ceil(max(min(ax, bx, cx), -1.0))))
        i1 = min(n0 - 1, np.int64(np.floor(min(max(ax, bx, cx), n0 + 1.0))))
        j0 = max(0, np.int64(np.ceil(max(min(ay, by, cy), -1.0))))
        j1 = min(n1 - 1, np.int64(np.floor(min(max(ay, by, cy), n1 + 1.0))))
        for i in range(i0, i1 + 1):
            for j in range(j0, j1 + 1):
                p, q, r = (
                    _turn(ax - i, ay - j, bx - i, by - j),
                    _turn(bx - i, by - j, cx - i, cy - j),
                    _turn(cx - i, cy - j, ax - i, ay - j),
                )
                if p[1] != q[1] or q[1] != r[1]:
                    continue
                total = p[0] + q[0] + r[0]
                height = (q[0] * az + r[0] * bz + p[0] * cz) / total if total != 0.0 else az
                step = -1 if p[1] else 1  # a face that looks up is where the line leaves
                rest[i, j] += step
                if height <= n2 - 1:
                    result[i, j, max(0, np.int64(np.ceil(height)))] += np.int16(step)
    for i in range(n0):
        for j in range(n1):
            count = np.int16(0)
            for k in range(n2):
                count += result[i, j, k]
                result[i, j, k] = count


@compiled(nogil=True, error_model="numpy")
def _turn(ax: float, ay: float, bx: float, by: float) -> tuple[float, bool]:
    """Twice the area of the triangle (0, a, b), and whether it turns left: the opposite of (0, b, a), to the last bit.

    If it vanishes it counts as left for a before b, as if the origin were beside the line.
    """
    if ax < bx or (ax == bx and ay < by):
        area = ax * by - ay * bx
        return area, area >= 0.0
    area = bx * ay - by * ax
    return -area, not area >= 0.0
