"""SciPy's SuperLU, available on every platform.

With nested dissection and one BLAS thread it takes as much CPU time as PARDISO at 100 000 unknowns, and 2.5 times as
much at 500 000; PARDISO also uses all cores.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu
from threadpoolctl import threadpool_limits

from ..errors import FactorizationError
from .ordering import elimination_order, whole


class SuperLUFactor:
    """LU factor without pivoting of a Hermitian positive definite matrix, from its upper triangle.

    ``order[k]`` is the unknown eliminated k-th; without it, nested dissection finds an order: with SuperLU's own
    minimum degree, surfaces of 100 000 unknowns take minutes instead of a second.
    """

    backend = "superlu"

    def __init__(self, upper: sparse.csr_matrix, order: NDArray[np.integer] | None = None) -> None:
        self.n: int = upper.shape[0]
        self.dtype: np.dtype[Any] = upper.dtype
        self._order = elimination_order(upper) if order is None else order
        matrix = whole(upper)[self._order][:, self._order]
        with threadpool_limits(1, "blas"):  # its dense blocks are tiny: threads cost ten times what they gain
            try:
                self._factor = splu(
                    sparse.csc_matrix(matrix),
                    permc_spec="NATURAL",
                    diag_pivot_thresh=0.0,
                    options={"SymmetricMode": True},
                )
            except RuntimeError as error:
                raise FactorizationError(f"SuperLU failed on {self.n} unknowns: {error}", element="matrix") from error
        if not (self._factor.U.diagonal().real > 0).all():
            raise FactorizationError(
                f"SuperLU failed on {self.n} unknowns: the matrix is not positive definite", element="matrix"
            )

    def solve(self, rhs: NDArray[Any]) -> NDArray[Any]:
        """Solve for one right-hand side (n,) or several (n, k)."""
        rhs = np.asarray(rhs, dtype=self.dtype)
        solution = np.empty_like(rhs)
        solution[self._order] = self._factor.solve(rhs[self._order])
        return solution

    @property
    def nonzeros(self) -> int:
        """Entries stored in the factor."""
        return int(self._factor.L.nnz)
