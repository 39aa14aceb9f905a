"""The cotan Laplacian (Eq. 10) and the divergence of face fields (Sec. 5.5)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ..arrays import Complexes, Floats, Ints
from ..mesh.intrinsic_mesh import IntrinsicMesh


def cotan_matrix(triangles: IntrinsicMesh) -> sparse.csr_matrix:
    """Return the upper triangle of C (Eq. 10), (n, n), the negative of the paper's matrix: ``φᵀ C φ = ∫ |∇φ|²``."""
    half = 0.5 * np.roll(triangles.corner_cotangents, 1, axis=1)  # the corner facing edge k is k + 2
    diagonal = half + np.roll(half, 1, axis=1)
    return assemble(triangles.corner_vertices, diagonal, -half, triangles.n_vertices)


def divergence(triangles: IntrinsicMesh, directions: Complexes) -> Floats:
    """(n,) b of Eq. 13, ``b_i = ∫ ⟨∇λ_i, Y⟩`` (Sec. 5.5), for (m,) directions Y of faces, in their layouts.

    It is the negative of the paper's divergence, as C is of its Laplacian. The area-weighted gradient of corner k's hat
    function is half the opposite edge, rotated inwards by 90°.
    """
    facing = np.roll(triangles.corner_vertices, 1, axis=1)  # edge k faces corner k + 2
    starts, shape = np.arange(0, facing.size + 1, 3), (triangles.n_vertices, triangles.n_faces)
    edges = sparse.csc_array((triangles.edge_vectors.ravel(), facing.ravel(), starts), shape)
    return -0.5 * (edges @ np.conj(directions)).imag


def assemble(unknowns: Ints, diagonal: Floats, coupling: NDArray[Any], n: int) -> sparse.csr_matrix:
    """Sum Hermitian 3×3 element matrices; return the upper triangle, (n, n), with its whole diagonal stored.

    For each element, `unknowns`, (m, 3), are its rows, `diagonal`, (m, 3), is its diagonal, and `coupling`, (m, 3), its
    entry in row k and column k + 1 (cyclically).
    """
    following = np.roll(unknowns, -1, axis=1)
    above = np.where(unknowns <= following, coupling, np.conj(coupling))
    above = np.where(unknowns == following, 2.0 * above.real, above)
    every, corners = np.arange(n), unknowns.ravel()
    rows = np.concatenate([every, corners, np.minimum(unknowns, following).ravel()]).astype(np.int32)
    columns = np.concatenate([every, corners, np.maximum(unknowns, following).ravel()]).astype(np.int32)
    entries = np.concatenate([np.zeros(n), diagonal.ravel(), above.ravel()])
    return sparse.coo_matrix((entries, (rows, columns)), shape=(n, n)).tocsr()
