"""Solutions that leave the range of floating-point numbers: restarts that are safe from underflow."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ..arrays import Bools, Floats

Solve = Callable[[NDArray[Any]], NDArray[Any]]
"""From right-hand sides (n, k) or (n,) to the solutions."""
Forces = Callable[[NDArray[Any], Bools], tuple[Bools, NDArray[Any]]]
"""From x, zero except on the faint rows (where the stages so far are too small), and the (n,) mask of these rows: to
the (n,) mask of the rows that couple faint rows to others, and A x on these."""


class Stage(NamedTuple):
    """A part of a solution: ``values · exp(logarithm)``."""

    values: NDArray[Any]  # (n, k) or (n,), NaN on rows that an earlier stage has
    logarithm: float  # natural logarithm of the factor


def solve_with_restarts(solve: Solve, border_forces: Forces, loads: NDArray[Any], size: float = 1.0) -> list[Stage]:
    """Solve ``A x = loads`` for columns that decay exponentially away from the loads; return the stages of x.

    Loads are scaled to `size`, about that of the diagonal; each stage has the rows on which earlier ones are too small.
    """
    loads, logarithm = scaled(loads, size)
    return restart(solve, border_forces, loads, Stage(solve(loads), logarithm), size)


def restart(solve: Solve, border_forces: Forces, loads: NDArray[Any], first: Stage, size: float = 1.0) -> list[Stage]:
    """Return all stages, given the first: where x is too faint, it solves the same equation loaded along the border."""
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
    """Return loads times a power of two that makes the largest about `size`, and the logarithm of its inverse."""
    largest = float(largest_components(loads).max(initial=0.0))
    if largest == 0.0:
        return loads, 0.0
    steps = int(np.frexp(size)[1] - np.frexp(largest)[1])
    raised = np.ldexp(np.ascontiguousarray(loads).view(np.float64), steps).view(loads.dtype)
    return raised, -steps * float(np.log(2.0))


def matrix_forces(matrix: sparse.csr_matrix) -> Forces:
    """Return the function that computes forces at the border of faint rows, from the whole matrix A."""
    pattern = sparse.csr_matrix((np.ones(matrix.nnz), matrix.indices, matrix.indptr), shape=matrix.shape)

    def border_forces(values: NDArray[Any], faint: Bools) -> tuple[Bools, NDArray[Any]]:
        around = pattern @ faint
        return (around > 0) & (around < np.diff(matrix.indptr)), matrix @ values

    return border_forces


def largest_components(values: NDArray[Any]) -> Floats:
    """Return (n,) the largest real or imaginary part in each row: squares would underflow."""
    parts = [values.real, values.imag] if np.iscomplexobj(values) else [values]
    sizes = np.zeros(len(values))
    for part in parts:
        for column in part.reshape(len(part), -1).T:
            np.maximum(sizes, np.abs(column), out=sizes)
    return sizes


def _rows(chosen: Bools, values: NDArray[Any]) -> Bools:
    """Reshape a choice of rows so that it applies to every column."""
    return chosen.reshape(-1, *[1] * (values.ndim - 1))
