"""Sparse Hermitian matrices, stored whole or by their upper triangle."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import sparse


def upper_triangle(matrix: Any) -> sparse.csr_matrix:
    """Upper triangle, diagonal included, as sorted CSR, from a whole Hermitian matrix or its upper triangle."""
    if sparse.issparse(matrix) and matrix.format == "csr" and _is_upper(matrix):
        return matrix
    upper = sparse.triu(matrix, format="csr")
    upper.sum_duplicates()
    missing = upper.diagonal() == 0
    if missing.any():  # solvers need every diagonal entry to be stored, zeros included
        upper = sparse.csr_matrix(upper + sparse.diags_array(np.where(missing, 1.0, 0.0)))
        upper.sort_indices()
        upper.data[upper.indptr[:-1][missing]] = 0
    return upper


def whole(upper: sparse.csr_matrix) -> sparse.csr_matrix:
    """The whole Hermitian matrix from its upper triangle."""
    return sparse.csr_matrix(upper + sparse.triu(upper, 1).conj().T)


def _is_upper(matrix: sparse.csr_matrix) -> bool:
    """Whether every row starts with its diagonal entry and has strictly increasing columns."""
    starts = matrix.indptr[:-1]
    if (np.diff(matrix.indptr) == 0).any() or (matrix.indices[starts] != np.arange(matrix.shape[0])).any():
        return False
    increasing = np.diff(matrix.indices) > 0
    increasing[starts[1:] - 1] = True
    return bool(increasing.all())
