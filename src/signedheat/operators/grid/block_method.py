"""The three steps of the method on some nodes of a grid, given by their neighbours: what lies beyond is a wall.

Nodes lie in blocks, and are numbered block by block. Each has six neighbours: before and behind along every axis, −1
where there is none. Positions are in cells.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...compiled import compiled
from .block_multigrid import Multigrid
from .blocks import SIDE, Blocks, off_grid, row_of_node

TINY = 1e-30
"""Values below this are treated as unknown."""
TOLERANCE = 1e-4
"""Residual of the Poisson equation, over its right side, at which it is solved."""
MOST = 100
"""Iterations at most."""


@dataclass(frozen=True, eq=False)
class SomeNodes:
    """Nodes of a grid.

    Attributes
    ----------
    blocks : Blocks
        In which they are.
    numbers : (b, 8, 8, 8) int32
        Number of each node of the blocks, −1 for those that are none of them.
    nodes : (n, 3) int32
        The nodes.
    neighbors : (n, 6) int32
        Nodes before and behind along each axis.
    """

    blocks: Blocks
    numbers: NDArray[np.int32]
    nodes: NDArray[np.int32]
    neighbors: NDArray[np.int32]

    @classmethod
    def of(cls, chosen: NDArray[np.bool_]) -> SomeNodes:
        """The chosen nodes of a grid, all of which is given.

        Examples
        --------
        >>> nodes = SomeNodes.of(np.array([[[True, True, False, True]]]))
        >>> nodes.neighbors[:, 4:].tolist()
        [[-1, 1], [0, -1], [-1, -1]]
        """
        blocks = Blocks.of(np.argwhere(chosen) // SIDE, chosen.shape)
        there = np.zeros((len(blocks), SIDE, SIDE, SIDE), dtype=bool)
        at = np.argwhere(chosen)
        i, j, k = (at % SIDE).T
        there[blocks.rows(at // SIDE), i, j, k] = True
        return cls._numbered(blocks, there)

    @classmethod
    def of_blocks(cls, blocks: Blocks) -> SomeNodes:
        """All nodes of some blocks that are on their grid."""
        there = np.ones((len(blocks), SIDE, SIDE, SIDE), dtype=bool)
        off_grid(there, blocks, False)
        return cls._numbered(blocks, there)

    @classmethod
    def _numbered(cls, blocks: Blocks, there: NDArray[np.bool_]) -> SomeNodes:
        numbers = np.full(there.shape, -1, dtype=np.int32)
        at = np.nonzero(there)
        numbers[at] = np.arange(len(at[0]), dtype=np.int32)
        nodes = np.empty((len(at[0]), 3), dtype=np.int32)
        for axis in range(3):
            nodes[:, axis] = blocks.places[at[0], axis] * SIDE + at[axis + 1]
        return cls(blocks, numbers, nodes, _neighbors(*blocks.tables, numbers, nodes, np.array(blocks.shape)))

    def in_blocks(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """(b, 8, 8, 8) values of all nodes of the blocks; NaN where there is none."""
        spread = np.full(self.numbers.shape, np.nan)
        spread[self.numbers >= 0] = values
        return spread

    def splat(self, positions: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n, 4) values (s, 4) at positions (s, 3) spread to the nodes around, as far as they are there."""
        result = np.zeros((len(self.nodes), 4))
        _splat(*self.blocks.tables, self.numbers, positions, values, np.array(self.blocks.shape), result)
        return result

    def at(self, values: NDArray[np.float64], positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """(s,) values at positions, linear between the nodes that are there; NaN where none is."""
        result = np.empty(len(positions))
        _read(*self.blocks.tables, self.numbers, positions, values, np.array(self.blocks.shape), result)
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


@dataclass(frozen=True, eq=False)
class BlockSources:
    """Samples of faces among some nodes, whose vectors are diffused from there.

    Attributes
    ----------
    nodes : SomeNodes
        The nodes.
    positions : (s, 3) float
        Of the samples, in cells.
    vectors : (s, 3) float
        Areas times normals.
    steps : (3,) float
        Distance between nodes.
    diffusion : float
        τ in ``t = τ h²``.
    rounds : int
        See `SomeNodes.diffuse`.
    """

    nodes: SomeNodes
    positions: NDArray[np.float64]
    vectors: NDArray[np.float64]
    steps: NDArray[np.float64]
    diffusion: float
    rounds: int

    @property
    def _weights(self) -> NDArray[np.float64]:
        weights: NDArray[np.float64] = np.linalg.norm(self.vectors, axis=1)
        return weights

    def _diffused(self, rows: NDArray[np.bool_], values: NDArray[np.float64]) -> NDArray[np.float64]:
        ratios = self.diffusion * (float(self.steps.mean()) / self.steps) ** 2
        return self.nodes.diffuse(self.nodes.splat(self.positions[rows], values), ratios, self.rounds)

    def directions(self) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """(n, 3) Y = X / |X|, and (n,) whether X is known at a node; it is 0 where it is not."""
        every = np.ones(len(self.vectors), dtype=bool)
        diffused = self._diffused(every, np.concatenate([self.vectors, self._weights[:, None]], axis=1))[:, :3]
        largest = np.abs(diffused).max(axis=1)
        arrived = largest > TINY * float(self._weights.max())
        directions = diffused / np.where(arrived, largest, 1.0)[:, None]
        lengths = np.linalg.norm(directions, axis=1)
        directions /= np.where(lengths > 0, lengths, 1.0)[:, None]
        return directions, np.asarray(arrived)

    def heights(self, phi: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """(n,) weights of the samples around each node, and the sums of φ at them times these."""
        known, sums = self._heights(phi)
        spread = self.nodes.splat(self.positions[known], sums)
        return spread[:, 0], spread[:, 1]

    def offsets(self, phi: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """(n,) by how much φ is off at the samples around each node, diffused, and whether it is known."""
        spread = self._diffused(*self._heights(phi))
        there = spread[:, 0] > TINY * float(self._weights.max())
        return np.where(there, spread[:, 1] / np.where(there, spread[:, 0], 1.0), 0.0), np.asarray(there)

    def _heights(self, phi: NDArray[np.float64]) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
        """(s,) samples among the nodes, and for these (k, 4) weights and φ times these."""
        heights = self.nodes.at(phi, self.positions)
        known = np.isfinite(heights)
        sums = np.zeros((int(known.sum()), 4))
        sums[:, 0], sums[:, 1] = self._weights[known], self._weights[known] * heights[known]
        return known, sums


@compiled(nogil=True)
def _number(
    cubes: NDArray[np.int32],
    rows: NDArray[np.int32],
    numbers: NDArray[np.int32],
    limit: NDArray[np.int64],
    i: int,
    j: int,
    k: int,
) -> int:
    """Of a node; −1 where there is none."""
    if not (0 <= i < limit[0] and 0 <= j < limit[1] and 0 <= k < limit[2]):
        return -1
    row = row_of_node(cubes, rows, i, j, k)
    return int(numbers[row, i % 8, j % 8, k % 8]) if row >= 0 else -1


@compiled(nogil=True)
def _neighbors(
    cubes: NDArray[np.int32],
    rows: NDArray[np.int32],
    numbers: NDArray[np.int32],
    nodes: NDArray[np.int32],
    limit: NDArray[np.int64],
) -> NDArray[np.int32]:
    """Looked up in the node's own block, and in others only beyond its rim."""
    result = np.full((len(nodes), 6), np.int32(-1))
    at, other = np.empty(3, dtype=np.int64), np.empty(3, dtype=np.int64)
    for p in range(len(nodes)):
        for d in range(3):
            at[d] = nodes[p, d]
        own = row_of_node(cubes, rows, at[0], at[1], at[2])
        for side in range(6):
            axis = side // 2
            for d in range(3):
                other[d] = at[d]
            other[axis] += 1 if side % 2 else -1
            if not 0 <= other[axis] < limit[axis]:
                continue
            row = own
            if other[axis] // SIDE != at[axis] // SIDE:
                row = row_of_node(cubes, rows, other[0], other[1], other[2])
            if row >= 0:
                result[p, side] = numbers[row, other[0] % SIDE, other[1] % SIDE, other[2] % SIDE]
    return result


@compiled(nogil=True)
def _splat(
    cubes: NDArray[np.int32],
    rows: NDArray[np.int32],
    numbers: NDArray[np.int32],
    positions: NDArray[np.float64],
    values: NDArray[np.float64],
    limit: NDArray[np.int64],
    out: NDArray[np.float64],
) -> None:
    for s in range(len(positions)):
        i, j, k = int(np.floor(positions[s, 0])), int(np.floor(positions[s, 1])), int(np.floor(positions[s, 2]))
        f, g, h = positions[s, 0] - i, positions[s, 1] - j, positions[s, 2] - k
        for corner in range(8):
            a, b, c = corner >> 2 & 1, corner >> 1 & 1, corner & 1
            p = _number(cubes, rows, numbers, limit, i + a, j + b, k + c)
            part = (f if a else 1.0 - f) * (g if b else 1.0 - g) * (h if c else 1.0 - h)
            if p >= 0:
                for d in range(4):
                    out[p, d] += part * values[s, d]


@compiled(nogil=True)
def _read(
    cubes: NDArray[np.int32],
    rows: NDArray[np.int32],
    numbers: NDArray[np.int32],
    positions: NDArray[np.float64],
    values: NDArray[np.float64],
    limit: NDArray[np.int64],
    out: NDArray[np.float64],
) -> None:
    for s in range(len(positions)):
        i, j, k = int(np.floor(positions[s, 0])), int(np.floor(positions[s, 1])), int(np.floor(positions[s, 2]))
        f, g, h = positions[s, 0] - i, positions[s, 1] - j, positions[s, 2] - k
        total, weight = 0.0, 0.0
        for corner in range(8):
            a, b, c = corner >> 2 & 1, corner >> 1 & 1, corner & 1
            p = _number(cubes, rows, numbers, limit, i + a, j + b, k + c)
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
