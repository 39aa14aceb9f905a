"""Intrinsic mollification: degenerate triangles made slightly thicker, by edge lengths alone (Sharp & Crane 2020)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..errors import GeometryError
from .intrinsic_mesh import IntrinsicMesh
from .meshes import Triangles

MARGIN = 1e-14
"""Margin of the triangle inequalities, relative to the mean length, to which flat triangles are mollified at least."""


def mollify(lengths: NDArray[np.float64], margin: float) -> tuple[NDArray[np.float64], float]:
    """Add one length δ to all edges, the smallest for which every triangle inequality holds with a margin.

    Parameters
    ----------
    lengths : (m, 3) float
        Edge lengths of every face.
    margin : float
        Least ``a + b − c`` in every triangle, as a fraction of the mean length.

    Returns
    -------
    (m, 3) float
        The new lengths; the given array itself if δ is zero.
    float
        δ.

    Examples
    --------
    >>> mollify(np.array([[1.0, 1.0, 2.0]]), 0.09375)
    (array([[1.125, 1.125, 2.125]]), 0.125)
    """
    longest = lengths.max(axis=1)
    slack = float((lengths.sum(axis=1) - 2.0 * longest).min())
    added = margin * float(lengths.mean()) - slack
    return (lengths + added, added) if added > 0 else (lengths, 0.0)


def laid_out(mesh: Triangles, margin: float) -> tuple[IntrinsicMesh, float]:
    """The intrinsic mesh of a mesh, mollified, and the length that mollification has added to all edges.

    Raises
    ------
    GeometryError
        If the mesh has no more area than rounding of its coordinates may make.

    Examples
    --------
    >>> from signedheat import TriangleMesh
    >>> flat = TriangleMesh([[0, 0, 0], [4, 0, 0], [1, 1, 0], [0, 0, 0]], [[0, 1, 2], [0, 1, 3]])
    >>> triangles, added = laid_out(flat, 1e-6)
    >>> bool(0 < added < 1e-5 and triangles.face_areas.min() > 0)
    True
    """
    corners = mesh.vertices[mesh.faces]
    sides = np.roll(corners, -1, axis=1) - corners
    lengths = np.linalg.norm(sides, axis=2)
    area = 0.5 * float(np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1).sum())
    if not area > 2 * np.finfo(np.float64).eps * float(np.abs(mesh.bounds).max()) * float(lengths.sum()):
        raise GeometryError(
            f"all {mesh.n_faces} faces have no area, or none beyond rounding: there is nothing to measure distance on",
            remedy="check the coordinates; move shapes that are far away to the origin",
            element="faces",
        )
    lengths, added = mollify(lengths, margin)
    return IntrinsicMesh.from_lengths(mesh.faces, lengths, mesh.n_vertices, mesh.edges), added
