"""Lines on which a function jumps, found among jumps everywhere, and the function that jumps on these alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy import sparse

from ..arrays import Bools, Complexes, Floats, Ints
from ..linear import factorize
from ..mesh.components import connected_components
from ..mesh.intrinsic_mesh import FacePairs, IntrinsicMesh, split_corners
from ..mesh.polylines import assemble_polylines
from ..surfaces.cotan import cotan_matrix, divergence
from .piecewise_field import PiecewiseField

FAR = 3.0
"""Somewhere on a cut the jump is at least this many times the longest side of a typical triangle."""

TWIG = 5.0
"""A branch of a cut needs a jump of this many times that side, or half of the highest: where directions turn within
several triangles, there are lower ones."""

WIDTH = 10.0
"""Width of `smoothed`, over the root of the area of a part: step 3 to a thousandth. By more M is rounded away."""


def typical_size(triangles: IntrinsicMesh) -> float:
    """Return the longest side of a typical triangle."""
    return float(np.average(triangles.edge_lengths.max(axis=1), weights=triangles.face_areas))


def high_jumps(triangles: IntrinsicMesh, pairs: FacePairs, values: Floats) -> Bools:
    """(p,) pairs of faces between which (m, 3) values at corners jump, on lines, by more than errors in triangles."""
    longest, typical = triangles.edge_lengths.max(axis=1), typical_size(triangles)
    height = np.abs(pairs.ends(values)).max(axis=1)
    high = np.flatnonzero(height > np.maximum(longest[pairs.faces].max(axis=1), typical))
    ends = triangles.edges.vertices[pairs.edges[high]]
    n = triangles.n_vertices
    line = connected_components(n, *ends.T)[ends[:, 0]]
    far = np.zeros(n, dtype=bool)
    far[line[height[high] > FAR * typical]] = True
    high, line = high[far[line]], line[far[line]]
    highest = np.zeros(n)
    np.maximum.at(highest, line, height[high])
    least = np.minimum(TWIG * typical, 0.5 * highest[line])
    ends = triangles.edges.vertices[pairs.edges[high]]
    result = np.zeros(len(height), dtype=bool)
    result[high[without_twigs(ends, height[high] > least)]] = True
    return result


def without_twigs(edges: Ints, high: Bools) -> Bools:
    """(k,) which (k, 2) edges are left without the lines between ends and forks that are `high`, (k,), nowhere.

    Examples
    --------
    >>> twig, line = [3, 9], [[1, 2], [2, 3], [3, 4]]
    >>> without_twigs(np.array([twig, *line]), np.array([False, True, False, True])).tolist()
    [False, True, True, True]
    """
    once, which = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True)
    keeps = np.zeros(len(once), dtype=bool)
    keeps[which.ravel()[high]] = True
    left = np.arange(len(once))
    while True:
        chains = assemble_polylines(once[left, 0], once[left, 1], directed=False)
        low = [chain for chain, _, _ in chains if not keeps[left[chain]].any()]
        if not low:
            return np.isin(which.ravel(), left)
        left = np.delete(left, np.concatenate(low))


def is_continuous(
    triangles: IntrinsicMesh, pairs: FacePairs, slopes: Floats, directions: Complexes, constants: Floats
) -> bool:
    """Whether the constants of the faces leave no cut, neither as a line nor spread over many small jumps."""
    values = slopes + constants[:, None]
    if np.abs(pairs.ends(values)).max(initial=0.0) > FAR * typical_size(triangles):
        return False
    corners, n = triangles.corner_vertices, triangles.n_vertices
    mean = np.bincount(corners.ravel(), values.ravel(), n) / np.maximum(np.bincount(corners.ravel(), minlength=n), 1)
    rough = np.abs(gradients(triangles, mean[corners]) - directions) > 0.5
    for _ in range(2):  # two rows of faces around a rough one: where Y turns back, few are rough side by side
        inner = np.ones(n, dtype=bool)
        inner[corners[~rough]] = False
        rough = np.asarray(inner[corners].all(axis=1))
    return not bool(rough.any())


def gradients(triangles: IntrinsicMesh, at_corners: Floats) -> Complexes:
    """(m,) gradients of functions that are linear in every face, in its layout."""
    opposite = 1j * np.roll(triangles.edge_vectors, -1, axis=1)
    return (at_corners * opposite).sum(axis=1) / (2.0 * triangles.areas_as_divisors)


def smoothed(triangles: IntrinsicMesh, pairs: FacePairs, directions: Complexes, rough: Floats, cut: Bools) -> Floats:
    """(m, 3) values on the surface cut open: step 3 (Eq. 13), with constants of φ₀: ``(M + w² C) φ = M φ₀ + w² b``.

    Shapes: `directions` Y (m,), `rough` φ₀ (m, 3) at the corners of the triangles, `cut` (p,) of the `pairs`.
    """
    opened = cut_open(triangles, pairs, cut)
    owner = opened.corner_vertices.ravel()
    share = np.repeat(triangles.face_areas / 3.0, 3)
    mass = opened.vertex_areas
    stiffness = cotan_matrix(opened)
    part = sparse.csgraph.connected_components(stiffness, directed=False)[1]
    squared = WIDTH**2 * np.bincount(part, mass)[part]
    matrix = sparse.csr_matrix(sparse.diags_array(squared) @ stiffness + sparse.diags_array(mass))
    pulled = np.bincount(owner, share * rough.ravel()) + squared * divergence(opened, directions)
    return factorize(matrix).solve(pulled)[opened.corner_vertices]


def slope_error(triangles: IntrinsicMesh, at_corners: Floats, directions: Complexes) -> float:
    """Root mean square of ∇φ − Y, where φ is known."""
    finite = ~np.isnan(at_corners[:, 0])
    error = np.abs(gradients(triangles, at_corners) - directions)
    return float(np.sqrt(np.average(error[finite] ** 2, weights=triangles.face_areas[finite])))


def integration_error(phi: PiecewiseField, directions: Complexes) -> float:
    """Root mean square of ∇φ̄ − Y, where φ̄ averages φ over the corners at each vertex of the split surface."""
    owner = phi.split_vertices[0]
    mean = np.bincount(owner, phi.values.ravel()) / np.bincount(owner)
    return slope_error(phi.triangles, mean[owner].reshape(-1, 3), directions)


def cut_open(triangles: IntrinsicMesh, pairs: FacePairs, cut: Bools) -> IntrinsicMesh:
    """Return the triangles with vertices doubled along a cut."""
    owner = split_corners(triangles, pairs, cut)
    return replace(triangles, corner_vertices=owner.reshape(-1, 3), n_vertices=int(owner.max(initial=-1)) + 1)
