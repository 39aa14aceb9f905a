"""Diffusion on a grid by Gauss–Seidel sweeps of lines: ``(1 − tΔ) X = X₀``, right in direction at any distance.

The matrix has no positive off-diagonal entry, so neither the elimination within a line nor the sweeps ever subtract:
X decays over hundreds of decades and keeps its relative accuracy. Every stretch of `STRETCH` nodes carries its own
power of two beside single-precision mantissas, so that it cannot underflow either, on a grid of any length.

Lines along the last axis are solved exactly; along all other axes lines are updated in order, in every combination of
directions. Tiles of lines on one diagonal do not depend on each other and run on several threads; each line reads the
same values as in plain order, so the result does not depend on the number of threads.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import product

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ..parallel import n_threads

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


def padded_shape(shape: tuple[int, ...]) -> tuple[int, int, int, int]:
    """Shape with axes of one node in front, to make four."""
    return (1,) * (4 - len(shape)) + tuple(shape)


def diffuse_by_sweeps(
    sources: NDArray[np.float32], touched: NDArray[np.bool_], ratios: NDArray[np.float64], rounds: int
) -> ScaledVectors:
    """Solve ``(1 + Σ_axes a · neighbours) X_i = B_i + Σ_axes a Σ X_j`` with no flux through the walls.

    Parameters
    ----------
    sources : (l₀, l₁, l₂, n, 4) float32
        B.
    touched : (l₀, l₁, l₂, ⌈n / STRETCH⌉) bool
        Stretches in which B is not zero.
    ratios : (4,) float
        a = t / h² along each axis.
    rounds : int
        How often each combination of directions is swept.
    """
    shape = sources.shape[:4]
    vectors = ScaledVectors(np.zeros(sources.shape, dtype=np.float32), np.full(touched.shape, NOTHING, dtype=np.int32))
    pivots = line_pivots(shape, ratios)
    steps = [(1, -1) if n > 1 else (1,) for n in shape[:3]]
    tile = [max(1, min(32, -(-n // 8))) for n in shape[1:3]]
    with ThreadPoolExecutor(n_threads()) as pool:
        for _ in range(rounds):
            for direction in product(*steps):
                for plane in range(shape[0])[:: direction[0]]:
                    for wave in wavefronts(shape[1:3], tile, direction[1:]):
                        jobs = [
                            pool.submit(
                                _sweep_tile,
                                vectors.mantissas,
                                vectors.exponents,
                                sources,
                                touched,
                                ratios.astype(np.float32),
                                pivots,
                                plane,
                                block,
                                POWERS,
                            )
                            for block in wave
                        ]
                        for job in jobs:
                            job.result()
    return vectors


def wavefronts(shape: tuple[int, int], tile: list[int], direction: tuple[int, int]) -> list[list[NDArray[np.int64]]]:
    """Tiles (begin, end, step; begin, end, step) of a plane of lines, in groups that may run at the same time."""
    starts = [range(0, n, size)[::step] for n, size, step in zip(shape, tile, direction, strict=True)]
    waves: list[list[NDArray[np.int64]]] = [[] for _ in range(len(starts[0]) + len(starts[1]) - 1)]
    for a, first in enumerate(starts[0]):
        for b, second in enumerate(starts[1]):
            block = []
            for start, n, size, step in zip((first, second), shape, tile, direction, strict=True):
                stop = min(start + size, n)
                block += [start, stop, 1] if step > 0 else [stop - 1, start - 1, -1]
            waves[a + b].append(np.array(block))
    return waves


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
def _sweep_tile(mantissas, exponents, sources, touched, ratios, pivots, i, block, powers):
    """Update the lines of one tile in order."""
    n0, n1, n2, n = mantissas.shape[:4]
    stretches = exponents.shape[3]
    row = np.empty(4 * n, dtype=np.float32)
    scale_of = np.empty(stretches, dtype=np.int32)
    along = ratios[3]
    for j in range(block[0], block[1], block[2]):
        for k in range(block[3], block[4], block[5]):
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
            carried = NOTHING
            for s in range(stretches):
                largest = max(scale_of[s], carried)
                if largest == NOTHING:
                    continue
                factor = powers[min(largest - scale_of[s], 127)]
                if scale_of[s] == NOTHING:
                    factor = np.float32(0)
                    for m in range(STRETCH * s, min(STRETCH * (s + 1), n)):
                        for c in range(4):
                            row[4 * m + c] = np.float32(0)
                shift = powers[min(largest - carried, 127)]
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
            carried = NOTHING
            out = mantissas[i, j, k].reshape(-1)
            for s in range(stretches - 1, -1, -1):
                largest = max(scale_of[s], carried)
                factor = powers[min(largest - scale_of[s], 127)]
                if scale_of[s] == NOTHING:
                    factor = np.float32(0)
                    for m in range(STRETCH * s, min(STRETCH * (s + 1), n)):
                        for c in range(4):
                            row[4 * m + c] = np.float32(0)
                shift = powers[min(largest - carried, 127)]
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
