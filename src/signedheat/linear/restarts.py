"""Solutions of linear systems that decay below the range of floating-point numbers, computed in stages."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ..arrays import Bools, Floats

Solve = Callable[[NDArray[Any]], NDArray[Any]]
"""A function that takes right-hand sides, (n,) or (n, k), and returns the solutions."""
Forces = Callable[[NDArray[Any], Bools], tuple[Bools, NDArray[Any]]]
"""A function of x and of the (n,) mask of faint rows, on which the stages so far are too small; x is 0 on other rows.
It returns the (n,) mask of the border, the rows that couple faint rows to others, and A x, which is used there."""


class Stage(NamedTuple):
    """Part of a solution on some of the rows, ``values · exp(logarithm)``."""

    values: NDArray[Any]  # (n, k) or (n,), NaN on rows that an earlier stage contains
    logarithm: float  # natural logarithm of the factor of all values


def solve_with_restarts(solve: Solve, border_forces: Forces, loads: NDArray[Any], size: float = 1.0) -> list[Stage]:
    """Solve ``A x = loads`` for columns x that decay exponentially away from the loads; return the stages of x.

    Each stage contains the rows on which earlier ones are too small. Loads are scaled to `size`, the typical size of
    entries on the diagonal of A.
    """
    loads, logarithm = scaled(loads, size)
    return restart(solve, border_forces, loads, Stage(solve(loads), logarithm), size)


def restart(solve: Solve, border_forces: Forces, loads: NDArray[Any], first: Stage, size: float = 1.0) -> list[Stage]:
    """Return all stages of a solution, given the first one.

    On rows where x is too small, the same equation is solved again, with loads along the border of these rows.
    """
    stages, unknown = [first], np.ones(len(loads), dtype=bool)
    while True:
        values, logarithm = stages[-1]
        sizes = np.where(unknown, largest_components(values), 0.0)
        faint = unknown & (sizes < 2.0**-900 * sizes.max(initial=0.0))  # terms may have underflowed
        if not faint.any():
            return stages
        inside = _rows(faint, values)
        border, forces = border_forces(np.where(inside, values, 0), faint)
        forces = np.where(_rows(border, values), forces, np.where(inside, loads, 0))
        if not forces.any():
            return stages
        loads, raised = scaled(forces, size)
        stages.append(Stage(np.where(inside, solve(loads), np.nan), logarithm + raised))
        unknown = faint


def scaled(loads: NDArray[Any], size: float) -> tuple[NDArray[Any], float]:
    """Return loads times a power of two, so that the largest is about `size`, and the logarithm of its inverse."""
    largest = float(largest_components(loads).max(initial=0.0))
    if largest == 0.0:
        return loads, 0.0
    steps = int(np.frexp(size)[1] - np.frexp(largest)[1])
    raised = np.ldexp(np.ascontiguousarray(loads).view(np.float64), steps).view(loads.dtype)
    return raised, -steps * float(np.log(2.0))


def matrix_forces(matrix: sparse.csr_matrix) -> Forces:
    """Return the `Forces` of a matrix A, which is given as a whole."""
    pattern = sparse.csr_matrix((np.ones(matrix.nnz), matrix.indices, matrix.indptr), shape=matrix.shape)

    def border_forces(values: NDArray[Any], faint: Bools) -> tuple[Bools, NDArray[Any]]:
        around = pattern @ faint
        return (around > 0) & (around < np.diff(matrix.indptr)), matrix @ values

    return border_forces


def largest_components(values: NDArray[Any]) -> Floats:
    """Return (n,) the largest absolute real or imaginary part in each row, without squares, which would underflow."""
    parts = [values.real, values.imag] if np.iscomplexobj(values) else [values]
    sizes = np.zeros(len(values))
    for part in parts:
        for column in part.reshape(len(part), -1).T:
            np.maximum(sizes, np.abs(column), out=sizes)
    return sizes


def _rows(chosen: Bools, values: NDArray[Any]) -> Bools:
    """Reshape an (n,) mask of rows so that it broadcasts with values of shape (n, …)."""
    return chosen.reshape(-1, *[1] * (values.ndim - 1))
