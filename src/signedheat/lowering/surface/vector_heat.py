"""Step 1 on an intrinsic mesh: one factorisation, with restarts where the solution would underflow."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from ...geometry.intrinsic_mesh import IntrinsicMesh
from ...geometry.triangle_kernels import extremes
from ...linear import Factor, factorize
from ...operators.crouzeix_raviart import vector_heat_forces, vector_heat_matrix

_FAINT = 2.0**-900  # relative to the largest X; smaller values may be wrong, because intermediate ones underflow


@dataclass(frozen=True, eq=False)
class VectorHeat:
    """Solver of ``(M + tL) X = X₀`` (Eq. 12) on the edges of triangles.

    X decays like exp(−r/√t) and leaves the range of floating-point numbers at about 300 mean edge lengths. Farther out
    it is solved for again: restricted to the faint edges, X satisfies the same equation with a right-hand side along
    their border, where X is still accurate. Scaled up, that is the next right-hand side for the same factor. The result
    is the exact solution of the original system, not that of a new source at the border.

    Parameters
    ----------
    triangles : IntrinsicMesh
        The surface.
    time : float
        t.
    order : (n_edges,) int
        Fill-reducing order of the edges.
    """

    triangles: IntrinsicMesh
    time: float
    order: NDArray[np.int64]

    @cached_property
    def factor(self) -> Factor:
        """The factor of M + tL."""
        matrix = vector_heat_matrix(self.triangles, self.time)
        parts = np.arange(matrix.shape[0] // self.triangles.n_edges)  # real and imaginary part, or one complex number
        return factorize(matrix, order=(len(parts) * self.order[:, None] + parts).ravel(), reused=True)

    @cached_property
    def _smallest_mass(self) -> float:
        """Least entry of M: |X| is at most |X₀| divided by it."""
        mass = np.bincount(self.triangles.edges.face_edges.ravel(), np.repeat(self.triangles.face_areas / 3.0, 3))
        return float(mass.min())

    def solve(self, sources: Sequence[csr_array]) -> list[list[NDArray[np.complex128]]]:
        """X for each X₀, in stages, each up to a positive factor, NaN between the source and the stage's border."""
        starts = np.zeros((len(sources), self.triangles.n_edges), dtype=np.complex128)
        for source, start in zip(sources, starts, strict=True):
            self._raise(source.indices, source.data, start)
        together = self._solve(starts.T)
        return [self._carried_on(start, near) for start, near in zip(starts, together.T, strict=True)]

    def _carried_on(self, start: NDArray[np.complex128], near: NDArray[np.complex128]) -> list[NDArray[np.complex128]]:
        stages = [near]
        smallest, largest = extremes(near)
        if smallest >= _FAINT * largest:
            return stages
        unknown = np.ones(len(near), dtype=bool)
        while True:
            size = np.where(unknown, _size(stages[-1]), 0.0)
            faint = unknown & (size < _FAINT * size.max())
            if not faint.any() or faint.sum() == unknown.sum():
                return stages
            border = self._at_border(stages[-1], faint, start)
            if not border.any():
                return stages
            start, held = np.zeros_like(border), np.flatnonzero(border)
            self._raise(held, border[held], start)
            stages.append(self._solve(start[:, None])[:, 0])
            stages[-1][~faint] = np.nan
            unknown = faint

    def _at_border(
        self, vectors: NDArray[np.complex128], faint: NDArray[np.bool_], start: NDArray[np.complex128]
    ) -> NDArray[np.complex128]:
        """(M + tL) applied to X on the faint edges and zero elsewhere."""
        edges = self.triangles.edges.face_edges
        of_face = faint[edges]
        near_border = np.zeros(len(faint), dtype=bool)
        near_border[edges[of_face.any(axis=1) & ~of_face.all(axis=1)]] = True
        around = np.flatnonzero(near_border[edges].any(axis=1))
        forces = vector_heat_forces(self.triangles, self.time, np.where(faint, vectors, 0), around)
        return np.where(near_border, forces, np.where(faint, start, 0))

    def _raise(
        self, edges: NDArray[np.integer], vectors: NDArray[np.complex128], start: NDArray[np.complex128]
    ) -> None:
        """Write vectors into `start`, scaled by a power of two so that the largest X will be about one."""
        largest = _size(vectors).max(initial=0.0)
        if largest > 0:
            steps = int(np.frexp(self._smallest_mass)[1] - np.frexp(largest)[1])
            start[edges] = np.ldexp(vectors.view(np.float64), steps).view(np.complex128)

    def _solve(self, columns: NDArray[np.complex128]) -> NDArray[np.complex128]:
        if self.factor.n == len(columns):
            return self.factor.solve(columns)
        pairs = np.stack([columns.real, columns.imag], axis=1).reshape(2 * len(columns), -1)
        solution = self.factor.solve(pairs)
        return solution[0::2] + 1j * solution[1::2]


def _size(vectors: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Maximum norm of each vector, since the square of its length would underflow."""
    return np.maximum(np.abs(vectors.real), np.abs(vectors.imag))
