"""Incomplete Cholesky factors without fill, IC(0), which precondition conjugate gradients.

For systems too large to factorise. The factor takes as much memory as half the matrix; time per iteration is linear.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse
from threadpoolctl import threadpool_limits

from ..compiled import compiled
from .conjugate_gradients import conjugate_gradients
from .matrices import whole

SMALLEST = 1e-290
"""Unknowns below this have lost bits to underflow, and are left out of the stopping criterion."""

MOST_ITERATIONS = 5000


@dataclass(frozen=True, eq=False)
class IncompleteCholesky:
    """A symmetric positive definite matrix with its IC(0) factor, in a chosen order of unknowns.

    Attributes
    ----------
    order : (k,) int
        Unknowns to solve for, in this order; the others stay zero.
    indptr, indices : int arrays
        Sparsity pattern (CSR) of the strictly lower triangle, rows and columns in that order.
    diagonal, lower : float arrays
        Diagonal and strictly lower triangle of the matrix.
    pivots, factor : float arrays
        Inverse diagonal and strictly lower triangle of the factor.
    n : int
        Number of unknowns, solved for or not.
    """

    order: NDArray[np.int64]
    indptr: NDArray[np.int64]
    indices: NDArray[np.int32]
    diagonal: NDArray[np.float64]
    lower: NDArray[np.float64]
    pivots: NDArray[np.float64]
    factor: NDArray[np.float64]
    n: int

    @classmethod
    def of(cls, matrix: sparse.csr_matrix, order: NDArray[np.int64]) -> IncompleteCholesky:
        """Factorise; if a pivot is not positive, again with a larger diagonal (Manteuffel 1980).

        Examples
        --------
        >>> A = sparse.csr_matrix([[4.0, -1.0], [-1.0, 4.0]])
        >>> IncompleteCholesky.of(A, np.arange(2)).solve(np.array([3.0, 3.0]))
        array([1., 1.])
        """
        indptr, indices, lower, diagonal = _lower_triangle(
            matrix.indptr, matrix.indices, matrix.data, order, matrix.shape[0]
        )
        shift = 0.0
        while True:
            factor, pivots = lower.copy(), (1 + shift) * diagonal
            if _factorize(indptr, indices, factor, pivots):
                return cls(order, indptr, indices, diagonal, lower, pivots, factor, matrix.shape[0])
            shift = max(1e-3, 2 * shift)

    def solve(self, rhs: ArrayLike, relative: float = 1e-10, componentwise: float = 0.0) -> NDArray[np.float64]:
        """Solve by conjugate gradients for one right-hand side (n,) or several (n, k), as one block-diagonal system.

        Conjugate gradients on all columns at once. They stop once ``‖r‖ ≤ relative · ‖b‖``, or once
        ``|r_i| ≤ componentwise · A_ii |x_i|`` in every row (an entrywise backward error, Oettli & Prager 1964): the
        second keeps solutions right that fall by hundreds of orders of magnitude. In `order` by distance from where b
        is not zero, errors travel outward with the solution and shrink with it.
        """
        b = np.asarray(rhs, dtype=np.float64)
        x = np.zeros((self.n, b[0].size))
        scale = np.abs(b).max() if b.size else 0.0
        if scale > 0:
            load = np.ascontiguousarray(b.reshape(self.n, -1)[self.order] / scale)
            x[self.order] = self._iterate(load, relative, componentwise) * scale
        return x.reshape(b.shape)

    def _iterate(self, load: NDArray[np.float64], relative: float, componentwise: float) -> NDArray[np.float64]:
        shape, goal = load.shape, relative**2 * float(np.einsum("ij,ij->", load, load))

        def multiply(p: NDArray[np.float64]) -> NDArray[np.float64]:
            q: NDArray[np.float64] = _multiply(self.indptr, self.indices, self.diagonal, self.lower, p.reshape(shape))
            return q.ravel()

        def precondition(r: NDArray[np.float64]) -> NDArray[np.float64]:
            z: NDArray[np.float64] = _precondition(
                self.indptr, self.indices, self.factor, self.pivots, r.reshape(shape)
            )
            return z.ravel()

        def converged(x: NDArray[np.float64], r: NDArray[np.float64]) -> bool:
            small = np.einsum("i,i->", r, r) <= goal
            return bool(small or _settled(self.diagonal, x.reshape(shape), r.reshape(shape), componentwise))

        with threadpool_limits(1, "blas"):  # threads only wait between the inner products
            solution = conjugate_gradients(
                multiply, load.ravel(), precondition, tolerance=0.0, limit=MOST_ITERATIONS, converged=converged
            )
        return solution.reshape(shape)


def outward_order(matrix: sparse.csr_matrix, seeds: NDArray[np.int64]) -> NDArray[np.int64]:
    """The unknowns that are connected to the seeds in the graph of the matrix, in order of distance from them.

    Examples
    --------
    >>> chain = sparse.csr_matrix([[1, 1, 0], [1, 1, 1], [0, 1, 1]])
    >>> outward_order(chain, np.array([1]))
    array([1, 0, 2])
    """
    seeds = np.asarray(seeds, dtype=np.int64)
    order: NDArray[np.int64] = _breadth_first(matrix.indptr, matrix.indices, matrix.data, seeds)
    return order


def from_first(upper: sparse.csr_matrix) -> IncompleteCholesky:
    """What solves a system given by its upper triangle: unknowns in the order of its own graph, from the first on."""
    full = whole(upper)
    _, first = np.unique(sparse.csgraph.connected_components(full, directed=False)[1], return_index=True)
    return IncompleteCholesky.of(full, outward_order(full, first))


@compiled
def _breadth_first(indptr, indices, data, seeds):
    n = len(indptr) - 1
    seen = np.zeros(n, dtype=np.bool_)
    queue = np.empty(n, dtype=np.int64)
    end = 0
    for s in seeds:
        if not seen[s]:
            seen[s] = True
            queue[end] = s
            end += 1
    begin = 0
    while begin < end:
        i = queue[begin]
        begin += 1
        for k in range(indptr[i], indptr[i + 1]):
            j = indices[k]
            if not seen[j] and data[k] != 0.0:
                seen[j] = True
                queue[end] = j
                end += 1
    return queue[:end].copy()


@compiled
def _lower_triangle(indptr, indices, data, order, n):
    """Diagonal and strictly lower triangle (CSR), rows and columns in `order`, columns sorted."""
    place = np.full(n, -1, dtype=np.int64)
    for i in range(len(order)):
        place[order[i]] = i
    starts = np.zeros(len(order) + 1, dtype=np.int64)
    for i in range(len(order)):
        count = 0
        for k in range(indptr[order[i]], indptr[order[i] + 1]):
            j = place[indices[k]]
            if 0 <= j < i:
                count += 1
        starts[i + 1] = starts[i] + count
    columns = np.empty(starts[-1], dtype=np.int32)
    lower = np.empty(starts[-1])
    diagonal = np.zeros(len(order))
    for i in range(len(order)):
        end = starts[i]
        for k in range(indptr[order[i]], indptr[order[i] + 1]):
            j = place[indices[k]]
            if j == i:
                diagonal[i] = data[k]
            elif 0 <= j < i:
                m = end
                while m > starts[i] and columns[m - 1] > j:
                    columns[m] = columns[m - 1]
                    lower[m] = lower[m - 1]
                    m -= 1
                columns[m] = j
                lower[m] = data[k]
                end += 1
    return starts, columns, lower, diagonal


@compiled
def _factorize(indptr, indices, factor, pivots):
    """IC(0) in place; `pivots` becomes the inverse diagonal. Returns False if a pivot is not clearly positive."""
    for i in range(len(pivots)):
        own = pivots[i]
        rest = own
        for k in range(indptr[i], indptr[i + 1]):
            j = indices[k]
            value = factor[k]
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
        if not rest > 1e-12 * own:
            return False
        pivots[i] = 1.0 / np.sqrt(rest)
    return True


@compiled
def _precondition(indptr, indices, factor, pivots, r):
    """z = (L Lᵀ)⁻¹ r, row by row down and up."""
    n, width = r.shape
    z = np.empty((n, width))
    for i in range(n):
        for c in range(width):
            z[i, c] = r[i, c]
        for k in range(indptr[i], indptr[i + 1]):
            for c in range(width):
                z[i, c] -= factor[k] * z[indices[k], c]
        for c in range(width):
            z[i, c] *= pivots[i]
    for i in range(n - 1, -1, -1):
        for c in range(width):
            z[i, c] *= pivots[i]
        for k in range(indptr[i], indptr[i + 1]):
            for c in range(width):
                z[indices[k], c] -= factor[k] * z[i, c]
    return z


@compiled
def _multiply(indptr, indices, diagonal, lower, p):
    """A p, from the lower triangle."""
    n, width = p.shape
    q = np.empty((n, width))
    for i in range(n):
        for c in range(width):
            q[i, c] = diagonal[i] * p[i, c]
        for k in range(indptr[i], indptr[i + 1]):
            j = indices[k]
            for c in range(width):
                q[i, c] += lower[k] * p[j, c]
                q[j, c] += lower[k] * p[i, c]
    return q


@compiled
def _settled(diagonal, x, r, componentwise):
    """Whether every row's residual is small beside its own unknowns."""
    n, width = x.shape
    for i in range(n):
        largest, residual = 0.0, 0.0
        for c in range(width):
            largest = max(largest, abs(x[i, c]))
            residual = max(residual, abs(r[i, c]))
        if residual > SMALLEST and residual / (diagonal[i] * largest + 1e-320) > componentwise:
            return False
    return True
