"""SciPy's SuperLU: there on every platform."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from .matrices import whole


class SuperLUFactor:
    """LU factor without pivoting of a Hermitian positive definite matrix.

    Parameters
    ----------
    upper : sparse CSR, float64 or complex128
        Upper triangle.
    order : (n,) int, optional
        Elimination order: ``order[k]`` is the unknown eliminated k-th.
    """

    backend = "superlu"

    def __init__(self, upper: sparse.csr_matrix, order: NDArray[np.integer] | None = None) -> None:
        from scipy.sparse.linalg import splu

        self.n, self.dtype = upper.shape[0], upper.dtype
        self._order = order
        matrix = whole(upper) if order is None else whole(upper)[order][:, order]
        self._factor = splu(
            sparse.csc_matrix(matrix),
            permc_spec="MMD_AT_PLUS_A" if order is None else "NATURAL",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )

    def solve(self, rhs: NDArray[Any]) -> NDArray[Any]:
        """Solution for one right-hand side (n,) or several (n, k)."""
        rhs = np.asarray(rhs, dtype=self.dtype)
        if self._order is None:
            return self._factor.solve(rhs)
        solution = np.empty_like(rhs)
        solution[self._order] = self._factor.solve(rhs[self._order])
        return solution

    @property
    def nonzeros(self) -> int:
        """Entries stored in the factor."""
        return int(self._factor.L.nnz)
