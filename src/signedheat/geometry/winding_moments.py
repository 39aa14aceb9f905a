"""What triangles far away add to winding numbers: moments of their area vectors, up to the second.

Around a centre p, with offsets e and area vectors a, 4π times the winding number at ``p − d`` is, by Taylor's theorem,
``a·d / r³ + (tr M − 3 M(d) / r²) / r³ + (15 S(d) / r² − 3 tr S(d)) / 2 r⁵``, where ``M(d) = Σ (a·d) (e·d)`` and
``S(d) = Σ (a·d) (e·d)²`` are polynomials, of which the symmetric part is all that counts (Barill et al. 2018).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .box_tree import LEAF, BoxTree

SQUARES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
"""Terms of M: xx, yy, zz, xy, xz, yz."""
CUBES = ((0, 0, 0), (1, 1, 1), (2, 2, 2), (0, 0, 1), (0, 0, 2), (0, 1, 1), (1, 1, 2), (0, 2, 2), (1, 2, 2), (0, 1, 2))
"""Terms of S: xxx, yyy, zzz, xxy, xxz, xyy, yyz, xzz, yzz, xyz."""
WIDTH = 7 + len(SQUARES) + len(CUBES)


def moments_of(triangles: NDArray[np.float64], tree: BoxTree, opening: float) -> NDArray[np.float64]:
    """(2 · leaves, 23) of what is below each node of a tree.

    Area vector, centre, the square of `opening` times the radius around it, then the coefficients of M and S.
    """
    leaves = len(tree.bounds) // 2
    grouped = tree.items.reshape(leaves, LEAF)
    there = grouped >= 0
    corners = np.where(there[..., None, None], triangles[grouped], 0.0)
    middles = corners.mean(axis=2)
    own = 0.5 * np.cross(corners[:, :, 1] - corners[:, :, 0], corners[:, :, 2] - corners[:, :, 0])
    areas = np.linalg.norm(own, axis=2)
    vectors, weights, firsts = own.sum(axis=1), areas.sum(axis=1), (areas[..., None] * middles).sum(axis=1)
    centres = _over(firsts, weights)
    offsets = np.where(there[..., None], middles - centres[:, None], 0.0)
    linear = _product(own, offsets)
    quadratic = _product(linear, offsets)
    for corner in range(3):  # the second moment of a triangle about its own centre
        arm = corners[:, :, corner] - middles
        quadratic += _product(_product(own, arm), arm) / 12
    first, second = linear.sum(axis=1), quadratic.sum(axis=1)
    reaches = np.where(there[..., None], np.linalg.norm(corners - centres[:, None, None], axis=3), 0.0)
    radii = reaches.max(axis=(1, 2))
    moments = np.zeros((2 * leaves, WIDTH))
    level = leaves
    while True:
        rows = slice(level, 2 * level)
        low, high = tree.bounds[rows, :3], tree.bounds[rows, 3:]
        with np.errstate(invalid="ignore"):  # of nothing
            box = np.linalg.norm(np.maximum(centres - low, high - centres), axis=1)
        radii = np.where(weights > 0, np.minimum(radii, box), 0.0)
        moments[rows, :3], moments[rows, 3:6], moments[rows, 6] = vectors, centres, (opening * radii) ** 2
        moments[rows, 7:13], moments[rows, 13:] = first, second
        if level == 1:
            return moments
        level //= 2
        firsts, total = _in_pairs(firsts).sum(axis=1), _in_pairs(weights).sum(axis=1)
        middle = _over(firsts, total)
        moved = np.where(weights[:, None] > 0, centres - np.repeat(middle, 2, axis=0), 0.0)
        second = second + 2 * _product(first, moved) + _product(_product(vectors, moved), moved)
        first = first + _product(vectors, moved)
        radii = _in_pairs(radii + np.linalg.norm(moved, axis=1)).max(axis=1)
        vectors, first, second = (_in_pairs(each).sum(axis=1) for each in (vectors, first, second))
        centres, weights = middle, total


def _product(form: NDArray[np.float64], line: NDArray[np.float64]) -> NDArray[np.float64]:
    """Coefficients of a linear or quadratic form, (…, 3) or (…, 6), times a linear one."""
    given, wanted = (((0,), (1,), (2,)), SQUARES) if form.shape[-1] == 3 else (SQUARES, CUBES)
    result = np.zeros((*form.shape[:-1], len(wanted)))
    for term, axes in enumerate(given):
        for axis in range(3):
            result[..., wanted.index(tuple(sorted((*axes, axis))))] += form[..., term] * line[..., axis]
    return result


def _over(firsts: NDArray[np.float64], weights: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(firsts / np.where(weights > 0, weights, 1.0)[:, None])


def _in_pairs(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n / 2, 2, …) values of the two nodes below each."""
    return values.reshape(-1, 2, *values.shape[1:])
