"""Factorisation by SciPy's SuperLU, which is available on every platform.

Systems are solved with its lower factor alone, since the upper factor of a Hermitian matrix is ``D Lᴴ``. So a factor
takes half the memory and a solution half the time, most of which is spent on reading factors.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from ..arrays import Floats
from ..compiled import compiled
from ..errors import FactorizationError
from ..jobs import interruptible
from .ordering import elimination_order, whole
from .threads import one_blas_thread


class SuperLUFactor:
    """Factor ``L D Lᴴ`` of a Hermitian positive definite matrix.

    Unknown ``order[k]`` is eliminated k-th; by default the order is that of nested dissection. SuperLU would take
    minutes to find an order of its own.
    """

    backend = "superlu"

    def __init__(self, upper: sparse.csr_matrix, order: NDArray[np.integer] | None = None) -> None:
        self.n: int = upper.shape[0]
        self.dtype: np.dtype[Any] = upper.dtype
        self._order = elimination_order(upper) if order is None else order
        matrix = whole(upper)[self._order][:, self._order]
        with one_blas_thread():  # its dense blocks are tiny: threads cost ten times what they gain
            try:
                self._lower, self._pivots, rows = interruptible(_factored, sparse.csc_matrix(matrix))
            except RuntimeError as error:
                raise FactorizationError(f"SuperLU failed on {self.n} unknowns: {error}", element="matrix") from error
        if not (self._pivots > 0).all() or (rows != np.arange(self.n)).any():
            raise FactorizationError(
                f"SuperLU failed on {self.n} unknowns: the matrix is not positive definite", element="matrix"
            )

    def solve(self, rhs: NDArray[Any]) -> NDArray[Any]:
        """Return the solutions for one right-hand side, (n,), or several, (n, k)."""
        ordered = np.ascontiguousarray(np.asarray(rhs, dtype=self.dtype)[self._order])
        factor = self._lower.indptr, self._lower.indices, self._lower.data, self._pivots
        if ordered.size == self.n:
            _substitute(*factor, ordered.reshape(-1))
        else:
            _substitute_columns(*factor, ordered)
        solution = np.empty_like(ordered)
        solution[self._order] = ordered
        return solution

    @property
    def nonzeros(self) -> int:
        """Number of entries stored in the factor."""
        return int(self._lower.nnz)


def _factored(matrix: sparse.csc_matrix) -> tuple[sparse.csc_matrix, Floats, NDArray[np.integer]]:
    """Factorise a matrix by SuperLU, and return its lower factor L, the pivots D, (n,), and the order of rows, (n,).

    Each column of L begins with its diagonal entry, 1. SuperLU's object of the factor is not returned, since it can
    only be freed on the thread that made it.
    """
    factor = splu(matrix, permc_spec="NATURAL", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    return factor.L, factor.U.diagonal().real, factor.perm_r.copy()  # which would keep it alive


@compiled
def _substitute(
    starts: NDArray[np.int32], rows: NDArray[np.int32], lower: NDArray[Any], pivots: Floats, x: NDArray[Any]
) -> None:
    """Replace the right-hand side x, (n,), by the solution y of ``L D Lᴴ y = x``, with the (n,) `pivots` D.

    Entries ``starts[j]`` to ``starts[j + 1]`` of `lower` and `rows` are column j of L and its rows, the diagonal first.
    First x becomes D⁻¹ L⁻¹ x, column by column, and then y, from the last row of Lᴴ to the first.
    """
    for j in range(len(pivots)):
        for k in range(starts[j] + 1, starts[j + 1]):
            x[rows[k]] -= lower[k] * x[j]
        x[j] /= pivots[j]
    for j in range(len(pivots) - 1, -1, -1):
        rest = x[j]
        for k in range(starts[j] + 1, starts[j + 1]):
            rest -= np.conj(lower[k]) * x[rows[k]]
        x[j] = rest


@compiled
def _substitute_columns(
    starts: NDArray[np.int32], rows: NDArray[np.int32], lower: NDArray[Any], pivots: Floats, x: NDArray[Any]
) -> None:
    """Replace the right-hand sides x, (n, k), by the solutions y of ``L D Lᴴ y = x``; L is stored by columns.

    It is `_substitute` for several columns: each entry of L is read once for all right-hand sides.
    """
    for j in range(len(pivots)):
        for k in range(starts[j] + 1, starts[j + 1]):
            row, entry = rows[k], lower[k]
            for c in range(x.shape[1]):
                x[row, c] -= entry * x[j, c]
        for c in range(x.shape[1]):
            x[j, c] /= pivots[j]
    for j in range(len(pivots) - 1, -1, -1):
        for k in range(starts[j] + 1, starts[j + 1]):
            row, entry = rows[k], np.conj(lower[k])
            for c in range(x.shape[1]):
                x[j, c] -= entry * x[row, c]
