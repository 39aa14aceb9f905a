"""Sparse grids: blocks of 8³ nodes near a surface, and tables that find them.

A grid of any size is divided into blocks of `BLOCK` nodes along each axis, and those into cubes of `CUBE` blocks.
Cubes that hold blocks have a table of their own: memory grows with the blocks, not with the grid.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats
from ..compiled import compiled

BLOCK = 8
"""Number of nodes along each edge of a block."""
CUBE = 16
"""Number of blocks along each edge of a cube."""
BLOCK_NODES = BLOCK**3
"""Number of nodes in a block."""
WINDOW = 8
"""Number of blocks along each edge of a window; large grids are contoured window by window."""
Tables: TypeAlias = tuple[NDArray[np.int32], NDArray[np.int32]]
"""The tables that find blocks, see `Blocks.tables`."""


@dataclass(frozen=True, eq=False)
class Blocks:
    """The blocks of a grid at whose nodes there are values."""

    # (n, 3) indices of the blocks: their first nodes, divided by `BLOCK`; in order of cubes, and of rows within each
    places: NDArray[np.int32]
    shape: tuple[int, int, int]  # nodes of the grid along each axis

    @classmethod
    def of(cls, indices: NDArray[np.integer], shape: tuple[int, ...]) -> Blocks:
        """Make blocks from their (n, 3) indices, which need neither be sorted nor distinct."""
        cubes = -(-np.array(shape) // (BLOCK * CUBE))
        ranked = np.asarray(indices, dtype=np.int64).reshape(-1, 3)
        cube = np.ravel_multi_index(tuple((ranked // CUBE).T), tuple(cubes))
        within = np.ravel_multi_index(tuple((ranked % CUBE).T), (CUBE,) * 3)
        _, order = np.unique(cube * CUBE**3 + within, return_index=True)
        return cls(ranked[order].astype(np.int32), (int(shape[0]), int(shape[1]), int(shape[2])))

    def __len__(self) -> int:
        return len(self.places)

    @cached_property
    def tables(self) -> Tables:
        """(a, b, c) numbers of cubes, −1 for those without blocks, and (cubes, 16, 16, 16) numbers of blocks, or −1."""
        cubes = np.full(tuple(-(-n // (BLOCK * CUBE)) for n in self.shape), -1, dtype=np.int32)
        if not len(self):
            return cubes, np.full((0, CUBE, CUBE, CUBE), -1, dtype=np.int32)
        indices = self.places.astype(np.int64)
        flat = np.ravel_multi_index(tuple((indices // CUBE).T), cubes.shape)
        occupied, number = np.unique(flat, return_inverse=True)
        cubes.ravel()[occupied] = np.arange(len(occupied))
        rows = np.full((len(occupied), CUBE, CUBE, CUBE), -1, dtype=np.int32)
        a, b, c = (indices % CUBE).T
        rows[number, a, b, c] = np.arange(len(self))
        return cubes, rows

    def rows(self, indices: NDArray[np.integer]) -> NDArray[np.int32]:
        """(k,) number of the block with each of (k, 3) indices; −1 if there is none, or outside the grid."""
        wanted = np.asarray(indices, dtype=np.int64)
        limit = -(-np.array(self.shape) // BLOCK)
        inside = np.flatnonzero(((wanted >= 0) & (wanted < limit)).all(axis=1))
        cubes, rows = self.tables
        result = np.full(len(wanted), -1, dtype=np.int32)
        number = cubes[tuple((wanted[inside] // CUBE).T)]
        occupied = number >= 0
        a, b, c = (wanted[inside[occupied]] % CUBE).T
        result[inside[occupied]] = rows[number[occupied], a, b, c]
        return result


@dataclass(frozen=True, eq=False)
class BlockValues:
    """Values at the nodes of blocks, indexed by nodes like an array of the whole grid."""

    blocks: Blocks  # the blocks whose nodes have values
    values: NDArray[np.floating[Any]]  # (n, 8, 8, 8) their values; NaN at nodes beyond the grid

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of nodes of the grid along each axis."""
        return self.blocks.shape

    def __getitem__(self, nodes: tuple[NDArray[np.integer], ...]) -> Floats:
        """(k,) values at nodes, given by three (k,) arrays of indices; NaN where there is no block."""
        wanted = np.stack(nodes, axis=1)
        row = self.blocks.rows(wanted // BLOCK)
        result = np.full(len(row), np.nan)
        has_block = row >= 0
        a, b, c = (wanted[has_block] % BLOCK).T
        result[has_block] = self.values[row[has_block], a, b, c]
        return result

    def interpolated(self, points: Floats) -> Floats:
        """(k,) values, interpolated linearly at (k, 3) points in cells; NaN where a node around has no value."""
        limit = np.array(self.shape, dtype=np.float64) - 1
        return _interpolate(self.blocks.tables, self.values, np.ascontiguousarray(points, dtype=np.float64), limit)

    def window(self, first: NDArray[np.integer], shape: tuple[int, int, int]) -> NDArray[np.float32]:
        """Return the values in a box of `shape` nodes whose lowest node is (3,) `first`; NaN where there are none."""
        low, high = first // BLOCK, -(-(first + np.array(shape)) // BLOCK)
        counts = high - low
        rows = self.blocks.rows(low + np.indices(counts).reshape(3, -1).T)
        nodes = np.full((len(rows), BLOCK, BLOCK, BLOCK), np.nan, dtype=np.float32)
        nodes[rows >= 0] = self.values[rows[rows >= 0]]
        # block and node in it along each axis, and then nodes along each axis
        by_axis = nodes.reshape(*counts, BLOCK, BLOCK, BLOCK).transpose(0, 3, 1, 4, 2, 5).reshape(BLOCK * counts)
        for axis, end in enumerate(self.shape - BLOCK * low):  # the last blocks reach beyond the grid
            np.moveaxis(by_axis, axis, 0)[max(end, 0) :] = np.nan
        return by_axis[tuple(slice(a, a + n) for a, n in zip(first - BLOCK * low, shape, strict=True))]


@compiled
def _interpolate(tables: Tables, values: NDArray[np.float32], points: Floats, limit: Floats) -> Floats:
    """(k,) values, interpolated linearly at (k, 3) points in cells.

    NaN outside the grid, whose last node is `limit`, and where a node around is in no block.
    """
    cubes, rows = tables
    out = np.empty(len(points))
    for p in range(len(points)):
        x, y, z = points[p, 0], points[p, 1], points[p, 2]
        out[p] = np.nan
        if not (0.0 <= x <= limit[0] and 0.0 <= y <= limit[1] and 0.0 <= z <= limit[2]):
            continue
        # the cell of the point, and the point in it
        i = min(np.int64(x), np.int64(limit[0]) - 1)
        j = min(np.int64(y), np.int64(limit[1]) - 1)
        k = min(np.int64(z), np.int64(limit[2]) - 1)
        f, g, h = x - i, y - j, z - k
        total = 0.0
        for corner in range(8):
            a, b, c = corner >> 2 & 1, corner >> 1 & 1, corner & 1
            part = (f if a else 1.0 - f) * (g if b else 1.0 - g) * (h if c else 1.0 - h)
            if part > 0.0:  # as in `Blocks.rows`
                block_i, block_j, block_k = (i + a) // BLOCK, (j + b) // BLOCK, (k + c) // BLOCK
                cube = cubes[block_i // CUBE, block_j // CUBE, block_k // CUBE]
                row = rows[cube, block_i % CUBE, block_j % CUBE, block_k % CUBE] if cube >= 0 else np.int32(-1)
                if row < 0:
                    total = np.nan
                    break
                total += part * values[row, (i + a) % BLOCK, (j + b) % BLOCK, (k + c) % BLOCK]
        out[p] = total
    return out
