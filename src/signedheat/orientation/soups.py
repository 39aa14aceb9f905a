"""Small pieces that hang together with nothing: which way they face is told by what lies near them."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

N_NEIGHBORS = 12
"""Neighbours of a piece that are asked."""
N_AROUND = 24
"""Neighbours of a piece, itself included, whose agreement is measured."""
SMOOTH = 0.7
"""Mean square of the cosines between normals of neighbours from which they tell something; ⅓ if normals are random."""
LEAST_AGREEMENT = 0.6
"""How clearly neighbours must agree (1: all their normals along one line, the same way) to turn a piece."""
AT_CORNERS = 5.0
"""Logarithm of the odds that a small part faces as those do that it touches, all of them parallel to it."""


def odds_at_corners(
    corners: NDArray[np.int64],
    parts: NDArray[np.int64],
    normals: NDArray[np.float64],
    odds: NDArray[np.float64],
    small: NDArray[np.bool_],
) -> NDArray[np.float64]:
    """Odds that small parts face the right way, given what they touch at corners: neighbours mostly face alike.

    Parameters
    ----------
    corners, parts : (c,) int
        Place of each corner of each face, and the face's part.
    normals : (c, 3) float
        Unit normal of the face, or zero.
    odds : (n_parts,) float
        Logarithms of the odds that parts face the right way.
    small : (n_parts,) bool
        Parts that ask others, and only such as do not ask or have been told.

    Returns
    -------
    (n_parts,) float
        Logarithms of the odds, those of small parts with those of what they touch.
    """
    odds = odds.copy()
    asking = small.copy()
    n_places = int(corners.max(initial=-1)) + 1
    for _ in range(16):
        weights = np.where(asking, 0.0, np.tanh(0.5 * odds))[parts]
        sums = np.stack([np.bincount(corners, weights * column, n_places) for column in normals.T], axis=1)
        here = np.flatnonzero(asking[parts])
        told = sums[corners[here]]
        ballots = np.bincount(parts[here], np.einsum("ij,ij->i", told, normals[here]), len(odds))
        cast = np.bincount(parts[here], np.linalg.norm(told, axis=1), len(odds))
        found = asking & (cast > 0.5)
        if not found.any():
            break
        odds[found] += AT_CORNERS * ballots[found] / cast[found]
        asking &= ~found
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
    centroids: NDArray[np.float64], normals: NDArray[np.float64], asking: NDArray[np.bool_], rounds: int = 4
) -> NDArray[np.bool_]:
    """Which of the asking pieces to turn so that they face as their neighbours do.

    Neighbours count the less the farther they are off the piece's plane, so that the other side of a thin wall is not
    asked. Where normals scatter they tell nothing: noise turns as many one way as the other, and turning these back
    would be a bias.

    Parameters
    ----------
    centroids, normals : (n, 3) float
        Where the pieces are, and unit normals; zero normals have no say.
    asking : (n,) bool
        Pieces that may turn.

    Returns
    -------
    (n,) bool
        Pieces to turn.
    """
    here = np.flatnonzero(asking)
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
    for _ in range(rounds):
        ballots = (along * signs[near]).sum(axis=1) * signs[here]
        wrong = smooth & (ballots < -LEAST_AGREEMENT * total)
        if not wrong.any():
            break
        signs[here[wrong]] *= -1
    result: NDArray[np.bool_] = signs < 0
    return result
