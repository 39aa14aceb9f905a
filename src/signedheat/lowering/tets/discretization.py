"""Tet meshes as a discretisation: one vector per face, one value per vertex (Sec. 8.1)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ...cache import LastUsed
from ...discretization import DiffusesEach, discretize
from ...domains.tet_mesh import TetMesh
from ...geometry.tet_clipping import Planes
from ...geometry.visibility import tet_neighbors, visible
from ...linear import upper_triangle
from ...linear.incomplete_cholesky import from_first
from ...linear.restarts import Stage
from ..heat_system import HeatSystem, bend_around_corners
from .integration import TetIntegration
from .source import TetSource, tet_source

DIRECT_FACES = 20_000
"""Up to this number of faces step 1 is factorised: that grows like n², conjugate gradients like n⁴ᐟ³."""

DIRECT_VERTICES = 40_000
"""Up to this number of vertices step 3 is factorised."""

DIRECTION_ERROR = 1e-3
"""Componentwise residual at which conjugate gradients stop: directions are then right to about 0.01°."""

SPRINGS = 30.0
"""Strength with which levels are imposed, over one edge length."""


@dataclass(frozen=True, eq=False)
class TetDiscretization(DiffusesEach):
    """A tet mesh as the three steps see it.

    Parameters
    ----------
    mesh : TetMesh
        The domain.
    direct : bool
        Whether to factorise the system of step 1; it is solved by conjugate gradients otherwise.
    """

    mesh: TetMesh
    direct: bool
    _heats: LastUsed[float, HeatSystem] = field(default_factory=LastUsed, init=False, repr=False)

    @cached_property
    def planes(self) -> Planes:
        """The planes of the faces, against which sources are clipped."""
        return Planes.of(self.mesh)

    @cached_property
    def spacing(self) -> float:
        """h: mean distance between the barycentres of two faces of a tet, a third of the edge between their corners."""
        corners = self.mesh.vertices[self.mesh.tets]
        pairs = [corners[:, a] - corners[:, b] for a in range(4) for b in range(a)]
        return float(np.mean([np.linalg.norm(edge, axis=1).mean() for edge in pairs])) / 3

    @cached_property
    def unknowns(self) -> NDArray[np.int64]:
        """(m, 4) unknown of φ at each corner.

        Heat flows through faces. Parts of the mesh that touch in an edge or a vertex alone are separate domains, and a
        vertex that they share is an unknown in each.
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

    def _gradients(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        return self.mesh.geometry.mean_gradients(values, self.unknowns, self.n_unknowns)

    def adapt(self, sources: Sequence[Any]) -> tuple[TetDiscretization, Sequence[Any]]:
        """Tets hold sources in any position."""
        return self, sources

    def lower(self, sources: Sequence[Any], diffusion: float) -> TetSource:
        """X₀ and the rows that average φ over the sources."""
        return tet_source(self.mesh, self.planes, self.unknowns, sources, diffusion, self.spacing)

    def diffuse(self, source: TetSource) -> NDArray[np.float64]:
        """Solve ``(M + tL) X = X₀``: one vector per face, averaged in the tets."""
        heat = self._heats(source.time, lambda: self._heat_system(source.time))
        if self._is_convex:
            return self._in_tets(heat.solve(source.vectors))[0]
        loads = np.concatenate([source.vectors, source.strengths[:, None]], axis=1)
        means, gradients, factors = self._in_tets(heat.solve(loads))
        with np.errstate(divide="ignore"):
            heights = np.log(np.maximum(means[:, 3], 0)) + factors
        neighbors = tet_neighbors(self.mesh.faces)
        return bend_around_corners(means[:, :3], -gradients, heights, neighbors, self._straight(source, neighbors))

    def _heat_system(self, time: float) -> HeatSystem:
        matrix, mass = self._laplacian * time, self.mesh.geometry.face_mass(self.mesh.faces)
        matrix.setdiag(matrix.diagonal() + mass)
        return HeatSystem(matrix, self.direct, DIRECTION_ERROR)

    def _in_tets(self, stages: list[Stage]) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Means of X, multiples of the gradient of its last column, and logarithms of the factors of both.

        They are those of the last stage that knows all four faces of a tet.
        """
        tet_faces = self.mesh.faces.tet_faces
        means, gradients, factors = None, None, np.full(self.mesh.n_tets, -np.inf)
        for vectors, factor in stages:
            of_faces = vectors[tet_faces]
            known = ~np.isnan(of_faces[..., 0]).any(axis=1)
            if means is None:
                means, gradients = np.zeros((self.mesh.n_tets, vectors.shape[1])), np.zeros((self.mesh.n_tets, 3))
            means[known] = of_faces[known].mean(axis=1)
            slopes = np.einsum("mki,mk->mi", self.mesh.geometry.area_vectors[known], of_faces[known, :, -1])
            gradients[known], factors[known] = slopes, factor
        return means, gradients, factors

    def _straight(self, source: TetSource, neighbors: NDArray[np.int64]) -> NDArray[np.bool_]:
        """(m,) tets that the source reaches along a straight line."""
        from scipy.spatial import cKDTree

        planes, centers = self.planes, self.mesh.tet_barycenters
        nearest = source.centers[cKDTree(source.centers).query(centers)[1]]
        ends = (np.ascontiguousarray(points - planes.center) for points in (centers, nearest))
        return visible(*ends, neighbors, self.mesh.faces.tet_faces, planes.normals, planes.offsets, planes.signs)

    @cached_property
    def _laplacian(self) -> sparse.csr_matrix:
        return self.mesh.geometry.face_laplacian(self.mesh.faces)

    def to_cells(self, vectors: NDArray[np.float64]) -> NDArray[np.float64]:
        """X at the tets, where it is already."""
        return vectors

    @cached_property
    def _is_convex(self) -> bool:
        """Whether the mesh fills its convex hull."""
        from scipy.spatial import ConvexHull

        hull = ConvexHull(self.mesh.vertices[np.unique(self.mesh.boundary.faces)])
        return bool(self.mesh.tet_volumes.sum() >= (1 - 1e-9) * hull.volume)

    def divergence(self, directions: NDArray[np.float64]) -> NDArray[np.float64]:
        """b, the right-hand side of ``C φ = b``."""
        return self.mesh.geometry.divergence(directions, self.unknowns, self.n_unknowns)

    @cached_property
    def vertices(self) -> NDArray[np.int64]:
        """(n,) vertex of the mesh at which each unknown is."""
        vertices = np.empty(self.n_unknowns, dtype=np.int64)
        vertices[self.unknowns] = self.mesh.tets
        return vertices

    def at_vertices(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values at the vertices of the mesh: means where parts of it touch, NaN where nothing is known."""
        known = np.flatnonzero(~np.isnan(values))
        vertices, n = self.vertices[known], self.mesh.n_vertices
        counts, sums = np.bincount(vertices, minlength=n), np.bincount(vertices, values[known], n)
        return np.where(counts > 0, sums / np.maximum(counts, 1), np.nan)


@discretize.register
def _(domain: TetMesh) -> TetDiscretization:
    return TetDiscretization(domain, direct=len(domain.faces.vertices) <= DIRECT_FACES)
