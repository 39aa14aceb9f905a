"""Tet meshes discretised for the signed heat method: one vector per face, and one value per vertex (Sec. 8.1)."""

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
"""With at most this number of faces, the matrix of step 1 is factorised, in O(n²) time. With more, conjugate gradients
take O(n⁴ᐟ³)."""
DIRECT_VERTICES = 40_000
"""With at most this number of vertices, the matrix of step 3 is factorised; with more, conjugate gradients are used."""
DIRECTION_ERROR = 1e-3
"""Componentwise residual at which conjugate gradients stop; directions are then exact to about 0.01°."""
TET_SPRINGS = 30.0
"""Strength of the springs that impose levels, times the mean edge length."""


def memory_estimate(n_tets: int) -> float:
    """Return the estimated peak memory, in bytes, of the first distance on a mesh of this many tets."""
    factored = min(n_tets, DIRECT_FACES // 2)  # a tet has about two faces of its own
    return max(1750 * n_tets, 2900 * factored)  # measured, by conjugate gradients and by factorisation


@dataclass(frozen=True, eq=False)
class TetDiscretization(DiffusesEach):
    """A tet mesh discretised for the signed heat method; see `Discretization` for its methods."""

    mesh: TetMesh
    direct: bool  # whether the system of step 1 is factorised; it is solved by conjugate gradients otherwise
    _heats: LastUsed[float, HeatSystem] = field(default_factory=lambda: LastUsed(3), init=False, repr=False)

    @cached_property
    def planes(self) -> Planes:
        """The planes of the faces, against which sources are clipped."""
        return Planes.of(self.mesh.geometry)

    @cached_property
    def spacing(self) -> float:
        """h: the mean distance between the barycentres of two faces of a tet, a third of the mean edge length."""
        corners = self.mesh.vertices[self.mesh.tets]
        pairs = [corners[:, a] - corners[:, b] for a in range(4) for b in range(a)]
        return float(np.mean([np.linalg.norm(edge, axis=1).mean() for edge in pairs])) / 3

    @cached_property
    def unknowns(self) -> Ints:
        """(m, 4) unknown of φ at each corner of each tet.

        Heat flows through faces only, so parts that share just a vertex or an edge have unknowns of their own there.
        """
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
        """(n, 3) mean gradients at the unknowns of (n,) values, 0 where there are none."""
        return np.nan_to_num(self.mesh.geometry.mean_gradients(values, self.unknowns, self.n_unknowns))

    def adapt(self, sources: Sequence[Any]) -> tuple[TetDiscretization, Sequence[Any]]:
        """Return the discretisation itself, since sources need not conform to the tets."""
        return self, sources

    def lower(self, sources: Sequence[Any], diffusion: float) -> TetSource:
        """Make a `TetSource`: X₀ (Sec. 8.1; Eq. 11 in space), and the rows that average φ over the sources (Eq. 14)."""
        return tet_source(self.mesh, self.planes, self.unknowns, sources, diffusion, self.spacing)

    def diffuse(self, source: TetSource) -> Floats:
        """Solve ``(M + tL) X = X₀`` (Eq. 12) for one vector per face; return (m, 3) means in the tets (App. B.2).

        Vectors diffuse without rotation. Where no straight line to the source stays in the domain, the direction is
        that in which scalar heat falls (Crane et al. 2013), with its sign at the tet where this heat comes from.
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
        """Return the system M + tL of Eq. 12, from the Laplacian of Eq. 21 and the lumped mass of Eq. 23."""
        matrix, mass = self._laplacian * time, self.mesh.geometry.face_mass()
        matrix.setdiag(matrix.diagonal() + mass)
        return HeatSystem(matrix, self.direct)

    def _in_tets(self, stages: list[Stage]) -> tuple[Floats, Floats, Floats]:
        """(m, k) means of X in tets, (m, 3) gradients of its last column, and (m,) logarithms of the scales of both.

        Each is from the last stage that has values at the four faces of the tet.
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
        """(m,) whether the segment from each tet to the nearest part of the source lies in the mesh."""
        planes, centers = self.planes, self.mesh.tet_barycenters
        nearest = source.centers[PointTree(source.centers).query(centers)[1]]
        begins, ends = (np.ascontiguousarray(points - planes.center) for points in (centers, nearest))
        return visible(planes, self.mesh.faces.neighbors, begins, ends, SIGHT_OUTSIDE * self.spacing)

    @cached_property
    def _laplacian(self) -> sparse.csr_matrix:
        """(f, f) Laplacian L on the faces (Eq. 21)."""
        return self.mesh.geometry.face_laplacian()

    def to_cells(self, vectors: Floats) -> Floats:
        """Return the (m, 3) vectors as they are, since `diffuse` has averaged them in the tets."""
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
        """(n,) b, the right-hand side of ``C φ = b`` (Eq. 13, Eq. 22), for (m, 3) directions in tets."""
        return self.mesh.geometry.divergence(directions, self.unknowns, self.n_unknowns)

    @cached_property
    def vertices(self) -> Ints:
        """(n,) vertex of the mesh that each unknown belongs to."""
        vertices = np.empty(self.n_unknowns, dtype=np.int64)
        vertices[self.unknowns] = self.mesh.tets
        return vertices

    def at_vertices(self, values: Floats) -> Floats:
        """(n_vertices,) means of (n,) values over the unknowns of each vertex, NaN where none has a value."""
        finite = np.flatnonzero(~np.isnan(values))
        vertices, n = self.vertices[finite], self.mesh.n_vertices
        counts, sums = np.bincount(vertices, minlength=n), np.bincount(vertices, values[finite], n)
        return np.where(counts > 0, sums / np.maximum(counts, 1), np.nan)


@dataclass(frozen=True, eq=False)
class HeatSystem:
    """The system of step 1, ``(M + tL) X = X₀``, whose solutions decay away from the right-hand side."""

    matrix: sparse.csr_matrix  # (n, n) M + tL, both triangles of it
    direct: bool  # whether it is factorised; otherwise it is solved by conjugate gradients

    @cached_property
    def factor(self) -> Factor:
        """The factor of the matrix."""
        return factorize(self.matrix)

    def solve(self, loads: Floats) -> list[Stage]:
        """Solve for the columns of (n, k) loads, in stages, since X underflows a few hundred cells away from them."""
        size = float(self.matrix.diagonal().mean())
        return solve_with_restarts(self._solve, matrix_forces(self.matrix), loads, size)

    def _solve(self, loads: Floats) -> Floats:
        """(n, k) solutions for (n, k) loads, without restarts at underflow."""
        if self.direct:
            return self.factor.solve(loads)
        order = outward_order(self.matrix, np.flatnonzero(loads.any(axis=1)))
        return IncompleteCholesky.of(self.matrix, order).solve(loads, relative=0.0, componentwise=DIRECTION_ERROR)


def uphill_roots(heights: Floats, neighbors: Ints, settled: Bools) -> Ints:
    """(m,) the settled tet, or the local maximum of the (m,) heights, to which steepest ascent from each tet leads.

    Ascent is from a tet to the highest of its (m, 4) neighbours, −1 for none.
    """
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
    """Discretise a tet mesh, or raise `MemoryLimitError` if distance on it does not fit in memory."""
    refuse_beyond_memory(
        f"distance on {domain.n_tets:,} tets",
        domain.n_tets,
        memory_estimate,
        lambda number: f"use at most {number:,} tets, as with a lower resolution of tetrahedralize",
    )
    return lowered_tets(domain)


def lowered_tets(mesh: TetMesh) -> TetDiscretization:
    """Discretise a tet mesh without checking whether distance on it fits into memory."""
    return TetDiscretization(mesh, direct=len(mesh.faces.vertices) <= DIRECT_FACES)


@dataclass(frozen=True, eq=False)
class TetIntegration(SpringIntegration):
    """`SpringIntegration` whose levels at the samples are corrected for the curvature of φ, from its gradients."""

    gradients: Callable[[Floats], Floats] = np.zeros_like  # from φ at the unknowns to (n, 3) gradients there

    def corrected(self, levels: Floats, solve: Callable[[Floats], Floats], source: SourceTerm) -> tuple[Floats, Floats]:
        """Return (s,) levels, less the quadratic correction of a first solution, and the solution with these levels.

        `solve` returns φ for given levels.
        """
        values = levels - self._quadratic_correction(solve(levels), source)
        return values, solve(values)

    def fit_exactly(self, divergence: Floats, source: SourceTerm, levels: Levels) -> Floats:
        """Return the φ that has given levels at the samples exactly (Eq. 14)."""
        correction = self._quadratic_correction(self.factor.solve(divergence), source)
        return super().fit_exactly(divergence, source, replace(levels, values=levels.values - correction))

    def penalize(self, divergence: Floats, source: SourceTerm, strength: float) -> Floats:
        """Solve ``(C + λ Aᵀ W A) φ = b`` (Sec. 7.1, Fig. 11), where A φ is corrected for the curvature of φ."""
        strength = min(strength, STIFFEST_SPRING * float(self.stiffness.diagonal().max()) / float(source.weights.max()))
        free = super().penalize(divergence, source, strength)
        pull = source.interpolation.T @ (strength * source.weights * self._quadratic_correction(free, source))
        return super().penalize(divergence - pull, source, strength)

    def _at_samples(self, values: Floats, source: SourceTerm) -> Floats:
        """(s,) means of φ, (n,) values, over the patches of a source, to second order."""
        return super()._at_samples(values, source) + self._quadratic_correction(values, source)

    def _quadratic_correction(self, values: Floats, source: SourceTerm) -> Floats:
        """(s,) means of φ minus its linear interpolant, over the patches of the source."""
        assert isinstance(source, TetSource)
        return source.quadratic_correction @ self.gradients(np.nan_to_num(values)).ravel()
