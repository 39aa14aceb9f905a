"""Positions of the corners of voxel faces for which the faces are nearly orthogonal to given normals."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ..linear.conjugate_gradients import conjugate_gradients

STAY = 0.1
"""Weight of staying in place: corners move by averages over 1/√0.1, about 3 voxels, as staircases need."""


def smoothed_corners(
    vertices: NDArray[np.float64], corners: NDArray[np.int64], normals: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(n, 3) positions p that minimise ``Σ (n_f · (p_j − p_i))² + STAY Σ |p_i − v_i|²`` over the sides ij of squares f.

    The sides of squares become orthogonal to the normals, while corners stay near where they were, after Coeurjolly,
    Lachaud & Gueth, *Digital surface regularization with guarantees* (2021). The squares then have the lengths of the
    surface that was digitised, and neighbours agree on them; projected one by one they do not.

    Examples
    --------
    A step of one voxel in a slope of 45° becomes straight.

    >>> vertices = np.array([[0, 0, 0], [1, 0, 0], [1, 0, 1], [2, 0, 1.0]])
    >>> vertices = np.concatenate([vertices, vertices + [0, 1, 0]])
    >>> corners = np.array([[0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6]])
    >>> normals = np.tile([-(0.5**0.5), 0, 0.5**0.5], (3, 1))
    >>> smooth = smoothed_corners(vertices, corners, normals)
    >>> heights = (smooth[:4] - smooth[0]) @ normals[0]
    >>> bool(np.abs(heights).max() < 0.25)  # 0.7 before
    True
    """
    m, n = len(corners), len(vertices)
    row, tails, heads = np.arange(4 * m), corners.ravel(), np.roll(corners, -1, axis=1).ravel()
    along = np.repeat(normals, 4, axis=0).ravel()
    axes = np.arange(3)
    columns = np.concatenate([(3 * heads[:, None] + axes).ravel(), (3 * tails[:, None] + axes).ravel()])
    rows = np.tile(np.repeat(row, 3), 2)
    heights = sparse.csr_matrix((np.concatenate([along, -along]), (rows, columns)), shape=(4 * m, 3 * n))
    matrix = sparse.csr_matrix(heights.T @ heights + STAY * sparse.identity(3 * n))
    center = vertices.mean(axis=0)
    moved = conjugate_gradients(
        lambda x: matrix @ x, -(heights.T @ (heights @ (vertices - center).ravel())), tolerance=1e-8
    )
    return vertices + moved.reshape(n, 3)
