"""Source vectors at the nodes of a grid, stored sparsely, in the stretches of grid lines in which they are not zero."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...compiled import compiled

STRETCH = 8
"""Number of consecutive nodes of a line that are stored, swept, or skipped together."""


@dataclass(frozen=True, eq=False)
class NodeSources:
    """Vectors at the nodes of a grid.

    Attributes
    ----------
    places : (l₀, l₁, l₂, ⌈n / STRETCH⌉) int32
        Row of `sums` for each stretch of the lines along the last axis; −1 where all vectors are zero. The grid is
        padded to four axes in front.
    sums : (k, STRETCH, 4) float32
        The vectors, padded to four components.
    shape : tuple of 4 int
        Nodes along each axis.
    steps : (4,) float
        Spacing of the grid; 0 along axes of one node.
    """

    places: NDArray[np.int32]
    sums: NDArray[np.float32]
    shape: tuple[int, ...]
    steps: NDArray[np.float64]

    @classmethod
    def empty(cls, shape: tuple[int, ...], steps: NDArray[np.float64]) -> NodeSources:
        """Zero everywhere."""
        places = np.full((*shape[:3], -(-shape[3] // STRETCH)), -1, dtype=np.int32)
        return cls(places, np.zeros((0, STRETCH, 4), dtype=np.float32), shape, steps)

    @classmethod
    def scattered(
        cls,
        shape: tuple[int, ...],
        steps: NDArray[np.float64],
        nodes: NDArray[np.int64],
        weights: NDArray[np.float64],
        values: NDArray[np.float64],
    ) -> NodeSources:
        """Values (s, c ≤ 4) added to the `nodes` (s, k) of a grid with `weights` (s, k)."""
        four = np.zeros((len(values), 4))
        four[:, : values.shape[1]] = values
        result = cls.empty(shape, steps)
        lines = result.places.reshape(-1, result.places.shape[3])
        return cls(result.places, _scatter(nodes, weights, four, lines, result.sums, shape[3]), shape, steps)

    def restricted(self, factors: NDArray[np.int64], shape: tuple[int, ...], steps: NDArray[np.float64]) -> NodeSources:
        """The sources on a coarser grid, by the transpose of linear interpolation."""
        coarse = NodeSources.empty(shape, steps)
        sums = _restrict(self.places, self.sums, np.array(self.shape), factors, coarse.places, coarse.sums)
        return NodeSources(coarse.places, sums, shape, steps)


@compiled
def with_room(sums: NDArray[np.float32], used: int, more: int) -> NDArray[np.float32]:
    """`sums`, or a longer copy of it, with room for `more` rows beyond the `used` ones."""
    if used + more <= sums.shape[0]:
        return sums
    grown = np.zeros((2 * sums.shape[0] + more, STRETCH, 4), dtype=np.float32)
    for row in range(used):
        for m in range(STRETCH):
            for q in range(4):
                grown[row, m, q] = sums[row, m, q]
    return grown


@compiled
def _scatter(
    nodes: NDArray[np.int64],
    weights: NDArray[np.float64],
    values: NDArray[np.float64],
    places: NDArray[np.int32],
    sums: NDArray[np.float32],
    n: int,
) -> NDArray[np.float32]:
    used = sums.shape[0]
    for s in range(nodes.shape[0]):
        if used + nodes.shape[1] > sums.shape[0]:
            sums = with_room(sums, used, nodes.shape[1])
        for c in range(nodes.shape[1]):
            line, m, weight = nodes[s, c] // n, nodes[s, c] % n, weights[s, c]
            if weight > 0.0:
                row = places[line, m // STRETCH]
                if row < 0:
                    row = places[line, m // STRETCH] = used
                    used += 1
                for q in range(4):
                    sums[row, m % STRETCH, q] += np.float32(weight * values[s, q])
    return sums[:used]


@compiled
def _restrict(
    places: NDArray[np.int32],
    sums: NDArray[np.float32],
    shape: NDArray[np.int64],
    factors: NDArray[np.int64],
    coarse_places: NDArray[np.int32],
    coarse: NDArray[np.float32],
) -> NDArray[np.float32]:
    used = coarse.shape[0]
    for i in range(shape[0]):
        for j in range(shape[1]):
            for k in range(shape[2]):
                for s in range(places.shape[3]):
                    if places[i, j, k, s] < 0:
                        continue
                    coarse = with_room(coarse, used, 16 * STRETCH)
                    for m in range(STRETCH * s, min(STRETCH * (s + 1), shape[3])):
                        odd = (
                            (8 if factors[0] == 2 and i % 2 else 0)
                            | (4 if factors[1] == 2 and j % 2 else 0)
                            | (2 if factors[2] == 2 and k % 2 else 0)
                            | (1 if factors[3] == 2 and m % 2 else 0)
                        )
                        share = np.float32(1)
                        for bit in range(4):
                            if odd >> bit & 1:
                                share *= np.float32(0.5)
                        for corner in range(16):
                            if corner & ~odd:
                                continue
                            a = i // factors[0] + (corner >> 3 & 1)
                            b = j // factors[1] + (corner >> 2 & 1)
                            c = k // factors[2] + (corner >> 1 & 1)
                            d = m // factors[3] + (corner & 1)
                            row = coarse_places[a, b, c, d // STRETCH]
                            if row < 0:
                                row = coarse_places[a, b, c, d // STRETCH] = used
                                used += 1
                            for q in range(4):
                                coarse[row, d % STRETCH, q] += share * sums[places[i, j, k, s], m % STRETCH, q]
    return coarse[:used]
