"""CHOLMOD, through the optional package scikit-sparse."""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ..errors import FactorizationError
from ..packages import lazy_module

cholmod: Any = lazy_module("sksparse.cholmod", "factors of CHOLMOD")


class CholmodFactor:
    """Supernodal Cholesky factor of a Hermitian positive definite matrix; without an order, CHOLMOD finds one."""

    backend = "cholmod"

    def __init__(self, upper: sparse.csr_matrix, order: NDArray[np.integer] | None = None) -> None:
        self.n: int = upper.shape[0]
        self.dtype: np.dtype[Any] = upper.dtype
        self._order = order
        lower = sparse.csc_matrix((upper.data.conj(), upper.indices, upper.indptr), shape=upper.shape)
        if order is not None:
            whole = lower + sparse.tril(lower, -1).conj().T
            lower = sparse.csc_matrix(sparse.tril(whole[order][:, order]))
        try:
            self._factor = cholmod.cholesky(
                lower, mode="supernodal", ordering_method="default" if order is None else "natural"
            )
        except cholmod.CholmodError as error:
            raise FactorizationError(f"CHOLMOD failed on {self.n} unknowns: {error}", element="matrix") from error

    def solve(self, rhs: NDArray[Any]) -> NDArray[Any]:
        """Solve for one right-hand side (n,) or several (n, k)."""
        rhs = np.asarray(rhs, dtype=self.dtype)
        if self._order is None:
            return self._factor(rhs)
        solution = np.empty_like(rhs)
        solution[self._order] = self._factor(rhs[self._order])
        return solution

    @property
    def nonzeros(self) -> int:
        """Entries stored in the factor."""
        return int(self._factor.L().nnz)


def is_available() -> bool:
    """Return whether scikit-sparse is installed, with the interface that it has had until version 0.4."""
    if find_spec("sksparse") is None:
        return False
    return hasattr(cholmod, "cholesky")
