"""A bounding volume hierarchy: a tree of axis-aligned boxes, for closest-point and intersection queries."""

from __future__ import annotations

from functools import reduce
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Floats, Ints
from ..compiled import compiled

BOXES_PER_LEAF = 4
"""Number of boxes in each leaf of a tree."""
SPREAD_BITS = (
    (32, 0x1F00000000FFFF),
    (16, 0x1F0000FF0000FF),
    (8, 0x100F00F00F00F00F),
    (4, 0x10C30C30C30C30C3),
    (2, 0x1249249249249249),
)
"""Shifts and masks that spread the 21 low bits of a number so that each is followed by two zero bits."""


class BoxTree(NamedTuple):
    """A complete binary tree over boxes in Morton order: node i has the children 2i and 2i + 1, the root is 1."""

    # (2 · leaves, 6) lower and upper corner of the box around all boxes below each node; lower > upper if there is none
    bounds: Floats
    items: Ints  # (leaves · BOXES_PER_LEAF,) ids of the boxes in each leaf; −1 in places that are not used

    @classmethod
    def of(cls, lower: Floats, upper: Floats) -> BoxTree:
        """Build the tree over boxes given by (n, 3) lower and (n, 3) upper corners, in O(n log n) time."""
        return cls.in_order(lower, upper, order_along_curve((lower + upper) / 2))

    @classmethod
    def around(cls, corners: Floats) -> BoxTree:
        """Build the tree over the boxes around (n, k, 3) corners."""
        return cls.of(*boxes_around(corners))

    @classmethod
    def in_order(cls, lower: Floats, upper: Floats, order: Ints) -> BoxTree:
        """Build the tree over boxes with (n, 3) corners; neighbours in the `order`, (n,), should be close in space."""
        n = len(lower)
        leaves = 1 << max(int(np.ceil(np.log2(max(n, 1) / BOXES_PER_LEAF))), 0)
        items = np.full(leaves * BOXES_PER_LEAF, -1, dtype=np.int64)
        items[:n] = order
        bounds = np.empty((2 * leaves, 6))
        boxes = np.full((leaves * BOXES_PER_LEAF, 6), np.inf)
        boxes[:, 3:] = -np.inf
        boxes[:n, :3], boxes[:n, 3:] = lower[items[:n]], upper[items[:n]]
        bounds[0] = 0
        # nodes of a level from those below them, or from their boxes, up to the root
        level, below = leaves, boxes.reshape(leaves, BOXES_PER_LEAF, 6)
        while level:
            bounds[level : 2 * level, :3] = boxes_around(below[..., :3])[0]
            bounds[level : 2 * level, 3:] = boxes_around(below[..., 3:])[1]
            below = bounds[level : 2 * level].reshape(-1, 2, 6) if level > 1 else below
            level //= 2
        return cls(bounds, items)

    def meeting(self, triangles: Floats, slack: float | Floats = 0.0) -> tuple[Ints, Ints]:
        """Find the boxes that may be within `slack` of each of (n, 3, 3) triangles.

        Returns (n + 1,) offsets and (k,) ids of boxes: those of triangle i are the ids from starts[i] to starts[i + 1].
        The slack is a number, or one for each triangle, (n,).
        """
        corners, slacks = np.ascontiguousarray(triangles).reshape(-1, 9), np.full(len(triangles), slack)
        starts, room = np.zeros(len(corners) + 1, dtype=np.int64), 64 * len(corners)  # faces of a mesh have about 40
        while True:
            near = np.empty(room, dtype=np.int64)
            _meeting(self, corners, slacks, starts, near)
            if starts[-1] <= room:
                return starts, near[: starts[-1]]
            room = int(starts[-1])


