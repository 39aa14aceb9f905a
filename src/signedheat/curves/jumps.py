"""Piecewise-continuous integration: the constants of least cost, with a certificate, and the jumps that they leave.

Summed over the two ends of an edge, the cost of a pair of faces in Eq. 16 is ``w (b − a)``, whatever the constants are,
plus ``2w`` times the distance of x = c_f − c_g from the interval [a, b], whose ends are the values of x that make φ
continuous at one end of the edge and at the other. The dual of ``min Σ 2w dist(K c, [a, b])`` is a flow y from face to
face across edges, conserved in every face, with capacities 2w; every such flow proves that no constants have a smaller
cost than ``−Σ max(a y, b y)``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np
from scipy import sparse

from ..arrays import Bools, Complexes, Floats, Ints, mask_of
from ..fields.field import Field
from ..jobs import report
from ..linear import factorize
from ..linear.splitting import split_rounds
from ..linear.threads import one_blas_thread
from ..mesh.components import connected_components
from ..mesh.intrinsic_mesh import FacePairs, IntrinsicMesh, split_corners
from ..mesh.polylines import assemble_polylines
from ..surfaces.cotan import cotan_matrix, divergence
from .cut_surface import CutSurface

DUALITY_GAP, MOST_SPLITTING_ROUNDS = 2e-3, 3000
"""Relative gap between objective and lower bound below which minimisation ends, and the largest number of rounds, after
which it ends in any case."""
LOOSE_GAP = 0.15
"""Relative gap below which minimisation ends early if φ has no cut. The remaining jumps are then smaller than
triangles."""
ROUNDS_PER_LOOK = 25
"""Rounds between two evaluations of the gap."""
THRESHOLD_GROWTH, GROWTH_ROUNDS = 2.0, 250
"""Factor by which the threshold of the proximal step may grow, at most every so many rounds: tuned on tori and
spheres."""


@dataclass(frozen=True, eq=False)
class JumpProblem:
    """Minimise ``floor + Σ 2w dist(c_f − c_g, [a, b])`` over one constant c per face, summed over pairs of faces."""

    faces: Ints  # (p, 2) ids of the faces f and g of each pair
    # (p,) a and b, a ≤ b. These values of c_f − c_g make φ continuous at one and at the other end of the edge
    low: Floats
    high: Floats
    weights: Floats  # (p,) w, positive
    n_faces: int  # number of constants
    floor: float = 0.0  # the cost that does not depend on the constants

    def differences(self, constants: Floats) -> Floats:
        """Return (p,) constants, of which there is one for each face, of the first minus the second face of each pair.

        This is K c in the notes above.
        """
        return constants[self.faces[:, 0]] - constants[self.faces[:, 1]]

    def objective(self, constants: Floats) -> float:
        """Return the value of the objective for (n_faces,) constants."""
        difference = self.differences(constants)
        return self.floor + 2.0 * float(self.weights @ np.abs(difference - np.clip(difference, self.low, self.high)))

    def bound(self, flow: Floats) -> float:
        """Return a lower bound of the objective from a flow (p,) that is conserved in every face (weak duality)."""
        excess = np.abs(flow / (2.0 * self.weights)).max(initial=1.0)
        return self.floor - float(np.maximum(self.low * flow, self.high * flow).sum() / excess)

    @property
    def scale(self) -> float:
        """Mean absolute value of a and b."""
        return 0.5 * float(np.mean(np.abs(self.low) + np.abs(self.high)))

    def incidence(self) -> sparse.csr_matrix:
        """Return K, sparse (p, n_faces), which takes constants to their `differences`."""
        n = len(self.faces)
        pair = np.repeat(np.arange(n), 2)
        return sparse.csr_matrix((np.tile([1.0, -1.0], n), (pair, self.faces.ravel())), shape=(n, self.n_faces))


@dataclass(frozen=True, eq=False)
class JumpSolution:
    """Constants that nearly minimise a `JumpProblem`, with a lower bound that certifies them."""

    constants: Floats  # (n_faces,) c; on each connected component of the surface up to a constant
    objective: float  # the objective at these constants
    bound: float  # a lower bound of the objective
    rounds: int  # number of iterations

    @property
    def gap(self) -> float:
        """(objective − bound) / objective: the objective is at most this fraction above the optimum."""
        return max(self.objective - self.bound, 0.0) / self.objective if self.objective > 0 else 0.0


def minimize(
    problem: JumpProblem,
    enough: Callable[[Floats], bool] | None = None,
) -> JumpSolution:
    """Solve a `JumpProblem` by ADMM, splitting z = K c, until the relative gap is below `DUALITY_GAP`.

    It also ends below `LOOSE_GAP` if ``enough(constants)`` is true, and after `MOST_SPLITTING_ROUNDS`. Penalties
    proportional to w give all edges the same threshold, which can grow without a new factorisation.
    """
    if not len(problem.faces):
        return JumpSolution(np.zeros(problem.n_faces), problem.floor, problem.floor, 0)
    low, high = problem.low, problem.high
    spring = problem.weights / problem.weights.mean()
    incidence = problem.incidence()
    transposed = sparse.csr_matrix(incidence.T)
    with one_blas_thread():  # threads cost a triangular solve of this size more than they gain
        factor = factorize(_grounded_laplacian(incidence, spring))
        constants = factor.solve(transposed @ (spring * (0.5 * (low + high))))
        step = problem.differences(constants)
        best, bound = constants, problem.floor
        least = problem.objective(best)
        threshold = 4.0 * problem.scale  # four typical differences
        negligible = 1e-9 * threshold * problem.weights.sum()

        def proximal(target: Floats) -> Floats:
            """Move (p,) differences towards the interval [a, b], by the threshold at most."""
            excess = target - np.clip(target, low, high)
            return target - np.clip(excess, -threshold, threshold)

        def solve(target: Floats) -> Floats:
            """Return the constants whose differences are nearest to a (p,) target, weighted by `spring`."""
            return factor.solve(transposed @ (spring * target))

        steps, rounds = split_rounds(proximal, solve, problem.differences, step, step), 0
        while least - bound > max(DUALITY_GAP * least, negligible) and rounds < MOST_SPLITTING_ROUNDS:
            constants, difference, z, before, scaled = next(islice(steps, ROUNDS_PER_LOOK - 1, None))
            rounds += ROUNDS_PER_LOOK
            value = problem.objective(constants)
            if value < least:
                best, least = constants, value
            flow = scaled * spring
            flow -= spring * problem.differences(factor.solve(transposed @ flow))
            bound = max(bound, problem.bound(flow * (2.0 * problem.weights.mean() / threshold)))
            if enough is not None and least - bound < LOOSE_GAP * least and enough(best):
                return JumpSolution(best, least, bound, rounds)
            if rounds % GROWTH_ROUNDS == 0 and _lags(spring, difference, low, high, z, before, scaled):
                threshold *= THRESHOLD_GROWTH
                scaled *= THRESHOLD_GROWTH  # so that the unscaled multipliers stay the same
            report(rounds / MOST_SPLITTING_ROUNDS, "integrate")
    moved = regions_moved(problem, best)
    return JumpSolution(moved, problem.objective(moved), bound, rounds)


def regions_moved(problem: JumpProblem, constants: Floats) -> Floats:
    """Improve (n_faces,) constants by shifting whole regions between cuts, the smallest first.

    A region consists of faces connected by jumps of at most ``problem.scale``. It is shifted by the weighted median of
    the shifts that make φ continuous at an end of an edge around it, which does not increase the objective.
    """
    constants = constants.copy()
    for _ in range(problem.n_faces):  # each round leaves one region less
        difference = problem.differences(constants)
        excess = difference - np.clip(difference, problem.low, problem.high)
        joined = np.abs(excess) <= problem.scale
        region = connected_components(problem.n_faces, *problem.faces[joined].T)
        faces = region[problem.faces]
        between = faces[:, 0] != faces[:, 1]
        if not between.any():
            break
        sizes = np.bincount(region)
        sizes[np.setdiff1d(region, faces[between])] = problem.n_faces + 1  # components, without neighbours
        smallest = sizes.argmin()
        rows = np.flatnonzero(between & (faces == smallest).any(axis=1))
        way = np.where(faces[rows, 0] == smallest, 1.0, -1.0)
        shifts = np.concatenate([way * (end[rows] - difference[rows]) for end in (problem.low, problem.high)])
        order = np.argsort(shifts, kind="stable")
        total = np.cumsum(np.tile(problem.weights[rows], 2)[order])
        constants[region == smallest] += shifts[order[np.searchsorted(total, 0.5 * total[-1])]]
    return constants


def _lags(
    spring: Floats, difference: Floats, low: Floats, high: Floats, z: Floats, before: Floats, scaled: Floats
) -> bool:
    """Whether multipliers of ADMM converge too slowly, with a relative dual residual more than twice the primal one.

    All arrays are (p,): the penalties `spring`, the differences K c, the ends of the intervals, the split variable z
    now and one round `before`, and the `scaled` multipliers.
    """
    primal = np.sqrt(spring @ (difference - z) ** 2)
    jumps = np.sqrt(spring @ (difference - np.clip(difference, low, high)) ** 2)
    dual = np.sqrt(spring @ (z - before) ** 2)
    return bool(dual * jumps > 2.0 * primal * np.sqrt(spring @ scaled**2))


def _grounded_laplacian(incidence: sparse.csr_matrix, spring: Floats) -> sparse.csr_matrix:
    """Return ``KᵀSK`` for K the `incidence` and S = diag(spring), made regular.

    On each connected component, 1 is added to the diagonal entry of one face.
    """
    laplacian = sparse.csr_matrix(incidence.T @ sparse.diags_array(spring) @ incidence)
    parts = sparse.csgraph.connected_components(laplacian, directed=False)[1]
    held = np.zeros(laplacian.shape[0])
    held[np.unique(parts, return_index=True)[1]] = 1.0
    return sparse.csr_matrix(laplacian + sparse.diags_array(held))


LEAST_JUMP = 3.0
"""Least size of the largest jump on a line of a cut, relative to `typical_size`. Lines with lower jumps are no cut."""

LEAST_BRANCH_JUMP = 5.0
"""Least size of the largest jump on a branch of a cut, relative to `typical_size`, or half of the largest jump on the
cut if that is less. Branches with lower jumps are no cut. They occur where Y turns within several triangles."""

SMOOTHED_WIDTH = 10.0
"""The length w in `smoothed`, relative to the square root of the area of a connected part. The result then differs from
that of step 3 by a thousandth. If w were much larger, M would be lost in rounding."""


def typical_size(triangles: IntrinsicMesh) -> float:
    """Return the mean of the longest sides of triangles, weighted by area."""
    return float(np.average(triangles.edge_lengths.max(axis=1), weights=triangles.face_areas))


def high_jumps(triangles: IntrinsicMesh, pairs: FacePairs, values: Floats) -> Bools:
    """Return (p,) bool, true for pairs of faces between which (m, 3) corner values jump by more than errors do.

    Such jumps form lines, whose largest jump is at least `LEAST_JUMP`, and without branches below `LEAST_BRANCH_JUMP`.
    """
    longest, typical = triangles.edge_lengths.max(axis=1), typical_size(triangles)
    height = np.abs(pairs.ends(values)).max(axis=1)
    high = np.flatnonzero(height > np.maximum(longest[pairs.faces].max(axis=1), typical))
    ends = triangles.edges.vertices[pairs.edges[high]]
    n = triangles.n_vertices
    line = connected_components(n, *ends.T)[ends[:, 0]]
    far = mask_of(n, line[height[high] > LEAST_JUMP * typical])
    high, line = high[far[line]], line[far[line]]
    highest = np.zeros(n)
    np.maximum.at(highest, line, height[high])
    least = np.minimum(LEAST_BRANCH_JUMP * typical, 0.5 * highest[line])
    ends = triangles.edges.vertices[pairs.edges[high]]
    return mask_of(len(height), high[without_twigs(ends, height[high] > least)])


def without_twigs(edges: Ints, high: Bools) -> Bools:
    """Return (k,) bool, true for the (k, 2) edges that remain after twigs are removed.

    A twig is a chain of edges between ends and forks, none of which is `high`, (k,).

    Examples
    --------
    >>> twig, line = [3, 9], [[1, 2], [2, 3], [3, 4]]
    >>> without_twigs(np.array([twig, *line]), np.array([False, True, False, True])).tolist()
    [False, True, True, True]
    """
    once, numbers = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True)
    keeps = mask_of(len(once), numbers.ravel()[high])
    left = np.arange(len(once))
    while True:
        chains = assemble_polylines(once[left, 0], once[left, 1], directed=False)
        low = [chain for chain, _, _ in chains if not keeps[left[chain]].any()]
        if not low:
            return np.isin(numbers.ravel(), left)
        left = np.delete(left, np.concatenate(low))


def is_continuous(
    triangles: IntrinsicMesh, pairs: FacePairs, slopes: Floats, directions: Complexes, constants: Floats
) -> bool:
    """Whether φ with these constants of the faces has no cut.

    A cut would be a line of large jumps, or a strip of small jumps in which gradients of the averaged φ differ from Y.
    `slopes` and `constants`, (m, 3) and (m,), add up to φ at the corners. `directions` are Y, (m,).
    """
    values = slopes + constants[:, None]
    if np.abs(pairs.ends(values)).max(initial=0.0) > LEAST_JUMP * typical_size(triangles):
        return False
    corners, n = triangles.corner_vertices, triangles.n_vertices
    mean = np.bincount(corners.ravel(), values.ravel(), n) / np.maximum(np.bincount(corners.ravel(), minlength=n), 1)
    rough = np.abs(gradients(triangles, mean[corners]) - directions) > 0.5
    for _ in range(2):  # a cut has two rows of rough faces around one: where Y turns, few are rough together
        inner = np.ones(n, dtype=bool)
        inner[corners[~rough]] = False
        rough = np.asarray(inner[corners].all(axis=1))
    return not bool(rough.any())


def gradients(triangles: IntrinsicMesh, at_corners: Floats) -> Complexes:
    """Return (m,) gradients of a function with (m, 3) corner values, complex numbers in each face's planar layout."""
    opposite = 1j * np.roll(triangles.edge_vectors, -1, axis=1)
    return (at_corners * opposite).sum(axis=1) / (2.0 * triangles.areas_as_divisors)


