"""Levels of triangles: means over both sides of the winding number of all triangles of their group.

The winding number jumps by one across a face. The mean of both sides is ½ on a closed surface that faces outwards, −½
on one that faces inwards, and 0 on a flat sheet; between, it says how much of a body a group is.
"""

from __future__ import annotations

import numpy as np

from ..arrays import Floats, Ints
from ..compiled import compiled
from ..mesh.triangles import area_vectors, face_areas
from ..mesh.unit_vectors import unit
from ..search.winding_tree import WindingTree, mean_angle
from .gauss import Pieces, sampled

FEW = 16
"""Triangles of a group whose level is wanted up to which all of the group are summed one by one."""


def levels_within(triangles: Floats, groups: Ints, counts: Ints, faces: Ints) -> Floats:
    """(n,) levels at the centres of some triangles, each in its own group.

    Triangles, (m, 3, 3), are there as often as `counts` says, (m,), reversed if that is negative.

    Examples
    --------
    >>> corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    >>> tet = corners[np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])]
    >>> levels_within(tet, np.zeros(4, dtype=int), np.ones(4, dtype=int), np.arange(2)).round(6).tolist()
    [0.5, 0.5]
    """
    _, labels = np.unique(groups, return_inverse=True)
    order = np.argsort(labels, kind="stable")
    sizes = np.bincount(labels)
    starts = np.concatenate([[0], np.cumsum(sizes)])
    rank = np.empty(len(order), dtype=np.int64)
    rank[order] = np.arange(len(order))
    corners = np.ascontiguousarray(triangles[order]).reshape(-1, 9)
    wanted = np.bincount(labels[faces], minlength=len(sizes))[labels[faces]]
    levels, few = np.zeros(len(faces)), np.flatnonzero(wanted <= FEW)
    levels[few] = _among_few(corners, starts, counts[order], rank[faces[few]], labels[faces[few]])
    for group in np.unique(labels[faces][wanted > FEW]):
        chosen = np.flatnonzero(labels[faces] == group)
        members = order[starts[group] : starts[group + 1]]
        there = np.repeat(members, np.abs(counts[members]))
        directed = np.where((counts[there] < 0)[:, None, None], triangles[there, ::-1], triangles[there])
        tree, some = WindingTree.of(directed), triangles[faces[chosen]]
        levels[chosen] = tree.levels(some.mean(axis=1), unit(area_vectors(some)), face_areas(some))
    return levels


def levels_of_pieces(pieces: Pieces) -> Floats:
    """(p,) mean level of each piece by itself."""
    faces, _ = sampled(pieces, 4096)
    levels = levels_within(pieces.triangles, pieces.labels, np.ones(len(pieces.labels), dtype=np.int64), faces)
    owners = pieces.labels[faces]
    return np.bincount(owners, levels, len(pieces.areas)) / np.bincount(owners, minlength=len(pieces.areas))


@compiled
def _among_few(corners: Floats, starts: Ints, counts: Ints, faces: Ints, groups: Ints) -> Floats:
    levels = np.zeros(len(faces))
    for row in range(len(faces)):
        i, group = faces[row], groups[row]
        x = (corners[i, 0] + corners[i, 3] + corners[i, 6]) / 3
        y = (corners[i, 1] + corners[i, 4] + corners[i, 7]) / 3
        z = (corners[i, 2] + corners[i, 5] + corners[i, 8]) / 3
        total = 0.0
        for j in range(starts[group], starts[group + 1]):
            if j != i:
                total += counts[j] * mean_angle(corners, j, x, y, z)
        levels[row] = total / (4.0 * np.pi)
    return levels
