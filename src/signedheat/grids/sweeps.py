"""Diffusion on a grid by line Gauss–Seidel sweeps: ``(1 − tΔ) X = B``, with directions right however small X becomes.

The matrix has no positive off-diagonal entry, so neither the elimination within a line nor the sweeps subtract: X
decays over many decades and keeps its relative accuracy. Lines along the last axis are solved exactly; along all other
axes lines are updated in order, in every combination of directions.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled
from ..memory import untouched_zeros
from .node_sources import STRETCH, NodeSources
from .wavefront import sweep_lines

TINY = np.float32(1e-34)
"""Values below this are treated as unknown, and taken from a coarser level."""


def diffuse_by_sweeps(
    sources: NodeSources,
    active: NDArray[np.bool_],
    ratios: NDArray[np.float64],
    rounds: int,
    given: NDArray[np.float32] | None = None,
) -> NDArray[np.float32]:
    """Solve ``(1 + Σ_axes a · neighbours) X_i = B_i + Σ_axes a Σ X_j``, Eq. 12, with no flux through the walls.

    Parameters
    ----------
    sources : NodeSources
        B, on a grid of (l₀, l₁, l₂, n) nodes.
    active : (l₀, l₁, l₂, ⌈n / STRETCH⌉) bool
        Stretches in which to solve.
    ratios : (4,) float
        a = t / h² along each axis.
    rounds : int
        How often each combination of sweep directions is used.
    given : (l₀, l₁, l₂, n, 4) float32, optional
        X in all other stretches, zero by default; overwritten.

    Returns
    -------
    (l₀, l₁, l₂, n, 4) float32
        X; memory outside the active stretches is never touched, so that it costs nothing.
    """
    shape = sources.shape
    vectors = untouched_zeros((*shape, 4), np.float32) if given is None else given
    ratios = np.minimum(ratios, 1e30)
    lines = shape[0] * shape[1] * shape[2]
    sweep_lines(
        _sweep_tiles,
        shape,
        rounds,
        vectors.reshape(lines, 4 * shape[3]),
        sources.sums.reshape(-1, 4 * STRETCH),
        sources.places.reshape(lines, -1),
        active.reshape(lines, -1),
        np.array(shape),
        ratios.astype(np.float32),
        line_pivots(shape, ratios),
    )
    return vectors


def line_pivots(shape: tuple[int, ...], ratios: NDArray[np.float64]) -> NDArray[np.float32]:
    """(8, n) reciprocal pivots of the tridiagonal matrix of a line; row bit k is set for lines at a wall of axis k."""
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


@compiled
def _sweep_tiles(
    vectors: NDArray[np.float32],
    sums: NDArray[np.float32],
    places: NDArray[np.int32],
    active: NDArray[np.bool_],
    shape: tuple[int, int, int, int],
    ratios: tuple[np.float32, np.float32, np.float32, np.float32],
    pivots: NDArray[np.float32],
    tiles: NDArray[np.int64],
) -> None:
    """Update the lines of tiles in order, four components at once. Slices of lines help the compiler to vectorise."""
    n0, n1, n2, n = shape
    ratio0, ratio1, ratio2, along = ratios
    scratch = np.empty(4 * n, dtype=np.float32)
    none = np.zeros(4 * n, dtype=np.float32)  # neighbours beyond the walls
    stretches = active.shape[1]
    for tile in tiles:
        for i in range(tile[0], tile[1], tile[2]):
            for j in range(tile[3], tile[4], tile[5]):
                for k in range(tile[6], tile[7], tile[8]):
                    here = (i * n1 + j) * n2 + k
                    walls = (i == 0 or i == n0 - 1) + 2 * (j == 0 or j == n1 - 1) + 4 * (k == 0 or k == n2 - 1)
                    stretch = 0
                    while stretch < stretches:
                        if not active[here, stretch]:
                            stretch += 1
                            continue
                        first = stretch
                        while stretch < stretches and active[here, stretch]:
                            stretch += 1
                        begin, end = first * STRETCH, min(stretch * STRETCH, n)
                        part = slice(4 * begin, 4 * end)
                        inflow, out, pivot = scratch[: 4 * (end - begin)], vectors[here, part], pivots[walls, begin:end]
                        # inflow from neighbouring lines, the source, and fixed values on the line itself
                        low = vectors[here - n2, part] if j > 0 else none[part]
                        high = vectors[here + n2, part] if j < n1 - 1 else none[part]
                        left = vectors[here - 1, part] if k > 0 else none[part]
                        right = vectors[here + 1, part] if k < n2 - 1 else none[part]
                        for m in range(len(inflow)):
                            inflow[m] = ratio1 * (low[m] + high[m]) + ratio2 * (left[m] + right[m])
                        if n0 > 1:
                            below = vectors[here - n1 * n2, part] if i > 0 else none[part]
                            above = vectors[here + n1 * n2, part] if i < n0 - 1 else none[part]
                            for m in range(len(inflow)):
                                inflow[m] += ratio0 * (below[m] + above[m])
                        for s in range(first, stretch):
                            row = places[here, s]
                            if row >= 0:
                                into = inflow[4 * STRETCH * (s - first) :]
                                for m in range(min(len(into), 4 * STRETCH)):
                                    into[m] += sums[row, m]
                        x, y, z, w = np.float32(0), np.float32(0), np.float32(0), np.float32(0)
                        if begin > 0:  # the previous node has been eliminated: its value is x + q · (value here)
                            before = vectors[here, 4 * begin - 4 : 4 * begin]
                            q = along * pivots[walls, begin - 1]
                            x, y = before[0] - q * out[0], before[1] - q * out[1]
                            z, w = before[2] - q * out[2], before[3] - q * out[3]
                        if end < n:
                            for c in range(4):
                                inflow[4 * (end - begin) - 4 + c] += along * vectors[here, 4 * end + c]
                        # forward elimination and back substitution
                        for m in range(end - begin):
                            p = pivot[m]
                            q = along * p
                            x = p * inflow[4 * m] + q * x
                            y = p * inflow[4 * m + 1] + q * y
                            z = p * inflow[4 * m + 2] + q * z
                            w = p * inflow[4 * m + 3] + q * w
                            inflow[4 * m] = x
                            inflow[4 * m + 1] = y
                            inflow[4 * m + 2] = z
                            inflow[4 * m + 3] = w
                        x, y, z, w = np.float32(0), np.float32(0), np.float32(0), np.float32(0)
                        for back in range(end - begin):
                            m = end - begin - 1 - back
                            q = along * pivot[m]
                            x = inflow[4 * m] + q * x
                            y = inflow[4 * m + 1] + q * y
                            z = inflow[4 * m + 2] + q * z
                            w = inflow[4 * m + 3] + q * w
                            out[4 * m] = x
                            out[4 * m + 1] = y
                            out[4 * m + 2] = z
                            out[4 * m + 3] = w
