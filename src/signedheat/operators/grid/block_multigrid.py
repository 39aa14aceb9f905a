"""A preconditioner for Poisson's equation on some nodes of a grid: cubes of 2³ nodes are the nodes of the next level.

Cubes are joined as their nodes are, with the sum of the weights. That makes a level twice too stiff, since within a
cube values do not rise; corrections are therefore doubled (Braess 1995). One sweep of Gauss–Seidel before and one to
the other way after the correction keep the whole symmetric.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...compiled import compiled

FEWEST = 64
"""Nodes of a level from which on there is no coarser one."""
LAST = 8
"""Pairs of sweeps on the last level."""
SPARSE = 64
"""Cells of a box for each node from which on a table of all of them is larger than sorting the nodes is slow."""
STIFF = 1.8
"""By how much corrections are enlarged; 2 for smooth ones in the middle of many nodes, less at walls."""


@dataclass(frozen=True, eq=False)
class Level:
    """Nodes of one level, and the cubes that they make.

    Attributes
    ----------
    neighbors : (n, 6) int32
        Nodes before and behind along each axis; −1 where there is none.
    weights : (n, 6) float32
        Of the differences to them; 0 where there is none.
    diagonal : (n,) float32
        Their sums; 1 for nodes that stand alone.
    cubes : (n,) int32
        The node of the next level that each is part of; none of the last.
    """

    neighbors: NDArray[np.int32]
    weights: NDArray[np.float32]
    diagonal: NDArray[np.float32]
    cubes: NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Multigrid:
    """All levels, the finest first."""

    levels: list[Level]

    @classmethod
    def of(cls, nodes: NDArray[np.int32], neighbors: NDArray[np.int32], axis_weights: NDArray[np.float64]) -> Multigrid:
        """Levels over (n, 3) nodes, with one weight for differences along each axis, up to a common factor.

        Examples
        --------
        >>> line = np.arange(200, dtype=np.int32)
        >>> links = np.full((200, 6), -1, dtype=np.int32)
        >>> links[1:, 0], links[:-1, 1] = line[:-1], line[1:]
        >>> grids = Multigrid.of(np.stack([line, 0 * line, 0 * line], axis=1), links, np.ones(3))
        >>> [len(level.neighbors) for level in grids.levels]
        [200, 100, 50]
        """
        _, power = np.frexp(axis_weights.max())  # single precision has room for no more; directions do not depend on it
        along = np.ldexp(axis_weights, -power)
        weights = np.where(neighbors >= 0, np.repeat(along, 2), 0.0).astype(np.float32)
        levels: list[Level] = []
        while True:
            diagonal = weights.sum(axis=1, dtype=np.float32)
            diagonal[diagonal == 0] = 1.0
            none = np.zeros(0, dtype=np.int32)
            if len(nodes) <= FEWEST:
                return cls([*levels, Level(neighbors, weights, diagonal, none)])
            parents, cubes = _cubes(nodes)
            levels.append(Level(neighbors, weights, diagonal, cubes))
            neighbors, weights = _joined(neighbors, weights, cubes, len(parents))
            nodes = parents

    def __call__(self, right: NDArray[np.float32]) -> NDArray[np.float32]:
        """An approximate solution of the equation with a right side, up to a factor: one V-cycle from zero."""
        return self._cycle(0, right)

    def _cycle(self, depth: int, right: NDArray[np.float32]) -> NDArray[np.float32]:
        level = self.levels[depth]
        values = np.zeros_like(right)
        is_last = depth + 1 == len(self.levels)
        for _ in range(LAST if is_last else 1):
            _sweep(level.neighbors, level.weights, level.diagonal, right, False, values)
            if not is_last:
                rest = np.zeros(len(self.levels[depth + 1].diagonal), dtype=np.float32)
                _restrict(level.neighbors, level.weights, level.diagonal, right, values, level.cubes, rest)
                _add(self._cycle(depth + 1, rest), level.cubes, values)
            _sweep(level.neighbors, level.weights, level.diagonal, right, True, values)
        return values


def _cubes(nodes: NDArray[np.int32]) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Cubes of 2³ nodes, in order, and the cube of each node."""
    halves = nodes >> 1
    halves -= halves.min(axis=0)
    extent = halves.max(axis=0).astype(np.int64) + 1
    flat = (halves[:, 0] * extent[1] + halves[:, 1]) * extent[2] + halves[:, 2]
    if extent.prod() > SPARSE * len(flat):
        held, number = np.unique(flat, return_inverse=True)
        cubes = number.astype(np.int32)
    else:
        taken = np.zeros(int(extent.prod()), dtype=np.bool_)
        taken[flat] = True
        held, cubes = np.flatnonzero(taken), (np.cumsum(taken, dtype=np.int32) - 1)[flat]
    return np.stack(np.unravel_index(held, tuple(extent)), axis=1).astype(np.int32), cubes


@compiled(nogil=True)
def _joined(
    neighbors: NDArray[np.int32], weights: NDArray[np.float32], cubes: NDArray[np.int32], count: int
) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Neighbours of cubes, and the sums of the weights between them."""
    others = np.full((count, 6), -1, dtype=np.int32)
    sums = np.zeros((count, 6), dtype=np.float32)
    for p in range(len(neighbors)):
        for side in range(6):
            q = neighbors[p, side]
            if q >= 0 and cubes[q] != cubes[p]:
                others[cubes[p], side] = cubes[q]
                sums[cubes[p], side] += weights[p, side]
    return others, sums


@compiled(nogil=True, error_model="numpy")
def _sweep(
    neighbors: NDArray[np.int32],
    weights: NDArray[np.float32],
    diagonal: NDArray[np.float32],
    right: NDArray[np.float32],
    backward: bool,
    values: NDArray[np.float32],
) -> None:
    n = len(neighbors)
    for count in range(n):
        p = n - 1 - count if backward else count
        total = right[p]
        for side in range(6):
            q = neighbors[p, side]
            if q >= 0:
                total += weights[p, side] * values[q]
        values[p] = total / diagonal[p]


@compiled(nogil=True)
def _restrict(
    neighbors: NDArray[np.int32],
    weights: NDArray[np.float32],
    diagonal: NDArray[np.float32],
    right: NDArray[np.float32],
    values: NDArray[np.float32],
    cubes: NDArray[np.int32],
    out: NDArray[np.float32],
) -> None:
    """The residual of each cube."""
    for p in range(len(neighbors)):
        total = right[p] - diagonal[p] * values[p]
        for side in range(6):
            q = neighbors[p, side]
            if q >= 0:
                total += weights[p, side] * values[q]
        out[cubes[p]] += total


@compiled(nogil=True)
def _add(correction: NDArray[np.float32], cubes: NDArray[np.int32], values: NDArray[np.float32]) -> None:
    for p in range(len(values)):
        values[p] += np.float32(STIFF) * correction[cubes[p]]