def smoothed(triangles: IntrinsicMesh, pairs: FacePairs, directions: Complexes, rough: Floats, cut: Bools) -> Floats:
    """Make φ continuous on the surface cut open, by step 3 of the method (Eq. 13); return its (m, 3) corner values.

    Solves ``(M + w² C) φ = M φ₀ + w² b``, so that φ has the mean of φ₀ on each connected part. `directions` are Y,
    (m,), `rough` is φ₀ at the corners, (m, 3), and `cut`, (p,), is true for the `pairs` that the cut separates.
    """
    opened = cut_open(triangles, pairs, cut)
    owner = opened.corner_vertices.ravel()
    share = np.repeat(triangles.face_areas / 3.0, 3)
    mass = opened.vertex_areas
    stiffness = cotan_matrix(opened)
    part = sparse.csgraph.connected_components(stiffness, directed=False)[1]
    squared = SMOOTHED_WIDTH**2 * np.bincount(part, mass)[part]
    matrix = sparse.csr_matrix(sparse.diags_array(squared) @ stiffness + sparse.diags_array(mass))
    pulled = np.bincount(owner, share * rough.ravel()) + squared * divergence(opened, directions)
    return factorize(matrix).solve(pulled)[opened.corner_vertices]


def slope_error(triangles: IntrinsicMesh, at_corners: Floats, directions: Complexes) -> float:
    """Return the root mean square of ∇φ − Y over the faces in which the (m, 3) corner values of φ are not NaN."""
    finite = ~np.isnan(at_corners[:, 0])
    error = np.abs(gradients(triangles, at_corners) - directions)
    return float(np.sqrt(np.average(error[finite] ** 2, weights=triangles.face_areas[finite])))


def integration_error(phi: Field[CutSurface], directions: Complexes) -> float:
    """Return the root mean square of ∇φ̄ − Y, where φ̄ averages φ over the corners at each vertex of the cut surface."""
    at_corners = phi.domain.means(phi.values)[phi.domain.split_vertices[0]]
    return slope_error(phi.domain.triangles, at_corners.reshape(-1, 3), directions)


def cut_open(triangles: IntrinsicMesh, pairs: FacePairs, cut: Bools) -> IntrinsicMesh:
    """Return the triangles with vertices doubled along the cut, which is true for some of the `pairs`, (p,)."""
    owner = split_corners(triangles, pairs, cut)
    return replace(triangles, corner_vertices=owner.reshape(-1, 3), n_vertices=int(owner.max(initial=-1)) + 1)
