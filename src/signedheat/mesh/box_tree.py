"""A bounding volume hierarchy: a tree of axis-aligned boxes, for closest-point and intersection queries."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled

LEAF = 4
"""Boxes per leaf."""
USUAL = 64
"""Boxes near a triangle for which there is room at first: faces of a mesh have some forty in the leaves around them."""
FEW = 64
"""Points that are not worth ordering: it takes as long as the searches of some of them."""


FLAT_LEVELS = 8
"""Levels of a tree over triangles, from the leaves up, that are bounded along their mean normals as well."""


@dataclass(frozen=True, eq=False)
class BoxTree:
    """A complete binary tree over boxes in Morton order: node i has the children 2i and 2i + 1, the root is 1.

    Attributes
    ----------
    bounds : (2 · leaves, 6) float
        Lower and upper corner of the box around everything below each node; an empty node has lower > upper.
    items : (leaves · LEAF,) int
        Boxes in each leaf, −1 where there are none.
    groups : (2 · leaves,) int
        Group that all boxes below each node are of; −1 if they are of several.
    slabs : (2 · leaves, 5) float
        A direction, and the least and the largest extent along it of everything below each node.
    triangles : (n, 9) or (0, 9) float
        What the boxes are of, if that is triangles.
    """

    bounds: NDArray[np.float64]
    items: NDArray[np.int64]
    groups: NDArray[np.int64]
    slabs: NDArray[np.float64]
    triangles: NDArray[np.float64]

    @classmethod
    def of(cls, lower: NDArray[np.float64], upper: NDArray[np.float64]) -> BoxTree:
        """Build the tree over boxes given by (n, 3) lower and (n, 3) upper corners, in O(n log n) time.

        Examples
        --------
        >>> corners = np.arange(6.0).reshape(2, 3)
        >>> BoxTree.of(corners, corners + 1).bounds[1]
        array([0., 1., 2., 4., 5., 6.])
        """
        return cls.in_order(lower, upper, np.argsort(morton_codes((lower + upper) / 2), kind="stable"))

    @classmethod
    def in_order(
        cls,
        lower: NDArray[np.float64],
        upper: NDArray[np.float64],
        order: NDArray[np.int64],
        groups: NDArray[np.int64] | None = None,
    ) -> BoxTree:
        """The same, with boxes in a given order, in which those near each other in space should be near each other.

        Those of a group, named by (n,) numbers from 0, should follow each other; −1 is in none.
        """
        n = len(lower)
        leaves = 1 << max(int(np.ceil(np.log2(max(n, 1) / LEAF))), 0)
        items = np.full(leaves * LEAF, -1, dtype=np.int64)
        items[:n] = order
        bounds = np.empty((2 * leaves, 6))
        boxes = np.full((leaves * LEAF, 6), np.inf)
        boxes[:, 3:] = -np.inf
        boxes[:n, :3], boxes[:n, 3:] = lower[items[:n]], upper[items[:n]]
        bounds[0] = 0
        common = np.full(2 * leaves, -1, dtype=np.int64)
        if groups is not None:
            own = np.append(groups, -1)[items].reshape(leaves, LEAF)
            common[leaves:] = np.where((own == own[:, :1]).all(axis=1), own[:, 0], -1)
        level, below = leaves, boxes.reshape(leaves, LEAF, 6)
        while level:
            bounds[level : 2 * level, :3] = below[..., :3].min(axis=1)
            bounds[level : 2 * level, 3:] = below[..., 3:].max(axis=1)
            if level < leaves and groups is not None:
                left, right = common[2 * level : 4 * level].reshape(-1, 2).T
                common[level : 2 * level] = np.where(left == right, left, -1)
            below = bounds[level : 2 * level].reshape(-1, 2, 6) if level > 1 else below
            level //= 2
        slabs = np.zeros((2 * leaves, 5))
        slabs[:, 3], slabs[:, 4] = -np.inf, np.inf
        return cls(bounds, items, common, slabs, np.empty((0, 9)))

    @classmethod
    def over(
        cls, triangles: NDArray[np.float64], order: NDArray[np.int64], groups: NDArray[np.int64] | None = None
    ) -> BoxTree:
        """Build the tree over (n, 3, 3) triangles, bounded along the mean normal of each node as well."""
        tree = cls.in_order(triangles.min(axis=1), triangles.max(axis=1), order, groups)
        _fit_slabs(np.ascontiguousarray(triangles), tree.items, tree.slabs)
        return replace(tree, triangles=np.ascontiguousarray(triangles).reshape(-1, 9))

    def meeting(
        self,
        triangles: NDArray[np.float64],
        slack: float | NDArray[np.float64] = 0.0,
        groups: NDArray[np.int64] | None = None,
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Where what is near each of (n, 3, 3) triangles begins, and what it is: all in leaves that they may meet.

        A triangle may meet a node if its box and its plane do, to a slack along each axis, and not all of the node is
        of the triangle's own group.

        Examples
        --------
        >>> corners = np.arange(9.0).reshape(3, 3)
        >>> tree = BoxTree.of(corners, corners)
        >>> tree.meeting(np.array([[[2.0, 2, 2], [5, 3, 3], [5, 5, 5]], [[9, 9, 9], [9, 9, 9], [9, 9, 9]]]))
        (array([0, 3, 3]), array([0, 1, 2]))
        """
        corners, slacks = np.ascontiguousarray(triangles).reshape(-1, 9), np.full(3, slack)
        own = np.full(len(corners), -1) if groups is None else np.ascontiguousarray(groups, dtype=np.int64)
        starts, room = np.zeros(len(corners) + 1, dtype=np.int64), USUAL * len(corners)
        while True:
            found = np.empty(room, dtype=np.int64)
            _meeting(
                self.bounds, self.items, self.groups, self.slabs, self.triangles, corners, slacks, own, starts, found
            )
            if starts[-1] <= room:
                return starts, found[: starts[-1]]
            room = int(starts[-1])


