"""The constants of piecewise-continuous integration by a linear program: what the solver of the package is held to."""

from __future__ import annotations

import numpy as np
import scipy
from scipy import sparse

from signedheat.curves.jumps import JumpProblem, JumpSolution


def minimize_exactly(problem: JumpProblem) -> JumpSolution:
    """Solve the dual, a minimum-cost flow, as a linear program (HiGHS in SciPy); the constants are its multipliers.

    Raises
    ------
    RuntimeError
        If HiGHS finds no optimum, or there is a duality gap.
    """
    if not len(problem.faces):
        return JumpSolution(np.zeros(problem.n_faces), problem.floor, problem.floor, 0)
    low, high = problem.low, problem.high
    scale = problem.scale or 1.0
    conserve = problem.incidence().T
    capacity = np.tile(2.0 * problem.weights / problem.weights.mean(), 2)
    bounds = np.stack([np.zeros_like(capacity), capacity], axis=1)
    for method in ("highs-ipm", "highs-ds"):
        result = scipy.optimize.linprog(
            np.concatenate([high, -low]) / scale,
            A_eq=sparse.hstack([conserve, -conserve], format="csr"),
            b_eq=np.zeros(problem.n_faces),
            bounds=bounds,
            method=method,
        )
        if result.status != 0:
            continue
        forth, back = np.split(result.x * problem.weights.mean(), 2)
        constants = result.eqlin.marginals * scale
        solution = JumpSolution(constants, problem.objective(constants), problem.bound(forth - back), int(result.nit))
        if solution.objective - solution.bound <= 1e-6 * max(
            solution.objective, problem.scale * problem.weights.mean()
        ):
            return solution
    raise RuntimeError(f"the linear program over {problem.n_faces} faces was not solved ({result.message})")
