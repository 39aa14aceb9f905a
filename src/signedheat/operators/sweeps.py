"""Diffusion on a grid by Gauss–Seidel sweeps of lines: ``(1 − tΔ) X = X₀``, right in direction at any distance.

The matrix has no positive off-diagonal entry, so neither the elimination within a line nor the sweeps ever subtract:
X decays over hundreds of decades and keeps its relative accuracy. Every stretch of `STRETCH` nodes carries its own
power of two beside single-precision mantissas, so that it cannot underflow either, on a grid of any length.

Lines along the last axis are solved exactly; along all other axes lines are updated in order, in every combination of
directions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from .wavefront import sweep_lines

STRETCH = 16
"""Nodes that share an exponent: X changes by less than e^16 over them at the default diffusion time."""
COMPONENTS = 4
"""Components of a vector in memory, whatever the dimension: one vector register."""
NOTHING = np.int32(-(2**30))
"""Exponent of a stretch that nothing has reached."""
POWERS = np.ldexp(1.0, -np.arange(128)).astype(np.float32)


@dataclass(frozen=True, eq=False)
class ScaledVectors:
    """Vectors on a grid with a power of two per stretch of a line.

    Attributes
    ----------
    mantissas : (l₀, l₁, l₂, n, 4) float32
        The grid's axes, with axes of one node in front where it has less than four; components beyond the grid's are 0.
    exponents : (l₀, l₁, l₂, ⌈n / STRETCH⌉) int32
        The vectors are ``mantissas · 2^exponents``.
    """

    mantissas: NDArray[np.float32]
    exponents: NDArray[np.int32]


def diffuse_by_sweeps(
    sources: NDArray[np.float32],
    touched: NDArray[np.bool_],
    active: NDArray[np.bool_],
    ratios: NDArray[np.float64],
    rounds: int,
) -> ScaledVectors:
    """Solve ``(1 + Σ_axes a · neighbours) X_i = B_i + Σ_axes a Σ X_j`` with no flux through the walls.

    Parameters
    ----------
    sources : (l₀, l₁, l₂, n, 4) float32
        B.
    touched : (l₀, l₁, l₂, ⌈n / STRETCH⌉) bool
        Stretches in which B is not zero.
    active : (l₀, l₁, l₂, ⌈n / STRETCH⌉) bool
        Stretches in which to solve; X is zero in all others.
    ratios : (4,) float
        a = t / h² along each axis.
    rounds : int
        How often each combination of directions is swept.
    """
    shape = sources.shape[:4]
    vectors = ScaledVectors(np.zeros(sources.shape, dtype=np.float32), np.full(touched.shape, NOTHING, dtype=np.int32))
    pivots = line_pivots(shape, ratios)
    sweep_lines(
        _sweep_tile,
        shape,
        rounds,
        vectors.mantissas,
        vectors.exponents,
        sources,
        touched,
        active,
        ratios.astype(np.float32),
        pivots,
        POWERS,
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


@njit(cache=True, nogil=True)
def _lift(size, exponent):
    """Power of two that brings values of this size near one, and the exponent that makes up for it."""
    factor = np.float32(1)
    if size == np.float32(0):
        return factor, np.int64(NOTHING)
    while size * factor < np.float32(2.0**-20) and factor < np.float32(2.0**100):
        factor *= np.float32(2.0**20)
        exponent -= 20
    while size * factor > np.float32(2.0**20):
        factor *= np.float32(2.0**-20)
        exponent += 20
    return factor, exponent


@njit(cache=True, nogil=True, fastmath={"contract", "reassoc", "nnan", "nsz"})
def _sweep_tile(mantissas, exponents, sources, touched, active, ratios, pivots, powers, tile):
    """Update the lines of one tile in order."""
    n0, n1, n2, n = mantissas.shape[:4]
    stretches = exponents.shape[3]
    row = np.empty(4 * n, dtype=np.float32)
    scale_of = np.empty(stretches, dtype=np.int32)
    along = ratios[3]
    i = tile[0]
    for j in range(tile[3], tile[4], tile[5]):
        for k in range(tile[6], tile[7], tile[8]):
            walls = 0
            if i == 0 or i == n0 - 1:
                walls |= 1
            if j == 0 or j == n1 - 1:
                walls |= 2
            if k == 0 or k == n2 - 1:
                walls |= 4
            pivot = pivots[walls]
            # right-hand side: what flows in from the lines around, and the source
            anything = False
            for s in range(stretches):
                scale_of[s] = NOTHING
                if not active[i, j, k, s]:
                    continue
                begin, end = 4 * STRETCH * s, min(4 * STRETCH * (s + 1), 4 * n)
                largest = np.int32(0) if touched[i, j, k, s] else NOTHING
                for side in range(6):
                    axis, step = side >> 1, 2 * (side & 1) - 1
                    a, b, c = i, j, k
                    if axis == 0:
                        a += step
                    elif axis == 1:
                        b += step
                    else:
                        c += step
                    if 0 <= a < n0 and 0 <= b < n1 and 0 <= c < n2:
                        largest = max(largest, exponents[a, b, c, s])
                scale_of[s] = largest
                if largest == NOTHING:
                    continue
                anything = True
                if touched[i, j, k, s]:
                    source = sources[i, j, k].reshape(-1)
                    factor = powers[min(largest, 127)]
                    for m in range(begin, end):
                        row[m] = factor * source[m]
                else:
                    for m in range(begin, end):
                        row[m] = np.float32(0.0)
                for side in range(6):
                    axis, step = side >> 1, 2 * (side & 1) - 1
                    a, b, c = i, j, k
                    if axis == 0:
                        a += step
                    elif axis == 1:
                        b += step
                    else:
                        c += step
                    if 0 <= a < n0 and 0 <= b < n1 and 0 <= c < n2:
                        gap = largest - exponents[a, b, c, s]
                        if gap < 127:
                            factor = ratios[axis] * powers[gap]
                            line = mantissas[a, b, c].reshape(-1)
                            for m in range(begin, end):
                                row[m] += factor * line[m]
            if not anything:
                continue
            # elimination
            x, y, z, w = np.float32(0), np.float32(0), np.float32(0), np.float32(0)
            carried = np.int64(NOTHING)
            for s in range(stretches):
                largest = max(scale_of[s], carried)
                if largest == NOTHING or not active[i, j, k, s]:
                    carried = np.int64(NOTHING)
                    continue
                factor = powers[min(largest - scale_of[s], 127)]
                if scale_of[s] == NOTHING:
                    factor = np.float32(0)
                    for m in range(STRETCH * s, min(STRETCH * (s + 1), n)):
                        for c in range(4):
                            row[4 * m + c] = np.float32(0)
                shift = powers[min(largest - carried, 127)] if carried != NOTHING else np.float32(0)
                x, y, z, w = shift * x, shift * y, shift * z, shift * w
                for m in range(STRETCH * s, min(STRETCH * (s + 1), n)):
                    p = factor * pivot[m]
                    q = along * pivot[m]
                    x = p * row[4 * m] + q * x
                    y = p * row[4 * m + 1] + q * y
                    z = p * row[4 * m + 2] + q * z
                    w = p * row[4 * m + 3] + q * w
                    row[4 * m], row[4 * m + 1], row[4 * m + 2], row[4 * m + 3] = x, y, z, w
                scale_of[s] = largest
                size = max(max(abs(x), abs(y)), max(abs(z), abs(w)))
                lift, level = _lift(size, largest)
                x, y, z, w = lift * x, lift * y, lift * z, lift * w
                carried = level
            # substitution
            x, y, z, w = np.float32(0), np.float32(0), np.float32(0), np.float32(0)
            carried = np.int64(NOTHING)
            out = mantissas[i, j, k].reshape(-1)
            for s in range(stretches - 1, -1, -1):
                largest = max(scale_of[s], carried)
                if largest == NOTHING or not active[i, j, k, s]:
                    carried = np.int64(NOTHING)
                    continue
                factor = powers[min(largest - scale_of[s], 127)]
                if scale_of[s] == NOTHING:
                    factor = np.float32(0)
                    for m in range(STRETCH * s, min(STRETCH * (s + 1), n)):
                        for c in range(4):
                            row[4 * m + c] = np.float32(0)
                shift = powers[min(largest - carried, 127)] if carried != NOTHING else np.float32(0)
                x, y, z, w = shift * x, shift * y, shift * z, shift * w
                for m in range(min(STRETCH * (s + 1), n) - 1, STRETCH * s - 1, -1):
                    q = along * pivot[m]
                    x = factor * row[4 * m] + q * x
                    y = factor * row[4 * m + 1] + q * y
                    z = factor * row[4 * m + 2] + q * z
                    w = factor * row[4 * m + 3] + q * w
                    row[4 * m], row[4 * m + 1], row[4 * m + 2], row[4 * m + 3] = x, y, z, w
                begin, end = 4 * STRETCH * s, min(4 * STRETCH * (s + 1), 4 * n)
                size = np.float32(0)
                for m in range(begin, end):
                    size = max(size, abs(row[m]))
                lift, level = _lift(size, largest)
                if lift != 1:
                    for m in range(begin, end):
                        row[m] *= lift
                    x, y, z, w = lift * x, lift * y, lift * z, lift * w
                for m in range(begin, end):
                    out[m] = row[m]
                exponents[i, j, k, s] = level
                carried = level
