"""Slopes of piecewise distance, once its corners are averaged at the vertices: continuity, error and smoothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ..fields.piecewise_field import FAR, PiecewiseField, typical_size
from ..geometry.face_pairs import FacePairs
from ..geometry.intrinsic_mesh import IntrinsicMesh
from ..linear import factorize
from ..operators.cotan import cotan_matrix


def is_continuous(
    triangles: IntrinsicMesh,
    pairs: FacePairs,
    slopes: NDArray[np.float64],
    directions: NDArray[np.complex128],
    constants: NDArray[np.float64],
) -> bool:
    """Whether the constants of the faces leave no cut, neither as a line nor spread over many small jumps.

    Spread out, it makes ∇φ̄, of the means φ̄ of φ at the vertices, differ from Y by more than a half in all faces around
    the corners of some face. Where Y turns back, at equal distance from two parts of the source, few faces in a row do.
    """
    values = slopes + constants[:, None]
    if np.abs(pairs.ends(values)).max(initial=0.0) > FAR * typical_size(triangles):
        return False
    corners, n = triangles.corner_vertices, triangles.n_vertices
    mean = np.bincount(corners.ravel(), values.ravel(), n) / np.maximum(np.bincount(corners.ravel(), minlength=n), 1)
    rough = np.abs(gradients(triangles, mean[corners]) - directions) > 0.5
    around = np.ones(n, dtype=bool)
    around[corners[~rough]] = False
    return not around[corners].all(axis=1).any()


def gradients(triangles: IntrinsicMesh, at_corners: NDArray[np.float64]) -> NDArray[np.complex128]:
    """(m,) gradients of functions that are linear in every face, in its layout."""
    opposite = 1j * np.roll(triangles.edge_vectors, -1, axis=1)
    result: NDArray[np.complex128] = (at_corners * opposite).sum(axis=1) / (2.0 * triangles.areas_as_divisors)
    return result


def smoothed(phi: PiecewiseField, width: float) -> NDArray[np.float64]:
    """(m, 3) corner values after heat flow on the surface split along the cut: ``(M + ½ width² C) φ = M φ₀``."""
    opened, first, mass = split_triangles(phi)
    matrix = sparse.csr_matrix(0.5 * width**2 * cotan_matrix(opened) + sparse.diags_array(mass))
    start = np.nan_to_num(first)
    return np.where(np.isnan(phi.values), np.nan, factorize(matrix).solve(mass * start)[opened.corner_vertices])


def integration_error(phi: PiecewiseField, directions: NDArray[np.complex128]) -> float:
    """Root mean square of ∇φ̄ − Y, where φ̄ averages φ over the corners at each vertex of the split surface."""
    opened, mean, _ = split_triangles(phi)
    known = ~np.isnan(phi.values[:, 0])
    error = np.abs(gradients(phi.triangles, mean[opened.corner_vertices]) - directions)
    return float(np.sqrt(np.average(error[known] ** 2, weights=phi.triangles.face_areas[known])))


def split_triangles(phi: PiecewiseField) -> tuple[IntrinsicMesh, NDArray[np.float64], NDArray[np.float64]]:
    """The triangles with vertices doubled along the cut, and the mean value and lumped mass at each vertex."""
    owner, vertices = phi.split_vertices
    opened = replace(phi.triangles, corner_vertices=owner.reshape(-1, 3), n_vertices=len(vertices))
    mean = np.bincount(owner, phi.values.ravel()) / np.bincount(owner)
    masses = np.asarray(np.bincount(owner, np.repeat(phi.triangles.face_areas / 3.0, 3)), dtype=np.float64)
    return opened, mean, masses
