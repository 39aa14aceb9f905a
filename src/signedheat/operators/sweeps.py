"""Diffusion on a grid by Gauss–Seidel sweeps of lines: ``(1 − tΔ) X = B``, right in direction however small X becomes.

The matrix has no positive off-diagonal entry, so neither the elimination within a line nor the sweeps ever subtract:
X decays over many decades and keeps its relative accuracy. Lines along the last axis are solved exactly; along all
other axes lines are updated in order, in every combination of directions.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from .wavefront import sweep_lines

TINY = np.float32(1e-34)
"""Where nothing greater arrives, a coarser level knows better."""
STRETCH = 8
"""Nodes of a line that are swept, or left out, together."""


def diffuse_by_sweeps(
    sources: NDArray[np.float32],
    touched: NDArray[np.bool_],
    active: NDArray[np.bool_],
    ratios: NDArray[np.float64],
    rounds: int,
    given: NDArray[np.float32] | None = None,
) -> NDArray[np.float32]:
    """Solve ``(1 + Σ_axes a · neighbours) X_i = B_i + Σ_axes a Σ X_j`` with no flux through the walls.

    Parameters
    ----------
    sources : (l₀, l₁, l₂, n, 4) float32
        B: the grid's axes, with axes of one node in front where it has less than four; components beyond the grid's
        are zero.
    touched : (l₀, l₁, l₂, ⌈n / STRETCH⌉) bool
        Stretches in which B is not zero.
    active : (l₀, l₁, l₂, ⌈n / STRETCH⌉) bool
        Stretches in which to solve.
    ratios : (4,) float
        a = t / h² along each axis.
    rounds : int
        How often each combination of directions is swept.
    given : (l₀, l₁, l₂, n, 4) float32, optional
        X in all other stretches, zero by default; overwritten.

    Returns
    -------
    (l₀, l₁, l₂, n, 4) float32
        X; pages outside the active stretches are never touched.
    """
    shape = sources.shape[:4]
    vectors = np.zeros_like(sources) if given is None else given
    lines = shape[0] * shape[1] * shape[2]
    sweep_lines(
        _sweep_tile,
        shape,
        rounds,
        vectors.reshape(lines, 4 * shape[3]),
        sources.reshape(lines, 4 * shape[3]),
        touched.reshape(lines, -1),
        active.reshape(lines, -1),
        np.array(shape),
        ratios.astype(np.float32),
        line_pivots(shape, ratios),
    )
    return vectors


def line_pivots(shape: tuple[int, ...], ratios: NDArray[np.float64]) -> NDArray[np.float32]:
    """(8, n) reciprocal pivots of the tridiagonal matrix of a line; bit k is set for lines at a wall of axis k."""
    n = shape[3]
    along = np.full(n, 2.0)
    along[0] = along[-1] = 1.0
    table = np.empty((8, n))
    for walls in range(8):
        across = sum(ratios[k] * (2 - (walls >> k & 1)) for k in range(3) if shape[k] > 1)
        previous = 0.0
        for k in range(n):
            previous = 1.0 / (1.0 + across + ratios[3] * along[k] - ratios[3] ** 2 * previous)
            table[walls, k] = previous
    return table.astype(np.float32)


@njit(cache=True, nogil=True, fastmath={"contract", "reassoc", "nnan", "nsz"})
def _sweep_tile(vectors, sources, touched, active, shape, ratios, pivots, tile):
    """Update the lines of one tile in order: four components side by side."""
    n0, n1, n2, n = shape
    row = np.empty(4 * n, dtype=np.float32)
    none = np.zeros(4 * n, dtype=np.float32)  # beyond the walls
    for i in range(tile[0], tile[1], tile[2]):
        for j in range(tile[3], tile[4], tile[5]):
            for k in range(tile[6], tile[7], tile[8]):
                here = (i * n1 + j) * n2 + k
                stretch, stretches = 0, active.shape[1]
                walls = (i == 0 or i == n0 - 1) + 2 * (j == 0 or j == n1 - 1) + 4 * (k == 0 or k == n2 - 1)
                pivot = pivots[walls]
                while stretch < stretches:
                    if not active[here, stretch]:
                        stretch += 1
                        continue
                    first = stretch
                    while stretch < stretches and active[here, stretch]:
                        stretch += 1
                    begin, end = first * STRETCH, min(stretch * STRETCH, n)
                    # what flows in from the lines around, and the source
                    low, high = vectors[here - n2] if j > 0 else none, vectors[here + n2] if j < n1 - 1 else none
                    left, right = vectors[here - 1] if k > 0 else none, vectors[here + 1] if k < n2 - 1 else none
                    for m in range(4 * begin, 4 * end):
                        row[m] = ratios[1] * (low[m] + high[m]) + ratios[2] * (left[m] + right[m])
                    if n0 > 1:
                        below, above = (
                            vectors[here - n1 * n2] if i > 0 else none,
                            vectors[here + n1 * n2] if i < n0 - 1 else none,
                        )
                        for m in range(4 * begin, 4 * end):
                            row[m] += ratios[0] * (below[m] + above[m])
                    for s in range(first, stretch):
                        if touched[here, s]:
                            for m in range(4 * STRETCH * s, min(4 * STRETCH * (s + 1), 4 * n)):
                                row[m] += sources[here, m]
                    # elimination and substitution, between neighbours on the line whose values stay
                    along = ratios[3]
                    out = vectors[here]
                    x, y, z, w = np.float32(0), np.float32(0), np.float32(0), np.float32(0)
                    if begin > 0:
                        m = 4 * begin - 4
                        q = along * pivot[begin - 1]  # of the eliminated neighbour, whose value is x + q · (value here)
                        x, y = out[m] - q * out[m + 4], out[m + 1] - q * out[m + 5]
                        z, w = out[m + 2] - q * out[m + 6], out[m + 3] - q * out[m + 7]
                    if end < n:
                        for c in range(4):
                            row[4 * end - 4 + c] += along * out[4 * end + c]
                    for m in range(begin, end):
                        p = pivot[m]
                        q = along * p
                        x = p * row[4 * m] + q * x
                        y = p * row[4 * m + 1] + q * y
                        z = p * row[4 * m + 2] + q * z
                        w = p * row[4 * m + 3] + q * w
                        row[4 * m] = x
                        row[4 * m + 1] = y
                        row[4 * m + 2] = z
                        row[4 * m + 3] = w
                    x, y, z, w = np.float32(0), np.float32(0), np.float32(0), np.float32(0)
                    for m in range(end - 1, begin - 1, -1):
                        q = along * pivot[m]
                        x = row[4 * m] + q * x
                        y = row[4 * m + 1] + q * y
                        z = row[4 * m + 2] + q * z
                        w = row[4 * m + 3] + q * w
                        out[4 * m] = x
                        out[4 * m + 1] = y
                        out[4 * m + 2] = z
                        out[4 * m + 3] = w
