"""Incomplete Cholesky factors without fill, IC(0), as preconditioners of conjugate gradients.

They are for systems that are too large to factorise. A factor takes as much memory as half the matrix, and the time of
an iteration is linear in the number of entries.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse

from ..arrays import Floats, Ints
from ..compiled import compiled
from .conjugate_gradients import conjugate_gradients
from .ordering import whole
from .threads import one_blas_thread


@dataclass(frozen=True, eq=False)
class IncompleteCholesky:
    """A symmetric positive definite matrix with its IC(0) factor, in a chosen order of unknowns."""

    order: Ints  # (k,) unknowns to solve for, in this order; all others are zero in the solution
    matrix: sparse.csr_matrix  # (k, k) the matrix, with rows and columns in that order
    factor: sparse.csr_matrix  # (k, k) strictly lower triangle of the factor
    pivots: Floats  # (k,) inverse diagonal of the factor
    n: int  # number of unknowns, solved for or not

    @classmethod
    def of(cls, matrix: sparse.csr_matrix, order: Ints) -> IncompleteCholesky:
        """Factorise a matrix; if a pivot is not positive, begin anew with a larger diagonal (Manteuffel 1980)."""
        chosen = sparse.csr_matrix(matrix[order][:, order])
        factor = sparse.csr_matrix(sparse.tril(chosen, -1))
        factor.sort_indices()
        lower, shift = factor.data.copy(), 0.0
        while True:
            pivots = (1 + shift) * chosen.diagonal()
            if _factorize(factor.indptr, factor.indices, factor.data, pivots):
                return cls(order, chosen, factor, pivots, matrix.shape[0])
            factor.data[:] = lower
            shift = max(1e-3, 2 * shift)

    def solve(self, rhs: ArrayLike, relative: float = 1e-10, componentwise: float = 0.0) -> Floats:
        """Solve for right-hand sides b, (n,) or (n, k), by preconditioned conjugate gradients.

        It ends once the residual r satisfies ``‖r‖ ≤ relative · ‖b‖`` or, in every row i, ``|r_i| ≤ componentwise ·
        A_ii |x_i|``. The second criterion keeps solutions accurate that decay by hundreds of orders of magnitude, if
        `order` follows the decay.
        """
        b = np.asarray(rhs, dtype=np.float64)
        x = np.zeros((self.n, b[0].size))
        scale = np.abs(b).max() if b.size else 0.0
        if scale > 0:
            load = np.ascontiguousarray(b.reshape(self.n, -1)[self.order] / scale)
            x[self.order] = self._iterate(load, relative, componentwise) * scale
        return x.reshape(b.shape)

    def _iterate(self, load: Floats, relative: float, componentwise: float) -> Floats:
        """Solve for the columns of `load`, (k, c), whose rows are in the order of the factor."""
        shape, goal = load.shape, relative**2 * float(np.einsum("ij,ij->", load, load))
        diagonal, factor = self.matrix.diagonal(), self.factor

        def multiply(p: Floats) -> Floats:
            return (self.matrix @ p.reshape(shape)).ravel()

        def precondition(r: Floats) -> Floats:
            solution: Floats = _precondition(factor.indptr, factor.indices, factor.data, self.pivots, r.reshape(shape))
            return solution.ravel()

        def converged(x: Floats, r: Floats) -> bool:
            small = np.einsum("i,i->", r, r) <= goal
            return bool(small or _settled(diagonal, x.reshape(shape), r.reshape(shape), componentwise))

        with one_blas_thread():  # threads only wait between the inner products
            solution = conjugate_gradients(
                multiply, load.ravel(), precondition, tolerance=0.0, limit=5000, converged=converged
            )
        return solution.reshape(shape)


def outward_order(matrix: sparse.csr_matrix, seeds: Ints) -> Ints:
    """Return the unknowns connected to the seeds in the graph of a matrix, in breadth-first order from the seeds."""
    n = matrix.shape[0]
    links = sparse.csr_matrix((np.ones(len(seeds)), (np.full(len(seeds), n), seeds)), shape=(n + 1, n + 1))
    graph = sparse.csr_matrix((matrix.data != 0, matrix.indices, matrix.indptr), shape=matrix.shape)
    graph.resize(n + 1, n + 1)
    order: NDArray[np.int32] = sparse.csgraph.breadth_first_order(links + graph, n, return_predecessors=False)
    return order[1:].astype(np.int64)


def from_first(upper: sparse.csr_matrix) -> IncompleteCholesky:
    """Factorise a matrix, given by its upper triangle, in breadth-first order from the least unknown of each part."""
    full = whole(upper)
    _, first = np.unique(sparse.csgraph.connected_components(full, directed=False)[1], return_index=True)
    return IncompleteCholesky.of(full, outward_order(full, first))


@compiled
def _factorize(indptr: NDArray[np.int32], indices: NDArray[np.int32], factor: Floats, pivots: Floats) -> bool:
    """Compute the IC(0) factor in place, and return whether all pivots are positive.

    `factor` has the strictly lower triangle by rows, the CSR matrix with `indptr` and sorted `indices`, and `pivots`,
    (n,), the diagonal, which becomes the inverse diagonal of the factor. Row by row, ``L_ij = (A_ij − Σ_k L_ik L_jk) /
    L_jj`` for the entries of A only, and ``L_ii² = A_ii − Σ_j L_ij²``.
    """
    for i in range(len(pivots)):
        diagonal = pivots[i]
        rest = diagonal
        for k in range(indptr[i], indptr[i + 1]):
            j = indices[k]
            value = factor[k]
            # entries of rows i and j in the same columns
            p, q = indptr[i], indptr[j]
            while p < k and q < indptr[j + 1]:
                if indices[p] == indices[q]:
                    value -= factor[p] * factor[q]
                    p += 1
                    q += 1
                elif indices[p] < indices[q]:
                    p += 1
                else:
                    q += 1
            value *= pivots[j]
            factor[k] = value
            rest -= value * value
        if not rest > 1e-12 * diagonal:
            return False
        pivots[i] = 1.0 / np.sqrt(rest)
    return True


@compiled
def _precondition(
    indptr: NDArray[np.int32], indices: NDArray[np.int32], factor: Floats, pivots: Floats, r: Floats
) -> Floats:
    """Return z = (L Lᵀ)⁻¹ r, by forward and backward substitution, for r of shape (n, c).

    L is given by the arrays of `_factorize`.
    """
    n, width = r.shape
    z = np.empty((n, width))
    for i in range(n):  # L y = r, by the rows of L
        for c in range(width):
            z[i, c] = r[i, c]
        for k in range(indptr[i], indptr[i + 1]):
            for c in range(width):
                z[i, c] -= factor[k] * z[indices[k], c]
        for c in range(width):
            z[i, c] *= pivots[i]
    for i in range(n - 1, -1, -1):  # Lᵀ z = y, by the columns of Lᵀ
        for c in range(width):
            z[i, c] *= pivots[i]
        for k in range(indptr[i], indptr[i + 1]):
            for c in range(width):
                z[indices[k], c] -= factor[k] * z[i, c]
    return z


@compiled
def _settled(diagonal: Floats, x: Floats, r: Floats, componentwise: float) -> bool:
    """Return whether the residual of every row i is at most `componentwise` times ``A_ii |x_i|``.

    `x` and `r` are (n, c). The largest entry of a row in any column counts.
    """
    n, width = x.shape
    for i in range(n):
        largest, residual = 0.0, 0.0
        for c in range(width):
            largest = max(largest, abs(x[i, c]))
            residual = max(residual, abs(r[i, c]))
        # unknowns below 1e-290 have lost digits to underflow
        if residual > 1e-290 and residual / (diagonal[i] * largest + 1e-320) > componentwise:
            return False
    return True
