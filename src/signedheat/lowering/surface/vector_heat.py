"""Step 1 on an intrinsic mesh: one factorisation, with restarts where the solution would underflow."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from ...geometry.intrinsic_mesh import IntrinsicMesh
from ...linear import Factor, factorize
from ...linear.restarts import Stage, restart, scaled
from ...operators.crouzeix_raviart import vector_heat_forces, vector_heat_matrix

TIMES = 3
"""Diffusion times whose factors are kept."""


@dataclass(frozen=True, eq=False)
class VectorHeat:
    """Solver of ``(M + tL) X = X₀`` (Eq. 12) on the edges of triangles.

    X falls like exp(−r/√t) and leaves the range of floating-point numbers at about 300 mean edge lengths. What lies
    beyond is solved for again with the same factor (`linear.restarts`).

    Parameters
    ----------
    triangles : IntrinsicMesh
        The surface.
    time : float
        t.
    order : (n_edges,) int
        Fill-reducing order of the edges.
    like : list of Factor
        The factor for another t, if there is one; the new one takes its place.
    """

    triangles: IntrinsicMesh
    time: float
    order: NDArray[np.int64]
    like: list[Factor] = field(default_factory=list)

    @cached_property
    def factor(self) -> Factor:
        """The factor of M + tL."""
        matrix = vector_heat_matrix(self.triangles, self.time)
        parts = np.arange(matrix.shape[0] // self.triangles.n_edges)  # real and imaginary part, or one complex number
        order = (len(parts) * self.order[:, None] + parts).ravel()
        like = self.like[0] if self.like else None
        self.like[:] = [factorize(matrix, order=order, reused=True, like=like, together=TIMES)]
        return self.like[0]

    @cached_property
    def _smallest_mass(self) -> float:
        """Least entry of M: |X| is at most |X₀| divided by it."""
        mass = np.bincount(self.triangles.edges.face_edges.ravel(), np.repeat(self.triangles.face_areas / 3.0, 3))
        return float(mass.min())

    def solve(self, sources: Sequence[csr_array]) -> list[list[NDArray[np.complex128]]]:
        """X for each X₀, in stages, each up to a positive factor, NaN between the source and the stage's border."""
        starts = np.zeros((len(sources), self.triangles.n_edges), dtype=np.complex128)
        for source, start in zip(sources, starts, strict=True):
            start[source.indices] = scaled(source.data, self._smallest_mass)[0]
        together = self._solve(starts.T)
        each = zip(starts, together.T, strict=True)
        return [[stage.values for stage in self._restarted(start, values)] for start, values in each]

    def _restarted(self, start: NDArray[np.complex128], values: NDArray[np.complex128]) -> list[Stage]:
        def solve(loads: NDArray[np.complex128]) -> NDArray[np.complex128]:
            return self._solve(loads[:, None])[:, 0]

        return restart(solve, self._border_forces, start, Stage(values, 0.0), self._smallest_mass)

    def _border_forces(
        self, vectors: NDArray[np.complex128], faint: NDArray[np.bool_]
    ) -> tuple[NDArray[np.bool_], NDArray[np.complex128]]:
        """(M + tL) applied to X, at the edges of faces that are faint in part."""
        edges = self.triangles.edges.face_edges
        of_face = faint[edges]
        border = np.zeros(len(faint), dtype=bool)
        border[edges[of_face.any(axis=1) & ~of_face.all(axis=1)]] = True
        around = np.flatnonzero(border[edges].any(axis=1))
        return border, vector_heat_forces(self.triangles, self.time, vectors, around)

    def _solve(self, columns: NDArray[np.complex128]) -> NDArray[np.complex128]:
        if self.factor.n == len(columns):
            return self.factor.solve(columns)
        pairs = np.stack([columns.real, columns.imag], axis=1).reshape(2 * len(columns), -1)
        solution = self.factor.solve(pairs)
        return solution[0::2] + 1j * solution[1::2]
