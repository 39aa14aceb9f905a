"""Step 1 on an intrinsic mesh: one factorisation, with restarts where the solution would underflow."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from ..linear import Factor, factorize
from ..linear.restarts import Stage, restart, scaled
from ..mesh.intrinsic_mesh import IntrinsicMesh
from ..mesh.unit_vectors import unit
from .crouzeix_raviart import vector_heat_forces, vector_heat_matrix

EXPONENTS = (-1.0, 0.5)
"""Powers of t in the error of Y: cells that do not resolve exp(−r/√t) give h²/t, smoothing gives √t."""


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
    def mass(self) -> NDArray[np.float64]:
        """(n_edges,) the diagonal of M. |X| is at most |X₀| divided by its least entry."""
        thirds = np.repeat(self.triangles.face_areas / 3.0, 3)
        return np.bincount(self.triangles.edges.face_edges.ravel(), thirds).astype(np.float64)

    def solve(self, sources: Sequence[csr_array], changes: int = 0) -> list[list[NDArray[np.complex128]]]:
        """X for each X₀, in stages, each up to a positive factor, NaN between the source and the stage's border."""
        starts = np.zeros((self.triangles.n_edges, len(sources), 1 + changes), dtype=np.complex128)
        for k, source in enumerate(sources):
            starts[source.indices, k, 0] = scaled(source.data, float(self.mass.min()))[0]
        together = self._solve(starts)
        return [[s.values for s in self._restarted(starts[:, k], together[:, k])] for k in range(len(sources))]

    def _restarted(self, start: NDArray[np.complex128], values: NDArray[np.complex128]) -> list[Stage]:
        def solve(loads: NDArray[np.complex128]) -> NDArray[np.complex128]:
            return self._solve(loads[:, None])[:, 0]

        return restart(solve, self._border_forces, start, Stage(values, 0.0), float(self.mass.min()))

    def _border_forces(
        self, columns: NDArray[np.complex128], faint: NDArray[np.bool_]
    ) -> tuple[NDArray[np.bool_], NDArray[np.complex128]]:
        """What `_solve` undoes, applied to columns, at the edges of faces that are faint in part."""
        edges = self.triangles.edges.face_edges
        of_face = faint[edges]
        border = np.zeros(len(faint), dtype=bool)
        border[edges[of_face.any(axis=1) & ~of_face.all(axis=1)]] = True
        around = np.flatnonzero(border[edges].any(axis=1))
        forces = [vector_heat_forces(self.triangles, self.time, column, around) for column in columns.T]
        for k in range(1, len(forces)):
            forces[k] -= self.mass * columns[:, k - 1]
        return border, np.stack(forces, axis=1)

    def _solve(self, loads: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """(n_edges, k, c) ``(M + tL) X_j = X₀_j + M X_{j-1}`` along the last axis, for each of k columns."""
        solution = np.empty_like(loads)
        for j in range(loads.shape[2]):
            pushed = loads[:, :, j] if j == 0 else loads[:, :, j] + self.mass[:, None] * solution[:, :, j - 1]
            solution[:, :, j] = self._solve_columns(pushed)
        return solution

    def _solve_columns(self, columns: NDArray[np.complex128]) -> NDArray[np.complex128]:
        if self.factor.n == len(columns):
            return self.factor.solve(columns)
        pairs = np.stack([columns.real, columns.imag], axis=1).reshape(2 * len(columns), -1)
        solution = self.factor.solve(pairs)
        return solution[0::2] + 1j * solution[1::2]


def extrapolated(columns: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """(m,) directions without the errors of Y that go like the `EXPONENTS` of t, from (m, 3) columns X, R X and R² X.

    With ``D = t d/dt``, Richardson's extrapolation in the limit of equal times is ``Π (1 − D/e) Y`` over the exponents
    e: it keeps what does not depend on t, and takes ``t^e`` to zero. For ``R = (M + tL)⁻¹ M``, since ``tL = (M + tL) −
    M``, ``D X = R X − X`` and ``D² X = X − 3 R X + 2 R² X``; those of Y follow from the angle θ of X = exp(ρ + iθ).

    Examples
    --------
    >>> t, change = 4.0, 0.01 * (1 / 4.0)  # X = exp(i a/t): its angle is an error of exponent −1
    >>> X = np.exp(1j * change)
    >>> DX, DDX = -1j * change * X, (1j * change - change**2) * X
    >>> RX = DX + X
    >>> bool(abs(np.angle(extrapolated(np.array([[X, RX, (DDX - X + 3 * RX) / 2]]))[0])) < 1e-5)
    True
    """
    x, once, twice = columns.T
    with np.errstate(all="ignore"):
        first, second = once / x - 1.0, 1.0 - 3.0 * (once / x) + 2.0 * (twice / x)
        turn, bend = first.imag, (second - first**2).imag
        one, two = -sum(1.0 / e for e in EXPONENTS), 1.0 / float(np.prod(EXPONENTS))
        factor = 1.0 + 1j * one * turn + two * (1j * bend - turn**2)
    return unit(x.copy()) * np.where(np.isfinite(factor), factor, 1.0)
