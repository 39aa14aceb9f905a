"""Step 1 of the method on an intrinsic mesh: vector heat on its edges, by one factorisation, restarted at underflow.

The connection Laplacian and mass are those of Crouzeix and Raviart (Eq. 8, Eq. 9). Frames at nonmanifold edges are
chosen so that heat enters the edge from its first face.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import sparse
from scipy.sparse import csr_array

from ..arrays import Bools, Complexes, Floats, Ints, mask_of
from ..geodesics.exact_distance import distances_along_edges
from ..linear import Factor, factorize
from ..linear.restarts import Stage, restart, scaled
from ..mesh.curve_segments import CurveSegments
from ..mesh.intrinsic_mesh import IntrinsicMesh
from ..mesh.surface_points import concatenated
from ..mesh.unit_vectors import unit
from .cotan import assemble

TIME_EXPONENTS = (-1.0, 0.5)
"""Powers of t in the errors of Y: h²/t, since cells do not resolve exp(−r/√t), and √t, from smoothing."""


@dataclass(frozen=True, eq=False)
class VectorHeat:
    """Solver of ``(M + tL) X = X₀`` (Eq. 12) on the edges of triangles, which are eliminated in a fill-reducing order.

    Beyond some 300 mean edge lengths X underflows, and is solved for again with the same factor (`linear.restarts`).
    """

    triangles: IntrinsicMesh
    time: float
    order: Ints

    @cached_property
    def factor(self) -> Factor:
        """The factor of M + tL."""
        matrix = vector_heat_matrix(self.triangles, self.time)
        parts = np.arange(matrix.shape[0] // self.triangles.n_edges)  # real and imaginary part, or one complex number
        return factorize(matrix, order=(len(parts) * self.order[:, None] + parts).ravel(), reused=True)

    @cached_property
    def mass(self) -> Floats:
        """(n_edges,) diagonal of M. |X| is at most |X₀| divided by its least entry."""
        thirds = np.repeat(self.triangles.face_areas / 3.0, 3)
        return np.bincount(self.triangles.edges.face_edges.ravel(), thirds).astype(np.float64)

    def solve(self, sources: Sequence[csr_array], changes: int = 0) -> list[list[Complexes]]:
        """Solve for each of the (1, n_edges) X₀; return a list of stages for each, (n_edges, 1 + `changes`).

        The columns of a stage are X, R X, R² X, …, with ``R = (M + tL)⁻¹ M``. Each later stage has values, with a scale
        of their own, only at edges where the one before has underflowed, and NaN elsewhere.
        """
        shape = self.triangles.n_edges, len(sources), 1 + changes
        starts = np.zeros(shape, dtype=np.complex128, order="F")  # each column is solved for, and read, at once
        for k, source in enumerate(sources):  # scaled so that |X| is at most about 1; only directions matter
            starts[source.indices, k, 0] = scaled(source.data, float(self.mass.min()))[0]
        first = self._solve(starts)
        return [[stage.values for stage in self._restarted(starts[:, k], first[:, k])] for k in range(len(sources))]

    def _restarted(self, start: Complexes, values: Complexes) -> list[Stage]:
        """Return the stages of one source, from its (n_edges, c) right-hand sides and the first solutions."""

        def solve(loads: Complexes) -> Complexes:
            """(n_edges, c) solutions for the right-hand sides of this source alone."""
            return self._solve(loads[:, None])[:, 0]

        return restart(solve, self._border_forces, start, Stage(values, 0.0), float(self.mass.min()))

    def _border_forces(self, columns: Complexes, faint: Bools) -> tuple[Bools, Complexes]:
        """(n_edges,) edges next to `faint` ones in a face, and (n_edges, c) right-hand sides of `_solve` there.

        These are what the matrix gives for the (n_edges, c) columns X_j of a solution that has underflowed elsewhere.
        """
        edges = self.triangles.edges.face_edges
        is_faint = faint[edges]
        border = mask_of(len(faint), edges[is_faint.any(axis=1) & ~is_faint.all(axis=1)])
        at_border = np.flatnonzero(border[edges].any(axis=1))
        forces = np.stack([vector_heat_forces(self.triangles, self.time, x, at_border) for x in columns.T], axis=1)
        forces[:, 1:] -= self.mass[:, None] * columns[:, :-1]
        return border, forces

    def _solve(self, loads: Complexes) -> Complexes:
        """(n_edges, k, c) solutions of ``(M + tL) X_j = X₀_j + M X_{j-1}``, j along the last axis, for k sources."""
        solution = np.empty_like(loads)
        for j in range(loads.shape[2]):
            pushed = loads[:, :, j] if j == 0 else loads[:, :, j] + self.mass[:, None] * solution[:, :, j - 1]
            solution[:, :, j] = self._solve_columns(pushed)
        return solution

    def _solve_columns(self, columns: Complexes) -> Complexes:
        """(n_edges, k) solutions of (M + tL) X = columns, whether the matrix is complex or has two rows per edge."""
        if self.factor.n == len(columns):
            return self.factor.solve(columns)
        pairs = np.stack([columns.real, columns.imag], axis=1).reshape(2 * len(columns), -1)
        solution = self.factor.solve(pairs)
        return solution[0::2] + 1j * solution[1::2]


def extrapolated(columns: Complexes) -> Complexes:
    """(m,) unit directions Y without errors like t to the `TIME_EXPONENTS`, from (m, 3) columns X, R X and R² X.

    With ``D = t d/dt`` it is ``Π (1 − D/e) Y`` over exponents e, which takes ``t^e`` to zero. For ``R = (M + tL)⁻¹ M``,
    ``D X = R X − X`` and ``D² X = X − 3 R X + 2 R² X``; those of Y follow from the angle θ of X = exp(ρ + iθ).
    """
    x, once, twice = columns.T
    linear, quadratic = -sum(1.0 / e for e in TIME_EXPONENTS), 1.0 / float(np.prod(TIME_EXPONENTS))
    factor = np.empty(x.shape, dtype=np.complex128)
    with np.errstate(all="ignore"):
        change, changes = once / x, twice / x
        turn = change.imag
        # the imaginary part of 1 − 3 R X / X + 2 R² X / X − (R X / X − 1)²
        bend = 2.0 * changes.imag - 3.0 * turn - 2.0 * (change.real - 1.0) * turn
        factor.real = 1.0 - quadratic * turn**2
        factor.imag = linear * turn + quadratic * bend
    factor[~np.isfinite(factor)] = 1.0
    return unit(x) * factor


def vector_heat_matrix(triangles: IntrinsicMesh, time: float) -> sparse.csr_matrix:
    """Return the upper triangle of ``M + t L`` (Eq. 12) in edge frames: complex (e, e), or real (2e, 2e).

    It is real if faces are not consistently oriented, since reflections are not complex factors.

    L (Eq. 9) has ``2 (cot α + cot β)`` on the diagonal, α and β the corners of a face at the ends of the edge, and ``−2
    cot θ conj(z_fe) z_fg`` between edges e and g that meet in θ (Eq. 8). M is a third of the area of each face.
    """
    edge, z = triangles.edges.face_edges, triangles.edge_directions
    diagonal, factor = _local_entries(triangles, time, slice(None))
    if triangles.is_consistently_oriented:
        return assemble(edge, diagonal, factor * np.conj(z) * np.roll(z, -1, axis=1), triangles.n_edges)
    return _real_form(triangles, diagonal, factor)


def vector_heat_forces(triangles: IntrinsicMesh, time: float, vectors: Complexes, faces: Ints) -> Complexes:
    """(n_edges,) ``(M + t L) X`` of Eq. 12, summed over some faces only, for (n_edges,) vectors X.

    It is complete at edges all of whose faces are among them.
    """
    diagonal, factor = _local_entries(triangles, time, faces)
    x = triangles.from_edge_frames(vectors[triangles.edges.face_edges[faces]], faces)
    forces = diagonal * x + factor * np.roll(x, -1, axis=1) + np.roll(factor * x, 1, axis=1)
    sums = np.zeros(len(vectors), dtype=np.complex128)
    np.add.at(sums, triangles.edges.face_edges[faces], triangles.in_edge_frames(forces, faces))
    return sums


def _local_entries(triangles: IntrinsicMesh, time: float, faces: Ints | slice) -> tuple[Floats, Floats]:
    """(m, 3) diagonal entries of M + tL, and (m, 3) entries between each edge and the next, before rotation (Eq. 8)."""
    cot = triangles.corner_cotangents[faces]
    following = np.roll(cot, -1, axis=1)  # at the corner that edge k shares with edge k + 1
    return triangles.face_areas[faces, None] / 3.0 + 2.0 * time * (cot + following), -2.0 * time * following


def _real_form(triangles: IntrinsicMesh, diagonal: np.ndarray, factor: np.ndarray) -> sparse.csr_matrix:
    """Assemble the real (2e, 2e) matrix of blocks ``B_feᵀ B_fg``, whose columns B_fe are the axes of edge e in face f.

    These are weighted by the entries of ``M + tL`` before rotation: `diagonal`, (m, 3), at the edges of each face, and
    `factor`, (m, 3), between each edge and the next.
    """
    edge, z = triangles.edges.face_edges, triangles.edge_directions
    rows, columns = edge.ravel(), np.roll(edge, -1, axis=1).ravel()
    second = np.where(triangles.reflected, -1j, 1j) * z
    frame = np.stack([_components(z), _components(second)], axis=-1)
    blocks = factor[..., None, None] * np.einsum("fkab,fkac->fkbc", frame, np.roll(frame, -1, axis=1))
    bits = np.arange(2)
    i = np.broadcast_to(2 * rows[:, None, None] + bits[:, None], (len(rows), 2, 2)).ravel()
    j = np.broadcast_to(2 * columns[:, None, None] + bits, (len(rows), 2, 2)).ravel()
    k = (2 * edge.ravel()[:, None] + bits).ravel()
    n = 2 * triangles.n_edges
    ij = np.concatenate([i, j, k]), np.concatenate([j, i, k])
    values = np.concatenate([blocks.ravel(), blocks.ravel(), np.repeat(diagonal.ravel(), 2)])
    matrix = sparse.triu(sparse.coo_matrix((values, ij), shape=(n, n)), format="csr")
    matrix.sum_duplicates()
    return matrix


def _components(vectors: np.ndarray) -> np.ndarray:
    """(..., 2) real and imaginary parts of complex numbers."""
    return np.stack([vectors.real, vectors.imag], axis=-1)


def nonmanifold_frames(
    triangles: IntrinsicMesh, groups: Sequence[Sequence[CurveSegments]]
) -> tuple[IntrinsicMesh, Sequence[Sequence[CurveSegments]]]:
    """Make the face nearest to the sources the first face of every edge with more than two faces.

    Heat that passes between two other faces is reflected. Edges whose ends are nearer still keep their first face.
    Return the triangles with these frames, and the groups of segments with vectors in them.
    """
    table = triangles.edges
    if table.face_counts.max(initial=0) <= 2:
        return triangles, groups
    parts = [part for group in groups for part in group]
    if not parts:
        return triangles, groups
    distance = _distances(triangles, parts)
    holds = mask_of(triangles.n_faces, np.concatenate([part.faces[part.edges < 0] for part in parts]))
    side = np.flatnonzero(table.face_counts[table.face_edges].ravel() > 2)
    edge = table.face_edges.ravel()[side]
    opposite = np.roll(triangles.corner_vertices, -2, axis=1).ravel()[side]
    ends = distance[table.vertices[edge]].mean(axis=1)
    first = np.full(triangles.n_edges, -1)
    first[table.face_edges.ravel()[triangles.first_halfedges]] = triangles.first_halfedges
    away = np.where(holds[side // 3], -1.0, distance[opposite])
    order = np.lexsort([side != first[edge], away, edge])  # among equally near faces the first stays first
    nearest = order[np.append(True, np.diff(edge[order]) > 0)]
    nearest = nearest[(away[nearest] < ends[nearest]) & (side[nearest] != first[edge[nearest]])]
    if not len(nearest):
        return triangles, groups
    changed = mask_of(triangles.n_edges, edge[nearest])
    first[edge[nearest]] = side[nearest]
    reframed = replace(triangles, leading_sides=first[first >= 0])
    return reframed, [[mirrored(part, changed) for part in group] for group in groups]


def mirrored(part: CurveSegments, changed: Bools) -> CurveSegments:
    """Reflect the vectors of segments along edges whose frames have `changed`, (e,)."""
    on_changed = (part.edges >= 0) & changed[part.edges]
    return replace(part, vectors=np.where(on_changed, np.conj(part.vectors), part.vectors))


def _distances(triangles: IntrinsicMesh, parts: Sequence[CurveSegments]) -> Floats:
    """(n_vertices,) distance from the sources: straight to the corners of their faces, and then along edges."""
    nodes = concatenated([part.nodes for part in parts])
    corners = triangles.corner_positions[nodes.faces]
    positions = np.einsum("nk,nk->n", nodes.barycentric, corners)
    vertices = triangles.corner_vertices[nodes.faces].ravel()
    return distances_along_edges(triangles, vertices, np.abs(corners - positions[:, None]).ravel())
