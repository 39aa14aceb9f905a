"""A tree of oriented bounding boxes of triangles, to find pairs that are near each other.

Axis-aligned boxes of long, thin triangles overlap far from the triangles. Boxes along their sides do not.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..arrays import Bools, Floats, Ints
from ..compiled import compiled
from .box_tree import boxes_around
from .triangles import area_vectors
from .unit_vectors import unit

TRIANGLES_PER_LEAF = 8
"""Number of triangles in each leaf. To compare the boxes of so few takes less time than to descend further."""
BOX_ROUNDING = 1e-12
"""Distance between oriented boxes, relative to their sizes, up to which it may be rounding, and they count as near."""


class OrientedBoxes(NamedTuple):
    """A complete binary tree over triangles in order; node i has the children 2 i and 2 i + 1, and the root is 1.

    A triangle has ten numbers: the largest coordinate along each axis, minus the smallest coordinate along each axis,
    its slack, 1 or 0 for whether it is asked for, its hub or −1, and minus the hub. A node has the largest of each of
    these numbers of all triangles below it, and −∞ if there are none.
    """

    own: Floats  # (leaves · TRIANGLES_PER_LEAF, 10) numbers of each triangle
    largest: Floats  # (2 · leaves, 10) numbers of each node
    # (2 · leaves, 15) oriented box of each node: centre, half the lengths of its sides, and their directions
    oriented: Floats

    @classmethod
    def of(cls, corners: Floats, slacks: Floats, hubs: Ints, asked: Bools) -> OrientedBoxes:
        """Build the tree over n triangles, with (n, 9) corners, (n,) slacks, (n,) hubs, and (n,) whether asked for."""
        leaves = 1 << max(int(np.ceil(np.log2(len(corners) / TRIANGLES_PER_LEAF))), 0)
        own = np.full((TRIANGLES_PER_LEAF * leaves, 10), -np.inf)
        lower, upper = boxes_around(corners.reshape(-1, 3, 3))
        for columns, values in zip(
            np.split(own[: len(corners)], [3, 6, 7, 8, 9], axis=1),
            (upper, -lower, slacks, asked, hubs, -hubs),
            strict=True,
        ):
            columns[:] = values.reshape(columns.shape)
        largest = np.full((2 * leaves, 10), -np.inf)
        return cls(own, largest, _oriented(corners, _axes(corners.reshape(-1, 3, 3), leaves), own, largest))


def _axes(triangles: Floats, leaves: int) -> Floats:
    """Return (leaves, 9) three perpendicular unit vectors for each leaf, the first along the longest side in it.

    The second is in the plane of that triangle, and the third its normal. They are 0 if the triangle is degenerate.
    """
    sides = np.roll(triangles, -1, axis=1) - triangles
    squares = np.zeros((TRIANGLES_PER_LEAF * leaves, 3))
    squares[: len(triangles)] = np.einsum("ncd,ncd->nc", sides, sides)
    longest = 3 * TRIANGLES_PER_LEAF * np.arange(leaves) + squares.reshape(leaves, -1).argmax(axis=1)
    chosen = np.minimum(longest // 3, len(triangles) - 1)
    along = unit(sides[chosen, longest % 3])
    normals = unit(area_vectors(triangles[chosen]))
    return np.concatenate([along, np.cross(normals, along), normals], axis=1)


@compiled
def _oriented(corners: Floats, axes: Floats, own: Floats, largest: Floats) -> Floats:
    """Return (2 · leaves, 15) oriented boxes of nodes; also compute the numbers `largest` of each node.

    Boxes of leaves have the given axes, (leaves, 9), and those of other nodes the axes of their wider child.
    """
    leaves, points = len(axes), np.empty((max(16, 3 * TRIANGLES_PER_LEAF), 3))
    oriented = np.zeros((2 * leaves, 15))
    for node in range(2 * leaves - 1, 0, -1):
        count, wider, widest, first = 0, 0, -1.0, TRIANGLES_PER_LEAF * (node - leaves)
        if first >= 0:
            for k in range(3 * first, 3 * min(first + TRIANGLES_PER_LEAF, len(corners))):
                for d in range(3):
                    points[count, d] = corners[k // 3, k % 3 * 3 + d]
                count += 1
        else:
            for child in range(2 * node, 2 * node + 2):
                a, b, c = oriented[child, 3], oriented[child, 4], oriented[child, 5]
                if max(a * b, b * c, c * a) > widest:
                    wider, widest = child, max(a * b, b * c, c * a)
                for k in range(8):
                    for d in range(3):
                        points[count, d] = oriented[child, d]
                        for e in range(3):
                            way = oriented[child, 3 + e] * oriented[child, 6 + 3 * e + d]
                            points[count, d] += way if (k >> e) & 1 else -way
                    count += 1
        for k in range(10):
            for i in range(TRIANGLES_PER_LEAF if first >= 0 else 2):
                value = own[first + i, k] if first >= 0 else largest[2 * node + i, k]
                largest[node, k] = max(largest[node, k], value)
        for k in range(3):
            square, least, most = 0.0, 0.0, 0.0
            for d in range(6 + 3 * k, 9 + 3 * k):
                oriented[node, d] = axes[node - leaves, d - 6] if first >= 0 else oriented[wider, d]
                square += oriented[node, d] ** 2
            for i in range(count):  # from the first point, so that rounding is small
                along = 0.0
                for d in range(3):
                    along += oriented[node, 6 + 3 * k + d] * (points[i, d] - points[0, d])
                least, most = min(least, along), max(most, along)
            oriented[node, 3 + k] = 0.5 * (most - least) if square > 0.0 else np.inf  # unknown
            for d in range(3):
                oriented[node, d] += 0.5 * (least + most) * oriented[node, 6 + 3 * k + d]
        for d in range(3):
            oriented[node, d] += points[0, d]
    return oriented


@compiled
def boxes_apart(first: Floats, a: int, second: Floats, b: int, slack: float) -> bool:
    """Return whether two axis-aligned boxes are farther apart than a slack along an axis.

    The boxes are rows a and b, with the upper ends along the axes, followed by minus the lower ends.
    """
    for d in range(3):
        if first[a, d] + second[b, 3 + d] < -slack or second[b, d] + first[a, 3 + d] < -slack:
            return True
    return False


@compiled
def oriented_apart(oriented: Floats, a: int, b: int, slack: float) -> bool:
    """Return whether the oriented boxes of nodes a and b are farther apart than a slack along a side of one of them.

    A row of `oriented` has the centre of a box, its half widths along its sides, and the three unit vectors of these.
    """
    x, y, z = oriented[b, 0] - oriented[a, 0], oriented[b, 1] - oriented[a, 1], oriented[b, 2] - oriented[a, 2]
    for d in range(3, 6):
        slack += BOX_ROUNDING * (oriented[a, d] + oriented[b, d])
    for t in range(2):
        c, d = (a, b) if t == 0 else (b, a)
        for k in range(3):
            u, v, w = oriented[c, 6 + 3 * k], oriented[c, 7 + 3 * k], oriented[c, 8 + 3 * k]
            reach = oriented[c, 3 + k] + slack
            for j in range(3):
                along = u * oriented[d, 6 + 3 * j] + v * oriented[d, 7 + 3 * j] + w * oriented[d, 8 + 3 * j]
                reach += abs(along) * oriented[d, 3 + j]
            if abs(u * x + v * y + w * z) > reach:
                return True
    return False
