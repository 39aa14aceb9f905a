"""Source vectors at the nodes of a grid, stored sparsely, in the stretches of grid lines in which they are not zero.

Sweeps run along lines, on grids of one to four dimensions; `Blocks` are for nodes near surfaces in three.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints, read_only
from ..compiled import compiled
from ..memory import untouched_zeros
from .stencil import interpolation_stencil

STRETCH = 8
"""Number of consecutive nodes of a line that are stored, swept, or skipped together."""


class NodeSources(NamedTuple):
    """Vectors at the nodes of a grid, which has four axes; in fewer dimensions the first ones have one node."""

    # (l₀, l₁, l₂, ⌈n / STRETCH⌉) row of `sums` for each stretch of the lines along the last axis of the grid; −1 where
    # all vectors are zero
    places: NDArray[np.int32]
    sums: NDArray[np.float32]  # (k, STRETCH, 4) the vectors, padded to four components
    shape: tuple[int, ...]  # nodes along each axis
    steps: Floats  # (4,) spacing of the grid; 0 along axes of one node

    @classmethod
    def empty(cls, shape: tuple[int, ...], steps: Floats) -> NodeSources:
        """Make sources that are zero everywhere, on a grid with four axes, `shape` nodes and spacings `steps`."""
        places = np.full((*shape[:3], -(-shape[3] // STRETCH)), -1, dtype=np.int32)
        return cls(places, np.zeros((0, STRETCH, 4), dtype=np.float32), shape, steps)

    @classmethod
    def scattered(
        cls, shape: tuple[int, ...], steps: Floats, nodes: Ints, weights: Floats, values: NDArray[np.floating]
    ) -> NodeSources:
        """Add (s, c) values, c ≤ 4, to the (s, k) `nodes` of a grid, numbered in C order, with (s, k) `weights`.

        `shape` and `steps` are those of the result.
        """
        used = weights > 0
        lines, offsets = np.divmod(nodes[used], shape[3])
        empty = cls.empty(shape, steps)
        flat = empty.places.reshape(-1)
        stretches = lines * empty.places.shape[3] + offsets // STRETCH
        flat[stretches] = 0
        first_ids = np.flatnonzero(flat == 0)
        flat[first_ids] = np.arange(len(first_ids))
        places = flat[stretches] * STRETCH + offsets % STRETCH
        owners = np.nonzero(used)[0]
        sums = np.zeros((STRETCH * len(first_ids), 4), dtype=np.float32)
        for k in range(values.shape[1]):
            sums[:, k] = np.bincount(places, weights[used] * values[owners, k], len(sums))
        return cls(empty.places, sums.reshape(-1, STRETCH, 4), shape, steps)

    def restricted(self, factors: Ints, shape: tuple[int, ...], steps: Floats) -> NodeSources:
        """Restrict the sources to a coarser grid by the transpose of linear interpolation.

        The coarser grid has `shape` nodes and the spacings `steps`, (4,). Its cells are `factors`, (4,), times as long
        as those of this grid.
        """
        nodes, values = self.nonzero()
        coarse = np.where(np.array(shape) > 1, nodes / factors, 0.0)
        return NodeSources.scattered(shape, steps, *interpolation_stencil(coarse, shape), values)

    def nonzero(self) -> tuple[Ints, NDArray[np.float32]]:
        """(k, 4) indices of the nodes whose vectors are not zero, and (k, 4) these vectors."""
        stored = self.places >= 0
        stretches, vectors = np.argwhere(stored), self.sums[self.places[stored]]
        rows, offsets = np.nonzero(vectors.any(axis=2))
        nodes = stretches[rows]
        nodes[:, 3] = STRETCH * nodes[:, 3] + offsets
        return nodes, vectors[rows, offsets]


def merge_in_cells(
    simplices: tuple[Floats, Floats, Floats, Ints], shape: Ints, size: float, sources: NodeSources, scale: float
) -> tuple[tuple[Floats, Floats, Floats, Ints], NodeSources]:
    """Merge simplices to one sample for each cell of a grid and each component; add their vectors to the nodes.

    Simplices are (m, c, d) corners in cells, (m, d) vectors, (m,) weights and (m,) components. They are split into
    parts at most `size` cells long. The grid has `shape` nodes. Return positions, vectors, weights and components of
    the s samples; and `sources` with all vectors added, divided by `scale` and shared among nodes by multilinear
    weights.
    """
    corners, vectors, weights, components = simplices
    order = np.argsort(components, kind="stable")
    slots = untouched_zeros((int(np.prod(shape - 1)),), np.int32)
    dimension = corners.shape[2]
    simplices = corners, vectors, read_only(weights), components
    sums, labels, nodes = _merge(*simplices, order, shape, size, slots, sources, scale)
    kept = sums[:, -1] > 0
    sums, labels = sums[kept], labels[kept]
    weight = sums[:, -1]
    samples = (sums[:, :dimension] / weight[:, None], sums[:, dimension:-1].copy(), weight.copy(), labels)
    return samples, sources._replace(sums=nodes)


@compiled
def _merge(
    corners: Floats,
    vectors: Floats,
    weights: Floats,
    components: Ints,
    order: Ints,
    shape: Ints,
    size: float,
    slots: NDArray[np.int32],
    sources: NodeSources,
    scale: float,
) -> tuple[Floats, Ints, NDArray[np.float32]]:
    """Do the work of `merge_in_cells`, simplex by simplex in `order`, by component.

    Return (s, 2 d + 1) sums of weight · position, vector and weight by component and cell, their (s,) components, and
    `sums` of the sources. `slots` are zeros, one for each cell; they become 1 + the sample of a cell. Each simplex is
    bisected at its longest edge until no edge is longer than `size`; each part is added at its centre.
    """
    nodes, places = sources.sums, sources.places.reshape(-1, sources.places.shape[3])
    n_corners, dimension = corners.shape[1], corners.shape[2]
    deepest = 256
    stack = np.empty((deepest, n_corners, dimension))
    shares = np.empty(deepest)  # of the whole simplex
    sums, labels = np.zeros((1024, 2 * dimension + 1)), np.zeros(1024, dtype=np.int64)
    count, used = 0, nodes.shape[0]
    first = 0  # slots of the current component start here
    current = np.int64(-1)
    centre = np.empty(dimension)
    lines = np.zeros(1 << (dimension - 1), dtype=np.int64)  # grid lines around a piece, and its share of each
    parts = np.empty(1 << (dimension - 1))
    n = shape[dimension - 1]
    limit, part_of_corner = size * size, 1.0 / n_corners
    for face in order:
        if weights[face] == 0.0:
            continue
        if components[face] != current:
            current = components[face]
            first = count
        for c in range(n_corners):
            for d in range(dimension):
                stack[0, c, d] = corners[face, c, d]
        shares[0] = 1.0
        top = 1
        while top > 0:
            top -= 1
            missed = False
            for d in range(dimension):
                low = high = stack[top, 0, d]
                for c in range(1, n_corners):
                    low = min(low, stack[top, c, d])
                    high = max(high, stack[top, c, d])
                if high < 0.0 or low > shape[d] - 1:
                    missed = True
            if missed:
                continue
            longest = -1.0  # squared length of the longest edge, from corner tail to head
            tail, head = 0, 0
            for c in range(n_corners):
                for e in range(c):
                    square = 0.0
                    for d in range(dimension):
                        square += (stack[top, c, d] - stack[top, e, d]) ** 2
                    if square > longest:
                        longest, tail, head = square, e, c
            if longest > limit and top + 2 < deepest:
                half = 0.5 * shares[top]
                for c in range(n_corners):
                    for d in range(dimension):
                        stack[top + 1, c, d] = stack[top, c, d]
                for d in range(dimension):
                    middle = 0.5 * (stack[top, tail, d] + stack[top, head, d])
                    stack[top, tail, d] = middle
                    stack[top + 1, head, d] = middle
                shares[top] = shares[top + 1] = half
                top += 2
                continue
            cell = np.int64(0)
            for d in range(dimension):
                mean = 0.0
                for c in range(n_corners):
                    mean += stack[top, c, d]
                mean *= part_of_corner
                centre[d] = mean
                if mean < 0.0 or mean > shape[d] - 1:
                    missed = True
                cell = cell * (shape[d] - 1) + min(max(np.int64(mean), 0), shape[d] - 2)
            if missed:
                continue
            slot = slots[cell] - 1
            if slot < first:
                if count == len(sums):
                    sums = np.concatenate((sums, np.zeros_like(sums)))
                    labels = np.concatenate((labels, np.zeros_like(labels)))
                slot = count
                labels[slot] = current
                count += 1
                slots[cell] = count
            share = shares[top]
            weight = weights[face] * share
            if used + (1 << dimension) > nodes.shape[0]:
                more = np.zeros((len(nodes) + (1 << dimension), STRETCH, 4), dtype=np.float32)
                nodes = np.concatenate((nodes, more))
            lines[0], parts[0] = 0, share / scale
            for d in range(dimension - 1):
                below = min(max(np.int64(centre[d]), 0), shape[d] - 2)
                f = centre[d] - below
                for k in range(1 << d):
                    line, part = lines[k] * shape[d] + below, parts[k]
                    lines[k], parts[k] = line, part * (1.0 - f)
                    lines[k + (1 << d)], parts[k + (1 << d)] = line + 1, part * f
            below = min(max(np.int64(centre[dimension - 1]), 0), n - 2)
            f = centre[dimension - 1] - below
            for k in range(1 << (dimension - 1)):
                if parts[k] > 0.0:
                    for side in range(2):
                        part = parts[k] * (f if side else 1.0 - f)
                        if part > 0.0:
                            m = below + side
                            row = places[lines[k], m // STRETCH]
                            if row < 0:
                                row = places[lines[k], m // STRETCH] = used
                                used += 1
                            for d in range(dimension):
                                nodes[row, m % STRETCH, d] += np.float32(part * vectors[face, d])
            for d in range(dimension):
                sums[slot, d] += weight * centre[d]
                sums[slot, dimension + d] += vectors[face, d] * share
            sums[slot, 2 * dimension] += weight
    return sums[:count], labels[:count], nodes[:used]
