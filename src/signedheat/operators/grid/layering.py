"""Where faces contradict each other: layers that face the same way, with none between them that faces back.

In front of one such layer is behind the next, so they cannot all be the surface of anything: the input is noise around
a surface there, or the same surface given more than once. What lies in the middle of the layers is nearer the truth.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy
from numpy.typing import NDArray

from ...geometry.face_features import FaceFeatures
from .sampled_surface import FaceBand
from .stencil import interpolation_stencil

PROBES = (0.125, 0.25, 0.5)
"""Cells before and behind a face at which is asked what is nearest."""
FEW = 3000
"""Samples that are probed first; where none is contradicted, all is well."""
MANY = 40_000
"""Samples that are probed otherwise."""
ALIKE = 0.3
"""Cosine from which two faces count as facing the same way."""
CLEAR = 0.5
"""Sine, from the face, below which a probe does not count: it lies beside the face rather than before or behind it."""
BLOCK = 2
"""Cells along each side of the blocks in which probes are counted; blocks count with those around them."""
LAYERED = 0.03
"""Mean gap between layers, in cells, from which on a place is layered."""
CENTRED = 0.3
"""Ratio of the mean of φ at faces to that gap, below which φ = 0 is taken to run in the middle of layers."""
SCATTERED = 0.15
"""The same, of scattered corners."""
APART = 0.15
"""Mean gap between layers, in cells, from which on φ = 0 is the better surface in any case; less scatter is none."""


def layered_faces(
    features: FaceFeatures, band: FaceBand, middle: Callable[[], NDArray[np.float64]], steps: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """(m,) faces that lie where faces contradict each other and φ = 0 runs in their middle.

    φ is asked for where there are such faces only. Triangles that touch no other need not overlap: their corners tell,
    which are scattered where they were one.
    At edges sharper than a cell φ = 0 is rounder than the faces are, and leaves them all on one side: there faces stay,
    layered or not.
    """
    layered = np.zeros(len(features.rows), dtype=bool)
    scatter = _scatter(features) / float(steps.min())
    if not scatter.any() and not _gaps(features, band, _some(len(band.faces), FEW), steps).any():
        return layered
    samples = _some(len(band.faces), MANY)
    gaps = _gaps(features, band, samples, steps)
    phi = middle()
    places = np.clip(band.feet[:, 1:] / steps, 0, np.array(phi.shape) - 1)
    nodes, weights = interpolation_stencil(places, phi.shape)
    heights = np.einsum("ij,ij->i", phi.ravel()[nodes], weights)
    blocks = (places / BLOCK).astype(np.int64)
    shape = tuple(-(-n // BLOCK) for n in phi.shape)
    gap = _around(blocks[samples], shape, gaps)[tuple(blocks.T)]
    mean = _around(blocks, shape, heights)[tuple(blocks.T)] / float(steps.min())
    wide = np.where(scatter > APART, scatter, 0.0)[band.faces]
    chosen = (gap > APART) | ((gap > LAYERED) & (np.abs(mean) < CENTRED * gap)) | (np.abs(mean) < SCATTERED * wide)
    table = _around(blocks, shape, chosen.astype(np.float64), 5)  # by vote, lest single faces remain
    chosen = table[tuple(blocks.T)] > 0.5
    counts = np.bincount(band.faces, minlength=len(layered))
    votes = np.bincount(band.faces, weights=chosen, minlength=len(layered))
    layered[counts > 0] = 2 * votes[counts > 0] > counts[counts > 0]
    rest = np.flatnonzero(counts == 0)
    if len(rest):
        middles = features.corners[rest].reshape(-1, 3, 3).mean(axis=1) / (BLOCK * steps)
        where = np.clip(middles.astype(np.int64), 0, np.array(shape) - 1)
        layered[rest] = table[tuple(where.T)] > 0.5
    return layered


def _scatter(features: FaceFeatures) -> NDArray[np.float64]:
    """(m,) distance of the corners of triangles that touch no other from the nearest corners of others.

    What was one vertex is as many as it had faces in a soup with noise. 0 where the next is farther than a quarter of
    the longest side: these were never together.
    """
    result = np.zeros(len(features.rows))
    alone = np.flatnonzero(np.all(features.across < 0, axis=1))
    if len(alone) < 2:
        return result
    corners = features.corners[alone].reshape(-1, 3, 3).astype(np.float64)
    points = corners.reshape(-1, 3)
    near, ids = scipy.spatial.cKDTree(points).query(points, 4, workers=-1)
    others = ids // 3 != np.arange(len(points))[:, None] // 3
    near = np.where(others, near, np.inf).min(axis=1).reshape(-1, 3)
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    result[alone] = np.where(near < 0.25 * longest[:, None], near, 0.0).mean(axis=1)
    return result


def _some(n: int, wanted: int) -> NDArray[np.int64]:
    """At most about so many of n, evenly."""
    return np.arange(0, n, max(1, n // wanted))


def _gaps(
    features: FaceFeatures, band: FaceBand, samples: NDArray[np.int64], steps: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(n,) cells between samples and the next face that faces the same way, where probes find one; 0 elsewhere.

    A probe is before the face of its sample and behind another, or the other way round. One or two of them find a layer
    between the first and twice the last of their distances.
    """
    normals = features.face_normals[band.faces[samples]]
    feet = band.feet[samples, 1:].astype(np.float64)
    cell = float(steps.min())
    result = np.zeros(len(samples))
    for away in PROBES:
        for side in (1, -1):
            found = band.search(features, feet + side * away * cell * normals, steps)
            alike = np.einsum("ij,ij->i", features.face_normals[found.faces], normals) > ALIKE
            layer = alike & (found.cosines * side < -CLEAR) & (found.faces >= 0)
            result += np.where(layer, away + found.distances / cell, 0.0)
    return result


def _around(
    blocks: NDArray[np.int64], shape: tuple[int, ...], values: NDArray[np.float64], width: int = 3
) -> NDArray[np.float64]:
    """(*shape) mean of values in cubes of `width` blocks around each block; 0 where there are none."""
    at = np.ravel_multi_index(tuple(blocks.T), shape)
    sums = np.bincount(at, weights=values, minlength=int(np.prod(shape))).reshape(shape)
    counts = np.bincount(at, minlength=int(np.prod(shape))).reshape(shape).astype(np.float64)
    sums, counts = (scipy.ndimage.uniform_filter(a, width, mode="constant") for a in (sums, counts))
    return np.where(counts > 1e-9, sums / np.maximum(counts, 1e-9), 0.0)
