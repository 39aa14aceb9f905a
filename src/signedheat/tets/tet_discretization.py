"""Tet meshes as a discretisation: one vector per face, one value per vertex (Sec. 8.1)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy
from scipy import sparse

from ..arrays import Bools, Floats, Ints, LastUsed
from ..discretization import DiffusesEach, Levels, SourceTerm, discretize
from ..linear import Factor, factorize, upper_triangle
from ..linear.direct_integration import STIFFEST_SPRING, SpringIntegration
from ..linear.incomplete_cholesky import IncompleteCholesky, from_first, outward_order
from ..linear.restarts import Stage, matrix_forces, solve_with_restarts
from ..memory import refuse_beyond_memory
from ..mesh.unit_vectors import unit
from ..parallel import PointTree
from .tet_clipping import SIGHT_OUTSIDE, Planes, visible
from .tet_mesh import TetMesh
from .tet_source import TetSource, tet_source

DIRECT_FACES = 20_000
"""Number of faces up to which step 1 is factorised, in O(n²) time; conjugate gradients take O(n⁴ᐟ³)."""
DIRECT_VERTICES = 40_000
"""Number of vertices up to which step 3 is factorised."""
DIRECTION_ERROR = 1e-3
"""Componentwise residual at which conjugate gradients stop: directions are then right to about 0.01°."""
TET_SPRINGS = 30.0
"""Strength of the springs that impose levels, times the mean edge length."""


def memory_estimate(n_tets: int) -> float:
    """Estimate the peak memory, in bytes, of a first distance on a mesh of this many tets."""
    factored = min(n_tets, DIRECT_FACES // 2)  # a tet has about two faces of its own
    return max(1750 * n_tets, 2900 * factored)  # measured, by conjugate gradients and by factorisation


@dataclass(frozen=True, eq=False)
class TetDiscretization(DiffusesEach):
    """The discretisation of a tet mesh."""

    mesh: TetMesh
    direct: bool  # whether the system of step 1 is factorised; it is solved by conjugate gradients otherwise
    _heats: LastUsed[float, HeatSystem] = field(default_factory=lambda: LastUsed(3), init=False, repr=False)

    @cached_property
    def planes(self) -> Planes:
        """The planes of the faces, against which sources are clipped."""
        return Planes.of(self.mesh.geometry)

    @cached_property
    def spacing(self) -> float:
        """h: mean distance between the barycentres of two faces of a tet, which is a third of an edge length."""
        corners = self.mesh.vertices[self.mesh.tets]
        pairs = [corners[:, a] - corners[:, b] for a in range(4) for b in range(a)]
        return float(np.mean([np.linalg.norm(edge, axis=1).mean() for edge in pairs])) / 3

    @cached_property
    def unknowns(self) -> Ints:
        """(m, 4) unknown of φ at each corner of each tet; heat flows through faces only, so parts share none."""
        parts = self.mesh.parts
        keys = self.mesh.tets * (parts.max() + 1) + parts[:, None]
        return np.unique(keys, return_inverse=True)[1].reshape(-1, 4)

    @cached_property
    def n_unknowns(self) -> int:
        """Number of unknowns of φ."""
        return int(self.unknowns.max()) + 1

    @cached_property
    def integration(self) -> TetIntegration:
        """The solver of step 3, direct or by conjugate gradients."""
        matrix = upper_triangle(self.mesh.geometry.vertex_laplacian(self.unknowns, self.n_unknowns))
        strength = TET_SPRINGS / (3 * self.spacing)
        if self.n_unknowns <= DIRECT_VERTICES:
            return TetIntegration(matrix, strength=strength, gradients=self._gradients)
        return TetIntegration(matrix, factorize=from_first, spring=1e4, strength=strength, gradients=self._gradients)

    def _gradients(self, values: Floats) -> Floats:
        return np.nan_to_num(self.mesh.geometry.mean_gradients(values, self.unknowns, self.n_unknowns))

    def adapt(self, sources: Sequence[Any]) -> tuple[TetDiscretization, Sequence[Any]]:
        """Return the discretisation itself, since sources need not conform to the tets."""
        return self, sources

    def lower(self, sources: Sequence[Any], diffusion: float) -> TetSource:
        """Compute X₀ (Sec. 8.1; Eq. 11 in space) and the rows that average φ over the sources (Eq. 14)."""
        return tet_source(self.mesh, self.planes, self.unknowns, sources, diffusion, self.spacing)

    def diffuse(self, source: TetSource) -> Floats:
        """Solve ``(M + tL) X = X₀`` (Eq. 12) for one vector per face, and average it in the tets (App. B.2).

        Vectors diffuse without turning. Where no straight line to the source stays in the domain, the direction is that
        in which undirected heat falls (Crane et al. 2013), with the sign of the place it comes from.
        """
        heat = self._heats(source.time, lambda: self._heat_system(source.time))
        if self._is_convex:
            return self._in_tets(heat.solve(source.vectors))[0]
        loads = np.concatenate([source.vectors, source.strengths[:, None]], axis=1)
        means, gradients, factors = self._in_tets(heat.solve(loads))
        with np.errstate(divide="ignore"):
            heights = np.log(np.maximum(means[:, 3], 0)) + factors
        straight, vectors, falling = self._straight(source), means[:, :3], -gradients
        roots = uphill_roots(heights, self.mesh.faces.neighbors, straight)
        side = np.sign(np.einsum("ij,ij->i", unit(vectors), falling))[roots]
        return np.where(straight[:, None], vectors, side[:, None] * falling)

    def _heat_system(self, time: float) -> HeatSystem:
        """Return M + tL of Eq. 12, from the Laplacian of Eq. 21 and the mass of Eq. 23, lumped."""
        matrix, mass = self._laplacian * time, self.mesh.geometry.face_mass()
        matrix.setdiag(matrix.diagonal() + mass)
        return HeatSystem(matrix, self.direct)

    def _in_tets(self, stages: list[Stage]) -> tuple[Floats, Floats, Floats]:
        """Return (m, k) means of X in tets, (m, 3) gradients of its last column, and (m,) logarithms of their scales.

        All are those of the last stage that has the four faces of a tet.
        """
        tet_faces = self.mesh.faces.tet_faces
        n = self.mesh.n_tets
        means, gradients, factors = np.zeros((n, stages[0].values.shape[1])), np.zeros((n, 3)), np.full(n, -np.inf)
        for vectors, factor in stages:
            of_faces = vectors[tet_faces]
            finite = ~np.isnan(of_faces[..., 0]).any(axis=1)
            means[finite] = of_faces[finite].mean(axis=1)
            slopes = np.einsum("mki,mk->mi", self.mesh.geometry.area_vectors[finite], of_faces[finite, :, -1])
            gradients[finite], factors[finite] = slopes, factor
        return means, gradients, factors

    def _straight(self, source: TetSource) -> Bools:
        """Return (m,) whether the source reaches each tet along a straight line."""
        planes, centers = self.planes, self.mesh.tet_barycenters
        nearest = source.centers[PointTree(source.centers).query(centers)[1]]
        begins, ends = (np.ascontiguousarray(points - planes.center) for points in (centers, nearest))
        return visible(planes, self.mesh.faces.neighbors, begins, ends, SIGHT_OUTSIDE * self.spacing)

    @cached_property
    def _laplacian(self) -> sparse.csr_matrix:
        return self.mesh.geometry.face_laplacian()

    def to_cells(self, vectors: Floats) -> Floats:
        """Return X at the tets, where `diffuse` has averaged it already."""
        return vectors

    @cached_property
    def _is_convex(self) -> bool:
        """Whether the mesh fills its convex hull."""
        try:
            hull = scipy.spatial.ConvexHull(self.mesh.vertices[np.unique(self.mesh.boundary.faces)])
        except scipy.spatial.QhullError:  # flat, to rounding
            return False
        return bool(self.mesh.tet_volumes.sum() >= (1 - 1e-9) * hull.volume)

    def divergence(self, directions: Floats) -> Floats:
        """Compute b, the right-hand side of ``C φ = b`` (Eq. 13, Eq. 22)."""
        return self.mesh.geometry.divergence(directions, self.unknowns, self.n_unknowns)

    @cached_property
    def vertices(self) -> Ints:
        """(n,) the vertex of the mesh that each unknown belongs to."""
        vertices = np.empty(self.n_unknowns, dtype=np.int64)
        vertices[self.unknowns] = self.mesh.tets
        return vertices

    def at_vertices(self, values: Floats) -> Floats:
        """Return (n_vertices,) means of values over the unknowns of each vertex, NaN where none has a value."""
        finite = np.flatnonzero(~np.isnan(values))
        vertices, n = self.vertices[finite], self.mesh.n_vertices
        counts, sums = np.bincount(vertices, minlength=n), np.bincount(vertices, values[finite], n)
        return np.where(counts > 0, sums / np.maximum(counts, 1), np.nan)


@dataclass(frozen=True, eq=False)
class HeatSystem:
    """The system of step 1, ``(M + tL) X = X₀``, whose solutions decay away from the right-hand side."""

    matrix: sparse.csr_matrix  # (n, n) M + tL, whole
    direct: bool  # whether it is factorised; it is solved by conjugate gradients otherwise

    @cached_property
    def factor(self) -> Factor:
        """The factor of the matrix."""
        return factorize(self.matrix)

    def solve(self, loads: Floats) -> list[Stage]:
        """Solve for columns (n, k), in stages: X underflows a few hundred cells away from the loads."""
        size = float(self.matrix.diagonal().mean())
        return solve_with_restarts(self._solve, matrix_forces(self.matrix), loads, size)

    def _solve(self, loads: Floats) -> Floats:
        if self.direct:
            return self.factor.solve(loads)
        order = outward_order(self.matrix, np.flatnonzero(loads.any(axis=1)))
        return IncompleteCholesky.of(self.matrix, order).solve(loads, relative=0.0, componentwise=DIRECTION_ERROR)


def uphill_roots(heights: Floats, neighbors: Ints, settled: Bools) -> Ints:
    """Return (m,) the settled tet, or the local maximum, that steepest ascent from tet to tet leads to."""
    own = np.arange(len(heights))
    around = np.where(neighbors >= 0, heights[neighbors], -np.inf)
    best = around.argmax(axis=1)
    higher = ~settled & (around[own, best] > heights)
    roots = np.where(higher, neighbors[own, best], own)
    while True:  # every round doubles the length of the paths followed
        further = roots[roots]
        if (further == roots).all():
            return roots
        roots = further


@discretize.register
def _(domain: TetMesh) -> TetDiscretization:
    refuse_beyond_memory(
        f"distance on {domain.n_tets:,} tets",
        domain.n_tets,
        memory_estimate,
        lambda number: f"use at most {number:,} tets, as with a lower resolution of tetrahedralize",
    )
    return lowered_tets(domain)


def lowered_tets(mesh: TetMesh) -> TetDiscretization:
    """Return the discretisation of a mesh, without checking whether distance on it fits into memory."""
    return TetDiscretization(mesh, direct=len(mesh.faces.vertices) <= DIRECT_FACES)


@dataclass(frozen=True, eq=False)
class TetIntegration(SpringIntegration):
    """`SpringIntegration` whose levels at the samples are corrected for the curvature of φ, from its gradients."""

    gradients: Callable[[Floats], Floats] = np.zeros_like  # from φ at the unknowns to (n, 3) gradients there

    def corrected(self, levels: Floats, solve: Callable[[Floats], Floats], source: SourceTerm) -> tuple[Floats, Floats]:
        """Return the levels minus the quadratic correction of a first solution, and the solution with these levels."""
        values = levels - self._quadratic_correction(solve(levels), source)
        return values, solve(values)

    def fit_exactly(self, divergence: Floats, source: SourceTerm, levels: Levels) -> Floats:
        """Impose levels at the samples exactly (Eq. 14)."""
        correction = self._quadratic_correction(self.factor.solve(divergence), source)
        return super().fit_exactly(divergence, source, replace(levels, values=levels.values - correction))

    def penalize(self, divergence: Floats, source: SourceTerm, strength: float) -> Floats:
        """Solve ``(C + λ Aᵀ W A) φ = b`` (Sec. 7.1, Fig. 11), where A φ is corrected for the curvature of φ."""
        strength = min(strength, STIFFEST_SPRING * float(self.stiffness.diagonal().max()) / float(source.weights.max()))
        free = super().penalize(divergence, source, strength)
        pull = source.interpolation.T @ (strength * source.weights * self._quadratic_correction(free, source))
        return super().penalize(divergence - pull, source, strength)

    def _at_samples(self, values: Floats, source: SourceTerm) -> Floats:
        """Return values at the samples of a source, to second order."""
        return super()._at_samples(values, source) + self._quadratic_correction(values, source)

    def _quadratic_correction(self, values: Floats, source: SourceTerm) -> Floats:
        """Return (s,) means of φ minus its linear interpolant, over the patches of the source."""
        assert isinstance(source, TetSource)
        return source.quadratic_correction @ self.gradients(np.nan_to_num(values)).ravel()