@compiled
def _meeting(
    bounds: NDArray[np.float64],
    items: NDArray[np.int64],
    groups: NDArray[np.int64],
    slabs: NDArray[np.float64],
    triangles: NDArray[np.float64],
    corners: NDArray[np.float64],
    slacks: NDArray[np.float64],
    own: NDArray[np.int64],
    starts: NDArray[np.int64],
    out: NDArray[np.int64],
) -> None:
    """Write what is near each triangle, as far as there is room, and where it begins."""
    leaves, stack = len(bounds) // 2, np.empty(64, dtype=np.int64)
    lower, upper, normal = np.empty(3), np.empty(3), np.empty(3)
    for t in range(len(corners)):
        level = 0.0
        for d in range(3):
            p, q = (d + 1) % 3, (d + 2) % 3
            a, b, c = corners[t, d], corners[t, 3 + d], corners[t, 6 + d]
            lower[d], upper[d] = min(a, b, c) - slacks[d], max(a, b, c) + slacks[d]
            normal[d] = (corners[t, 3 + p] - corners[t, p]) * (corners[t, 6 + q] - corners[t, q])
            normal[d] -= (corners[t, 3 + q] - corners[t, q]) * (corners[t, 6 + p] - corners[t, p])
            level += normal[d] * a
        stack[0], depth, count = 1, 1, starts[t]
        while depth > 0:
            depth -= 1
            node = stack[depth]
            if own[t] >= 0 and groups[node] == own[t]:
                continue
            apart, height, reach = False, -level, 0.0
            for d in range(3):
                low, high = bounds[node, d], bounds[node, 3 + d]
                apart |= low > upper[d] or high < lower[d]
                height += normal[d] * 0.5 * (low + high)
                reach += abs(normal[d]) * (0.5 * (high - low) + slacks[d])
            if apart or abs(height) > reach:
                continue
            if slabs[node, 4] < np.inf:
                least, most, give = np.inf, -np.inf, 0.0
                for k in range(0, 9, 3):
                    along = 0.0
                    for d in range(3):
                        along += slabs[node, d] * corners[t, k + d]
                    least, most = min(least, along), max(most, along)
                for d in range(3):
                    give += abs(slabs[node, d]) * slacks[d]
                if least > slabs[node, 4] + give or most < slabs[node, 3] - give:
                    continue
            if node < leaves:
                stack[depth], stack[depth + 1] = 2 * node, 2 * node + 1
                depth += 2
                continue
            for place in range((node - leaves) * LEAF, (node - leaves + 1) * LEAF):
                if items[place] >= 0:
                    if len(triangles) and _is_beyond(triangles[items[place]], lower, upper, normal, level, slacks):
                        continue
                    if count < len(out):
                        out[count] = items[place]
                    count += 1
        starts[t + 1] = count


