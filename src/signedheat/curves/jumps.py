"""Two solvers for the constants of piecewise-continuous integration: a fast one with a certificate, and an exact one.

Summed over the two ends of an edge, the cost of a pair of faces in Eq. 16 is ``w (b − a)``, whatever the constants are,
plus ``2w`` times the distance of x = c_f − c_g from the interval [a, b], whose ends are the values of x that make φ
continuous at one end of the edge and at the other. The dual of ``min Σ 2w dist(K c, [a, b])`` is a flow y from face to
face across edges, conserved in every face, with capacities 2w; every such flow proves that no constants have a smaller
cost than ``−Σ max(a y, b y)``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy import sparse
from threadpoolctl import threadpool_limits

from ..errors import SignedHeatError
from ..geometry.components import connected_components
from ..linear import factorize

LOOSE = 0.15
"""Gap from which constants are asked whether they leave a cut. Without one, what is left is below the triangles."""
_LOOK = 25  # rounds between two evaluations of the gap
_RELAXATION = 1.6
_THRESHOLD = 4.0  # initial threshold of the proximal step, relative to a typical difference
_GROWTH, _PATIENCE = 2.0, 250  # factor by which it may grow, at most every so many rounds; tuned on tori and spheres


@dataclass(frozen=True, eq=False)
class JumpProblem:
    """Minimise ``floor + Σ 2w dist(c_f − c_g, [a, b])`` over one constant c per face.

    Attributes
    ----------
    faces : (p, 2) int
        The faces f and g of each pair.
    low, high : (p,) float
        a and b: the differences that make φ continuous at one end of the edge, and at the other, the smaller first.
    weights : (p,) float
        w, positive.
    n_faces : int
        Number of constants.
    floor : float
        The cost that does not depend on the constants.
    """

    faces: NDArray[np.int64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    weights: NDArray[np.float64]
    n_faces: int
    floor: float = 0.0

    def differences(self, constants: NDArray[np.float64]) -> NDArray[np.float64]:
        """x = K c: (p,) constants of the first faces minus those of the second."""
        return constants[self.faces[:, 0]] - constants[self.faces[:, 1]]

    def objective(self, constants: NDArray[np.float64]) -> float:
        """The value to be minimised."""
        difference = self.differences(constants)
        return self.floor + 2.0 * float(self.weights @ np.abs(difference - np.clip(difference, self.low, self.high)))

    def bound(self, flow: NDArray[np.float64]) -> float:
        """Lower bound of the objective from a flow (p,) that is conserved in every face (weak duality)."""
        excess = np.abs(flow / (2.0 * self.weights)).max(initial=1.0)
        return self.floor - float(np.maximum(self.low * flow, self.high * flow).sum() / excess)

    @property
    def scale(self) -> float:
        """Typical size of a and b."""
        return 0.5 * float(np.mean(np.abs(self.low) + np.abs(self.high)))

    def incidence(self) -> sparse.csr_matrix:
        """K: sparse (p, n_faces)."""
        n = len(self.faces)
        pair = np.repeat(np.arange(n), 2)
        return sparse.csr_matrix((np.tile([1.0, -1.0], n), (pair, self.faces.ravel())), shape=(n, self.n_faces))


@dataclass(frozen=True, eq=False)
class JumpSolution:
    """Constants, with a certificate of their quality.

    Attributes
    ----------
    constants : (n_faces,) float
        c; on each connected component of the surface up to a constant.
    objective : float
        The objective at these constants.
    bound : float
        A lower bound of the objective.
    rounds : int
        Number of iterations.
    """

    constants: NDArray[np.float64]
    objective: float
    bound: float
    rounds: int

    @property
    def gap(self) -> float:
        """(objective − bound) / objective: the objective is at most this fraction above the optimum."""
        return max(self.objective - self.bound, 0.0) / self.objective if self.objective > 0 else 0.0


def minimize_fast(
    problem: JumpProblem,
    tolerance: float = 2e-3,
    max_rounds: int = 3000,
    progress: Callable[[float], None] | None = None,
    enough: Callable[[NDArray[np.float64]], bool] | None = None,
) -> JumpSolution:
    """ADMM (Boyd et al. 2011) on ``min Σ 2w dist(z, [a, b])  s.t.  z = K c``, with one factorisation for all rounds.

    Penalties proportional to w make the threshold of the proximal step the same length for all edges, which can change
    without a new factorisation. The multipliers, projected on conserved flows, certify the result.

    Parameters
    ----------
    problem : JumpProblem
        The problem.
    tolerance : float
        Stop when the certified `JumpSolution.gap` is below this.
    max_rounds : int
        Largest number of iterations.
    progress : callable, optional
        Called with the fraction of `max_rounds` done.
    enough : callable, optional
        Asked about constants whose gap is below `LOOSE` whether they will do: then no better ones are sought.

    Returns
    -------
    JumpSolution
        The best constants found.
    """
    if not len(problem.faces):
        return _nothing(problem)
    low, high = problem.low, problem.high
    spring = problem.weights / problem.weights.mean()
    incidence = problem.incidence()
    transposed = sparse.csr_matrix(incidence.T)
    with threadpool_limits(1, "blas"):  # threads cost a triangular solve of this size more than they gain
        factor = factorize(_grounded_laplacian(incidence, spring))
        constants = factor.solve(transposed @ (spring * (0.5 * (low + high))))
        step = problem.differences(constants)
        best, bound = constants, problem.floor
        least = problem.objective(best)
        threshold = _THRESHOLD * problem.scale
        negligible = 1e-9 * threshold * problem.weights.sum()
        z, scaled, rounds = step.copy(), np.zeros_like(step), 0
        while least - bound > max(tolerance * least, negligible) and rounds < max_rounds:
            for _ in range(_LOOK):
                before, target = z, step + scaled
                excess = target - np.clip(target, low, high)
                z = target - np.clip(excess, -threshold, threshold)
                scaled = target - z
                constants = factor.solve(transposed @ (spring * (z - scaled)))
                difference = problem.differences(constants)
                step = _RELAXATION * difference + (1.0 - _RELAXATION) * z
            rounds += _LOOK
            value = problem.objective(constants)
            if value < least:
                best, least = constants, value
            flow = scaled * spring
            flow -= spring * problem.differences(factor.solve(transposed @ flow))
            bound = max(bound, problem.bound(flow * (2.0 * problem.weights.mean() / threshold)))
            if enough is not None and least - bound < LOOSE * least and enough(best):
                return JumpSolution(best, least, bound, rounds)
            if rounds % _PATIENCE == 0 and _lags(spring, difference, low, high, z, before, scaled):
                threshold *= _GROWTH
                scaled *= _GROWTH  # so that the unscaled multipliers stay the same
            if progress is not None:
                progress(rounds / max_rounds)
    moved = regions_moved(problem, best, problem.scale)
    return JumpSolution(moved, problem.objective(moved), bound, rounds)


def _lags(
    spring: NDArray[np.float64],
    difference: NDArray[np.float64],
    low: NDArray[np.float64],
    high: NDArray[np.float64],
    z: NDArray[np.float64],
    before: NDArray[np.float64],
    scaled: NDArray[np.float64],
) -> bool:
    """Whether the multipliers converge slowly: the relative dual residual is more than twice the primal one."""
    primal = np.sqrt(spring @ (difference - z) ** 2)
    jumps = np.sqrt(spring @ (difference - np.clip(difference, low, high)) ** 2)
    dual = np.sqrt(spring @ (z - before) ** 2)
    return bool(dual * jumps > 2.0 * primal * np.sqrt(spring @ scaled**2))


def regions_moved(problem: JumpProblem, constants: NDArray[np.float64], jump: float) -> NDArray[np.float64]:
    """Constants improved by shifting whole regions, which are separated by jumps larger than `jump`.

    For many rounds the jump is divided between cuts of nearly equal cost; this moves all of it to the cheapest one.
    """
    low, high = problem.low, problem.high
    difference = problem.differences(constants)
    joined = np.abs(difference - np.clip(difference, low, high)) <= jump
    region = connected_components(problem.n_faces, *problem.faces[joined].T)
    n_regions = int(region.max(initial=-1)) + 1
    faces = region[problem.faces]
    between = faces[:, 0] != faces[:, 1]
    low, high = (low - difference)[between], (high - difference)[between]
    moves = minimize_exactly(JumpProblem(faces[between], low, high, problem.weights[between], n_regions))
    moved: NDArray[np.float64] = constants + moves.constants[region]
    return moved


def minimize_exactly(problem: JumpProblem) -> JumpSolution:
    """Solve the dual, a minimum-cost flow, as a linear program (HiGHS in SciPy); the constants are its multipliers.

    Raises
    ------
    SignedHeatError
        If HiGHS finds no optimum, or there is a duality gap.
    """
    if not len(problem.faces):
        return _nothing(problem)
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
    raise SignedHeatError(
        f"the linear program over {problem.n_faces} faces was not solved ({result.message})",
        remedy="leave out exact=True",
    )


def _nothing(problem: JumpProblem) -> JumpSolution:
    """The solution if no two faces share an edge: all constants are optimal."""
    return JumpSolution(np.zeros(problem.n_faces), problem.floor, problem.floor, 0)


def _grounded_laplacian(incidence: sparse.csr_matrix, spring: NDArray[np.float64]) -> sparse.csr_matrix:
    """``KᵀSK``, S the diagonal matrix `spring`, with one face of each connected component grounded."""
    laplacian = sparse.csr_matrix(incidence.T @ sparse.diags_array(spring) @ incidence)
    parts = sparse.csgraph.connected_components(laplacian, directed=False)[1]
    held = np.zeros(laplacian.shape[0])
    held[np.unique(parts, return_index=True)[1]] = 1.0
    return sparse.csr_matrix(laplacian + sparse.diags_array(held))
