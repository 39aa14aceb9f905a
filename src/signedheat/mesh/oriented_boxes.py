"""A tree of oriented bounding boxes of triangles, to find pairs that are near each other.

Axis-aligned boxes of long, thin triangles overlap far from the triangles. Boxes along their sides do not.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..arrays import Bools, Floats, Ints
from ..compiled import compiled

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
        largest, oriented = np.full((2 * leaves, 10), -np.inf), np.zeros((2 * leaves, 15))
        _write_boxes(corners, slacks, hubs, asked, own, largest, oriented)
        return cls(own, largest, oriented)


@compiled
def _write_axes(corners: Floats, first: int, end: int, oriented: Floats, node: int) -> None:
    """Write three perpendicular unit vectors for the triangles of a leaf to its row, the first along the longest side.

    The second is in the plane of that triangle, and the third its normal. They are 0 if the triangle is degenerate.
    """
    longest, chosen, start = -1.0, first, 0
    for f in range(first, end):
        for k in range(3):
            square = 0.0
            for d in range(3):
                square += (corners[f, (3 * k + 3 + d) % 9] - corners[f, 3 * k + d]) ** 2
            if square > longest:
                longest, chosen, start = square, f, 3 * k
    if not longest > 0.0:
        return
    length = np.sqrt(longest)
    for d in range(3):
        oriented[node, 6 + d] = (corners[chosen, (start + 3 + d) % 9] - corners[chosen, start + d]) / length
        oriented[node, 9 + d] = (corners[chosen, (start + 6 + d) % 9] - corners[chosen, start + d]) / length
    _write_cross(oriented, node, 6, 9, 12)
    _write_cross(oriented, node, 12, 6, 9)


@compiled
def _write_cross(oriented: Floats, node: int, a: int, b: int, to: int) -> None:
    """Write the unit vector across those at `a` and `b` in a row to place `to`; 0 if they are parallel."""
    square = 0.0
    for d in range(3):
        e, f = (d + 1) % 3, (d + 2) % 3
        value = oriented[node, a + e] * oriented[node, b + f] - oriented[node, a + f] * oriented[node, b + e]
        oriented[node, to + d] = value
        square += value * value
    scale = 1.0 / np.sqrt(square) if square > 0.0 else 0.0
    for d in range(3):
        oriented[node, to + d] *= scale


@compiled
def _write_boxes(
    corners: Floats, slacks: Floats, hubs: Ints, asked: Bools, own: Floats, largest: Floats, oriented: Floats
) -> None:
    """Write the numbers of triangles, `own`, and the largest numbers and the oriented boxes of nodes.

    Boxes of leaves are as `_write_axes` turns them, and those of other nodes as that of their wider child.
    """
    leaves, points = len(largest) // 2, np.empty((max(16, 3 * TRIANGLES_PER_LEAF), 3))
    for node in range(2 * leaves - 1, 0, -1):  # children before their parents
        count, wider, widest, first = 0, 0, -1.0, TRIANGLES_PER_LEAF * (node - leaves)
        # the points that the box must contain: corners of triangles, or of the boxes of both children
        if first >= 0:  # a leaf
            end = min(first + TRIANGLES_PER_LEAF, len(corners))
            _write_axes(corners, first, end, oriented, node)
            for f in range(first, end):
                own[f, 6], own[f, 7], own[f, 8], own[f, 9] = slacks[f], 1.0 if asked[f] else 0.0, hubs[f], -hubs[f]
                for d in range(3):
                    x, y, z = corners[f, d], corners[f, 3 + d], corners[f, 6 + d]
                    own[f, d], own[f, 3 + d] = max(x, y, z), -min(x, y, z)
                    points[count, d], points[count + 1, d], points[count + 2, d] = x, y, z
                count += 3
        else:
            for child in range(2 * node, 2 * node + 2):
                if largest[child, 6] == -np.inf:  # no triangles
                    continue
                a, b, c = oriented[child, 3], oriented[child, 4], oriented[child, 5]
                if max(a * b, b * c, c * a) > widest:
                    wider, widest = child, max(a * b, b * c, c * a)
                for k in range(8):
                    for d in range(3):
                        points[count, d] = oriented[child, d]
                        for e in range(3):
                            half_side = oriented[child, 3 + e] * oriented[child, 6 + 3 * e + d]
                            points[count, d] += half_side if (k >> e) & 1 else -half_side
                    count += 1
        if count == 0:
            continue
        # the largest numbers of its triangles, or of its children
        for k in range(10):
            for i in range(TRIANGLES_PER_LEAF if first >= 0 else 2):
                value = own[first + i, k] if first >= 0 else largest[2 * node + i, k]
                largest[node, k] = max(largest[node, k], value)
        # the extent of the points along each direction gives half widths and centre
        for k in range(3):
            square, least, most = 0.0, 0.0, 0.0
            for d in range(6 + 3 * k, 9 + 3 * k):
                if first < 0:
                    oriented[node, d] = oriented[wider, d]
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
    Boxes that only axes across two sides separate count as near.
    """
    x, y, z = oriented[b, 0] - oriented[a, 0], oriented[b, 1] - oriented[a, 1], oriented[b, 2] - oriented[a, 2]
    for d in range(3, 6):
        slack += BOX_ROUNDING * (oriented[a, d] + oriented[b, d])
    for t in range(2):
        c, d = (a, b) if t == 0 else (b, a)
        for k in range(3):
            u, v, w = oriented[c, 6 + 3 * k], oriented[c, 7 + 3 * k], oriented[c, 8 + 3 * k]
            reach = oriented[c, 3 + k] + slack  # half of what both boxes take up along this side of box c
            for j in range(3):
                along = u * oriented[d, 6 + 3 * j] + v * oriented[d, 7 + 3 * j] + w * oriented[d, 8 + 3 * j]
                reach += abs(along) * oriented[d, 3 + j]
            if abs(u * x + v * y + w * z) > reach:
                return True
    return False
