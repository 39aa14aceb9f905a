"""A tree of boxes that are turned as what they are around, for pairs of shapes near each other.

Boxes along the axes around long, thin triangles overlap far from where these are; boxes along their sides do not.
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
"""Triangles in each leaf: comparing their boxes takes less time than descending further."""
BOX_ROUNDING = 1e-12
"""Distance between turned boxes that may be rounding, relative to their sizes."""


class TurnedBoxes(NamedTuple):
    """A complete binary tree over triangles in order: node i has the children 2 i and 2 i + 1, the root is 1.

    Known of a triangle, and of a node the largest of all below it, are: its coordinates, their opposites, its slack,
    whether it is asked for, its hub or −1, and the opposite of that; or −∞ where there is nothing.
    """

    own: Floats  # (leaves · TRIANGLES_PER_LEAF, 10) what is known of each triangle
    largest: Floats  # (2 · leaves, 10) what is known of each node
    # (2 · leaves, 15) box along a large triangle below: centre, half the lengths of its sides, and their directions
    turned: Floats

    @classmethod
    def of(cls, corners: Floats, slacks: Floats, hubs: Ints, asked: Bools) -> TurnedBoxes:
        """Build the tree over (n, 9) corners."""
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
        return cls(own, largest, _turned(corners, _axes(corners.reshape(-1, 3, 3), leaves), own, largest))


def _axes(triangles: Floats, leaves: int) -> Floats:
    """Return (leaves, 9) directions along the longest side in each leaf, and across it; 0 where there are none."""
    sides = np.roll(triangles, -1, axis=1) - triangles
    squares = np.zeros((TRIANGLES_PER_LEAF * leaves, 3))
    squares[: len(triangles)] = np.einsum("ncd,ncd->nc", sides, sides)
    longest = 3 * TRIANGLES_PER_LEAF * np.arange(leaves) + squares.reshape(leaves, -1).argmax(axis=1)
    chosen = np.minimum(longest // 3, len(triangles) - 1)
    along = unit(sides[chosen, longest % 3])
    normals = unit(area_vectors(triangles[chosen]))
    return np.concatenate([along, np.cross(normals, along), normals], axis=1)


@compiled
def _turned(corners: Floats, axes: Floats, own: Floats, largest: Floats) -> Floats:
    """Return (2 · leaves, 15) boxes along the (leaves, 9) axes of leaves, or along those of the wider child.

    Also fill in what is the `largest` of all below each node.
    """
    leaves, points = len(axes), np.empty((max(16, 3 * TRIANGLES_PER_LEAF), 3))
    turned = np.zeros((2 * leaves, 15))
    for node in range(2 * leaves - 1, 0, -1):
        count, wider, widest, first = 0, 0, -1.0, TRIANGLES_PER_LEAF * (node - leaves)
        if first >= 0:
            for k in range(3 * first, 3 * min(first + TRIANGLES_PER_LEAF, len(corners))):
                for d in range(3):
                    points[count, d] = corners[k // 3, k % 3 * 3 + d]
                count += 1
        else:
            for child in range(2 * node, 2 * node + 2):
                a, b, c = turned[child, 3], turned[child, 4], turned[child, 5]
                if max(a * b, b * c, c * a) > widest:
                    wider, widest = child, max(a * b, b * c, c * a)
                for k in range(8):
                    for d in range(3):
                        points[count, d] = turned[child, d]
                        for e in range(3):
                            way = turned[child, 3 + e] * turned[child, 6 + 3 * e + d]
                            points[count, d] += way if (k >> e) & 1 else -way
                    count += 1
        for k in range(10):
            for i in range(TRIANGLES_PER_LEAF if first >= 0 else 2):
                value = own[first + i, k] if first >= 0 else largest[2 * node + i, k]
                largest[node, k] = max(largest[node, k], value)
        for k in range(3):
            square, least, most = 0.0, 0.0, 0.0
            for d in range(6 + 3 * k, 9 + 3 * k):
                turned[node, d] = axes[node - leaves, d - 6] if first >= 0 else turned[wider, d]
                square += turned[node, d] ** 2
            for i in range(count):  # from the first point, so that rounding is small
                along = 0.0
                for d in range(3):
                    along += turned[node, 6 + 3 * k + d] * (points[i, d] - points[0, d])
                least, most = min(least, along), max(most, along)
            turned[node, 3 + k] = 0.5 * (most - least) if square > 0.0 else np.inf  # unknown
            for d in range(3):
                turned[node, d] += 0.5 * (least + most) * turned[node, 6 + 3 * k + d]
        for d in range(3):
            turned[node, d] += points[0, d]
    return turned


@compiled
def boxes_apart(first: Floats, a: int, second: Floats, b: int, slack: float) -> bool:
    """Return whether boxes along the axes are farther apart than a slack: rows have upper and opposite lower ends."""
    for d in range(3):
        if first[a, d] + second[b, 3 + d] < -slack or second[b, d] + first[a, 3 + d] < -slack:
            return True
    return False


@compiled
def turned_apart(turned: Floats, a: int, b: int, slack: float) -> bool:
    """Return whether turned boxes are farther apart than a slack along a side of one of them."""
    x, y, z = turned[b, 0] - turned[a, 0], turned[b, 1] - turned[a, 1], turned[b, 2] - turned[a, 2]
    for d in range(3, 6):
        slack += BOX_ROUNDING * (turned[a, d] + turned[b, d])
    for t in range(2):
        one, other = (a, b) if t == 0 else (b, a)
        for k in range(3):
            u, v, w = turned[one, 6 + 3 * k], turned[one, 7 + 3 * k], turned[one, 8 + 3 * k]
            reach = turned[one, 3 + k] + slack
            for j in range(3):
                along = u * turned[other, 6 + 3 * j] + v * turned[other, 7 + 3 * j] + w * turned[other, 8 + 3 * j]
                reach += abs(along) * turned[other, 3 + j]
            if abs(u * x + v * y + w * z) > reach:
                return True
    return False
