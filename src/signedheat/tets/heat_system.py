"""Step 1 in flat space: ``M + tL`` with one scalar unknown per face or node, solved for several columns at once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

from ..arrays import Bools, Floats, Ints
from ..linear import Factor, factorize
from ..linear.incomplete_cholesky import IncompleteCholesky, outward_order
from ..linear.restarts import Stage, matrix_forces, solve_with_restarts
from ..mesh.unit_vectors import unit
from .visibility import uphill_roots


@dataclass(frozen=True, eq=False)
class HeatSystem:
    """``(M + tL) X = X₀`` for right-hand sides that X decays away from.

    Parameters
    ----------
    matrix : (n, n) sparse
        M + tL, whole.
    direct : bool
        Whether to factorise it; it is solved by conjugate gradients otherwise.
    accuracy : float
        Componentwise residual at which conjugate gradients stop.
    """

    matrix: sparse.csr_matrix
    direct: bool
    accuracy: float

    @cached_property
    def factor(self) -> Factor:
        """Its factor."""
        return factorize(self.matrix)

    def solve(self, loads: Floats) -> list[Stage]:
        """X for columns (n, k), in stages: it leaves the range of floating-point numbers a few hundred cells away."""
        size = float(self.matrix.diagonal().mean())
        return solve_with_restarts(self._solve, matrix_forces(self.matrix), loads, size)

    def _solve(self, loads: Floats) -> Floats:
        if self.direct:
            return self.factor.solve(loads)
        order = outward_order(self.matrix, np.flatnonzero(loads.any(axis=1)))
        return IncompleteCholesky.of(self.matrix, order).solve(loads, relative=0.0, componentwise=self.accuracy)


def bend_around_corners(vectors: Floats, falling: Floats, heights: Floats, neighbors: Ints, straight: Bools) -> Floats:
    """X, turned where it has come round a corner.

    In flat space diffusion carries vectors along without turning them. Where the straight line to the source leaves the
    domain, the shortest way to it is bent, and its direction is that in which undirected heat falls (Crane et al.
    2013). The side it is on is the one from which that heat has come.

    That heat falls along `falling`, of any length; `heights` are its logarithms, `neighbors`, (n, k), the cells or
    nodes next to each or −1. What the source reaches along a straight line keeps its X.
    """
    roots = uphill_roots(heights, neighbors, straight)
    side = np.sign(np.einsum("ij,ij->i", unit(vectors), falling))[roots]
    return np.where(straight[:, None], vectors, side[:, None] * falling)
