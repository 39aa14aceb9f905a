"""Kernels: the nearest face of every node in a narrow band around faces.

Positions are in units of length from the grid's first node. Grids have three axes; `shape` counts their nodes.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled
from ..parallel import n_threads
from .point_triangle import foot_on_triangle

SLABS = 8
"""Parts of the grid that may be worked on at the same time."""


def nearest_in_band(
    rows: NDArray[np.float64], shape: tuple[int, ...], steps: NDArray[np.float64], reach: float
) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Nearest face of each node that has one within `reach`, −1 elsewhere, and the squares of the distances.

    Every face visits the nodes near its plane within its box: time grows with the number of faces plus that of the
    nodes in the band around each.

    Parameters
    ----------
    rows : (m, 16) float
        The faces, as `triangle_rows` gives them.
    shape, steps : three numbers each
        Nodes along the axes, and their distances.
    reach : float
        Half width of the band.
    """
    nearest = np.full(shape, -1, dtype=np.int32)
    squares = np.full(shape, np.inf, dtype=np.float32)
    cuts = [shape[0] * k // SLABS for k in range(SLABS + 1)]
    with ThreadPoolExecutor(n_threads()) as pool:
        jobs = [
            pool.submit(_visit_nodes, rows, steps, reach, nearest, squares, start, stop)
            for start, stop in pairwise(cuts)
        ]
        for job in jobs:
            job.result()
    _visit_walls(rows, steps, nearest, squares)
    return nearest, squares


@compiled
def _visit_walls(
    rows: NDArray[np.float64], steps: NDArray[np.float64], nearest: NDArray[np.int32], squares: NDArray[np.float32]
) -> None:
    """Faces that lie beyond a wall of the grid visit the nodes of that wall in front of them, however far."""
    first, last = np.empty(3, dtype=np.int64), np.empty(3, dtype=np.int64)
    for f in range(len(rows)):
        beyond = False
        for d in range(3):
            most = nearest.shape[d] - 1.0
            low = (rows[f, d] + min(0.0, rows[f, 3 + d], rows[f, 6 + d])) / steps[d]
            high = (rows[f, d] + max(0.0, rows[f, 3 + d], rows[f, 6 + d])) / steps[d]
            beyond = beyond or high < 0.0 or low > most
            first[d] = np.int64(min(max(np.floor(low), 0.0), most))
            last[d] = np.int64(min(max(np.ceil(high), 0.0), most))
        if not beyond:
            continue
        for i in range(first[0], last[0] + 1):
            for j in range(first[1], last[1] + 1):
                for k in range(first[2], last[2] + 1):
                    square = np.float32(foot_on_triangle(rows, f, i * steps[0], j * steps[1], k * steps[2])[0])
                    if square < squares[i, j, k]:
                        squares[i, j, k] = square
                        nearest[i, j, k] = f


@compiled
def _visit_nodes(
    rows: NDArray[np.float64],
    steps: NDArray[np.float64],
    reach: float,
    nearest: NDArray[np.int32],
    squares: NDArray[np.float32],
    start: int,
    stop: int,
) -> None:
    n1, n2 = nearest.shape[1], nearest.shape[2]
    h0, h1, h2 = steps
    limit = np.float32(reach * reach)
    low, high = np.empty(3), np.empty(3)
    for f in range(len(rows)):
        for d in range(3):
            low[d] = rows[f, d] + min(0.0, rows[f, 3 + d], rows[f, 6 + d]) - reach
            high[d] = rows[f, d] + max(0.0, rows[f, 3 + d], rows[f, 6 + d]) + reach
        i0, i1 = max(start, np.int64(np.ceil(max(low[0], -h0) / h0))), min(stop - 1, np.int64(np.floor(high[0] / h0)))
        if i0 > i1:
            continue
        j0, j1 = max(0, np.int64(np.ceil(low[1] / h1))), min(n1 - 1, np.int64(np.floor(high[1] / h1)))
        k0, k1 = max(0, np.int64(np.ceil(low[2] / h2))), min(n2 - 1, np.int64(np.floor(high[2] / h2)))
        ax, ay, az = rows[f, 0], rows[f, 1], rows[f, 2]
        ux, uy, uz, vx, vy, vz = rows[f, 3], rows[f, 4], rows[f, 5], rows[f, 6], rows[f, 7], rows[f, 8]
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        away = reach * np.sqrt(nx * nx + ny * ny + nz * nz)
        small = (i1 - i0 < 6) and (j1 - j0 < 6) and (k1 - k0 < 6)
        for i in range(i0, i1 + 1):
            for j in range(j0, j1 + 1):
                first, last = k0, k1
                if not small:  # only nodes within reach of the plane
                    height = nx * (i * h0 - ax) + ny * (j * h1 - ay) - nz * az
                    if abs(nz) * h2 * n2 > 1e-6 * away:
                        a, b = (-away - height) / (nz * h2), (away - height) / (nz * h2)
                        if a > b:
                            a, b = b, a
                        first = max(k0, np.int64(np.ceil(max(a, -1.0))))
                        last = min(k1, np.int64(np.floor(min(b, n2 + 1.0))))
                    elif abs(height) > 1.01 * away:
                        continue
                for k in range(first, last + 1):
                    square = np.float32(foot_on_triangle(rows, f, i * h0, j * h1, k * h2)[0])
                    if square <= limit and square < squares[i, j, k]:
                        squares[i, j, k] = square
                        nearest[i, j, k] = f
