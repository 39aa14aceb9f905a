"""Source vectors at the nodes of a grid, stored sparsely, in the stretches of grid lines in which they are not zero.

Sweeps run along lines, on grids of one to four dimensions; `Blocks` are for nodes near surfaces in three.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints
from .stencil import interpolation_stencil

STRETCH = 8
"""Number of consecutive nodes of a line that are stored, swept, or skipped together."""


@dataclass(frozen=True, eq=False)
class NodeSources:
    """Vectors at the nodes of a grid."""

    # (l₀, l₁, l₂, ⌈n / STRETCH⌉) row of `sums` for each stretch of the lines along the last axis; −1 where all vectors
    # are zero. The grid is padded to four axes in front.
    places: NDArray[np.int32]
    sums: NDArray[np.float32]  # (k, STRETCH, 4) the vectors, padded to four components
    shape: tuple[int, ...]  # nodes along each axis
    steps: Floats  # (4,) spacing of the grid; 0 along axes of one node

    @classmethod
    def empty(cls, shape: tuple[int, ...], steps: Floats) -> NodeSources:
        """Zero everywhere."""
        places = np.full((*shape[:3], -(-shape[3] // STRETCH)), -1, dtype=np.int32)
        return cls(places, np.zeros((0, STRETCH, 4), dtype=np.float32), shape, steps)

    @classmethod
    def scattered(
        cls, shape: tuple[int, ...], steps: Floats, nodes: Ints, weights: Floats, values: NDArray[np.floating]
    ) -> NodeSources:
        """Values (s, c ≤ 4) added to the `nodes` (s, k) of a grid with `weights` (s, k)."""
        used = weights > 0
        lines, at = np.divmod(nodes[used], shape[3])
        result = cls.empty(shape, steps)
        flat = result.places.reshape(-1)
        stretches = lines * result.places.shape[3] + at // STRETCH
        flat[stretches] = 0
        taken = np.flatnonzero(flat == 0)
        flat[taken] = np.arange(len(taken))
        places = flat[stretches] * STRETCH + at % STRETCH
        owners = np.nonzero(used)[0]
        sums = np.zeros((STRETCH * len(taken), 4), dtype=np.float32)
        for k in range(values.shape[1]):
            sums[:, k] = np.bincount(places, weights[used] * values[owners, k], len(sums))
        return cls(result.places, sums.reshape(-1, STRETCH, 4), shape, steps)

    def restricted(self, factors: Ints, shape: tuple[int, ...], steps: Floats) -> NodeSources:
        """The sources on a coarser grid, by the transpose of linear interpolation."""
        nodes, values = self.nonzero()
        coarse = np.where(np.array(shape) > 1, nodes / factors, 0.0)
        return NodeSources.scattered(shape, steps, *interpolation_stencil(coarse, shape), values)

    def nonzero(self) -> tuple[Ints, NDArray[np.float32]]:
        """(k, 4) nodes whose vectors are not zero, and (k, 4) these."""
        taken = self.places >= 0
        stretches, vectors = np.argwhere(taken), self.sums[self.places[taken]]
        rows, at = np.nonzero(vectors.any(axis=2))
        nodes = stretches[rows]
        nodes[:, 3] = STRETCH * nodes[:, 3] + at
        return nodes, vectors[rows, at]
