"""Winding numbers of pieces of curves at each other: they tell how curves face each other that share no end.

The winding number of the boundary of a region is w on one side of it and w + 1 on the other, everywhere with the same
w. Half way between is what all pieces find on themselves that face the right way; where one of two curves is turned,
they differ by one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ..geometry.curve_segments import CurveSegments
from ..geometry.geodesics.sources import PlacedSegments
from ..geometry.intrinsic_mesh import IntrinsicMesh
from ..lowering.surface.discretization import SurfaceDiscretization

BLOCK = 64
"""Curves whose winding numbers are solved for at a time."""
LEVEL = 1e-9
"""Height of a corner beside a segment, relative to its face, up to which it is on neither side."""


@dataclass(frozen=True, eq=False)
class Windings:
    """What is needed to compute winding numbers of combinations of curves at each of them.

    Attributes
    ----------
    surface : SurfaceDiscretization
        That they lie on.
    jumps : (k, n) sparse
        Right-hand sides of ``C w = b``, whose solution jumps by one across each curve: up, to its positive side.
    means : (k, n) sparse
        Mean over each curve of the middle of the values on its two sides.
    parts : (k,) int
        Part of the surface that each curve lies on.
    """

    surface: SurfaceDiscretization
    jumps: sparse.csr_matrix
    means: sparse.csr_matrix
    parts: NDArray[np.int64]

    @classmethod
    def of(cls, surface: SurfaceDiscretization, curves: Sequence[CurveSegments]) -> Windings:
        """Prepare oriented curves."""
        triangles = surface.triangles
        placed = [PlacedSegments.of(triangles, [curve]) for curve in curves]
        jumps = sparse.csr_matrix(sparse.vstack([_jump(triangles, each) for each in placed]))
        means = sparse.csr_matrix(sparse.vstack([_middle(triangles, each) for each in placed]))
        parts = np.array([triangles.face_components[curve.faces[0]] for curve in curves], dtype=np.int64)
        return cls(surface, jumps, means, parts)

    def of_sums(self, combined: sparse.csr_matrix) -> NDArray[np.float64]:
        """(k, j) mean winding number, at each curve, of j sums of curves, (j, k) signs; up to one number a part."""
        sums = sparse.csr_matrix(combined @ self.jumps)
        found = np.empty((self.means.shape[0], sums.shape[0]))
        for begin in range(0, sums.shape[0], BLOCK):
            right = np.asfortranarray(sums[begin : begin + BLOCK].T.toarray())
            found[:, begin : begin + BLOCK] = self.means @ self.surface.integration.factor.solve(right)
        return found


def _jump(triangles: IntrinsicMesh, placed: PlacedSegments) -> sparse.csr_matrix:
    """(1, n) b: integrals of the slopes of hat functions across a curve."""
    times = np.bincount(placed.given)[placed.given]
    steps = placed.positions[:, 1] - placed.positions[:, 0]
    across = 1j * steps * placed.sides / times
    opposite = np.roll(triangles.edge_vectors[placed.faces], -1, axis=1)
    slopes = 1j * opposite / (2 * triangles.areas_as_divisors[placed.faces])[:, None]
    return _row(triangles, placed, (np.conj(slopes) * across[:, None]).real)


def _middle(triangles: IntrinsicMesh, placed: PlacedSegments) -> sparse.csr_matrix:
    """(1, n) the mean over a curve of the middle of the values on its two sides.

    What jumps across a curve is, as a function linear on triangles, a slope as wide as they are: values on the curve
    itself would depend on where in them it runs. Beside each segment those at the corners of its face on either side
    are taken.
    """
    start, steps = placed.positions[:, :1], np.diff(placed.positions, axis=1)
    corners = triangles.corner_positions[placed.faces] - start
    height = (np.conj(steps) * corners).imag / np.abs(steps)
    least = LEVEL * triangles.edge_lengths[placed.faces].max(axis=1, keepdims=True)
    left, right = height > least, height < -least
    shares = sum(0.5 * side / np.maximum(side.sum(axis=1, keepdims=True), 1) for side in (left, right))
    shares[~(left.any(axis=1) & right.any(axis=1))] *= 2  # along an edge, the other face of which has the other side
    lengths = np.abs(steps) / np.bincount(placed.given)[placed.given][:, None]
    return _row(triangles, placed, shares * lengths / lengths.sum())


def _row(triangles: IntrinsicMesh, placed: PlacedSegments, values: NDArray[np.float64]) -> sparse.csr_matrix:
    """(1, n) sums at vertices of (k, 3) values at the corners of the faces of segments."""
    rows = np.zeros(values.size, dtype=np.int64)
    columns = triangles.corner_vertices[placed.faces].ravel()
    return sparse.csr_matrix((values.ravel(), (rows, columns)), shape=(1, triangles.n_vertices))
