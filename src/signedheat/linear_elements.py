"""Functions that are linear in every cell: what the convex problem of Eq. 17 and Eq. 18 needs of a domain."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from .arrays import Floats, Ints
from .mesh.intrinsic_mesh import IntrinsicMesh
from .mesh.tet_shapes import Tetrahedra


@dataclass(frozen=True, eq=False)
class LinearElements:
    """Linear finite elements on triangles or tets."""

    corners: Ints  # (m, d + 1) unknown at each corner of each cell
    sizes: Floats  # (m,) areas or volumes of the cells
    slope_matrix: sparse.csr_matrix  # (m d, n) maps values at the unknowns to the components of ∇φ, cell after cell

    @classmethod
    def of(cls, corners: Ints, sizes: Floats, hats: Floats, n: int) -> LinearElements:
        """Make elements of the gradients (m, d + 1, d) of the hat functions of each cell."""
        m, k = corners.shape
        d = hats.shape[2]
        columns = np.repeat(corners[:, None], d, axis=1)
        entries = hats.transpose(0, 2, 1).ravel(), columns.ravel(), k * np.arange(m * d + 1)
        return cls(corners, sizes, sparse.csr_matrix(entries, shape=(m * d, n)))

    @classmethod
    def on_triangles(cls, triangles: IntrinsicMesh) -> LinearElements:
        """Elements of a surface; gradients are in the layout of each face."""
        slopes = 1j * np.roll(triangles.edge_vectors, -1, axis=1) / (2.0 * triangles.face_areas)[:, None]
        hats = np.stack([slopes.real, slopes.imag], axis=2)
        return cls.of(triangles.corner_vertices, triangles.face_areas, hats, triangles.n_vertices)

    @classmethod
    def on_tets(cls, tets: Tetrahedra, corners: Ints, n: int) -> LinearElements:
        """Elements of a tet mesh; thin tets have a reduced weight, as they have in C, and flat ones none."""
        flat = tets.thickness < 1e-10
        hats = tets.area_vectors / np.where(flat, -np.inf, -3.0 * tets.volumes)[:, None, None]
        return cls.of(corners, np.where(flat, 0.0, tets.weights * tets.volumes), hats, n)

    @property
    def masses(self) -> Floats:
        """(n,) integrals of the hat functions: A_i of Eq. 18."""
        share = np.repeat(self.sizes / self.corners.shape[1], self.corners.shape[1])
        return np.asarray(np.bincount(self.corners.ravel(), share, self.slope_matrix.shape[1]), np.float64)

    def slopes(self, values: Floats) -> Floats:
        """(m, d) ∇φ in every cell, whose length Eq. 17 bounds by one."""
        return np.asarray(self.slope_matrix @ values).reshape(len(self.sizes), -1)

    def divergence(self, vectors: Floats) -> Floats:
        """b of Eq. 13, ``b_i = ∫ ⟨∇λ_i, Y⟩``, for one vector per cell."""
        return self.slope_matrix.T @ (self.sizes[:, None] * vectors).ravel()

    def slope_error(self, values: Floats) -> float:
        """Root mean square of ``|∇φ| − 1`` over the cells in which φ is known."""
        return float(np.sqrt(self._mean((np.linalg.norm(self.slopes(values), axis=1) - 1.0) ** 2)))

    def bounded_slope_error(self, values: Floats) -> float:
        """Mean of ``min(| |∇φ| − 1 |, 1)``: hardly moved by cells without height, nor by the kinks of a distance."""
        return self._mean(np.minimum(np.abs(np.linalg.norm(self.slopes(values), axis=1) - 1.0), 1.0))

    def _mean(self, errors: Floats) -> float:
        finite = np.isfinite(errors) & (self.sizes > 0)
        return float(np.average(errors[finite], weights=self.sizes[finite])) if finite.any() else float("nan")
