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
        rows_of_stretches = empty.places.reshape(-1)
        stretches = lines * empty.places.shape[3] + offsets // STRETCH
        rows_of_stretches[stretches] = 0  # marked, then numbered in order
        stored = np.flatnonzero(rows_of_stretches == 0)
        rows_of_stretches[stored] = np.arange(len(stored))
        places = rows_of_stretches[stretches] * STRETCH + offsets % STRETCH
        owners = np.nonzero(used)[0]
        sums = np.zeros((STRETCH * len(stored), 4), dtype=np.float32)
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
    `sums` of the sources. Each simplex is bisected at its longest edge until no edge is longer than `size`; each part
    is added at its centre. `slots` are zeros, one for each cell; they become 1 + the sample of a cell. One array serves
    all components, since samples of earlier ones have lower numbers, and count as none.
    """
    rows, places = sources.sums, sources.places.reshape(-1, sources.places.shape[3])
    n_corners, dimension = corners.shape[1], corners.shape[2]
    deepest = 256
    stack = np.empty((deepest, n_corners, dimension))  # corners of the parts that are still to be added
    shares = np.empty(deepest)  # their shares of the whole simplex
    samples, labels_of = np.zeros((1024, 2 * dimension + 1)), np.zeros(1024, dtype=np.int64)
    n_samples, n_rows = 0, rows.shape[0]
    first_of_component = 0  # first sample of the current component
    component = np.int64(-1)
    centre = np.empty(dimension)
    lines = np.zeros(1 << (dimension - 1), dtype=np.int64)  # the grid lines around a part, and what each gets of it
    line_shares = np.empty(1 << (dimension - 1))
    n_along = shape[dimension - 1]
    longest_allowed, per_corner = size * size, 1.0 / n_corners
    for face in order:
        if weights[face] == 0.0:
            continue
        if components[face] != component:
            component = components[face]
            first_of_component = n_samples
        for corner in range(n_corners):
            for axis in range(dimension):
                stack[0, corner, axis] = corners[face, corner, axis]
        shares[0] = 1.0
        top = 1
        while top > 0:
            top -= 1
            # leave out parts beyond the grid
            missed = False
            for axis in range(dimension):
                low = high = stack[top, 0, axis]
                for corner in range(1, n_corners):
                    low = min(low, stack[top, corner, axis])
                    high = max(high, stack[top, corner, axis])
                if high < 0.0 or low > shape[axis] - 1:
                    missed = True
            if missed:
                continue
            # bisect long parts: one half replaces the part on the stack, the other is put on top
            longest, tail, head = -1.0, 0, 0  # squared length of the longest edge, and its corners
            for corner in range(n_corners):
                for other in range(corner):
                    square = 0.0
                    for axis in range(dimension):
                        square += (stack[top, corner, axis] - stack[top, other, axis]) ** 2
                    if square > longest:
                        longest, tail, head = square, other, corner
            if longest > longest_allowed and top + 2 < deepest:
                half = 0.5 * shares[top]
                for corner in range(n_corners):
                    for axis in range(dimension):
                        stack[top + 1, corner, axis] = stack[top, corner, axis]
                for axis in range(dimension):
                    middle = 0.5 * (stack[top, tail, axis] + stack[top, head, axis])
                    stack[top, tail, axis] = middle
                    stack[top + 1, head, axis] = middle
                shares[top] = shares[top + 1] = half
                top += 2
                continue
            # the cell of the centre, in C order, and its sample
            cell = np.int64(0)
            for axis in range(dimension):
                mean = 0.0
                for corner in range(n_corners):
                    mean += stack[top, corner, axis]
                mean *= per_corner
                centre[axis] = mean
                if mean < 0.0 or mean > shape[axis] - 1:
                    missed = True
                cell = cell * (shape[axis] - 1) + min(max(np.int64(mean), 0), shape[axis] - 2)
            if missed:
                continue
            slot = slots[cell] - 1
            if slot < first_of_component:
                if n_samples == len(samples):
                    samples = np.concatenate((samples, np.zeros_like(samples)))
                    labels_of = np.concatenate((labels_of, np.zeros_like(labels_of)))
                slot = n_samples
                labels_of[slot] = component
                n_samples += 1
                slots[cell] = n_samples
            share = shares[top]
            weight = weights[face] * share
            # share the vector among the nodes of the cell: first by grid lines, then by the two nodes on each line
            if n_rows + (1 << dimension) > rows.shape[0]:
                more = np.zeros((len(rows) + (1 << dimension), STRETCH, 4), dtype=np.float32)
                rows = np.concatenate((rows, more))
            lines[0], line_shares[0] = 0, share / scale
            for axis in range(dimension - 1):
                below = min(max(np.int64(centre[axis]), 0), shape[axis] - 2)
                fraction = centre[axis] - below
                for k in range(1 << axis):
                    line, part = lines[k] * shape[axis] + below, line_shares[k]
                    lines[k], line_shares[k] = line, part * (1.0 - fraction)
                    lines[k + (1 << axis)], line_shares[k + (1 << axis)] = line + 1, part * fraction
            below = min(max(np.int64(centre[dimension - 1]), 0), n_along - 2)
            fraction = centre[dimension - 1] - below
            for k in range(1 << (dimension - 1)):
                if line_shares[k] > 0.0:
                    for side in range(2):
                        part = line_shares[k] * (fraction if side else 1.0 - fraction)
                        if part > 0.0:
                            node = below + side
                            row = places[lines[k], node // STRETCH]
                            if row < 0:
                                row = places[lines[k], node // STRETCH] = n_rows
                                n_rows += 1
                            for axis in range(dimension):
                                rows[row, node % STRETCH, axis] += np.float32(part * vectors[face, axis])
            # add to the sample
            for axis in range(dimension):
                samples[slot, axis] += weight * centre[axis]
                samples[slot, dimension + axis] += vectors[face, axis] * share
            samples[slot, 2 * dimension] += weight
    return samples[:n_samples], labels_of[:n_samples], rows[:n_rows]
