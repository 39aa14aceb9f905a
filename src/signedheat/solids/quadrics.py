"""Points that are nearest to several planes at once, within boxes: the quadratic error functions of dual contouring.

Around a centre m the error is ``E(y) = Σ (nᵢ · (y − pᵢ))² = yᵀ A y − 2 bᵀ y + c`` (Ju, Losasso, Schaefer & Warren 2002,
Eq. 1), with ``A = Σ nᵢ nᵢᵀ`` and ``b = Σ nᵢ (nᵢ · pᵢ)``. Along directions in which the planes hardly turn, where A has
small eigenvalues, its minimum stays at m (Lindstrom 2000).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Floats, Ints
from ..mesh.components import sums_of

FLAT = 0.05
"""Tangent of half the angle below which planes count as one. This cuts creases of 5.7° off by a hundredth of a cell at
most; .2 loses creases of 20°, and .01 makes facets of smooth surfaces creases."""


@dataclass(frozen=True, eq=False)
class Quadrics:
    """Sums over planes, for each of n points.

    Attributes
    ----------
    products : (n, 3, 3) float
        A.
    sides : (n, 3) float
        b.
    """

    products: Floats
    sides: Floats

    @classmethod
    def of(cls, owners: Ints, places: Floats, normals: Floats, count: int) -> Quadrics:
        """Sum planes, each through a place, relative to the centre of its owner, with a normal of length 1."""
        along = (normals * places).sum(axis=1)[:, None]
        products = sums_of(normals[:, :, None] * normals[:, None, :], owners, count)
        return cls(products, sums_of(normals * along, owners, count))

    def __add__(self, other: Quadrics) -> Quadrics:
        return Quadrics(self.products + other.products, self.sides + other.sides)

    def __getitem__(self, rows: Ints | slice) -> Quadrics:
        return Quadrics(self.products[rows], self.sides[rows])


def minimizers(quadrics: Quadrics, lower: Floats, upper: Floats) -> tuple[Floats, Ints, Floats]:
    """Return the points of least error of n quadrics within boxes, whose (n, 3) corners are relative to the centres.

    A minimum outside of its box moves along the direction in which the error grows the least, that of a crease, until
    it is in the box; or else it is looked for again on the wall that it is beyond the farthest, up to three times.

    Returns
    -------
    points : (n, 3) float
        Relative to the centres.
    ranks : (n,) int
        Directions that the planes fix: 1 on flat surface, 2 on creases, 3 at corners.
    along : (n, 3) float
        The direction that they fix the least: that of a crease.

    Examples
    --------
    >>> normals = np.eye(3)
    >>> corner = Quadrics.of(np.zeros(3, dtype=int), np.full((3, 3), 0.2), normals, 1)
    >>> points, ranks, _ = minimizers(corner, np.full((1, 3), -1.0), np.array([[1.0, 1.0, 0.1]]))
    >>> points.round(3).tolist(), ranks.tolist()
    ([[0.2, 0.2, 0.1]], [3])
    """
    values, vectors = np.linalg.eigh(quadrics.products)
    least = FLAT**2 * np.maximum(values[:, 2], 1e-300)
    ranks = (values > least[:, None]).sum(axis=1)
    points = _solved(values, vectors, quadrics.sides, least)
    points += _way_into(points, vectors[:, :, 0], lower, upper) * (ranks > 1)[:, None]
    fixed, held = np.zeros(points.shape, dtype=bool), np.zeros_like(points)
    for _ in range(3):
        beyond = np.where(fixed, 0.0, np.maximum(lower - points, points - upper))
        axis = beyond.argmax(axis=1)
        rows = np.flatnonzero(beyond[np.arange(len(points)), axis] > 0)
        if not len(rows):
            break
        axis = axis[rows]
        fixed[rows, axis] = True
        held[rows, axis] = np.clip(points[rows, axis], lower[rows, axis], upper[rows, axis])
        free = ~fixed[rows]
        inner = quadrics.products[rows] * (free[:, :, None] & free[:, None, :])
        sides = (quadrics.sides[rows] - np.einsum("nij,nj->ni", quadrics.products[rows], held[rows])) * free
        points[rows] = _solved(*np.linalg.eigh(inner), sides, least[rows]) + held[rows]
    return np.clip(points, lower, upper), ranks, vectors[:, :, 0]


def _way_into(points: Floats, along: Floats, lower: Floats, upper: Floats) -> Floats:
    """Return the shortest moves along directions into boxes; 0 where a line misses its box."""
    slow = np.where(np.abs(along) > 1e-12, along, 1e-12)
    first, second = (lower - points) / slow, (upper - points) / slow
    enter, leave = np.minimum(first, second).max(axis=1), np.maximum(first, second).min(axis=1)
    way = np.where(enter <= leave, np.clip(0.0, enter, np.maximum(enter, leave)), 0.0)
    return way[:, None] * along


def _solved(values: Floats, vectors: Floats, sides: Floats, least: Floats) -> Floats:
    """A⁻¹ b without eigenvalues below `least`."""
    inverse = np.where(values > least[:, None], 1.0 / np.where(values > least[:, None], values, 1.0), 0.0)
    return np.einsum("nij,nj,nkj,nk->ni", vectors, inverse, vectors, sides, optimize=True)
