"""The three steps of the method on some nodes of a grid, given by their neighbours: what lies beyond is a wall.

Nodes are numbered in the order of the grid. Each has six neighbours: before and behind along every axis, −1 where there
is none. Positions are in cells.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...compiled import compiled
from .block_multigrid import Multigrid

TINY = 1e-30
"""Values below this are treated as unknown."""
TOLERANCE = 1e-4
"""Residual of the Poisson equation, over its right side, at which it is solved."""
MOST = 100
"""Iterations at most."""


@dataclass(frozen=True, eq=False)
class SomeNodes:
    """Nodes of a box of a grid.

    Attributes
    ----------
    numbers : (nx, ny, nz) int32
        Number of each node of the box, −1 for those that are none of them.
    nodes : (n, 3) int32
        The nodes.
    neighbors : (n, 6) int32
        Nodes before and behind along each axis.
    """

    numbers: NDArray[np.int32]
    nodes: NDArray[np.int32]
    neighbors: NDArray[np.int32]

    @classmethod
    def of(cls, chosen: NDArray[np.bool_]) -> SomeNodes:
        """The chosen nodes of a box.

        Examples
        --------
        >>> nodes = SomeNodes.of(np.array([[[True, True, False, True]]]))
        >>> nodes.neighbors[:, 4:].tolist()
        [[-1, 1], [0, -1], [-1, -1]]
        """
        nodes = np.argwhere(chosen).astype(np.int32)
        numbers = np.full(chosen.shape, -1, dtype=np.int32)
        numbers[chosen] = np.arange(len(nodes), dtype=np.int32)
        return cls(numbers, nodes, _neighbors(numbers, nodes))

    def splat(self, positions: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n, 4) values (s, 4) at positions (s, 3) spread to the nodes around, as far as they are there."""
        result = np.zeros((len(self.nodes), 4))
        _splat(self.numbers, positions, values, result)
        return result

    def at(self, values: NDArray[np.float64], positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """(s,) values at positions, linear between the nodes that are there; NaN where none is."""
        result = np.empty(len(positions))
        _read(self.numbers, positions, values, result)
        return result

    def diffuse(self, sources: NDArray[np.float64], ratios: NDArray[np.float64], rounds: int) -> NDArray[np.float64]:
        """(n, 4) X of ``(1 − tΔ) X = B``, Eq. 12, by Gauss–Seidel sweeps to and fro; see `sweeps` for their merit.

        Parameters
        ----------
        sources : (n, 4) float
            B.
        ratios : (3,) float
            t / h² along each axis.
        rounds : int
            Pairs of sweeps; X is known as many cells from the sources.
        """
        result = np.zeros_like(sources)
        _sweep(self.neighbors, sources, ratios, rounds, result)
        return result

    def integrate(
        self, directions: NDArray[np.float64], steps: NDArray[np.float64], start: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """(n,) φ that is nearest to having the given (n, 3) gradients, Eq. 13, by conjugate gradients from a start.

        The constant of each connected part is whatever comes out.
        """
        weights = 1.0 / steps**2
        right, image = np.zeros(len(start)), np.zeros(len(start))
        _fluxes(self.neighbors, directions, 1.0 / steps, right)
        preconditioner = Multigrid.of(self.nodes, self.neighbors, weights)
        _laplacian(self.neighbors, weights, start, image)
        residual = right - image
        phi: NDArray[np.float64] = start.copy()
        largest = max(float(np.abs(right).max()), 1e-300)
        least, square, way = TOLERANCE * float(np.linalg.norm(right)), 1.0, np.zeros(len(start))
        for _ in range(MOST):
            if float(np.linalg.norm(residual)) <= least:
                break
            scaled = preconditioner((residual / largest).astype(np.float32))
            before, square = square, float(residual @ scaled)
            way *= square / before
            way += scaled
            _laplacian(self.neighbors, weights, way, image)
            length = square / float(way @ image)
            phi += length * way
            residual -= length * image
        return phi


@compiled(nogil=True)
def _neighbors(numbers: NDArray[np.int32], nodes: NDArray[np.int32]) -> NDArray[np.int32]:
    n0, n1, n2 = numbers.shape
    result = np.empty((len(nodes), 6), dtype=np.int32)
    for p in range(len(nodes)):
        i, j, k = nodes[p, 0], nodes[p, 1], nodes[p, 2]
        result[p, 0] = numbers[i - 1, j, k] if i > 0 else -1
        result[p, 1] = numbers[i + 1, j, k] if i + 1 < n0 else -1
        result[p, 2] = numbers[i, j - 1, k] if j > 0 else -1
        result[p, 3] = numbers[i, j + 1, k] if j + 1 < n1 else -1
        result[p, 4] = numbers[i, j, k - 1] if k > 0 else -1
        result[p, 5] = numbers[i, j, k + 1] if k + 1 < n2 else -1
    return result


@compiled(nogil=True)
def _splat(
    numbers: NDArray[np.int32],
    positions: NDArray[np.float64],
    values: NDArray[np.float64],
    out: NDArray[np.float64],
) -> None:
    for s in range(len(positions)):
        i, j, k = int(np.floor(positions[s, 0])), int(np.floor(positions[s, 1])), int(np.floor(positions[s, 2]))
        f, g, h = positions[s, 0] - i, positions[s, 1] - j, positions[s, 2] - k
        for corner in range(8):
            a, b, c = corner >> 2 & 1, corner >> 1 & 1, corner & 1
            x, y, z = i + a, j + b, k + c
            if 0 <= x < numbers.shape[0] and 0 <= y < numbers.shape[1] and 0 <= z < numbers.shape[2]:
                p = numbers[x, y, z]
                part = (f if a else 1.0 - f) * (g if b else 1.0 - g) * (h if c else 1.0 - h)
                if p >= 0:
                    for d in range(4):
                        out[p, d] += part * values[s, d]


@compiled(nogil=True)
def _read(
    numbers: NDArray[np.int32],
    positions: NDArray[np.float64],
    values: NDArray[np.float64],
    out: NDArray[np.float64],
) -> None:
    for s in range(len(positions)):
        i, j, k = int(np.floor(positions[s, 0])), int(np.floor(positions[s, 1])), int(np.floor(positions[s, 2]))
        f, g, h = positions[s, 0] - i, positions[s, 1] - j, positions[s, 2] - k
        total, weight = 0.0, 0.0
        for corner in range(8):
            a, b, c = corner >> 2 & 1, corner >> 1 & 1, corner & 1
            x, y, z = i + a, j + b, k + c
            if 0 <= x < numbers.shape[0] and 0 <= y < numbers.shape[1] and 0 <= z < numbers.shape[2]:
                p = numbers[x, y, z]
                part = (f if a else 1.0 - f) * (g if b else 1.0 - g) * (h if c else 1.0 - h)
                if p >= 0:
                    total += part * values[p]
                    weight += part
        out[s] = total / weight if weight > 0.5 else np.nan


@compiled(nogil=True)
def _sweep(
    neighbors: NDArray[np.int32],
    sources: NDArray[np.float64],
    ratios: NDArray[np.float64],
    rounds: int,
    out: NDArray[np.float64],
) -> None:
    n = len(neighbors)
    for turn in range(2 * rounds):
        for count in range(n):
            p = count if turn % 2 == 0 else n - 1 - count
            x, y, z, w = sources[p, 0], sources[p, 1], sources[p, 2], sources[p, 3]
            total = 1.0
            for side in range(6):
                q = neighbors[p, side]
                if q >= 0:
                    a = ratios[side // 2]
                    total += a
                    x += a * out[q, 0]
                    y += a * out[q, 1]
                    z += a * out[q, 2]
                    w += a * out[q, 3]
            out[p, 0], out[p, 1], out[p, 2], out[p, 3] = x / total, y / total, z / total, w / total


@compiled(nogil=True)
def _fluxes(
    neighbors: NDArray[np.int32],
    directions: NDArray[np.float64],
    inverse: NDArray[np.float64],
    out: NDArray[np.float64],
) -> None:
    """What flows into each node across the faces between it and its neighbours, per cell."""
    for p in range(len(neighbors)):
        total = 0.0
        for side in range(6):
            q = neighbors[p, side]
            if q >= 0:
                axis = side // 2
                flux = 0.5 * (directions[p, axis] + directions[q, axis]) * inverse[axis]
                total += flux if side % 2 == 0 else -flux
        out[p] = total


@compiled(nogil=True)
def _laplacian(
    neighbors: NDArray[np.int32],
    weights: NDArray[np.float64],
    values: NDArray[np.float64],
    out: NDArray[np.float64],
) -> None:
    for p in range(len(neighbors)):
        total = 0.0
        for side in range(6):
            q = neighbors[p, side]
            if q >= 0:
                total += weights[side // 2] * (values[p] - values[q])
        out[p] = total
