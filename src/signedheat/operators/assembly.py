"""Assembly of sparse matrices from 3 × 3 element matrices, one per triangle."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ..frozen import read_only
from ..geometry.triangle_kernels import add_up


def assemble(
    unknowns: NDArray[np.int64], diagonal: NDArray[np.float64], coupling: NDArray[Any], n: int
) -> sparse.csr_matrix:
    """Upper triangle of the Hermitian matrix that element matrices add up to, with its whole diagonal stored.

    Parameters
    ----------
    unknowns : (m, 3) int
        The three unknowns of each triangle.
    diagonal : (m, 3) float
        Diagonal entries of each element matrix.
    coupling : (m, 3) float or complex
        Entry of each element matrix in row k and column k + 1 (cyclically).
    n : int
        Number of unknowns.

    Examples
    --------
    >>> assemble(np.array([[0, 2, 1]]), np.ones((1, 3)), np.array([[1j, 2.0, 3.0]]), 3).toarray()
    array([[1.+0.j, 3.+0.j, 0.+1.j],
           [0.+0.j, 1.+0.j, 2.+0.j],
           [0.+0.j, 0.+0.j, 1.+0.j]])
    """
    starts, columns, values = add_up(read_only(unknowns), diagonal, coupling, n)
    return sparse.csr_matrix((values, columns, starts), shape=(n, n))
