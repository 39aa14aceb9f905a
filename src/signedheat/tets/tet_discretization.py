"""Tet meshes as a discretisation: one vector per face, one value per vertex (Sec. 8.1)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy
from scipy import sparse

from ..arrays import Bools, Floats, Ints
from ..cache import LastUsed
from ..direct_integration import STIFFEST
from ..discretization import DiffusesEach, Levels, SourceTerm, discretize
from ..linear import upper_triangle
from ..linear.incomplete_cholesky import from_first
from ..linear.restarts import Stage
from ..memory import refuse_beyond_memory
from ..spring_integration import SpringIntegration
from .heat_system import HeatSystem, bend_around_corners
from .tet_clipping import Planes
from .tet_mesh import TetMesh
from .tet_source import TetSource, tet_source
from .visibility import GRAZING, visible

DIRECT_FACES = 20_000
"""Up to this number of faces step 1 is factorised, in O(n²) time; conjugate gradients take O(n⁴ᐟ³)."""
DIRECT_VERTICES = 40_000
"""Up to this number of vertices step 3 is factorised."""
DIRECTION_ERROR = 1e-3
"""Componentwise residual at which conjugate gradients stop: directions are then right to about 0.01°."""
SPRINGS = 30.0
"""Strength of the springs that impose levels, times the mean edge length."""
BYTES_PER_TET, BYTES_PER_FACTORED = 1750, 2900
"""Peak for each tet, by conjugate gradients and by factorisation. Measured."""


def memory_estimate(n_tets: int) -> float:
    """Bytes that a first distance on so many tets takes at the most.

    Examples
    --------
    >>> 0.9e9 < memory_estimate(580_000) < 1.1e9
    True
    """
    factored = min(n_tets, DIRECT_FACES // 2)  # a tet has about two faces of its own
    return max(BYTES_PER_TET * n_tets, BYTES_PER_FACTORED * factored)


@dataclass(frozen=True, eq=False)
class TetDiscretization(DiffusesEach):
    """The discretisation of a tet mesh.

    Parameters
    ----------
    mesh : TetMesh
        The domain.
    direct : bool
        Whether to factorise the system of step 1, instead of solving it by conjugate gradients.
    """

    mesh: TetMesh
    direct: bool
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
        """(m, 4) unknown of φ at each corner of each tet.

        Heat flows through faces only. Parts of the mesh that meet in an edge or a vertex only are separate domains, and
        a vertex of several parts has one unknown for each.
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
        """Step 3."""
        matrix = upper_triangle(self.mesh.geometry.vertex_laplacian(self.unknowns, self.n_unknowns))
        strength = SPRINGS / (3 * self.spacing)
        if self.n_unknowns <= DIRECT_VERTICES:
            return TetIntegration(matrix, strength=strength, gradients=self._gradients)
        return TetIntegration(matrix, factorize=from_first, spring=1e4, strength=strength, gradients=self._gradients)

    def _gradients(self, values: Floats) -> Floats:
        return np.nan_to_num(self.mesh.geometry.mean_gradients(values, self.unknowns, self.n_unknowns))

    def adapt(self, sources: Sequence[Any]) -> tuple[TetDiscretization, Sequence[Any]]:
        """The discretisation itself: sources need not conform to the tets."""
        return self, sources

    def lower(self, sources: Sequence[Any], diffusion: float) -> TetSource:
        """X₀ (Sec. 8.1; Eq. 11 in space) and the rows that average φ over the sources (Eq. 14)."""
        return tet_source(self.mesh, self.planes, self.unknowns, sources, diffusion, self.spacing)

    def diffuse(self, source: TetSource) -> Floats:
        """Solve ``(M + tL) X = X₀`` (Eq. 12): one vector per face, averaged in the tets (App. B.2)."""
        heat = self._heats(source.time, lambda: self._heat_system(source.time))
        if self._is_convex:
            return self._in_tets(heat.solve(source.vectors))[0]
        loads = np.concatenate([source.vectors, source.strengths[:, None]], axis=1)
        means, gradients, factors = self._in_tets(heat.solve(loads))
        with np.errstate(divide="ignore"):
            heights = np.log(np.maximum(means[:, 3], 0)) + factors
        neighbors = self.mesh.faces.neighbors
        return bend_around_corners(means[:, :3], -gradients, heights, neighbors, self._straight(source))

    def _heat_system(self, time: float) -> HeatSystem:
        """M + tL of Eq. 12, from the Laplacian of Eq. 21 and the mass of Eq. 23, lumped."""
        matrix, mass = self._laplacian * time, self.mesh.geometry.face_mass()
        matrix.setdiag(matrix.diagonal() + mass)
        return HeatSystem(matrix, self.direct, DIRECTION_ERROR)

    def _in_tets(self, stages: list[Stage]) -> tuple[Floats, Floats, Floats]:
        """Means of X in the tets, positive multiples of the gradient of its last column, and logarithms of its scale.

        Each tet takes them from the last stage in which all its four faces are known.
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
        """(m,) tets that the source reaches along a straight line."""
        planes, centers = self.planes, self.mesh.tet_barycenters
        nearest = source.centers[scipy.spatial.cKDTree(source.centers).query(centers)[1]]
        begins, ends = (np.ascontiguousarray(points - planes.center) for points in (centers, nearest))
        return visible(planes, self.mesh.faces.neighbors, begins, ends, GRAZING * self.spacing)

    @cached_property
    def _laplacian(self) -> sparse.csr_matrix:
        return self.mesh.geometry.face_laplacian()

    def to_cells(self, vectors: Floats) -> Floats:
        """X at the tets: `diffuse` has averaged it already."""
        return vectors

    @cached_property
    def _is_convex(self) -> bool:
        """Whether the mesh fills its convex hull."""
        try:
            hull = scipy.spatial.ConvexHull(self.mesh.vertices[np.unique(self.mesh.boundary.faces)])
        except scipy.spatial.QhullError:  # flat but for rounding
            return False
        return bool(self.mesh.tet_volumes.sum() >= (1 - 1e-9) * hull.volume)

    def divergence(self, directions: Floats) -> Floats:
        """b, the right-hand side of ``C φ = b`` (Eq. 13, Eq. 22)."""
        return self.mesh.geometry.divergence(directions, self.unknowns, self.n_unknowns)

    @cached_property
    def vertices(self) -> Ints:
        """(n,) vertex of the mesh that each unknown belongs to."""
        vertices = np.empty(self.n_unknowns, dtype=np.int64)
        vertices[self.unknowns] = self.mesh.tets
        return vertices

    def at_vertices(self, values: Floats) -> Floats:
        """(n_vertices,) values at the vertices: means over the unknowns of each, NaN where none has a value."""
        finite = np.flatnonzero(~np.isnan(values))
        vertices, n = self.vertices[finite], self.mesh.n_vertices
        counts, sums = np.bincount(vertices, minlength=n), np.bincount(vertices, values[finite], n)
        return np.where(counts > 0, sums / np.maximum(counts, 1), np.nan)


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
    """A tet mesh as the three steps see it, whether distance on it fits into memory or not."""
    return TetDiscretization(mesh, direct=len(mesh.faces.vertices) <= DIRECT_FACES)


@dataclass(frozen=True, eq=False)
class TetIntegration(SpringIntegration):
    """As `SpringIntegration`, and levels are corrected for the curvature of φ.

    The level at samples is corrected, because the linear interpolant of a curved function differs from it. The
    difference is known to second order from the gradients at the corners, once there is a first φ.

    Parameters
    ----------
    gradients : callable
        From φ at the unknowns to (n, 3) gradients there.
    """

    gradients: Callable[[Floats], Floats] = np.zeros_like

    def corrected(self, levels: Floats, solve: Callable[[Floats], Floats], source: SourceTerm) -> tuple[Floats, Floats]:
        """Levels less the quadratic correction of a first φ, and the φ with these."""
        values = levels - self._quadratic_correction(solve(levels), source)
        return values, solve(values)

    def fit_exactly(self, divergence: Floats, source: SourceTerm, levels: Levels) -> Floats:
        """Impose levels at the samples exactly (Eq. 14)."""
        correction = self._quadratic_correction(self.factor.solve(divergence), source)
        return super().fit_exactly(divergence, source, replace(levels, values=levels.values - correction))

    def penalize(self, divergence: Floats, source: SourceTerm, strength: float) -> Floats:
        """Solve ``(C + λ Aᵀ W A) φ = b`` (Sec. 7.1, Fig. 11), where A φ is corrected for the curvature of φ."""
        strength = min(strength, STIFFEST * float(self.stiffness.diagonal().max()) / float(source.weights.max()))
        free = super().penalize(divergence, source, strength)
        pull = source.interpolation.T @ (strength * source.weights * self._quadratic_correction(free, source))
        return super().penalize(divergence - pull, source, strength)

    def _at_samples(self, values: Floats, source: SourceTerm) -> Floats:
        return super()._at_samples(values, source) + self._quadratic_correction(values, source)

    def _quadratic_correction(self, values: Floats, source: SourceTerm) -> Floats:
        """(s,) φ minus its linear interpolant, on the source."""
        assert isinstance(source, TetSource)
        return source.quadratic_correction @ self.gradients(np.nan_to_num(values)).ravel()