@compiled
def _meeting(tree: BoxTree, corners: Floats, slacks: Floats, starts: Ints, out: Ints) -> None:
    """Write the ids of the boxes near each triangle into `out`, as far as there is room, and offsets into `starts`.

    A row of `corners` has the nine coordinates of a triangle; boxes are near if they are within its slack, of (t,)
    `slacks`, along the axes, along its normal, and in its plane perpendicular to its sides: no such axis separates them
    from the triangle. Descend to children only of boxes that are near.
    """
    bounds, items = tree
    leaves, stack = len(bounds) // 2, np.empty(64, dtype=np.int64)
    # the box of the triangle; axes in its plane (0–2) and its normal (3), of any length; and its extents along these
    lower, upper, axes, extents = np.empty(3), np.empty(3), np.empty((4, 3)), np.empty((4, 2))
    for t in range(len(corners)):
        for d in range(3):
            p, q = (d + 1) % 3, (d + 2) % 3
            a, b, c = corners[t, d], corners[t, 3 + d], corners[t, 6 + d]
            lower[d], upper[d] = min(a, b, c) - slacks[t], max(a, b, c) + slacks[t]
            axes[3, d] = (corners[t, 3 + p] - corners[t, p]) * (corners[t, 6 + q] - corners[t, q])
            axes[3, d] -= (corners[t, 3 + q] - corners[t, q]) * (corners[t, 6 + p] - corners[t, p])
        for k in range(3):  # perpendicular to each side, in the plane
            i, j = 3 * k, (3 * k + 3) % 9
            for d in range(3):
                p, q = (d + 1) % 3, (d + 2) % 3
                axes[k, d] = axes[3, p] * (corners[t, j + q] - corners[t, i + q])
                axes[k, d] -= axes[3, q] * (corners[t, j + p] - corners[t, i + p])
        for k in range(4):
            slack_along = 0.0
            extents[k, 0], extents[k, 1] = np.inf, -np.inf
            for i in range(0, 9, 3):
                along = axes[k, 0] * corners[t, i] + axes[k, 1] * corners[t, i + 1] + axes[k, 2] * corners[t, i + 2]
                extents[k, 0], extents[k, 1] = min(extents[k, 0], along), max(extents[k, 1], along)
            for d in range(3):
                slack_along += abs(axes[k, d]) * slacks[t]
            extents[k, 0], extents[k, 1] = extents[k, 0] - slack_along, extents[k, 1] + slack_along
        stack[0], depth, count = 1, 1, starts[t]
        while depth > 0:
            depth -= 1
            node = stack[depth]
            apart = False
            for d in range(3):
                apart |= bounds[node, d] > upper[d] or bounds[node, 3 + d] < lower[d]
            if apart:
                continue
            for k in range(4):
                height, reach = 0.0, 0.0
                for d in range(3):
                    low, high = bounds[node, d], bounds[node, 3 + d]
                    height += axes[k, d] * 0.5 * (low + high)
                    reach += abs(axes[k, d]) * 0.5 * (high - low)
                apart |= height - reach > extents[k, 1] or height + reach < extents[k, 0]
            if apart:
                continue
            if node < leaves:
                stack[depth], stack[depth + 1] = 2 * node, 2 * node + 1
                depth += 2
                continue
            for place in range((node - leaves) * BOXES_PER_LEAF, (node - leaves + 1) * BOXES_PER_LEAF):
                if items[place] >= 0:
                    if count < len(out):
                        out[count] = items[place]
                    count += 1
        starts[t + 1] = count


def boxes_around(corners: Floats) -> tuple[Floats, Floats]:
    """Return (n, 3) lower and (n, 3) upper corners of the boxes around (n, k, 3) corners.

    This is faster than NumPy's `min` and `max` along a short axis.
    """
    columns = corners.swapaxes(0, 1)
    return reduce(np.minimum, columns), reduce(np.maximum, columns)


def room_around(bounds: ArrayLike, reach: float = 0.0, share: float = 0.2) -> float:
    """Return a padding for the box of a shape, (2, d) corners.

    It is a `share` of the longest side, for the completion of the shape, plus room for offsets up to `reach`.
    """
    lower, upper = np.asarray(bounds, dtype=np.float64)
    return share * float((upper - lower).max()) + 1.05 * reach


def order_in_space(points: Floats) -> Ints:
    """Return (n,) indices that sort (n, 3) points along a space-filling curve; fewer than 64 keep their order."""
    if len(points) < 64:  # sorting them would take as long as searching for some
        return np.arange(len(points))
    return order_along_curve(points)


def order_along_curve(points: Floats, groups: Ints | None = None) -> Ints:
    """Return (n,) indices that sort (n, 3) points along a space-filling curve, group by group of (n,) `groups`.

    Each group has a curve of its own, and so have points of which more than a leaf holds are at one place of a curve,
    because others are far away.
    """
    if groups is None:
        order, starts = np.arange(len(points)), np.zeros(min(len(points), 1), dtype=np.int64)
    else:
        order = np.argsort(groups, kind="stable")
        starts = np.flatnonzero(np.diff(groups[order], prepend=-1))
    rows = np.arange(len(points))  # places in the order whose points are still to be sorted, run by run from `starts`
    while len(rows):
        sizes = np.diff(starts, append=len(rows))
        runs, unsorted = np.repeat(np.arange(len(starts)), sizes), points[order[rows]]
        lower, upper = (extreme.reduceat(unsorted, starts) for extreme in (np.minimum, np.maximum))
        extents = (upper - lower).max(axis=1)
        codes = morton_codes(unsorted - lower[runs], extents[runs])
        by_code = np.lexsort((codes, runs)) if len(starts) > 1 else np.argsort(codes, kind="stable")
        order[rows], codes = order[rows[by_code]], codes[by_code]
        begins = np.flatnonzero(np.append(True, (codes[1:] != codes[:-1]) | (runs[1:] != runs[:-1])))
        counts = np.diff(begins, append=len(rows))
        crowded = (counts > BOXES_PER_LEAF) & (extents[runs[begins]] > 0)
        rows, counts = rows[np.repeat(crowded, counts)], counts[crowded]
        starts = np.cumsum(counts) - counts
    return order


@np.errstate(all="ignore")
def morton_codes(points: Floats, extents: Floats | float) -> NDArray[np.uint64]:
    """Return Morton codes of (n, 3) points: places along a space-filling curve, with 21 bits per axis.

    Coordinates are from 0 to `extents`, a number or one for each point, (n,).
    """
    scales = (2**21 - 1) / np.maximum(extents, 1e-290)
    codes = np.zeros(len(points), dtype=np.uint64)
    for axis in range(3):
        x = (points[:, axis] * scales).astype(np.uint64)
        for shift, mask in SPREAD_BITS:
            x |= x << np.uint64(shift)
            x &= np.uint64(mask)
        codes |= x << np.uint64(axis)
    return codes
