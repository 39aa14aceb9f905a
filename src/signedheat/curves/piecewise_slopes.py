"""Slopes of piecewise distance: step 3 on the surface cut open, continuity, error and smoothing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ..fields.piecewise_field import PiecewiseField
from ..geometry.face_pairs import FacePairs, split_corners
from ..geometry.intrinsic_mesh import IntrinsicMesh
from ..linear import factorize
from ..operators.cotan import cotan_matrix, divergence
from .cut_lines import FAR, Opened, high_jumps, typical_size, unforked

WIDEST = 10.0
"""Greatest width, over the root of the area of a part: that is step 3 all but alone. Beside w² C rounding took M."""


def is_continuous(
    triangles: IntrinsicMesh,
    pairs: FacePairs,
    slopes: NDArray[np.float64],
    directions: NDArray[np.complex128],
    constants: NDArray[np.float64],
) -> bool:
    """Whether the constants of the faces leave no cut, neither as a line nor spread over many small jumps.

    Spread out, it makes ∇φ̄, of the means φ̄ of φ at the vertices, differ from Y by more than a half in two rows of faces
    around some face. Where Y turns back, at equal distance from two parts of the source, few faces side by side do.
    """
    values = slopes + constants[:, None]
    if np.abs(pairs.ends(values)).max(initial=0.0) > FAR * typical_size(triangles):
        return False
    corners, n = triangles.corner_vertices, triangles.n_vertices
    mean = np.bincount(corners.ravel(), values.ravel(), n) / np.maximum(np.bincount(corners.ravel(), minlength=n), 1)
    rough = np.abs(gradients(triangles, mean[corners]) - directions) > 0.5
    for _ in range(2):
        inner = np.ones(n, dtype=bool)
        inner[corners[~rough]] = False
        rough = np.asarray(inner[corners].all(axis=1))
    return not bool(rough.any())


def gradients(triangles: IntrinsicMesh, at_corners: NDArray[np.float64]) -> NDArray[np.complex128]:
    """(m,) gradients of functions that are linear in every face, in its layout."""
    opposite = 1j * np.roll(triangles.edge_vectors, -1, axis=1)
    result: NDArray[np.complex128] = (at_corners * opposite).sum(axis=1) / (2.0 * triangles.areas_as_divisors)
    return result


def smoothed(
    triangles: IntrinsicMesh,
    pairs: FacePairs,
    directions: NDArray[np.complex128],
    rough: NDArray[np.float64],
    cut: NDArray[np.bool_],
    width: float,
) -> tuple[NDArray[np.float64], float]:
    """(m, 3) values continuous off the cut, and the error of their slopes: ``(M + w² C) φ = M φ₀ + w² b``.

    The heat flow of Fig. 12 on what φ₀ differs by from a function of slopes Y, so that it does not flatten those. It
    minimises ``∫ (φ − φ₀)² + w² ∫ |∇φ − Y|²`` on the surface cut open: within the width w it is step 3 (Eq. 13), which
    alone would spread over all of the surface what the cut does not take up.

    Parameters
    ----------
    triangles, pairs : IntrinsicMesh, FacePairs
        The surface.
    directions : (m,) complex
        Y.
    rough : (m, 3) float
        φ₀ at the corners of the triangles.
    cut : (p,) bool
        The pairs of faces that the cut separates.
    width : float
        w; more than `WIDEST` is that.
    """
    opened = cut_open(triangles, pairs, cut)
    owner = opened.corner_vertices.ravel()
    share = np.repeat(triangles.face_areas / 3.0, 3)
    mass = np.asarray(np.bincount(owner, share), dtype=np.float64)
    stiffness = cotan_matrix(opened)
    part = sparse.csgraph.connected_components(stiffness, directed=False)[1]
    squared = np.minimum(width**2, WIDEST**2 * np.bincount(part, mass))[part]
    matrix = sparse.csr_matrix(sparse.diags_array(squared) @ stiffness + sparse.diags_array(mass))
    pulled = np.bincount(owner, share * rough.ravel()) + squared * divergence(opened, directions)
    at_corners = factorize(matrix).solve(pulled)[opened.corner_vertices]
    return at_corners, slope_error(triangles, at_corners, directions)


def on_lines(
    triangles: IntrinsicMesh,
    pairs: FacePairs,
    directions: NDArray[np.complex128],
    width: float,
    rough: NDArray[np.float64],
    progress: Callable[[float], None] | None = None,
) -> Opened:
    """Values `smoothed` between the lines on which rough ones jump, less forks.

    `progress` is called with the fraction of the cut that is gone, each time that the surface has been cut open.
    """
    lines = high_jumps(triangles, pairs, rough)

    def integrate(cut: NDArray[np.bool_]) -> tuple[NDArray[np.float64], float]:
        if progress is not None:
            progress(1.0 - cut.sum() / max(lines.sum(), 1))
        return smoothed(triangles, pairs, directions, rough, cut, width)

    return unforked(triangles, pairs, lines, integrate)


def slope_error(triangles: IntrinsicMesh, at_corners: NDArray[np.float64], directions: NDArray[np.complex128]) -> float:
    """Root mean square of ∇φ − Y, where φ is known."""
    known = ~np.isnan(at_corners[:, 0])
    error = np.abs(gradients(triangles, at_corners) - directions)
    return float(np.sqrt(np.average(error[known] ** 2, weights=triangles.face_areas[known])))


def integration_error(phi: PiecewiseField, directions: NDArray[np.complex128]) -> float:
    """Root mean square of ∇φ̄ − Y, where φ̄ averages φ over the corners at each vertex of the split surface."""
    owner = phi.split_vertices[0]
    mean = np.bincount(owner, phi.values.ravel()) / np.bincount(owner)
    return slope_error(phi.triangles, mean[owner].reshape(-1, 3), directions)


def cut_open(triangles: IntrinsicMesh, pairs: FacePairs, cut: NDArray[np.bool_]) -> IntrinsicMesh:
    """The triangles with vertices doubled along a cut."""
    owner = split_corners(triangles, pairs, cut)
    return replace(triangles, corner_vertices=owner.reshape(-1, 3), n_vertices=int(owner.max(initial=-1)) + 1)
