"""Close the rims of bodies by lids."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from . import bending, lids
from .rims import loops, open_edges

SIDES = 100
"""Most sides of a rim that is closed by a few flat triangles."""
NARROW = 0.03
"""Width of a rim, over the diagonal of its part, up to which that is so."""
SLIT = 1e-3
"""Width of an opening, over the length of its rim, up to which its lid is flat: its strip has no end of samples."""


def lids_of(
    triangles: NDArray[np.float64], ids: NDArray[np.int64], parts: NDArray[np.int64], vertices: NDArray[np.float64]
) -> list[NDArray[np.float64]]:
    """(k, 3, 3) corners of the triangles of each lid that closes a rim of oriented parts.

    Parameters
    ----------
    triangles, ids, parts : (m, 3, 3) float, (m, 3) int, (m,) int
        Corners of the faces, their vertices, and the part that each is of.
    vertices : (n, 3) float
        Positions.
    """
    edges, owners = open_edges(ids, parts)
    order = np.argsort(parts, kind="stable")
    starts = np.concatenate([[0], np.cumsum(np.bincount(parts))])
    made = []
    for part in np.unique(owners):
        here = order[starts[part] : starts[part + 1]]
        own = triangles[here]
        diagonal = float(np.linalg.norm(np.ptp(own.reshape(-1, 3), axis=0)))
        patches = bending.smooth_patches(own, ids[here])
        ends = _Ends.of(ids[here], patches, len(vertices))
        for loop in loops(edges[np.searchsorted(owners, part) : np.searchsorted(owners, part, side="right")]):
            lid = _lid(vertices[loop], own, patches, ends.at(loop), diagonal)
            made.append(lid.vertices[lid.faces])
    return made


@dataclass(frozen=True, eq=False)
class _Ends:
    """Smooth patches that end at edges, by numbers of the edges in the direction of lids."""

    keys: NDArray[np.int64]
    patches: NDArray[np.int64]
    size: int

    @classmethod
    def of(cls, ids: NDArray[np.int64], patches: NDArray[np.int64], size: int) -> _Ends:
        keys = (np.roll(ids, -1, axis=1) * size + ids).ravel()
        order = np.argsort(keys, kind="stable")
        return cls(keys[order], np.repeat(patches, 3)[order], size)

    def at(self, loop: NDArray[np.int64]) -> NDArray[np.int64]:
        """(n,) the patch beside each edge of a loop."""
        return self.patches[np.searchsorted(self.keys, loop * self.size + np.roll(loop, -1))]


def _lid(
    corners: NDArray[np.float64],
    own: NDArray[np.float64],
    patches: NDArray[np.int64],
    ends: NDArray[np.int64],
    diagonal: float,
) -> lids.Lid:
    if len(corners) == 3:
        return lids.Lid(corners, np.array([[0, 1, 2]]), 3)
    if len(corners) <= SIDES and np.linalg.norm(np.ptp(corners, axis=0)) < NARROW * diagonal:
        return lids.Lid(corners, lids.least_triangles(corners), len(corners))
    flat = lids.film(corners)
    rim = flat.vertices[: flat.n_rim]
    width = bending.width_of(flat)
    if width <= SLIT * np.linalg.norm(rim - np.roll(rim, 1, axis=0), axis=1).sum():
        return flat
    near = bending.samples_near(own, patches, scipy.spatial.cKDTree(rim), bending.REACH * width)
    normals, curvatures, held = bending.continuation(flat, near, ends[_edges_at(rim, corners)], width)
    if held.max() <= bending.FREE:
        return flat
    return lids.plate(flat, normals, curvatures, held)


def _edges_at(rim: NDArray[np.float64], corners: NDArray[np.float64]) -> NDArray[np.int64]:
    """(n,) number of the corner of a loop after which each point of the cut loop comes."""
    begins = np.zeros(len(rim), dtype=np.int64)
    begins[scipy.spatial.cKDTree(rim).query(corners)[1]] = 1
    return np.cumsum(begins) - 1
