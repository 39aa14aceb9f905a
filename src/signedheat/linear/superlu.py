"""SciPy's SuperLU, available on every platform; systems are then solved with its lower factor alone.

The upper factor of a Hermitian matrix is ``D Lᴴ``, so that it need not be kept: a factor takes half the memory and a
solution half the time, since most of that is spent on reading the factors.
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

    Unknowns are eliminated in a given order, or else by nested dissection: SuperLU's own order takes minutes.
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
        """Solve for one right-hand side (n,) or several (n, k)."""
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
        """Entries stored in the factor."""
        return int(self._lower.nnz)


def _factored(matrix: sparse.csc_matrix) -> tuple[sparse.csc_matrix, Floats, NDArray[np.integer]]:
    """Return the lower factor, whose columns begin with their diagonal, which is one; pivots; and the order of rows.

    SuperLU's own copy of the factor ends here: it can only be freed on the thread that made it.
    """
    factor = splu(matrix, permc_spec="NATURAL", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    return factor.L, factor.U.diagonal().real, factor.perm_r.copy()  # which would keep it alive


@compiled
def _substitute(
    starts: NDArray[np.int32], rows: NDArray[np.int32], lower: NDArray[Any], pivots: Floats, x: NDArray[Any]
) -> None:
    """Replace the right-hand side x (n,) by the solution y of ``L D Lᴴ y = x``; L is given by columns."""
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
    """Do as `_substitute` for all columns of x (n, k) at once, so that each entry of L is read once for all."""
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
