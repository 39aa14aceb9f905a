"""Vector heat on the edges of an intrinsic mesh: the Crouzeix–Raviart connection Laplacian and mass (Eq. 8, Eq. 9)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ..mesh.intrinsic_mesh import IntrinsicMesh
from .cotan import assemble


def vector_heat_matrix(triangles: IntrinsicMesh, time: float) -> sparse.csr_matrix:
    """Upper triangle of ``M + t L``, the matrix of Eq. 12: one vector unknown per edge, in the frame of the edge.

    L is the connection Laplacian of Eq. 9, positive semidefinite here: ``2 (cot α + cot β)`` on the diagonal, α and β
    the corners of a face at the two ends of the edge, and ``−2 cot θ conj(z_fe) z_fg`` between edges e and g that meet
    in the corner θ; ``conj(z_fe) z_fg`` is the rotation of Eq. 8. M is diagonal: a third of the area of each face. No
    face may be degenerate.

    Complex Hermitian (e, e) where all frames agree with their faces; otherwise, since a reflection is not a complex
    number, the real form (2e, 2e) with the real and imaginary part of each unknown in turn.
    """
    edge, z = triangles.edges.face_edges, triangles.edge_directions
    diagonal, factor = _local_entries(triangles, time, slice(None))
    if triangles.is_consistently_oriented:
        return assemble(edge, diagonal, factor * np.conj(z) * np.roll(z, -1, axis=1), triangles.n_edges)
    return _real_form(triangles, diagonal, factor)


def vector_heat_forces(
    triangles: IntrinsicMesh, time: float, vectors: NDArray[np.complex128], faces: NDArray[np.int64]
) -> NDArray[np.complex128]:
    """``(M + t L) X`` of Eq. 12, summed over some faces only: complete at edges all of whose faces are among them."""
    diagonal, factor = _local_entries(triangles, time, faces)
    x = triangles.in_face_frames(vectors, faces)
    forces = diagonal * x + factor * np.roll(x, -1, axis=1) + np.roll(factor * x, 1, axis=1)
    sums = np.zeros(len(vectors), dtype=np.complex128)
    np.add.at(sums, triangles.edges.face_edges[faces], triangles.in_edge_frames(forces, faces))
    return sums


def _local_entries(
    triangles: IntrinsicMesh, time: float, faces: NDArray[np.int64] | slice
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(m, 3) diagonal entries of M + tL; (m, 3) entries between each edge and the next, before the turn of Eq. 8."""
    cot = triangles.corner_cotangents[faces]
    following = np.roll(cot, -1, axis=1)  # at the corner that edge k shares with edge k + 1
    return triangles.face_areas[faces, None] / 3.0 + 2.0 * time * (cot + following), -2.0 * time * following


def _real_form(triangles: IntrinsicMesh, diagonal: np.ndarray, factor: np.ndarray) -> sparse.csr_matrix:
    """The real matrix of blocks ``B_feᵀ B_fg``; the columns of B_fe are the axes of the edge's frame in the face."""
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
    return np.stack([vectors.real, vectors.imag], axis=-1)
