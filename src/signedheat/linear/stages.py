"""Underflow-safe solves: solutions that leave the range of floating-point numbers, in stages with a scale each."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

FAINT = 1e-250
"""Unknowns below this fraction of the largest are solved for again in the next stage, before they underflow."""


def solve_in_stages(
    matrix: sparse.csr_matrix,
    solve: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    loads: NDArray[np.float64],
) -> list[tuple[NDArray[np.float64], float]]:
    """Solve ``A x = loads`` for columns that decay exponentially away from the nonzeros of the loads.

    Where x is faint it satisfies the same equation, with a right-hand side along the border of the faint region that
    the known x outside determines. Scaled up, that is the right-hand side of the next stage.

    Parameters
    ----------
    matrix : (n, n) sparse
        A, whole.
    solve : callable
        Solves ``A x = b`` for (n, k) right-hand sides.
    loads : (n, k) float
        Right-hand sides, not all zero.

    Returns
    -------
    list of (values (n, k), logarithm)
        One pair per stage: x is the values times the exponential of the logarithm. Values are NaN between the source
        and the border at which the stage begins.

    Examples
    --------
    >>> A = sparse.csr_matrix(sparse.diags_array([-1.0, 1e9, -1.0], offsets=[-1, 0, 1], shape=(50, 50)))
    >>> factor = sparse.linalg.splu(A.tocsc())
    >>> stages = solve_in_stages(A, factor.solve, np.eye(50)[:, :1])
    >>> len(stages), round(float((np.log(stages[-1][0][49, 0]) + stages[-1][1]) / np.log(1e-9)), 6)
    (2, 50.0)
    """
    pattern = sparse.csr_matrix((np.ones(matrix.nnz), matrix.indices, matrix.indptr), shape=matrix.shape)
    scale = float(np.abs(loads).max())
    logarithm = float(np.log(scale))
    values = solve(loads / scale)
    stages, faint = [(values, logarithm)], np.abs(values).max(axis=1) < FAINT
    while faint.any():
        beside = pattern @ faint
        border = (beside > 0) & (beside < np.diff(matrix.indptr))
        forces = np.where(border[:, None], matrix @ np.where(faint[:, None], values, 0.0), 0.0)
        forces += np.where((faint & ~border)[:, None], loads / scale, 0.0)
        loads, scale = forces, float(np.abs(forces).max())
        if scale == 0.0:
            break
        logarithm += float(np.log(scale))
        values = solve(loads / scale)
        still = faint & (np.abs(values).max(axis=1) < FAINT)
        stages.append((np.where(faint[:, None], values, np.nan), logarithm))
        values = np.where(faint[:, None], values, 0.0)
        if still.sum() == faint.sum():
            break
        faint = still
    return stages
