"""Close the rims of bodies by lids."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from ..geometry.box_tree import BoxTree
from ..geometry.components import connected_components
from . import bending, creases, lids
from .rims import loops, meeting_edges, open_edges


def lids_of(
    triangles: NDArray[np.float64], ids: NDArray[np.int64], parts: NDArray[np.int64], vertices: NDArray[np.float64]
) -> list[NDArray[np.float64]]:
    """(k, 3, 3) corners of the triangles of each lid that closes a rim of oriented parts."""
    edges, owners = open_edges(ids, parts)
    order = np.argsort(parts, kind="stable")
    starts = np.concatenate([[0], np.cumsum(np.bincount(parts))])
    made: list[lids.Lid] = []
    with threadpool_limits(1, "blas"):  # systems of a few hundred unknowns: threads would only wait
        for part in np.unique(owners):
            here = order[starts[part] : starts[part + 1]]
            own = triangles[here]
            patches, tree = bending.smooth_patches(own, ids[here]), BoxTree.of(own.min(axis=1), own.max(axis=1))
            ends = _Ends.of(ids[here], patches, len(vertices))
            rims = loops(edges[np.searchsorted(owners, part) : np.searchsorted(owners, part, side="right")])
            made += [_lid(vertices[loop], own, tree, patches, ends.at(loop)) for loop in _openings(rims, vertices)]
    return [lid.vertices[lid.faces] for lid in made]


def _openings(rims: list[NDArray[np.int64]], vertices: NDArray[np.float64]) -> list[NDArray[np.int64]]:
    """Loops around openings: rims without stretches along which others run, each end joined to the nearest start."""
    if len(rims) < 2:
        return rims
    owners = np.repeat(np.arange(len(rims)), [len(rim) for rim in rims])
    edges = np.concatenate([np.stack([rim, np.roll(rim, -1)], axis=1) for rim in rims])
    one, other = meeting_edges(vertices[edges])
    apart = owners[one] != owners[other]
    met = np.zeros(len(edges), dtype=bool)
    met[one[apart]] = met[other[apart]] = True
    shared = np.split(met, np.cumsum([len(rim) for rim in rims])[:-1])
    whole = [rim for rim, some in zip(rims, shared, strict=True) if not some.any()]
    partly = [(rim, some) for rim, some in zip(rims, shared, strict=True) if some.any() and not some.all()]
    chains = [chain for rim, some in partly for chain in _chains(rim, some)]
    if not chains:
        return whole
    following = scipy.spatial.cKDTree(vertices[[chain[0] for chain in chains]]).query(
        vertices[[chain[-1] for chain in chains]]
    )[1]
    if len(np.unique(following)) < len(chains):  # which start belongs to which end is not clear
        return whole + [rim for rim, _ in partly]
    cycles = connected_components(len(chains), np.arange(len(chains)), following)
    for first in np.unique(cycles, return_index=True)[1]:
        loop, at = [chains[first]], following[first]
        while at != first:
            loop.append(chains[at])
            at = following[at]
        joined = np.concatenate(loop)
        joined = joined[joined != np.roll(joined, 1)]
        if len(joined) > 2:
            whole.append(joined)
    return whole


def _chains(rim: NDArray[np.int64], met: NDArray[np.bool_]) -> list[NDArray[np.int64]]:
    """Stretches of a rim, as vertices, none of whose edges is met."""
    turn = int(np.argmax(met)) + 1
    rim, free = np.roll(rim, -turn), np.flatnonzero(~np.roll(met, -turn))
    runs = np.split(free, np.flatnonzero(np.diff(free) > 1) + 1)
    return [rim[np.append(run, run[-1] + 1) % len(rim)] for run in runs]


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
        """(n,) the patch at each edge of a loop; where there is no such edge, at the last one before it."""
        keys = loop * self.size + np.roll(loop, -1)
        found = np.minimum(np.searchsorted(self.keys, keys), len(self.keys) - 1)
        there = self.keys[found] == keys
        last = np.maximum.accumulate(np.where(there, np.arange(len(loop)), int(np.argmax(there))))
        return self.patches[found[last]]


def _lid(
    corners: NDArray[np.float64],
    own: NDArray[np.float64],
    tree: BoxTree,
    patches: NDArray[np.int64],
    ends: NDArray[np.int64],
) -> lids.Lid:
    if len(corners) == 3:
        return lids.Lid(corners, np.array([[0, 1, 2]]), 3)
    for frame in (lids.frame_of(corners), None):
        if lid := _spanned(corners, frame, own, tree, patches, ends):
            return lid
    raise AssertionError("a disc has room for every loop")


def _spanned(
    corners: NDArray[np.float64],
    frame: lids.Frame | None,
    own: NDArray[np.float64],
    tree: BoxTree,
    patches: NDArray[np.int64],
    ends: NDArray[np.int64],
) -> lids.Lid | None:
    """The lid of a loop, triangulated in a plane or without one in a disc; None if it crosses itself in that plane."""
    rim = lids.SmoothRim.of(corners)
    smooth = lids.pattern(rim.points, frame, float(rim.places[0]))
    if smooth is None:
        return None
    flat = lids.film(smooth)
    width, points = bending.width_of(flat), flat.vertices[: flat.n_rim]
    near = bending.samples_near(own, tree, patches, scipy.spatial.cKDTree(points), bending.REACH * width)
    normals, curvatures, held = bending.continuation(flat, near, ends[rim.edges_at(points)], width)
    bent = lids.plate(flat, normals, curvatures, held) if held.any() else None
    if bent is None:
        middles = 0.5 * (corners + np.roll(corners, -1, axis=0))
        nearest = scipy.spatial.cKDTree(points).query(middles)[1]
        if lid := creases.creased(corners, normals[nearest]):
            return lid
    pattern = lids.pattern(lids.cut_to_pieces(corners), frame)
    return None if pattern is None else lids.draped(pattern, bent or flat)
