"""Krylov methods, restarts and splitting, on systems so small that their solutions are known."""

from __future__ import annotations

from itertools import islice

import numpy as np
import pytest
from scipy import sparse

from signedheat.linear.conjugate_gradients import conjugate_gradients
from signedheat.linear.restarts import matrix_forces, solve_with_restarts
from signedheat.linear.splitting import split_rounds


def test_conjugate_gradients_solve_a_diagonal_system():
    solution = conjugate_gradients(lambda x: np.array([2.0, 4.0]) * x, np.array([2.0, 8.0]))
    assert solution == pytest.approx([1.0, 2.0], abs=1e-12)


def test_a_solution_that_underflows_goes_on_in_a_second_stage():
    matrix = sparse.csr_matrix(sparse.diags_array([-1.0, 1e9, -1.0], offsets=[-1, 0, 1], shape=(50, 50)))
    factor = sparse.linalg.splu(matrix.tocsc())
    stages = solve_with_restarts(factor.solve, matrix_forces(matrix), np.eye(50)[:, :1], size=1e9)
    assert len(stages) == 2
    decades = (np.log(stages[-1].values[49, 0]) + stages[-1].logarithm) / np.log(1e-9)
    assert decades == pytest.approx(50.0, abs=1e-6)


def test_splitting_minimises_within_bounds():
    """Of (x − 3)² with |x| ≤ 1 the minimum is at 1."""
    rounds = split_rounds(
        lambda values: np.clip(values, -1.0, 1.0),
        lambda target: 0.5 * (target + 3.0),
        np.copy,
        np.zeros(1),
        np.zeros(1),
    )
    assert next(islice(rounds, 49, None)).split.tolist() == [1.0]