@compiled
def _is_beyond(
    triangle: NDArray[np.float64],
    lower: NDArray[np.float64],
    upper: NDArray[np.float64],
    normal: NDArray[np.float64],
    level: float,
    slacks: NDArray[np.float64],
) -> bool:
    """Whether a triangle lies off a box, or on one side of a plane."""
    give, least, most = 0.0, np.inf, -np.inf
    for d in range(3):
        a, b, c = triangle[d], triangle[3 + d], triangle[6 + d]
        if min(a, b, c) > upper[d] or max(a, b, c) < lower[d]:
            return True
        give += abs(normal[d]) * slacks[d]
    for k in range(0, 9, 3):
        height = normal[0] * triangle[k] + normal[1] * triangle[k + 1] + normal[2] * triangle[k + 2] - level
        least, most = min(least, height), max(most, height)
    return least > give or most < -give


@compiled
def _fit_slabs(triangles: NDArray[np.float64], items: NDArray[np.int64], slabs: NDArray[np.float64]) -> None:
    """Bound triangles along their mean normals, in the lowest nodes of a tree."""
    n, size = np.empty(3), LEAF
    first = len(slabs) // 2
    for _ in range(FLAT_LEVELS):
        for node in range(first, 2 * first):
            begin = (node - first) * size
            n[:] = 0.0
            for place in range(begin, begin + size):
                if items[place] < 0:
                    break
                t = triangles[items[place]]
                for d in range(3):
                    p, q = (d + 1) % 3, (d + 2) % 3
                    n[d] += (t[1, p] - t[0, p]) * (t[2, q] - t[0, q]) - (t[1, q] - t[0, q]) * (t[2, p] - t[0, p])
            length = np.sqrt((n * n).sum())
            if not length > 0.0:
                continue
            least, most = np.inf, -np.inf
            for place in range(begin, begin + size):
                if items[place] < 0:
                    break
                for k in range(3):
                    along = 0.0
                    for d in range(3):
                        along += n[d] / length * triangles[items[place], k, d]
                    least, most = min(least, along), max(most, along)
            slabs[node, :3] = n / length
            slabs[node, 3], slabs[node, 4] = least, most
        size *= 2
        first //= 2
        if first == 0:
            return


def order_in_space(points: NDArray[np.float64]) -> NDArray[np.int64]:
    """(n,) numbers of (n, 3) points along a space-filling curve; few points stay as they are."""
    if len(points) < FEW:
        return np.arange(len(points))
    return np.argsort(morton_codes(points), kind="stable")


def morton_codes(points: NDArray[np.float64]) -> NDArray[np.uint64]:
    """(n,) Morton codes of (n, 3) points: their positions along a space-filling curve, with 21 bits per axis."""
    lower = points.min(axis=0)
    extent = max(float((points.max(axis=0) - lower).max()), 1e-290)
    return _codes(np.ascontiguousarray(points), lower, (2**21 - 1) / extent)


@compiled
def _codes(points: NDArray[np.float64], lower: NDArray[np.float64], scale: float) -> NDArray[np.uint64]:
    """The 21 low bits of each cell are spread so that each is followed by two zero bits."""
    codes = np.zeros(len(points), dtype=np.uint64)
    for p in range(len(points)):
        for axis in range(3):
            x = np.uint64((points[p, axis] - lower[axis]) * scale)
            x = (x | (x << np.uint64(32))) & np.uint64(0x1F00000000FFFF)
            x = (x | (x << np.uint64(16))) & np.uint64(0x1F0000FF0000FF)
            x = (x | (x << np.uint64(8))) & np.uint64(0x100F00F00F00F00F)
            x = (x | (x << np.uint64(4))) & np.uint64(0x10C30C30C30C30C3)
            x = (x | (x << np.uint64(2))) & np.uint64(0x1249249249249249)
            codes[p] |= x << np.uint64(axis)
    return codes
