"""Boundary faces of voxels, and corrected normals for them.

The faces of voxels that separate inside from outside, called surfels, are squares with six possible normals: as a
surface they overestimate the length of every curve that is not parallel to an axis, however small the voxels. Normals
estimated over a wider neighbourhood approximate those of the surface that was digitised (Coeurjolly & Lachaud 2022).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from ..mesh.edges import EdgeTable

_STEEPEST = 0.05  # least cosine of the angle between a corrected normal and the square's own
_WIDEST, _NARROWEST = 1e3, 1e-3  # of blurs, in extents of the volume and in voxels: beyond, the normals are the same


@dataclass(frozen=True, eq=False)
class Surfels:
    """Boundary squares of a set of voxels."""

    corners: NDArray[np.int64]  # (m, 4) vertex ids, counter-clockwise seen from outside
    vertices: NDArray[np.int64]  # (n, 3) lattice points: corner ``(i, j, k)`` is where voxel ``(i, j, k)`` begins
    voxels: NDArray[np.int64]  # (m, 3) the voxel inside each surfel
    axes: NDArray[np.int64]  # (m,) axis to which the surfel is orthogonal
    # (m,) +1 where the outward normal points along the positive axis, −1 where along the negative one
    signs: NDArray[np.int64]


def boundary_surfels(volume: NDArray[np.bool_]) -> Surfels:
    """Surfels of a volume, in order of their voxels; everything beyond the array is outside."""
    voxels, axes, signs = [], [], []
    for axis in range(3):
        for sign in (-1, 1):
            beyond = np.zeros_like(volume)
            here, there = [slice(None)] * 3, [slice(None)] * 3
            here[axis], there[axis] = (slice(None, -1), slice(1, None))[::sign]
            beyond[tuple(here)] = volume[tuple(there)]
            found = np.argwhere(volume & ~beyond)
            voxels.append(found)
            axes.append(np.full(len(found), axis))
            signs.append(np.full(len(found), sign))
    all_voxels, all_axes, all_signs = np.concatenate(voxels), np.concatenate(axes), np.concatenate(signs)
    order = np.lexsort((all_signs, all_axes, *all_voxels.T[::-1]))
    voxel, along, towards = all_voxels[order], all_axes[order], all_signs[order]

    unit = np.eye(3, dtype=np.int64)
    first, second = unit[(along + 1) % 3], unit[(along + 2) % 3]
    forward = (towards > 0)[:, None]
    first, second = np.where(forward, first, second), np.where(forward, second, first)
    start = voxel + unit[along] * forward
    corners = np.stack([start, start + first, start + first + second, start + second], axis=1)
    shape = np.array(volume.shape) + 1
    keys = np.ravel_multi_index(tuple(corners.reshape(-1, 3).T), tuple(shape))
    distinct, ids = np.unique(keys, return_inverse=True)
    vertices = np.stack(np.unravel_index(distinct, tuple(shape)), axis=1)
    return Surfels(ids.reshape(-1, 4), vertices, voxel, along, towards)


def count_surfels(volume: NDArray[np.bool_]) -> int:
    """Number of boundary squares of a set of voxels, found slice by slice."""
    total = 0
    for axis in range(3):
        before: NDArray[np.bool_] | bool = False
        for layer in np.moveaxis(volume, axis, 0):
            total += int(np.count_nonzero(layer != before))
            before = layer
        total += int(np.count_nonzero(before))
    return total


def corrected_normals(
    volume: NDArray[np.bool_], surfels: Surfels, spacing: NDArray[np.float64], radius: float
) -> NDArray[np.float64]:
    """(m, 3) unit normals: mean area vectors of the surfels around each, by a Gaussian of standard deviation radius/2.

    By the divergence theorem that mean is the negative gradient of the blurred volume, which is how it is computed. A
    radius of zero returns each surfel's own normal.

    Examples
    --------
    >>> solid = np.ones((9, 9, 3), dtype=bool)
    >>> found = boundary_surfels(solid)
    >>> top = (found.signs > 0) & (found.axes == 2) & (found.voxels[:, :2] == 4).all(axis=1)
    >>> corrected_normals(solid, found, np.ones(3), 2.0)[top].round(6) + 0.0
    array([[0., 0., 1.]])
    """
    own = np.zeros((len(surfels.axes), 3))
    own[np.arange(len(own)), surfels.axes] = surfels.signs
    if radius == 0:
        return own
    extent = spacing * volume.shape
    width = np.maximum(0.5 * min(radius, _WIDEST * float(extent.max())) / spacing, _NARROWEST)
    padded = np.pad(volume, 1).astype(np.float32)
    reach = [min(int(4 * w + 0.5), n) for w, n in zip(width, padded.shape, strict=True)]  # beyond, there is nothing
    inside = tuple((surfels.voxels + 1).T)
    outside = tuple((surfels.voxels + own.astype(np.int64) + 1).T)
    gradient = np.empty_like(own)
    for axis in range(3):
        order = [int(a == axis) for a in range(3)]
        slope = scipy.ndimage.gaussian_filter(padded, width, order=order, mode="constant", radius=reach)
        gradient[:, axis] = (slope[inside].astype(np.float64) + slope[outside]) / spacing[axis]
    length = np.linalg.norm(gradient, axis=1, keepdims=True)
    normals = np.divide(-gradient, length, out=own.copy(), where=length > 0)
    steep = _STEEPEST - (normals * own).sum(axis=1)
    normals += np.maximum(steep, 0)[:, None] * own
    return normals / np.linalg.norm(normals, axis=1)[:, None]


def separated_edges(edges: EdgeTable, surfels: Surfels) -> EdgeTable:
    """The edges of the triangles of surfels, with two edges in place of one where two voxels touch along it.

    Four surfels meet there. Surfels that face the same voxel outside share an edge, so that the surface connects the
    two voxels inside: voxels that touch along an edge are connected. There are four triangles per surfel; edge 0 of
    each is a side of the surfel.
    """
    triangles = np.flatnonzero(edges.face_counts[edges.face_edges[:, 0]] > 2)
    surfel = triangles // 4
    step = np.zeros((len(surfel), 3), dtype=np.int64)
    step[np.arange(len(surfel)), surfels.axes[surfel]] = surfels.signs[surfel]
    outside = surfels.voxels[surfel] + step
    key = np.column_stack([edges.face_edges[triangles, 0], outside])
    _, first, pair = np.unique(key, axis=0, return_index=True, return_inverse=True)
    kept = np.isin(first, np.unique(edges.face_edges[triangles, 0], return_index=True)[1])
    n_edges = len(edges.vertices)
    ids = np.where(kept, key[first, 0], n_edges + np.cumsum(~kept) - 1)

    leading = triangles[first[~kept]]  # the first triangle of each new edge determines its direction
    direction = edges.vertices[edges.face_edges[leading, 0]]
    direction = np.where(edges.forward[leading, 0, None], direction, direction[:, ::-1])
    of_faces, forward = edges.face_edges.copy(), edges.forward.copy()
    of_faces[triangles, 0] = ids[pair.ravel()]
    renamed = triangles[~kept[pair.ravel()]]
    forward[renamed, 0] ^= ~edges.forward[leading, 0][of_faces[renamed, 0] - n_edges]
    return EdgeTable(np.concatenate([edges.vertices, direction]), of_faces, forward)
