"""Orientation of small pieces without neighbours across edges, by what lies near them."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

from ..geometry.components import sums_of
from ..geometry.meshes import area_vectors
from ..geometry.outward_signs import outward_signs
from ..geometry.plane_fits import fit_planes, noise_scale

N_SAMPLES = 20_000
"""Points on loose triangles: at least one on each, and as many more as its share of the area is."""
N_NEIGHBORS = 12
"""Neighbours that a piece is compared with."""
N_AROUND = 24
"""Neighbours of a piece, itself included, whose agreement is measured."""
SMOOTH = 0.7
"""Mean square of the cosines between normals of neighbours from which they are evidence; ⅓ if normals are random."""
LEAST_AGREEMENT = 0.6
"""How clearly neighbours must agree (1: all their normals along one line, the same way) to turn a piece."""
ROUNDS = 4
"""Times that pieces turn which clearly disagree with their neighbours."""
AT_CORNERS = 5.0
"""Logarithm of the odds that a small part faces as those do that it touches, all of them parallel to it."""


def orient_triangles(corners: NDArray[np.float64], groups: NDArray[np.int64] | None = None) -> NDArray[np.float64]:
    """(m,) signs, −1 for triangles to turn round so that loose triangles, taken together, face outwards.

    Parameters
    ----------
    corners : (m, 3, 3) float
        Corners of triangles, of which nothing is known to be connected. Their order is evidence: weak, and relative; if
        most are inverted, that is found out.
    groups : (m,) int, optional
        Triangles of the same group, which agree with each other, share one sign.

    Notes
    -----
    Groups without area keep their order.

    Examples
    --------
    >>> from signedheat import samples
    >>> mesh = samples.sphere(3)
    >>> corners = mesh.vertices[mesh.faces]
    >>> corners[::2] = corners[::2, ::-1]
    >>> signs = orient_triangles(corners)
    >>> bool((signs[::2] == -1).all() and (signs[1::2] == 1).all())
    True
    """
    vectors = area_vectors(corners)
    areas = np.linalg.norm(vectors, axis=1)
    members = np.arange(len(corners)) if groups is None else groups
    signs = np.ones(int(members.max(initial=-1)) + 1)
    solid = np.flatnonzero(areas > 0)
    counts = np.maximum(1, np.rint(areas[solid] / max(areas.sum(), np.finfo(float).tiny) * N_SAMPLES)).astype(np.int64)
    owners = np.repeat(np.arange(len(solid)), counts)
    order = np.arange(len(owners)) - np.repeat(np.cumsum(counts) - counts, counts)
    points = _spread(corners[solid][owners], order, counts[owners])
    distinct = np.sort(np.unique(points, axis=0, return_index=True)[1])
    points, owners = points[distinct], solid[owners[distinct]]
    if len(points) >= 4:
        present, kept = np.unique(members[owners], return_inverse=True)
        fits = fit_planes(points, noise_scale(points))
        axes = vectors[owners] / areas[owners, None]
        signs[present[kept.ravel()]] = outward_signs(fits, axes, True, kept.ravel()).signs
    return signs[members]


def _spread(corners: NDArray[np.float64], order: NDArray[np.int64], counts: NDArray[np.int64]) -> NDArray[np.float64]:
    """The centroid where a triangle has one sample; else samples spread evenly by a sequence of low discrepancy.

    The sequence is that of Roberts (2018), with steps of the inverse plastic number and its square.
    """
    plastic = 1.324717957244746
    u, v = np.mod(0.5 + order / plastic, 1.0), np.mod(0.5 + order / plastic**2, 1.0)
    root = np.sqrt(u)
    weights = np.stack([1 - root, root * (1 - v), root * v], axis=1)
    weights = np.where((counts == 1)[:, None], 1 / 3, weights)
    return (weights[:, :, None] * corners).sum(axis=1)


def odds_at_corners(
    corners: NDArray[np.int64],
    parts: NDArray[np.int64],
    normals: NDArray[np.float64],
    odds: NDArray[np.float64],
    small: NDArray[np.bool_],
) -> NDArray[np.float64]:
    """Logarithms of the odds that parts face the right way, given what small ones touch at corners: most face alike.

    Corners of faces have a place, a part and a unit normal or zero. Small parts follow others: those that do not, or
    that have followed some already.
    """
    odds = odds.copy()
    undecided = small.copy()
    n_places = int(corners.max(initial=-1)) + 1
    for _ in range(16):
        weights = np.where(undecided, 0.0, np.tanh(0.5 * odds))[parts]
        sums = sums_of(weights[:, None] * normals, corners, n_places)
        here = np.flatnonzero(undecided[parts])
        around = sums[corners[here]]
        balance = np.bincount(parts[here], np.einsum("ij,ij->i", around, normals[here]), len(odds))
        cast = np.bincount(parts[here], np.linalg.norm(around, axis=1), len(odds))
        found = undecided & (cast > 0.5)
        if not found.any():
            break
        odds[found] += AT_CORNERS * balance[found] / cast[found]
        undecided &= ~found
    return odds


def agreement(centroids: NDArray[np.float64], vectors: NDArray[np.float64]) -> float:
    """From about ⅕, where pieces face either way at random, to 1, where all face as those around them do.

    The length of the sum of the area vectors of `N_AROUND` neighbours, over the sum of their lengths.
    """
    tree = scipy.spatial.cKDTree(centroids)
    _, near = tree.query(centroids, k=min(N_AROUND, len(centroids)), workers=-1)
    sums, lengths = np.zeros_like(vectors), np.zeros(len(vectors))
    for column in near.reshape(len(centroids), -1).T:
        sums += vectors[column]
        lengths += np.linalg.norm(vectors[column], axis=1)
    return float(np.linalg.norm(sums, axis=1).sum() / max(lengths.sum(), np.finfo(float).tiny))


def disagreeing_with_neighbors(
    centroids: NDArray[np.float64], normals: NDArray[np.float64], chosen: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """(n,) which of the chosen pieces to turn so that they face as their neighbours do.

    Neighbours count the less the farther they are off the piece's plane, so that the other side of a thin wall does not
    count. Where normals scatter they are no evidence: noise turns as many one way as the other, and turning these back
    would be a bias. Zero normals have no say.
    """
    here = np.flatnonzero(chosen)
    if len(centroids) < 3:
        return np.zeros(len(centroids), dtype=bool)
    distance, near = scipy.spatial.cKDTree(centroids).query(centroids[here], k=min(N_NEIGHBORS + 1, len(centroids)))
    away = centroids[near] - centroids[here, None]
    height = np.abs(np.einsum("ijk,ik->ij", away, normals[here])) / np.maximum(distance, 1e-300)
    weights = np.maximum(0.0, 1.0 - 2.0 * height) * (near != here[:, None])
    along = np.einsum("ijk,ik->ij", normals[near], normals[here])
    total = weights.sum(axis=1)
    smooth = (weights * along**2).sum(axis=1) > SMOOTH * np.maximum(total, 1.0)
    along *= weights
    signs = np.ones(len(centroids))
    for _ in range(ROUNDS):
        balance = (along * signs[near]).sum(axis=1) * signs[here]
        wrong = smooth & (balance < -LEAST_AGREEMENT * total)
        if not wrong.any():
            break
        signs[here[wrong]] *= -1
    return signs < 0
